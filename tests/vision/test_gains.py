"""How a pose follows what sizes and camera are wrong by: closed forms, and a slow twin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.mechanism import load
from monodyn.types import Camera
from monodyn.vision.drawing.gains import pose_gains
from monodyn.vision.drawing.outline import outline
from monodyn.vision.locating.bundle import shifted_rigs
from monodyn.vision.locating.variables import scene_variables

CAMERA = Camera(640, 480, 600.0, x=0.02, y=-0.05, depth=0.9, yaw=0.1)
NAMES = ["link1.length", "link2.width", "camera.x", "camera.yaw", "camera.roll", "camera.focal"]


def gains(positions: np.ndarray, camera: Camera, names: list[str]) -> np.ndarray:
    double = load("double")
    variables = scene_variables(double, names)
    rig, shifts = shifted_rigs(variables, variables.read(double, camera), double, camera, 1.0)
    return pose_gains(rig, shifts, positions)


def test_a_roll_of_the_camera_turns_the_first_hinge_alone() -> None:
    # squarely before the hinge a roll is a turn of the picture about the hinge
    square = replace(CAMERA, x=0.0, y=0.0, yaw=0.0)
    found = gains(np.array([[-1.0, 0.4], [0.3, -2.0]]), square, ["camera.roll"])
    np.testing.assert_allclose(found[:, :, 0], [[1.0, 0.0], [1.0, 0.0]], atol=1e-4)


def test_the_gains_are_those_of_a_slow_twin() -> None:
    double, q = load("double"), np.array([-0.9, 0.7])
    variables = scene_variables(double, NAMES)
    x, h = variables.read(double, CAMERA), 1e-5

    def corners(position: np.ndarray, values: np.ndarray) -> np.ndarray:
        return np.stack(
            [polygon for _, polygon in outline(*variables.write(values, double, CAMERA), position)]
        )

    base = corners(q, x)
    ahead = np.roll(base, -1, axis=1) - base
    length = np.linalg.norm(ahead, axis=2)
    normal = np.stack([ahead[..., 1], -ahead[..., 0]], axis=2) / length[..., None]

    def displaced(moved: np.ndarray) -> np.ndarray:
        """Return the displacements along the normals at many places of each edge, weighted by its length."""
        step = (moved - base) / h
        share = (np.arange(200) + 0.5)[:, None, None, None] / 200
        along = (1.0 - share) * step + share * np.roll(step, -1, axis=1)
        return (np.einsum("nekc,ekc->nek", along, normal) * np.sqrt(length / 200)).ravel()

    by_pose = np.column_stack([displaced(corners(q + h * unit, x)) for unit in np.eye(2)])
    by_param = np.column_stack([displaced(corners(q, x + h * unit)) for unit in np.eye(len(x))])
    twin = -np.linalg.lstsq(by_pose, by_param, rcond=None)[0]
    found = gains(q[None], CAMERA, NAMES)[0]
    np.testing.assert_allclose(found, twin, atol=2e-3 * np.abs(twin).max())


def test_what_cannot_be_drawn_has_no_gain() -> None:
    assert not gains(np.array([[np.nan, 0.0]]), CAMERA, ["camera.x"]).any()
    assert gains(np.zeros((0, 2)), CAMERA, ["camera.x"]).shape == (0, 2, 1)
