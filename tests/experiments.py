"""What a method would have seen and fitted in the repeated experiment, made from the truth."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np

from monodyn.mechanism import Mechanism, load
from monodyn.paper.filter import Gains, filtered
from monodyn.reproduce.cases import Case, Design, FitPlan, rms
from monodyn.reproduce.clip import ClipSettings, simulated
from monodyn.reproduce.experiment import START
from monodyn.reproduce.vision import Seen
from monodyn.results.fill import States
from swings import white

NOISE = np.radians(0.2)
DESIGN = Design(lengths=(20, 30, 40), starts=2)
JOINTS = ("joint1", "joint2")
FAILED = Seen("paper", "failed: x")


@lru_cache
def seen() -> Seen:
    """Return what a method would have seen: the truth with noise, and turned by a whole turn."""
    settings = ClipSettings(frames=90)
    truth = simulated(settings)
    noise = NOISE * np.random.default_rng(2).standard_normal(truth.position.shape)
    position = truth.position + noise + [0.0, 2.0 * np.pi]
    poses = white(JOINTS, truth.time, position, NOISE)
    scene: Any = SimpleNamespace(mechanism=mechanism(), camera=settings.camera)
    states = filtered(poses.time, poses.position, Gains(), poses.covariance)
    return Seen("fast", "done", scene, poses, 1.0, 0.5, states, noise)


@lru_cache
def mechanism() -> Mechanism:
    """Load the mechanism file that the methods are given."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "start.xml"
        path.write_text(START)
        return load(path)


def moved(case: str, error: float, states: str = "measured", frames: int = 40, noise: float = 0.0) -> Case:
    """Return a fit whose motion is off by ``error`` [rad] and by a share of the noise."""
    found = seen()
    assert found.poses is not None
    assert found.errors is not None
    true = found.poses.position - found.errors
    position = true + error + noise * found.errors
    motion = States(found.poses.time, position, 0.0 * position, 0.0 * position)
    fit: Any = SimpleNamespace(
        shared=tuple("abcdef"),
        starts=(None,),
        mechanism=mechanism(),
        evaluations=7,
        ok=True,
        parameters=(),
        advice=(),
    )
    return Case(
        FitPlan("fast", case, states, frames),
        "made",
        fit,
        motion,
        rms((position - found.poses.position)[:frames]),
        rms((position - true)[:frames]),
        rms((position - true)[frames:]),
        rms((position - true)[frames:]),
    )
