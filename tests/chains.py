"""A chain of boxes and its silhouettes, drawn corner by corner: what the published vision is tested on."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

import monodyn
from monodyn.mechanism import Mechanism
from monodyn.paper.placed import CameraFree
from monodyn.paper.subproblems import History
from monodyn.paper.view import ModelView, SilhouetteImage, model_view, silhouette_image
from monodyn.types import FULL, Camera

CAMERA = Camera(360, 280, 400.0, x=0.03, y=-0.12, depth=1.1)
LENGTHS, WIDTHS, THICK = (0.2, 0.15), (0.03, 0.024), 0.006
POSE = np.array([-0.8, 0.7])
FINE = 8
"""Samples of a pixel by side."""
ALL_FREE = CameraFree(x=True, y=True, depth=True)


def chain(
    folder: Path, lengths: tuple[float, ...] = LENGTHS, widths: tuple[float, ...] = WIDTHS, limits: str = ""
) -> Mechanism:
    """Load a chain of boxes from hinge to hinge, all in one plane."""
    bodies, ends = "", ""
    for i, (length, width) in enumerate(zip(lengths, widths, strict=True)):
        place = lengths[i - 1] if i else 0
        bodies += (
            f'<body name="link{i + 1}" pos="{place} 0 0"><joint name="joint{i + 1}" type="hinge" '
            f'axis="0 -1 0" {limits}/><geom type="box" pos="{length / 2} 0 0" density="2700" '
            f'size="{length / 2} {THICK / 2} {width / 2}"/>'
        )
        ends += "</body>"
    path = folder / "chain.xml"
    path.write_text(
        '<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/>'
        f"<worldbody>{bodies}{ends}</worldbody></mujoco>"
    )
    return monodyn.load(path)


def chain_picture(
    q: np.ndarray,
    camera: Camera = CAMERA,
    lengths: tuple[float, ...] = LENGTHS,
    widths: tuple[float, ...] = WIDTHS,
    fine: int = 1,
) -> np.ndarray:
    """Draw the chain: eight corners of each box through a pinhole, their hull filled."""
    out = np.zeros((camera.height * fine, camera.width * fine), np.uint8)
    at, angle = np.zeros(2), 0.0
    for turn, length, width in zip(q, lengths, widths, strict=True):
        angle += turn
        along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        corners = []
        for a in (0.0, length):
            for b in (-width / 2, width / 2):
                for z in (-THICK / 2, THICK / 2):
                    x, y = at + a * along + b * across
                    away = camera.depth - z
                    px = (camera.width - 1) / 2 + camera.focal * (x - camera.x) / away
                    py = (camera.height - 1) / 2 - camera.focal * (y - camera.y) / away
                    corners.append([(px + 0.5) * fine - 0.5, (py + 0.5) * fine - 0.5])
        fill_hull(out, cv2.convexHull(np.array(corners, dtype=np.float32))[:, 0].astype(float))
        at = at + length * along
    return out


def fill_hull(out: np.ndarray, hull: np.ndarray) -> None:
    """Set the pixels whose centres lie inside a convex polygon."""
    left, top = np.maximum(np.floor(hull.min(axis=0)).astype(int), 0)
    right, bottom = np.ceil(hull.max(axis=0)).astype(int) + 1
    window = out[top:bottom, left:right]
    y, x = np.mgrid[top : top + window.shape[0], left : left + window.shape[1]]
    following = np.roll(hull, -1, axis=0)
    sides = [
        (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) for a, b in zip(hull, following, strict=True)
    ]
    window[np.all(np.array(sides) >= 0, axis=0) | np.all(np.array(sides) <= 0, axis=0)] = 1


def silhouette_of(q: np.ndarray = POSE, **kwargs: object) -> SilhouetteImage:
    """Return a drawn silhouette; a pixel belongs to it when more than half of it does."""
    fine = chain_picture(q, fine=FINE, **kwargs).astype(np.float32)  # pyright: ignore[reportArgumentType]
    size = (fine.shape[1] // FINE, fine.shape[0] // FINE)
    share = cv2.resize(fine, size, interpolation=cv2.INTER_AREA)
    return silhouette_image(np.where(share > 0.5, FULL, 0).astype(np.uint8))


def view_of(
    mechanism: Mechanism,
    camera: Camera = CAMERA,
    q: np.ndarray = POSE,
    free: CameraFree = ALL_FREE,
) -> ModelView:
    """Put a chain before a camera."""
    return model_view(mechanism, camera, q, free)


def falls(history: History) -> bool:
    """Return whether a history counts up its drawings and never rises."""
    return bool(np.all(np.diff(history.values) <= 0) and np.all(np.diff(history.evaluations) >= 0))
