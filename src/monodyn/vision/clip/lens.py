"""What a lens bends is put straight, once, before anything looks at the pictures.

Behind it every line of the scene is a line in the picture, as the pinhole camera has it: background, masks,
edges, overlay all live in straight pictures, and nothing else knows of the lens.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from monodyn.errors import SettingsError
from monodyn.types import Frame
from monodyn.vision.clip.video import Decode, Video

ROUNDS = 20
"""Newton steps by which a place in a straight picture is found."""
GRID = 33
"""Places along a side of the picture at which it is tried whether the lens folds it."""
SHARES = 16
"""Places on the way from the middle to a point at which that is tried for a point."""
OFF_PX = 0.1
"""Distance up to which a place counts as found [px]."""
MOST_BENT = 2.0
"""How far from the middle the border may be shown, in longer sides of the picture; not bent, it is half of
one away."""
MOST_LOST = 0.1
"""Share of the picture, at most, that the coefficients may leave without a place in the straight one: a
calibration that had no points in the corners may fold them. Outside of the circle that touches the left and
the right side of a picture of 4:3 lies about as much."""


@dataclass(frozen=True)
class Lens:
    """How a lens bends the picture: the radial and tangential model of Brown, as OpenCV has it.

    Attributes:
        coefficients: ``k1, k2, p1, p2`` and, if there is one, ``k3``, in OpenCV's order.
        focal: The focal length that they were found with [px].
        width: Width of the pictures [px].
        height: Height of the pictures [px]; the principal point is in their middle.
    """

    coefficients: tuple[float, ...]
    focal: float
    width: int
    height: int

    def frame(self, frame: Frame) -> Frame:
        """Return a frame as a lens that bends nothing would show it.

        Args:
            frame: A frame of the clip; masks of several objects stand one below the other.
        """
        luma = [self._plane(part) for part in np.split(frame.luma, len(frame.luma) // self.height)]
        chroma = None if frame.chroma is None else tuple(self._plane(plane) for plane in frame.chroma)
        whole = luma[0] if len(luma) == 1 else np.concatenate(luma)
        return replace(frame, luma=whole, chroma=chroma)

    def points(self, px: np.ndarray) -> np.ndarray:
        """Return places in the picture as a lens that bends nothing would show them.

        Args:
            px: Places [px], (..., 2); NaN stays.

        Returns:
            Places in the straight picture [px], (..., 2); NaN where the coefficients have nothing appear.
        """
        bent = (np.asarray(px, dtype=np.float64) - self.centre) / self.focal
        straight = bent.copy()
        # where no place appears there the steps lead anywhere, and the numbers may overflow
        with np.errstate(all="ignore"):
            for _ in range(ROUNDS):
                there, slope = _bent(self.coefficients, straight)
                # NaN passes through, where a solver would stop at a singular matrix
                straight = straight - np.einsum("...ij,...j->...i", _inverse(slope), there - bent)
            off = np.hypot(*np.moveaxis(_bent(self.coefficients, straight)[0] - bent, -1, 0))
            found = (self.focal * off <= OFF_PX) & self._unfolded(straight)
        return np.where(found[..., None], self.centre + self.focal * straight, np.nan)

    @property
    def centre(self) -> np.ndarray:
        """The principal point [px], (2,)."""
        return np.array([(self.width - 1) / 2.0, (self.height - 1) / 2.0])

    def _unfolded(self, straight: np.ndarray) -> np.ndarray:
        """Return whether the lens keeps neighbours in order all the way from the middle to directions
        (..., 2) [focal lengths], bool (...): behind a fold the same place of the picture is reached again."""
        ways = (share * straight for share in np.linspace(0.0, 1.0, SHARES + 1)[1:])
        return np.all([_in_order(_bent(self.coefficients, way)[1]) for way in ways], axis=0)

    def _plane(self, plane: np.ndarray) -> np.ndarray:
        """Return one plane of a picture, of any size, put straight."""
        import cv2

        # linear: what it blurs, it blurs alike on both sides of an edge
        straight = cv2.remap(
            plane, *_places(self, plane.shape[1], plane.shape[0]), cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )  # fmt: skip
        straight.flags.writeable = False
        return straight


@cache
def _places(lens: Lens, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Return where each pixel of a straight plane comes from, as OpenCV's fixed-point maps."""
    import cv2

    # pixel c of a reduced plane covers what pixels of the picture around ``step (c + 1/2) - 1/2`` do
    step = np.array([lens.width / width, lens.height / height])
    cells = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1)
    px = step * (cells + 0.5) - 0.5
    bent, _ = _bent(lens.coefficients, (px - lens.centre) / lens.focal)
    source = ((lens.centre + lens.focal * bent + 0.5) / step - 0.5).astype(np.float32)
    return cv2.convertMaps(source[..., 0], source[..., 1], cv2.CV_16SC2)


def _bent(coefficients: Sequence[float], straight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where a lens shows directions (..., 2) [focal lengths], and the derivative by them (..., 2, 2).

    Source:
        D. C. Brown, "Decentering distortion of lenses", 1966, with the signs and names of OpenCV.
    """
    k1, k2, p1, p2, k3 = (*coefficients, 0.0)[:5]
    x, y = straight[..., 0], straight[..., 1]
    square = x * x + y * y
    radial = 1.0 + square * (k1 + square * (k2 + square * k3))
    slope = 2.0 * (k1 + square * (2.0 * k2 + square * 3.0 * k3))
    bent = straight * radial[..., None] + np.stack(
        [2.0 * p1 * x * y + p2 * (square + 2.0 * x * x), p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y], -1
    )
    xy = x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y
    rows = [
        [radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x, xy],
        [xy, radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x],
    ]
    return bent, np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _inverse(matrix: np.ndarray) -> np.ndarray:
    """Invert matrices, (..., 2, 2)."""
    (a, b), (c, d) = np.moveaxis(matrix, (-2, -1), (0, 1))
    adjugate = np.stack([np.stack([d, -b], axis=-1), np.stack([-c, a], axis=-1)], axis=-2)
    return adjugate / (a * d - b * c)[..., None, None]


def lens_of(coefficients: Sequence[float], focal: float, width: int, height: int) -> Lens:
    """Return the lens of given coefficients.

    Args:
        coefficients: ``k1, k2, p1, p2[, k3]`` as OpenCV has them.
        focal: The focal length that they were found with, in pixels of these pictures; 0 where none is given.
        width: Width of the pictures [px].
        height: Height of the pictures [px].

    Raises:
        SettingsError: there is no focal length, or the coefficients would fold the picture.
    """
    if not focal > 0.0:
        raise SettingsError(
            "camera.distortion: expected the focal length that the coefficients were found with, got none; "
            "give --locate.focal PX."
        )
    lens = Lens(tuple(map(float, coefficients)), float(focal), width, height)
    if not _is_one_to_one(lens):
        raise SettingsError(
            f"camera.distortion: expected coefficients that bend a picture of {width}x{height} px at a focal "
            f"length of {focal:g} px, got some that fold it or move it far off; give K1,K2,P1,P2[,K3] in the "
            "order of OpenCV, and the focal length in pixels of this clip."
        )
    return lens


def _is_one_to_one(lens: Lens) -> bool:
    """Return whether neighbours in the straight picture are neighbours in the same order in the bent one, not
    far outside of it, and whether all but corners of that one show something."""
    size = np.array([lens.width, lens.height])
    sides = (np.linspace(-0.5, 0.5, GRID) * side for side in size)
    grid = np.stack(np.meshgrid(*sides), axis=-1)
    # numbers that are beyond all lenses may be beyond all numbers, too
    with np.errstate(all="ignore"):
        bent, slope = _bent(lens.coefficients, grid / lens.focal)
        ordered = _in_order(slope)
    if not (np.all(ordered) and np.abs(bent).max() * lens.focal <= MOST_BENT * size.max()):
        return False
    return float(np.isnan(lens.points(lens.centre + grid)[..., 0]).mean()) <= MOST_LOST


def _in_order(slope: np.ndarray) -> np.ndarray:
    """Return where a lens of derivatives (..., 2, 2) keeps neighbours in order, bool (...)."""
    (a, b), (c, d) = np.moveaxis(slope, (-2, -1), (0, 1))
    # written so that what is no number, NaN, is not in order
    return (a > 0.0) & (a * d - b * c > 0.0)


def straightened(video: Video, lens: Lens) -> Video:
    """Return the clip as a lens that bends nothing would show it.

    Args:
        video: The clip.
        lens: Its lens.
    """
    return replace(video, decode=partial(_straight, lens, video.decode), straight=lens.frame)


def _straight(lens: Lens, decode: Decode, start: int, stop: int) -> Iterator[Frame]:
    """Yield the straight pictures of a range of frame numbers."""
    return map(lens.frame, decode(start, stop))
