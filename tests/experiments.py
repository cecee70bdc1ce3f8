"""What a method would have seen and fitted in the repeated experiment, made from the truth."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np

from monodyn.mechanism import Mechanism, load
from monodyn.reproduce.cases import Case, rms
from monodyn.reproduce.clip import ClipSettings, simulated
from monodyn.reproduce.evidence import Evidence
from monodyn.reproduce.plans import Design, own_form
from monodyn.reproduce.pose_starts import PoseStarts
from monodyn.reproduce.repetition import START, Repetition
from monodyn.reproduce.truth import Truth
from monodyn.reproduce.vision import Seen
from monodyn.results.fill import States
from swings import white

NOISE = np.radians(0.2)
DESIGN = Design(lengths=(20, 30, 40), periods=(20, 40), starts=2)
JOINTS = ("joint1", "joint2")
SETTINGS = ClipSettings(frames=90)


@lru_cache
def mechanism() -> Mechanism:
    """Load the mechanism file that the methods are given."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "start.xml"
        path.write_text(START)
        return load(path)


@lru_cache
def truth() -> Truth:
    """Return the true motion."""
    return simulated(SETTINGS)


@lru_cache
def seen(method: str = "fast") -> Seen:
    """Return what a method would have seen: the truth with noise, and turned by a whole turn."""
    noise = NOISE * np.random.default_rng(2).standard_normal(truth().position.shape)
    position = truth().position + noise + [0.0, 2.0 * np.pi]
    poses = white(JOINTS, truth().time, position, NOISE)
    scene: Any = SimpleNamespace(mechanism=mechanism(), camera=SETTINGS.camera)
    return Seen(method, "done", mechanism().joints, scene, poses, 1.0, 0.02, noise)


def lost(method: str = "paper") -> Evidence:
    """Return the evidence of a method that found nothing."""
    return Evidence(Seen(method, "failed: x", mechanism().joints), (), DESIGN)


def moved(
    name: str, error: float, frames: int = 40, noise: float = 0.0, method: str = "fast", **more: Any
) -> Case:
    """Return a fit whose motion is off by ``error`` [rad] and by a share of the noise."""
    found = seen(method)
    assert found.poses is not None
    assert found.errors is not None
    measured = found.poses.position
    true = measured - found.errors
    position = true + error + noise * found.errors
    motion = States(found.poses.joints, found.poses.time, position, *3 * [0.0 * position])
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
        replace(own_form(method, name, frames), **more),
        "made",
        fit,
        motion,
        measured,
        true,
        rms((position - measured)[:frames]),
        rms((position - true)[:frames]),
        rms((position - true)[frames:]),
        rms((position - true)[frames:]),
    )


def evidence(*cases: Case, method: str = "fast", starts: PoseStarts | None = None) -> Evidence:
    """Return the evidence of one method from made fits."""
    return Evidence(seen(method), cases, DESIGN, 1.0 / 30.0, starts)


def repetition(*cases: Case, published: Evidence | None = None, given: bool = False) -> Repetition:
    """Return one pendulum with made fits of the default method, and what the published one found."""
    both = {"paper": published or lost(), "fast": evidence(*cases)}
    settings = None if given else SETTINGS
    return Repetition("pendulum 0, the usual one", Path("clip.mp4"), settings, truth(), both)
