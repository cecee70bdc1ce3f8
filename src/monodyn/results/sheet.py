"""Pieces of a page drawn with OpenCV: text, panels with legends, hatching, markers, in colours told apart
by everybody.

A page is a column of rows, each a picture of the page's width; so nothing has to know where it stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

Colour = tuple[int, int, int]
"""Blue, green and red, 0 to 255, in OpenCV's order."""

Picture = np.ndarray
"""Blue, green and red of every pixel, uint8 (height, width, 3)."""

INK, SOFT, PALE = (38, 33, 29), (115, 106, 98), (176, 171, 166)
LINE, GROUND, PAPER = (214, 218, 222), (244, 243, 242), (255, 255, 255)
"""Greys, from text to paper."""
BLUE, ORANGE, GREEN, RED = (178, 114, 0), (0, 159, 230), (115, 158, 0), (0, 94, 213)
SKY, PURPLE, YELLOW, BLACK = (233, 180, 86), (167, 121, 204), (66, 228, 240), (20, 20, 20)
"""Colours that people with any kind of colour vision distinguish (Okabe and Ito)."""

WIDTH = 1400
"""Width of the page [px]."""
MARGIN = 24
"""Space around and between panels [px]."""
TITLE, BODY, SMALL = 0.62, 0.5, 0.44
"""Sizes of text: of panels' titles, of sentences, of legends."""
MARKER = 5
"""Half the size of a marker [px]."""
DASH = 10
"""Length of a dash with its gap [px]."""


class Key(NamedTuple):
    """An entry of a legend.

    Attributes:
        text: What it says.
        colour: Its colour; None for text alone.
        shape: ``box``, ``hatch``, ``line``, or one of the markers.
    """

    text: str
    colour: Colour | None = None
    shape: str = "box"


class Crop(NamedTuple):
    """A part of a picture as it is shown; it may reach beyond the picture.

    Attributes:
        left: First column [px of the picture].
        top: First row [px of the picture].
        width: Columns [px of the picture].
        height: Rows [px of the picture].
        scale: Shown pixels per pixel of the picture.
    """

    left: int
    top: int
    width: int
    height: int
    scale: float

    @property
    def size(self) -> tuple[int, int]:
        """Width and height as shown [px]."""
        return max(1, round(self.width * self.scale)), max(1, round(self.height * self.scale))

    def shown(self, picture: Picture, beyond: Colour = SOFT) -> Picture:
        """Return the part of a picture at its size on the page.

        Args:
            picture: uint8 (height, width) or with a third axis of colours.
            beyond: What is shown beyond the picture.
        """
        import cv2

        part = self._part(picture, beyond)
        way = cv2.INTER_AREA if self.scale < 1.0 else cv2.INTER_LINEAR
        return cv2.resize(part, self.size, interpolation=way)

    def marked(self, marks: np.ndarray) -> np.ndarray:
        """Return the part of a picture of marks at its size on the page; nothing is marked beyond it.

        Args:
            marks: bool (height, width).

        Returns:
            bool (height, width).
        """
        import cv2

        part = self._part(marks.astype(np.uint8), (0, 0, 0))
        return cv2.resize(part, self.size, interpolation=cv2.INTER_NEAREST) > 0

    def points(self, points: np.ndarray) -> np.ndarray:
        """Return where points of the picture are shown.

        Args:
            points: [px of the picture], (point, 2).

        Returns:
            Pixels of the page, (point, 2).
        """
        # pixel centres lie at whole numbers, in the picture as on the page
        return (np.asarray(points, dtype=np.float64) - [self.left, self.top] + 0.5) * self.scale - 0.5

    def _part(self, picture: np.ndarray, beyond: Colour) -> np.ndarray:
        import cv2

        height, width = picture.shape[:2]
        right, bottom = self.left + self.width, self.top + self.height
        inside = picture[max(self.top, 0) : max(bottom, 0), max(self.left, 0) : max(right, 0)]
        edges = (
            max(-self.top, 0), max(bottom - max(height, self.top), 0),
            max(-self.left, 0), max(right - max(width, self.left), 0),
        )  # fmt: skip
        if not any(edges):
            return np.ascontiguousarray(inside)
        return cv2.copyMakeBorder(inside, *edges, cv2.BORDER_CONSTANT, value=beyond)


def fitted_crop(box: tuple[float, float, float, float], width: int, height: int) -> Crop:
    """Return the crop that shows a box as large as a place on the page allows, at most four times enlarged.

    Args:
        box: Left, top, right and bottom [px of the picture].
        width: Width of the place [px].
        height: Height of the place [px].
    """
    left, top = int(np.floor(box[0])), int(np.floor(box[1]))
    wide, high = max(1, int(np.ceil(box[2])) - left), max(1, int(np.ceil(box[3])) - top)
    return Crop(left, top, wide, high, min(width / wide, height / high, 4.0))


def blank(height: int, width: int = WIDTH, colour: Colour = PAPER) -> Picture:
    """Return an empty picture, uint8 (height, width, 3).

    Args:
        height: Rows [px].
        width: Columns [px].
        colour: Its colour.
    """
    # one value for all bytes is written much faster than a colour for each pixel
    same = len(set(colour)) == 1
    return np.full((height, width, 3), colour[0] if same else colour, np.uint8)


def write(picture: Picture, text: str, at: tuple[int, int], size: float = BODY, colour: Colour = INK) -> int:
    """Write a line of text.

    Args:
        picture: Where to.
        text: One line; what is not ASCII is replaced.
        at: Its left end on the base line [px].
        size: Size of the text.
        colour: Colour of the text.

    Returns:
        Where it ends [px].
    """
    import cv2

    # the font of older versions of OpenCV has no other characters
    plain = text.replace("×", "x").replace("–", "-").encode("ascii", "replace").decode()
    weight = 2 if size >= TITLE else 1
    cv2.putText(picture, plain, at, cv2.FONT_HERSHEY_SIMPLEX, size, colour, weight, cv2.LINE_AA)
    return at[0] + length(plain, size)


def length(text: str, size: float = BODY) -> int:
    """Return how wide a line of text is [px].

    Args:
        text: The line.
        size: Size of the text.
    """
    import cv2

    return cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size, 2 if size >= TITLE else 1)[0][0]


def wrapped(text: str, width: int, size: float = BODY) -> list[str]:
    """Break a text into lines, as many as it takes.

    Args:
        text: Words between spaces.
        width: Width of a line [px].
        size: Size of the text.

    Returns:
        The lines, at least one.
    """
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and length(longer, size) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def hatch(picture: Picture, marks: np.ndarray, colour: Colour, *, rising: bool = True) -> None:
    """Draw stripes over a part of a picture.

    Args:
        picture: Where to, uint8 (height, width, 3).
        marks: Where the stripes are, bool (height, width).
        colour: Their colour.
        rising: Direction of the stripes: two kinds are distinct where they cross.
    """
    rows, columns = np.ogrid[: marks.shape[0], : marks.shape[1]]
    stripes = (columns + rows if rising else columns - rows) % 7 < 2
    picture[marks & stripes] = colour


def washed(picture: Picture, share: float = 0.45) -> Picture:
    """Return a picture in pale grey, over which colours stand out.

    Args:
        picture: uint8 (height, width, 3).
        share: How much of it is white.
    """
    import cv2

    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    pale = cv2.convertScaleAbs(grey, alpha=1.0 - share, beta=255.0 * share)
    return cv2.cvtColor(pale, cv2.COLOR_GRAY2BGR)


def blended(picture: Picture, coverage: np.ndarray, colour: Colour) -> None:
    """Lay a colour over a picture.

    Args:
        picture: Where to, uint8 (height, width, 3).
        coverage: How much of it by pixel, 0 to 1, (height, width).
        colour: The colour.
    """
    rows, columns = np.nonzero(coverage > 0.02)
    share = coverage[rows, columns, np.newaxis]
    picture[rows, columns] = (picture[rows, columns] * (1.0 - share) + np.array(colour) * share).astype(
        np.uint8
    )


def mark(picture: Picture, at: np.ndarray, colour: Colour, shape: str, size: int = MARKER) -> None:
    """Draw a marker; each shape is distinct without its colour.

    Args:
        picture: Where to.
        at: Its centre [px], (2,).
        colour: Its colour.
        shape: ``dot``, ``ring``, ``square``, ``cross``, ``triangle`` or ``diamond``.
        size: Half its size [px].
    """
    import cv2

    x, y = (round(float(value)) for value in at)
    if shape in ("dot", "ring"):
        cv2.circle(picture, (x, y), size - 1, colour, -1 if shape == "dot" else 1, cv2.LINE_AA)
    elif shape == "square":
        cv2.rectangle(picture, (x - size + 1, y - size + 1), (x + size - 1, y + size - 1), colour, 1)
    elif shape == "cross":
        cv2.line(picture, (x - size + 1, y - size + 1), (x + size - 1, y + size - 1), colour, 2, cv2.LINE_AA)
        cv2.line(picture, (x - size + 1, y + size - 1), (x + size - 1, y - size + 1), colour, 2, cv2.LINE_AA)
    else:
        corners = [(0, -size), (size, size - 1), (-size, size - 1)]
        if shape == "diamond":
            corners = [(0, -size), (size, 0), (0, size), (-size, 0)]
        cv2.fillPoly(picture, [np.add(corners, (x, y)).astype(np.int32)], colour, cv2.LINE_AA)


def polygon(picture: Picture, points: np.ndarray, colour: Colour, thick: int = 1) -> None:
    """Draw a closed outline with sub-pixel corners on a light edge, so that it shows on any ground.

    Args:
        picture: Where to.
        points: Corners [px], (point, 2).
        colour: Its colour.
        thick: Width of the line [px].
    """
    import cv2

    # what lies far outside does not fit into fixed point
    corners = [np.round(np.clip(points, -1e5, 1e5) * 16.0).astype(np.int32)]
    cv2.polylines(picture, corners, True, PAPER, thick + 2, cv2.LINE_AA, 4)
    cv2.polylines(picture, corners, True, colour, thick, cv2.LINE_AA, 4)


def dashed(picture: Picture, row: int, columns: tuple[int, int], colour: Colour) -> None:
    """Draw a dashed level line.

    Args:
        picture: Where to.
        row: Its row [px].
        columns: First and last column [px].
        colour: Its colour.
    """
    for x in range(columns[0], columns[1], DASH):
        picture[row, x : min(x + DASH // 2, columns[1])] = colour


def legend(keys: Sequence[Key], width: int) -> Picture:
    """Return a legend, in as many lines as it takes.

    Args:
        keys: Its entries.
        width: Its width [px].
    """
    rows: list[list[Key]] = [[]]
    used = 0
    for key in keys:
        need = length(key.text, SMALL) + (40 if key.colour else 16)
        if rows[-1] and used + need > width:
            rows, used = [*rows, []], 0
        rows[-1].append(key)
        used += need
    picture = blank(20 * len(rows), width)
    for i, row in enumerate(rows):
        x, y = 2, 20 * i + 14
        for key in row:
            if key.colour is not None:
                _sample(picture, key, (x, y))
                x += 22
            x = write(picture, key.text, (x, y), SMALL, SOFT) + 16
    return picture


def _sample(picture: Picture, key: Key, at: tuple[int, int]) -> None:
    """Draw what a legend's entry is about."""
    import cv2

    assert key.colour is not None
    x, y = at
    box = (slice(y - 10, y + 2), slice(x, x + 16))
    if key.shape == "box":
        picture[box] = key.colour
    elif key.shape == "hatch":
        hatch(picture[box], np.ones((12, 16), dtype=bool), key.colour)
        cv2.rectangle(picture, (x, y - 10), (x + 15, y + 1), key.colour, 1)
    elif key.shape == "line":
        cv2.line(picture, (x, y - 4), (x + 15, y - 4), key.colour, 2)
    else:
        mark(picture, np.array([x + 8, y - 4]), key.colour, key.shape)


def panel(title: str, picture: Picture, keys: Sequence[Key], width: int) -> Picture:
    """Return a picture with its title above and its legend below.

    Args:
        title: One line.
        picture: At most as wide as the panel; see ``Picture``.
        keys: What the legend lists.
        width: Width of the panel [px].
    """
    head = blank(30, width)
    write(head, title, (0, 19), TITLE)
    body = blank(picture.shape[0], width, GROUND)
    left = (width - picture.shape[1]) // 2
    body[:, left : left + picture.shape[1]] = picture
    return np.concatenate([head, body, blank(5, width), legend(keys, width)])


def absent(text: str, width: int, height: int) -> Picture:
    """Return a picture that says what is not there.

    Args:
        text: What.
        width: Its width [px].
        height: Its height [px].
    """
    picture = blank(height, width, GROUND)
    hatch(picture, np.ones((height, width), dtype=bool), (232, 234, 236))
    lines = wrapped(text, width - 2 * MARGIN)
    for i, line in enumerate(lines):
        x, y = (width - length(line)) // 2, height // 2 + 22 * i - 11 * (len(lines) - 1) + 6
        picture[y - 17 : y + 7, x - 6 : x + length(line) + 6] = GROUND
        write(picture, line, (x, y), BODY, INK)
    return picture


def row(pictures: Sequence[Picture]) -> Picture:
    """Return pictures side by side over the width of the page.

    Args:
        pictures: uint8 (height, width, 3), their widths and the margins between them as wide as the page.
    """
    high = max(picture.shape[0] for picture in pictures)
    page = blank(high)
    x = MARGIN
    for picture in pictures:
        page[: picture.shape[0], x : x + picture.shape[1]] = picture
        x += picture.shape[1] + MARGIN
    return page


def column_width(count: int) -> int:
    """Return the width of each of several panels in a row [px].

    Args:
        count: How many.
    """
    return (WIDTH - MARGIN * (count + 1)) // count
