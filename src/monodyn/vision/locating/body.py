"""A picture of a body in its own frame, and the bar or disc that explains most of it.

What moves with a body is the same in every frame, seen from the body: the mean of the masks, each turned and
shifted into the body's frame, is a picture of it. What covering a cell of it gains is 1 where foreground
always is and -1 where it never is, so that the best geom is the one with the largest sum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.types import FULL
from monodyn.vision.drawing import silhouette
from monodyn.vision.drawing.camera import CENTRE_X, CENTRE_Y, DEPTH, FOCAL, ROTATION, X, Y
from monodyn.vision.drawing.rig import Rig, rig_of
from monodyn.vision.locating.keyframes import KeyFrames
from monodyn.vision.locating.search import SceneGuess, as_thick

CELLS = 80
"""Cells of the picture of a body from its joint to each side."""
TURNS = 12
"""Directions in half a turn that are tried for a bar."""
LEAST_CELLS, SIZE_RATIO = 2, 1.3
"""The smallest size that is tried [cells], and the ratio of one size to the next."""
ALWAYS = 0.5
"""Gain above which a cell is foreground in most frames."""
NEAR = 2
"""Distance from the outline of a body within which the foreground is its own [cells]."""
WORTH = (2.0 * np.minimum(np.arange(256), FULL).astype(np.float32) / FULL - 1.0).astype(np.float32)
"""What covering a pixel gains, by its coverage in a mask."""
FARTHEST = 99.0
"""Percentile of the distances of the foreground from the joint that the picture reaches to."""


@dataclass(frozen=True)
class Bar:
    """A place in the picture of a body.

    Attributes:
        gain: Foreground that it covers there less what it covers besides [cells].
        x: Middle in the link's frame [cells].
        y: As ``x``.
        length: Extent along its direction [cells].
        width: Extent across it [cells].
        angle: Its direction in the link's frame [rad].
    """

    gain: float
    x: float
    y: float
    length: float
    width: float
    angle: float


@dataclass(frozen=True, eq=False)
class BodyView:
    """What the key frames show of a link in its own frame; y by row and x by column, ``CELLS`` to each side.

    Attributes:
        frames: The key frames.
        guess: The mechanism with its pose in each.
        link: Row of the link.
    """

    frames: KeyFrames
    guess: SceneGuess
    link: int

    @cached_property
    def rig(self) -> Rig:
        """The mechanism before the reduced camera."""
        return rig_of(self.guess.mechanism, self.guess.camera, shrink=self.frames.shrink)

    @property
    def geoms(self) -> list[int]:
        """Rows of the geoms of the link."""
        return np.flatnonzero(self.rig.link == self.link).tolist()

    @cached_property
    def _pixel(self) -> float:
        """Size of a reduced pixel at the mechanism [m]."""
        return float(self.rig.camera[DEPTH] / self.rig.camera[FOCAL])

    @cached_property
    def cell(self) -> float:
        """Size of a cell [m]: the foreground reaches to the edge, or a cell is a reduced pixel."""
        far = 0.0
        for frame, q in zip(self.frames.frames, self.guess.positions, strict=True):
            shown = np.flatnonzero((frame.coarse > FULL // 2) & ~self.frames.unknown)
            if len(shown):
                y, x = np.divmod(shown, frame.coarse.shape[1])
                place = silhouette.link_frames(self.rig, q)[self.link]
                root = _homography(
                    self.rig, np.diag([place[silhouette.LINK_X], place[silhouette.LINK_Y], 0.0])
                ) @ np.ones(3)
                away = np.hypot(x - root[0] / root[2], y - root[1] / root[2])
                far = max(far, float(np.percentile(away, FARTHEST)))
        return max(1.0, far / CELLS) * self._pixel

    @property
    def area(self) -> float:
        """Mean area of the foreground of a frame [cells]."""
        return float(np.mean([frame.area for frame in self.frames.frames])) * (self._pixel / self.cell) ** 2

    @cached_property
    def gain(self) -> np.ndarray:
        """What covering each cell gains on average; nothing where other links are, or the background is not
        known."""
        import cv2

        rig, geoms = self.rig, self.geoms
        height = float(np.mean([rig.points[rig.first[g], 2] for g in geoms])) if geoms else 0.0
        side = 2 * CELLS + 1
        corner, gain = -CELLS * self.cell, np.zeros((side, side), np.float32)
        place_of = np.array([[self.cell, 0.0, corner], [0.0, self.cell, corner], [0.0, 0.0, 1.0]])

        def seen(row: int) -> np.ndarray | None:
            q, outlines = self.guess.positions[row], silhouette.blank_outlines(rig, len(rig.radius))
            if not silhouette.draw(rig, q, outlines):
                return None
            x0, y0, angle = silhouette.link_frames(rig, q)[self.link][
                [silhouette.LINK_X, silhouette.LINK_Y, silhouette.LINK_ANGLE]
            ]
            c, s = np.cos(angle), np.sin(angle)
            plane = np.array([[c, -s, x0], [s, c, y0], [0.0, 0.0, height]])
            worth = cv2.LUT(self.frames.frames[row].coarse, WORTH)
            worth[self.frames.unknown] = 0.0
            for g in np.flatnonzero(rig.link != self.link):
                corners = outlines.px[outlines.hull[outlines.first[g] : outlines.first[g + 1]]]
                cv2.fillPoly(worth, [np.round(corners * 16.0).astype(np.int32)], 0.0, cv2.LINE_8, 4)
            # outside of the picture nothing is known
            flags, place = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, _homography(rig, plane) @ place_of
            return cv2.warpPerspective(worth, place, (side, side), flags=flags, borderValue=0.0)

        for picture in on_all_cores(seen, range(len(self.frames.frames))):
            if picture is not None:
                gain += picture
        return gain / len(self.frames.frames)

    def covered(self, geoms: Sequence[int]) -> np.ndarray:
        """Return the cells that geoms of the link cover.

        Args:
            geoms: Their rows.

        Returns:
            True where covered, bool (row, column).
        """
        import cv2

        rig = self.rig
        mask = np.zeros((2 * CELLS + 1, 2 * CELLS + 1), np.uint8)
        for g in geoms:
            points = rig.points[rig.first[g] : rig.first[g + 1], :2]
            ring = points[:, np.newaxis] + rig.radius[g] * silhouette.AROUND.T
            corners = cv2.convexHull((ring.reshape(-1, 2) / self.cell + CELLS).astype(np.float32))
            cv2.fillPoly(mask, [np.round(corners * 16.0).astype(np.int32)], 1, cv2.LINE_8, 4)
        return mask > 0


def beside(frames: KeyFrames, guess: SceneGuess) -> dict[str, float]:
    """Measure what moves along with each body and is not inside of its outline.

    What merely passes by is in other places of the body's frame from one key frame to the next.

    Args:
        frames: The key frames.
        guess: A located mechanism with its pose in each.

    Returns:
        Share of the foreground by body.
    """
    return _outside(frames, guess, NEAR, ALWAYS)


def left_over(frames: KeyFrames, guess: SceneGuess) -> dict[str, float]:
    """Measure what covering more cells right beside each body would gain.

    Parts of a few cells that show beside a body count here, and so does an outline that is a cell too narrow.

    Args:
        frames: The key frames.
        guess: A mechanism with its pose in each.

    Returns:
        Share of the foreground by body.
    """
    return _outside(frames, guess, 0, 0.0)


def _outside(frames: KeyFrames, guess: SceneGuess, near: int, least: float) -> dict[str, float]:
    """Return what cells more than ``near`` cells outside of each body gain, of those that gain more than
    ``least``, as a share of the foreground by body."""
    import cv2

    shares = {}
    # in masks that are made thicker the outlines are as thick as these
    guess = replace(guess, mechanism=as_thick(frames, guess.mechanism, guess.camera))
    for link, joint in enumerate(guess.mechanism.joints):
        view = BodyView(frames, guess, link)
        if not view.geoms:
            continue
        own = view.covered(view.geoms).astype(np.uint8)
        inside = cv2.dilate(own, np.ones((2 * near + 1, 2 * near + 1), np.uint8)) > 0
        rest = view.gain[(view.gain > least) & ~inside]
        shares[joint.body] = float(rest.sum() / max(view.area, 1.0))
    return shares


def _homography(rig: Rig, plane: np.ndarray) -> np.ndarray:
    """Return the map (3, 3) from (u, v, 1) to the reduced pixels, from that to points of the plane frame [m],
    whose last row is their height."""
    camera = rig.camera
    before = plane - np.outer(camera[[X, Y, DEPTH]], [0.0, 0.0, 1.0])
    lens = np.array(
        [[camera[FOCAL], 0.0, camera[CENTRE_X]], [0.0, camera[FOCAL], camera[CENTRE_Y]], [0.0, 0.0, 1.0]]
    )
    return lens @ camera[:ROTATION].reshape(3, 3) @ before


def _sizes(most: int) -> list[int]:
    """Return the sizes that are tried, odd numbers of cells up to ``most``."""
    count = int(np.log(most / LEAST_CELLS) / np.log(SIZE_RATIO)) + 1
    sizes = {2 * int(0.5 * LEAST_CELLS * SIZE_RATIO**i) + 1 for i in range(count + 1)}
    return sorted(size for size in sizes if size <= most)


def best_bar(picture: np.ndarray) -> Bar:
    """Return the bar of any place, direction and size that gains most.

    Args:
        picture: What covering each cell gains, float32 (row, column).

    Returns:
        The bar; one of no gain where nothing gains.
    """
    import cv2

    best = Bar(0.0, 0.0, 0.0, 1.0, 1.0, 0.0)
    y, x = np.mgrid[-CELLS : CELLS + 1, -CELLS : CELLS + 1].astype(np.float32)
    for angle in np.pi / TURNS * np.arange(TURNS):
        c, s = np.float32(np.cos(angle)), np.float32(np.sin(angle))
        # the picture with the bar's direction along its rows, in which the sum over a bar takes four numbers
        turned = cv2.remap(picture, c * x - s * y + CELLS, s * x + c * y + CELLS, cv2.INTER_LINEAR)
        sums = cv2.integral(turned)
        for width in _sizes(CELLS):
            rows = sums[width:] - sums[:-width]
            for length in _sizes(2 * CELLS):
                if length < width:
                    continue
                gains = rows[:, length:] - rows[:, :-length]
                place = int(np.argmax(gains))
                if gains.flat[place] > best.gain:
                    row, column = divmod(place, gains.shape[1])
                    u, v = column + length // 2 - CELLS, row + width // 2 - CELLS
                    best = Bar(
                        float(gains.flat[place]), float(c * u - s * v), float(s * u + c * v),
                        float(length), float(width), float(angle),
                    )  # fmt: skip
    return best


def best_disc(picture: np.ndarray) -> Bar:
    """Return the disc of any place and size that gains most.

    Args:
        picture: What covering each cell gains, float32 (row, column).

    Returns:
        The disc, its length and width the diameter; one of no gain where nothing gains.
    """
    import cv2

    best = Bar(0.0, 0.0, 0.0, 1.0, 1.0, 0.0)
    for size in _sizes(CELLS):
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)).astype(np.float32)
        gains = cv2.filter2D(picture, cv2.CV_32F, disc, borderType=cv2.BORDER_CONSTANT)
        row, column = np.unravel_index(int(np.argmax(gains)), gains.shape)
        if gains[row, column] > best.gain:
            best = Bar(float(gains[row, column]), float(column - CELLS), float(row - CELLS), size, size, 0.0)
    return best
