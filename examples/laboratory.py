"""What stands for a laboratory in the examples: a true mechanism in MuJoCo, measured while it swings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

import monodyn

RATE = 25
"""Measurements a second [Hz]."""
NOISE = 1e-3
"""Standard deviation of what is measured [m, rad]."""


def swinging(true: Path, start: Sequence[float], frames: int, seed: int) -> monodyn.Poses:
    """Return what is measured of a mechanism that is let go at rest, its motors off.

    Args:
        true: Its file.
        start: Joint positions at which it is let go [m, rad], (dof,).
        frames: How many measurements there are.
        seed: Of the noise.
    """
    body = mujoco.MjModel.from_xml_path(str(true))
    data = mujoco.MjData(body)
    data.qpos[:] = start
    position = np.zeros((frames, body.nq))
    for row in position:
        row[:] = data.qpos
        mujoco.mj_step(body, data, round(1.0 / (RATE * body.opt.timestep)))
    position += np.random.default_rng(seed).normal(scale=NOISE, size=position.shape)
    joints = tuple(body.joint(i).name for i in range(body.njnt))
    covariance = np.tile(NOISE**2 * np.eye(body.nq), (frames, 1, 1))
    frame, seen = np.arange(frames), np.ones(frames, dtype=bool)
    return monodyn.Poses(joints, frame, frame / RATE, position, covariance, seen)
