"""A file of another shape than the body in the clip: the truth lies in the interval, or it is not trusted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import monodyn
from clips import cached, wrong
from spec import Case, Part, mjcf

STDS = 3.0
"""Standard deviations within which the truth has to lie."""


def case(shape: str, count: int) -> Case:
    """Return a clip of a few seconds: a single or a double pendulum of this shape."""
    parts = (Part(0.25, 0.028, shape=shape), Part(0.2, 0.024, shape=shape, parent=0, colour=(170, 40, 40)))
    return Case(f"exchanged_{shape}", parts[:count], (-0.3, 0.8)[:count], seconds=2.5, size=(480, 320))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shown", "file", "count"), [("box", "capsule", 1), ("box", "capsule", 2), ("capsule", "box", 1)]
)
def test_the_picture_decides_the_shape_or_the_interval_contains_both(
    shown: str, file: str, count: int, tmp_path: Path
) -> None:
    clip = cached(case(shown, count), tmp_path)
    model = tmp_path / "file.xml"
    model.write_text(mjcf(tuple(replace(wrong(part), shape=file) for part in clip.case.parts)))
    scene = monodyn.locate(monodyn.segment(monodyn.read(clip.video)), monodyn.load(model))
    fit = monodyn.identify(monodyn.track(scene.masks, scene), scene.mechanism)
    last = clip.case.parts[-1]
    cap = 0.5 * last.width if shown == "capsule" else 0.0
    truth = {f"link{i}.length": part.length for i, part in enumerate(clip.case.parts, 1)}
    truth[f"link{count}.length"] += cap
    if fit.grade == "trusted":
        for name, length in truth.items():
            found = fit.parameter(name)
            assert abs(found.value - length) < STDS * found.std, (name, found.value, found.std)
