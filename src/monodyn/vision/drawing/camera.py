"""The pinhole camera: from a ``Camera`` to the numbers the kernels use, and from points to pixels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.types import Camera

PARAMETERS = {
    "camera.x": "m",
    "camera.y": "m",
    "camera.depth": "m",
    "camera.roll": "rad",
    "camera.pitch": "rad",
    "camera.yaw": "rad",
    "camera.focal": "px",
}
"""Names and units of the camera's parameters."""


def rotation(camera: Camera) -> np.ndarray:
    """Return ``R_camera_plane``, (3, 3): plane frame (x right, y up, z to the camera) to camera frame
    (OpenCV).

    Args:
        camera: The camera.
    """
    cr, sr = np.cos(camera.roll), np.sin(camera.roll)
    cp, sp = np.cos(camera.pitch), np.sin(camera.pitch)
    cy, sy = np.cos(camera.yaw), np.sin(camera.yaw)
    roll = np.array([[cr, -sr, 0.0], [sr, cr, 0.0], [0.0, 0.0, 1.0]])
    pitch = np.array([[1.0, 0.0, 0.0], [0.0, cp, sp], [0.0, -sp, cp]])
    yaw = np.array([[cy, 0.0, -sy], [0.0, 1.0, 0.0], [sy, 0.0, cy]])
    return roll @ pitch @ yaw @ np.diag([1.0, -1.0, -1.0])


def camera_array(camera: Camera) -> np.ndarray:
    """Pack rotation (9), position (3), focal length and principal point for the kernels: (15,).

    Args:
        camera: The camera.
    """
    centre = [(camera.width - 1) / 2.0, (camera.height - 1) / 2.0]
    return np.concatenate(
        [rotation(camera).ravel(), [camera.x, camera.y, camera.depth, camera.focal], centre]
    )


def shrunk(packed: np.ndarray, factor: float) -> np.ndarray:
    """Return the packed camera for a picture reduced by ``factor`` (area averaging).

    Args:
        packed: From ``camera_array``.
        factor: Old pixels per new pixel.
    """
    out = packed.copy()
    out[12] /= factor
    out[13:15] = (packed[13:15] + 0.5) / factor - 0.5
    return out


def pixels(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Project points of the plane frame [m], (point, 3), to pixels, (point, 2).

    Args:
        camera: The camera.
        points: Points before the camera.
    """
    seen = (np.asarray(points, dtype=np.float64) - [camera.x, camera.y, camera.depth]) @ rotation(camera).T
    centre = np.array([(camera.width - 1) / 2.0, (camera.height - 1) / 2.0])
    return centre + camera.focal * seen[:, :2] / seen[:, 2:]


def value_of(camera: Camera, name: str) -> float:
    """Return the camera parameter ``camera.<field>``.

    Args:
        camera: The camera.
        name: One of ``PARAMETERS``.
    """
    return float(getattr(camera, name.removeprefix("camera.")))


def with_values(camera: Camera, values: dict[str, float]) -> Camera:
    """Return the camera with some parameters replaced.

    Args:
        camera: The camera.
        values: Parameter names, of ``PARAMETERS``, and values.
    """
    return replace(camera, **{name.removeprefix("camera."): float(value) for name, value in values.items()})
