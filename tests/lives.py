"""Frames of a stream with what is known at them, made up from a small fit, for tests of what shows them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

import monodyn
from fits import identified
from monodyn.estimation.fit import Fit
from monodyn.live.step import Step
from monodyn.mechanism.simulate import simulate
from monodyn.results.fill import fill
from monodyn.results.predict import Prediction
from monodyn.types import Camera, Frame, Poses
from monodyn.vision.locating.scene import Scene

RATE = 30.0
"""Frames a second [Hz]."""
AHEAD = 1.0
"""How far ahead the motion is predicted [s]."""


@dataclass(frozen=True, eq=False)
class Known:
    """What was identified at a frame: all that is shown of an `Estimate`, with the fit's own motion."""

    fit: Fit
    future: Prediction

    @property
    def grade(self) -> str:
        return self.fit.grade

    def expected(self, time: float) -> np.ndarray:
        rows = [np.interp(time, self.future.time, column) for column in self.future.position.T]
        return np.array(rows)


@lru_cache
def double() -> Fit:
    """Identify the bundled double pendulum from 40 simulated frames."""
    mechanism = monodyn.load("double")
    time = np.arange(40) / RATE
    rng = np.random.default_rng(3)
    position = simulate(mechanism, time, np.array([0.4, 0.3]), np.zeros(2)).position
    position = position + 1e-3 * rng.standard_normal(position.shape)
    covariance = np.broadcast_to(1e-6 * np.eye(2), (len(time), 2, 2))
    joints = tuple(joint.name for joint in mechanism.joints)
    return monodyn.identify(
        Poses(joints, np.arange(len(time)), time, position, covariance, np.ones(len(time), bool)), mechanism
    )


def scene(fit: Fit, width: int = 320, height: int = 240) -> Scene:
    """Return that mechanism before a camera that looks squarely at all of it."""
    reach = sum(p.value for p in fit.mechanism.parameters if p.kind == "length") or 0.2
    camera = Camera(width, height, focal=float(width), y=-0.2 * reach, depth=width * 2.6 * reach / height)
    still: Any = None
    dofs = len(fit.mechanism.joints)
    return Scene(
        fit.mechanism, camera, still, 0, np.zeros(dofs), (), np.zeros((0, dofs)), {}, 0.1, ()
    )  # fmt: skip


def picture(index: int, width: int = 320, height: int = 240, colour: bool = True) -> Frame:
    """Return a grey picture with a gradient and one bright corner."""
    luma = np.linspace(60, 160, width, dtype=np.uint8)[np.newaxis].repeat(height, axis=0).copy()
    luma[:20, :20] = 235
    half = ((height + 1) // 2, (width + 1) // 2)
    chroma = (np.full(half, 120, np.uint8), np.full(half, 134, np.uint8)) if colour else None
    return Frame(index, index / RATE, luma, chroma)


def watched(index: int = 0, said: str = "Waiting for motion.", **changes: Any) -> Step:
    """Return a frame before the mechanism is found."""
    return replace(Step(index, index / RATE, "watching", picture(index), said=said, latency=1e-3), **changes)


def followed(index: int = 45, fit: Fit | None = None, **changes: Any) -> Step:
    """Return a frame at which a mechanism is followed and known; its pose is on the fitted motion."""
    fit = fit or identified()
    time = index / RATE
    ahead = fill(fit, time + np.arange(int(AHEAD * RATE) + 1) / RATE)
    future = Prediction(
        ahead.joints, ahead.time, ahead.position, ahead.velocity, ahead.std, ahead.velocity_std
    )
    dofs = len(fit.mechanism.joints)
    joints = tuple(joint.name for joint in fit.mechanism.joints)
    pose = Poses(
        joints, np.array([index]), np.array([time]), ahead.position[:1], 1e-6 * np.eye(dofs)[np.newaxis],
        np.ones(1, bool), roll=None,
    )  # fmt: skip
    known: Any = Known(fit, future)
    step = Step(
        index, time, "following", picture(index), pose, scene(fit), known, fit, fit.status, 2, 4.2e-3, 9.7e-3,
        np.full(dofs, 0.01),
    )  # fmt: skip
    return replace(step, **changes)
