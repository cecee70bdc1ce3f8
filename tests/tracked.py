"""Tracked points with known truth, for the tests of what takes the place of masks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from monodyn.mechanism import Mechanism, load
from monodyn.mechanism.simulate import rollout
from monodyn.types import Camera
from monodyn.vision.points.marks import marks_of
from monodyn.vision.points.shown import Places, project, shown_by
from monodyn.vision.points.tracks import PointTracks

CAMERA = Camera(1280, 720, 1280.0, 0.02, -0.05, 1.2)
"""The camera that the points are seen by."""
RATE = 30.0
"""Frames a second [Hz]."""


def swing(mechanism: Mechanism, count: int, start: Sequence[float]) -> np.ndarray:
    """Return a free motion from rest, (frame, dof)."""
    rest = np.zeros(len(start))
    return rollout(mechanism.tree, np.arange(count) / RATE, np.array(start, float), rest, substeps=16)[0]


def stretched() -> tuple[Mechanism, Mechanism, np.ndarray]:
    """Return the double pendulum, one of other proportions, and a motion of that (frame, dof)."""
    file = load("double")
    sizes = {"link1.length": 1.4, "link2.length": 0.8}
    truth = file.with_values({name: by * file.values[name] for name, by in sizes.items()})
    return file, truth, swing(truth, 120, (0.5, 0.6))


def seen(
    mechanism: Mechanism, position: np.ndarray, names: Sequence[str], mapped: Mapping[str, str] | None = None,
    own: Sequence[Sequence[float]] = (), camera: Camera = CAMERA,
) -> np.ndarray:  # fmt: skip
    """Return where the named points of a motion are in the picture, (frame, point, 2)."""
    marks = tuple(marks_of(mechanism, names, mapped))
    free = np.array([i for i, mark in enumerate(marks) if mark.kind == "free"], dtype=int)
    return project(shown_by(Places(marks, mechanism, free), mechanism, camera, np.array(own)), position)


def spoiled(
    px: np.ndarray, *, noise: float = 0.5, outliers: float = 0.03, missing: float = 0.05, seed: int = 0
) -> np.ndarray:
    """Return points as a tool finds them: with noise [px], and some nowhere near or not at all."""
    draw = np.random.default_rng(seed)
    found = px + noise * draw.normal(size=px.shape)
    wrong = draw.random(px.shape[:2]) < outliers
    found[wrong] = draw.uniform([0.0, 0.0], [1280.0, 720.0], (int(wrong.sum()), 2))
    found[draw.random(px.shape[:2]) < missing] = np.nan
    return found


def tracks(names: Sequence[str], px: np.ndarray, likelihood: np.ndarray | None = None) -> PointTracks:
    """Return points by frame, thirty a second."""
    count = len(px)
    sure = np.ones(px.shape[:2]) if likelihood is None else likelihood
    return PointTracks(
        Path("points.csv"), tuple(names), np.arange(count), np.arange(count) / RATE, px, sure, 1280, 720
    )


def plain_csv(path: Path, names: Sequence[str], px: np.ndarray) -> Path:
    """Write a plain table of points."""
    lines = ["frame," + ",".join(f"{name}_x,{name}_y" for name in names)]
    for frame, row in enumerate(px):
        cells = ["" if np.isnan(value) else repr(float(value)) for value in row.ravel()]
        lines.append(f"{frame},{','.join(cells)}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def apart(found: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Return differences of angles without whole turns [rad]."""
    return (found - truth + np.pi) % (2.0 * np.pi) - np.pi
