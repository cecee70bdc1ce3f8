"""The pinhole camera: from a ``Camera`` to the packed array of the kernels, and from points to pixels."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monodyn.errors import SettingsError
from monodyn.mechanism.upright import ROLL_STD
from monodyn.types import Camera
from monodyn.vision.settings import FOCALS


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

CAMERA_TURNS = ("camera.roll", "camera.pitch", "camera.yaw")
"""Turns of the camera, which is assumed to look about squarely at the plane of the mechanism."""
CAMERA_STD = {
    "camera.roll": ROLL_STD,
    "camera.pitch": float(np.radians(6.0)),
    "camera.yaw": float(np.radians(6.0)),
    "camera.focal": 0.25,
}
"""Standard deviations of what is assumed of a camera of which nothing is known: turns about zero [rad], and
the logarithm of the focal length about its start."""

LEAST_VIEW = 0.1
"""Least focal length over the picture's longer side: a view of 157 deg, as of no lens that bends nothing."""
FARTHEST = 1e6
"""Farthest that a camera may be from a mechanism, and one over the nearest [m]."""
GRAZING = 0.1
"""Least slope of a ray to the plane that is told apart from one along it."""
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
    cr, sr = math.cos(camera.roll), math.sin(camera.roll)
    cp, sp = math.cos(camera.pitch), math.sin(camera.pitch)
    cy, sy = math.cos(camera.yaw), math.sin(camera.yaw)
    # roll, pitch and yaw one after the other, of axes of which y points down and z away from the camera
    return np.array(
        [
            [cr * cy - sr * sp * sy, sr * cp, cr * sy + sr * sp * cy],
            [sr * cy + cr * sp * sy, -cr * cp, sr * sy - cr * sp * cy],
            [cp * sy, sp, -cp * cy],
        ]
    )


def turned(camera: Camera, angle: float) -> Camera:
    """Return the same camera in a plane frame that is turned, so that the picture stays as it is.

    Args:
        camera: The camera.
        angle: Turn of what the mechanism's frame calls a direction, counter-clockwise [rad].

    Returns:
        The camera before points that are turned by ``angle`` about the origin.
    """
    c, s = np.cos(angle), np.sin(angle)
    x, y = c * camera.x - s * camera.y, s * camera.x + c * camera.y
    # R_camera_turned = R_camera_plane R_plane_turned, and its angles from the order roll, pitch, yaw
    whole = rotation(camera) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    whole = whole @ np.diag([1.0, -1.0, -1.0])
    pitch = float(np.arcsin(np.clip(whole[2, 1] * -1.0, -1.0, 1.0)))
    roll = float(np.arctan2(-whole[0, 1], whole[1, 1]))
    yaw = float(np.arctan2(whole[2, 0], whole[2, 2]))
    return replace(camera, x=float(x), y=float(y), roll=roll, pitch=pitch, yaw=yaw)


def around_origin(camera: Camera) -> Camera:
    """Return the camera with its place told by where the mechanism's origin is before it.

    Args:
        camera: The camera.

    Returns:
        The same turns; ``x``, ``y`` and ``depth`` are how far the camera would stand to the right, above and
        before the origin if it looked along -z and saw the origin in the same place.
    """
    x, y, z = -rotation(camera) @ [camera.x, camera.y, camera.depth] * [-1.0, 1.0, 1.0]
    return replace(camera, x=float(x), y=float(y), depth=float(z))


def from_origin(camera: Camera) -> Camera:
    """Return the camera whose place is told by where the mechanism's origin is before it.

    Args:
        camera: As ``around_origin`` returns it.
    """
    x, y, z = -rotation(camera).T @ (np.array([camera.x, camera.y, camera.depth]) * [-1.0, 1.0, 1.0])
    return replace(camera, x=float(x), y=float(y), depth=float(z))


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


def on_plane(packed: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the points of the plane z = 0 that appear at places in the picture.

    Args:
        packed: The camera as the kernels take it, (entry,).
        places: Places in the picture [px], (point, 2).

    Returns:
        The points [m], (point, 2); of a place beyond the horizon one that is far away.
    """
    rays = np.column_stack([(places - packed[[CENTRE_X, CENTRE_Y]]) / packed[FOCAL], np.ones(len(places))])
    seen = rays @ packed[:ROTATION].reshape(3, 3)
    # the camera looks along -z; what looks away from the plane, or along it, meets it nowhere near
    steps = packed[DEPTH] / np.maximum(-seen[:, 2], GRAZING)
    return packed[[X, Y]] + steps[:, np.newaxis] * seen[:, :2]


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


def displaced_camera(packed: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Displace the picture of a packed camera.

    Args:
        packed: The camera as the kernels take it, (entry,).
        by: To the right and down [px], (2,).

    Returns:
        The camera whose picture is displaced, (entry,).
    """
    out = packed.copy()
    out[[CENTRE_X, CENTRE_Y]] += by
    return out


def check_value(name: str, value: float) -> None:
    """Refuse a value of a camera parameter that no camera in front of the plane can have.

    Args:
        name: Name of the parameter.
        value: Its value.

    Raises:
        SettingsError: there is no such camera.
    """
    unit = PARAMETERS[name].unit
    if not math.isfinite(value):
        raise SettingsError(f"parameter '{name}': expected a finite number, got {value}; give it in {unit}.")
    if name in ("camera.depth", "camera.focal") and value <= 0:
        raise SettingsError(
            f"parameter '{name}': expected a value above 0 {unit}, got {value:g}; correct it."
        )
    if name == "camera.focal" and not FOCALS[0] <= value <= FOCALS[1]:
        raise SettingsError(
            f"parameter '{name}': expected {FOCALS[0]:g} to {FOCALS[1]:g} {unit}, got {value:g}; correct it."
        )
    if PARAMETERS[name].unit == "m" and (
        abs(value) > FARTHEST or (name == "camera.depth" and value < 1.0 / FARTHEST)
    ):
        raise SettingsError(
            f"parameter '{name}': expected a place within {FARTHEST:g} {unit} of the mechanism, got "
            f"{value:g}; correct it."
        )
    if name == "camera.roll" and abs(value) > 2.0 * math.pi:
        raise SettingsError(
            f"parameter '{name}': expected an angle within a turn, got {value:g} rad; give it in radians."
        )
    if name in ("camera.pitch", "camera.yaw") and abs(value) >= math.pi / 2:
        raise SettingsError(
            f"parameter '{name}': expected less than a quarter turn, got {value:g} rad; "
            "the camera looks at the plane, give the angle in radians."
        )


def check_view(focal: float, width: int, height: int) -> None:
    """Refuse a focal length with which the picture would show nearly all that is before the camera.

    Args:
        focal: The focal length [px].
        width: Width of the picture [px].
        height: Its height [px].

    Raises:
        SettingsError: it is less than ``LEAST_VIEW`` of the picture's longer side.
    """
    least = LEAST_VIEW * max(width, height)
    if focal < least:
        raise SettingsError(
            f"camera.focal: expected at least {least:g} px in pictures of {width}x{height} px, got "
            f"{focal:g}; give it in pixels of the clip."
        )
