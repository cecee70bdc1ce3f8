"""Films of a chain of known motion before a patterned wall, for the tests of what is assumed about a film."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

import monodyn
from chains import CAMERA, chain, chain_picture
from monodyn.types import Poses
from monodyn.vision.locating.scene import Scene

COUNT = 40
"""Frames of a film."""
Change = Callable[[int, np.ndarray], np.ndarray]


def swing() -> np.ndarray:
    """Return the joint positions of a film [rad], (frame, 2): a wide swing of both links."""
    t = np.arange(COUNT) / 30.0
    return np.column_stack([-1.6 + 1.3 * np.sin(5.0 * t), 1.2 * np.sin(7.0 * t + 1.0)])


def film(
    folder: Path, change: Change | None = None, *, lost: tuple[int, ...] = (), stretch: float = 1.0
) -> tuple[Scene, Poses]:
    """Film a swinging chain and return its scene and poses as they are in truth.

    Args:
        folder: For the pictures and the model.
        change: Number of a frame and its grey picture to the picture that is filmed.
        lost: Frames without a pose.
        stretch: Factor by which the picture of the mechanism is drawn out to the right.
    """
    mechanism, poses = chain(folder), swing()
    y, x = np.mgrid[: CAMERA.height, : CAMERA.width]
    wall = 165.0 + 25.0 * np.sin(x / 9.0) * np.cos(y / 11.0)
    rng = np.random.default_rng(7)
    pictures = folder / "film"
    pictures.mkdir()
    for k, q in enumerate(poses):
        drawn = chain_picture(q)
        about = np.array([[stretch, 0.0, (1.0 - stretch) * CAMERA.width / 2], [0.0, 1.0, 0.0]])
        drawn = cv2.warpAffine(drawn, about, (CAMERA.width, CAMERA.height), flags=cv2.INTER_NEAREST)
        picture = np.where(drawn > 0, 60.0, wall)
        if change is not None:
            picture = change(k, picture)
        noisy = np.clip(picture + rng.normal(size=picture.shape), 0, 255).round().astype(np.uint8)
        cv2.imwrite(str(pictures / f"{k:03d}.png"), noisy)
    masks = monodyn.segment(monodyn.read(pictures, rate=30.0))
    scene = Scene(mechanism, CAMERA, masks, 0, poses[0], (0,), poses[:1], {}, 0.0, ())
    seen = np.array([k not in lost for k in range(COUNT)])
    covariance = np.where(seen[:, None, None], 1e-6 * np.eye(2), np.nan)
    position = np.where(seen[:, None], poses, np.nan)
    joints = tuple(joint.name for joint in mechanism.joints)
    times = masks.video.times
    return scene, Poses(joints, np.arange(COUNT), times, position, covariance, seen, metric=False)
