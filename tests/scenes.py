"""Pictures of a still scene from a camera that moves, with the true maps."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from monodyn.types import Frame
from monodyn.vision.clip.homography import Homography

SIZE = (240, 160)
"""Width and height of the pictures [px]."""
BEYOND = 60
"""What the scene reaches beyond the picture to every side [px]."""


def wall(seed: int = 3) -> np.ndarray:
    """Paint a scene larger than the pictures: soft spots and boxes with sharp edges."""
    rng = np.random.default_rng(seed)
    width, height = SIZE[0] + 2 * BEYOND, SIZE[1] + 2 * BEYOND
    spots = cv2.GaussianBlur(rng.normal(size=(height, width)), (0, 0), 4.0)
    scene = 130.0 + 25.0 * spots / spots.std()
    for x, y, grey in rng.integers([0, 0, 60], [width, height, 200], (14, 3)):
        cv2.rectangle(scene, (int(x), int(y)), (int(x) + 30, int(y) + 22), float(grey), -1)
    return cv2.GaussianBlur(scene, (0, 0), 0.8)


def moved(
    shift: Sequence[float] = (0.0, 0.0), turn: float = 0.0, zoom: float = 1.0, bend: float = 0.0
) -> Homography:
    """Return the map that displaces [px], turns clockwise [rad] and zooms, seen from the side by ``bend``."""
    c, s = zoom * np.cos(turn), zoom * np.sin(turn)
    return Homography(np.array([[c, -s, shift[0]], [s, c, shift[1]], [bend, 0.0, 1.0]]), SIZE)


def taken(scene: np.ndarray, at: Homography, index: int = 0, noise: float = 1.0) -> Frame:
    """Take a picture of the scene; ``at`` maps what a camera at rest would show to it."""
    place = np.eye(3)
    place[:2, 2] = BEYOND
    picture = cv2.warpPerspective(
        scene, place @ np.linalg.inv(at.matrix), SIZE, flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
    )
    picture = picture + np.random.default_rng(index).normal(scale=noise, size=picture.shape)
    return Frame(index, index / 30, np.clip(picture.round(), 0, 255).astype(np.uint8))


def hand_held(count: int) -> list[Homography]:
    """Return the maps of a camera that sways slowly, turns a little and zooms."""
    t = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return [
        moved((6.0 * np.sin(k), 4.0 * np.sin(2.0 * k)), 0.01 * np.sin(k), 1.0 + 0.01 * np.sin(k)) for k in t
    ]


def disc(frame: Frame, x: float, y: float, radius: int = 18) -> Frame:
    """Draw a dark disc over a frame, as something that moves."""
    luma = frame.luma.copy()
    cv2.circle(luma, (round(x), round(y)), radius, 20, -1)
    return Frame(frame.index, frame.time, luma)
