"""The pinhole camera: from a ``Camera`` to the packed array of the kernels, and from points to pixels."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monodyn.types import Camera


class CameraParameter(NamedTuple):
    """What a parameter of the camera stands for.

    Attributes:
        field: Field of ``Camera``.
        unit: Its unit.
    """

    field: str
    unit: str


PARAMETERS = {
    "camera.x": CameraParameter("x", "m"),
    "camera.y": CameraParameter("y", "m"),
    "camera.depth": CameraParameter("depth", "m"),
    "camera.roll": CameraParameter("roll", "rad"),
    "camera.pitch": CameraParameter("pitch", "rad"),
    "camera.yaw": CameraParameter("yaw", "rad"),
    "camera.focal": CameraParameter("focal", "px"),
}
"""The camera's parameters by name."""

ROTATION = 9
"""The first entries of a packed camera, this many, are its rotation ``R_camera_plane``, row by row."""
X, Y, DEPTH, FOCAL, CENTRE_X, CENTRE_Y = range(ROTATION, 15)
"""Columns of a packed camera after the rotation: position [m], focal length and principal point [px]."""


def rotation(camera: Camera) -> np.ndarray:
    """Return the rotation from the plane frame (x right, y up, z to the camera) to the camera frame (OpenCV).

    Args:
        camera: The camera.

    Returns:
        ``R_camera_plane``, (3, 3).
    """
    cr, sr = np.cos(camera.roll), np.sin(camera.roll)
    cp, sp = np.cos(camera.pitch), np.sin(camera.pitch)
    cy, sy = np.cos(camera.yaw), np.sin(camera.yaw)
    roll = np.array([[cr, -sr, 0.0], [sr, cr, 0.0], [0.0, 0.0, 1.0]])
    pitch = np.array([[1.0, 0.0, 0.0], [0.0, cp, sp], [0.0, -sp, cp]])
    yaw = np.array([[cy, 0.0, -sy], [0.0, 1.0, 0.0], [sy, 0.0, cy]])
    # the last factor turns y down and z away from the camera: the rest is the identity for a level camera
    return roll @ pitch @ yaw @ np.diag([1.0, -1.0, -1.0])


def camera_array(camera: Camera) -> np.ndarray:
    """Pack a camera for the kernels.

    Args:
        camera: The camera.

    Returns:
        Rotation, position [m], focal length and principal point [px], in the columns named above, (entry,).
    """
    centre = [(camera.width - 1) / 2.0, (camera.height - 1) / 2.0]
    return np.concatenate(
        [rotation(camera).ravel(), [camera.x, camera.y, camera.depth, camera.focal], centre]
    )


def shrunk(packed: np.ndarray, factor: float) -> np.ndarray:
    """Return the packed camera for a picture reduced by ``factor`` (area averaging).

    Args:
        packed: From ``camera_array``, (entry,).
        factor: Old pixels per new pixel.

    Returns:
        The packed camera, (entry,).
    """
    out = packed.copy()
    out[FOCAL] /= factor
    # pixel 0 covers -0.5 to 0.5, and its reduced pixel the same corner: centres shift by half a pixel
    centre = slice(CENTRE_X, CENTRE_Y + 1)
    out[centre] = (packed[centre] + 0.5) / factor - 0.5
    return out


def pixels(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Project points of the plane frame.

    Args:
        camera: The camera.
        points: Points before the camera [m], (point, 3).

    Returns:
        Their places in the picture [px], (point, 2).
    """
    seen = (np.asarray(points, dtype=np.float64) - [camera.x, camera.y, camera.depth]) @ rotation(camera).T
    centre = np.array([(camera.width - 1) / 2.0, (camera.height - 1) / 2.0])
    return centre + camera.focal * seen[:, :2] / seen[:, 2:]


def value_of(camera: Camera, name: str) -> float:
    """Return a parameter of the camera.

    Args:
        camera: The camera.
        name: One of ``PARAMETERS``.

    Returns:
        Its value, in the unit that ``PARAMETERS`` gives.
    """
    return float(getattr(camera, PARAMETERS[name].field))


def with_values(camera: Camera, values: dict[str, float]) -> Camera:
    """Return the camera with some parameters replaced.

    Args:
        camera: The camera.
        values: Values by name, the names from ``PARAMETERS``.

    Returns:
        The new camera.
    """
    return replace(camera, **{PARAMETERS[name].field: float(value) for name, value in values.items()})
