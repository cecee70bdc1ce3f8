"""Structures that grow link by link on drawn masks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from models import read
from monodyn.mechanism import load
from monodyn.types import Camera
from monodyn.vision.locating import grow
from monodyn.vision.locating.beam import extended
from monodyn.vision.locating.grow import (
    LENGTHS,
    SceneStart,
    Structure,
    _alternately,
    better_mean,
    grown,
    typical_widths,
    whole,
)
from monodyn.vision.locating.roots import Root
from monodyn.vision.locating.settle import settled
from monodyn.vision.locating.unit import scaled
from pictures import drawn_frames, root_in

CAMERA = Camera(160, 120, 150.0, x=0.05, y=-0.1, depth=0.9)
POSES = np.array([[-2.2, 0.9], [-1.4, -1.7], [-0.6, 1.6], [0.1, -0.8], [-2.6, -2.2]])
TRUE = load("double").with_values({"link1.length": 0.16, "link2.length": 0.24, "link2.width": 0.024})
PX = CAMERA.focal / CAMERA.depth


def start(pinned: frozenset[str] = frozenset()) -> SceneStart:
    # in units of the distance, of any size and proportion
    wrong = scaled(load("double"), 5.0).with_values({"link1.length": 0.3, "link1.width": 0.9})
    return SceneStart(wrong, Camera(160, 120, 150.0, depth=1.0), pinned)


def root() -> Root:
    x, y = root_in(CAMERA)
    return Root(x, y, 0.41 * PX)


def test_proportions_come_from_the_masks() -> None:
    frames = drawn_frames(TRUE, CAMERA, POSES)
    best = grown(frames, start(), [root()])[0]
    found = settled(frames, whole(best, start()), start()).mechanism.values
    assert found["link1.length"] * 150.0 == pytest.approx(0.16 * PX, abs=3.0)
    assert found["link2.length"] * 150.0 == pytest.approx(0.24 * PX, abs=3.0)
    assert found["link1.width"] * 150.0 == pytest.approx(0.03 * PX, abs=1.0)
    # blurred, and with angles and lengths of a grid
    assert best.score < 0.45


@pytest.mark.parametrize("width", [0.03, 0.05, 0.08])
@pytest.mark.parametrize("model", ["ball", "bob"])
def test_a_ball_hangs_at_the_reach_less_its_radius(model: str, width: float) -> None:
    sizes = {"link1.width": 1e-4, "link1.sphere.width": width} if model == "bob" else {"link1.width": width}
    true = load(model).with_values(sizes)
    frames = drawn_frames(true, CAMERA, POSES[:, :1])
    begun = SceneStart(load(model), Camera(160, 120, 150.0, depth=1.0), frozenset())
    x, y = root_in(CAMERA)
    best = grown(frames, begun, [Root(x, y, (0.2 + 0.5 * width) * PX)])[0]
    # lengths of the grid are 20 % apart; the width of the foreground is known to a pixel of 33
    assert best.mechanism.values["link1.length"] * 150.0 == pytest.approx(0.2 * PX, rel=0.03)


def test_directions_are_tried_for_one_width_of_each_length(monkeypatch: pytest.MonkeyPatch) -> None:
    true = load("bob").with_values({"link1.width": 0.012})
    frames, laid = drawn_frames(true, CAMERA, POSES[:, :1]), []

    def counted(*given: Any) -> Any:
        laid.append(given)
        return extended(*given)

    monkeypatch.setattr(grow, "extended", counted)
    x, y = root_in(CAMERA)
    begun = SceneStart(load("bob"), Camera(160, 120, 150.0, depth=1.0), frozenset())
    best = grown(frames, begun, [Root(x, y, (0.2 + 0.5 * 0.05) * PX)])[0]
    # with one of the eight pairs of widths, each length in all frames
    assert len(typical_widths(frames)) == 2
    assert len(laid) == (LENGTHS + 2) * len(POSES)
    # the pair that the masks show is the one that goes on
    sizes = best.mechanism.values
    assert sizes["link1.width"] < 0.5 * sizes["link1.sphere.width"]
    assert sizes["link1.sphere.width"] * 150.0 == pytest.approx(0.05 * PX, abs=3.0)


def test_what_is_held_keeps_its_proportions() -> None:
    pinned = frozenset({"link1.length", "link2.length", "link2.width"})
    frames = drawn_frames(TRUE, CAMERA, POSES)
    begun = start()
    told = begun.mechanism.with_values({"link1.length": 1.6, "link2.length": 2.4, "link2.width": 0.24})
    begun = SceneStart(told, begun.camera, pinned)
    best = whole(grown(frames, begun, [root()])[0], begun)
    found = settled(frames, best, begun).mechanism.values
    assert best.scale is not None
    for name in pinned:
        assert found[name] == pytest.approx(told.values[name] * best.scale)
    assert found["link1.length"] * 150.0 == pytest.approx(0.16 * PX, rel=0.12)


def test_widths_are_those_of_the_foreground() -> None:
    frames = drawn_frames(load("double"), CAMERA, POSES)
    (width,) = typical_widths(frames)
    assert width == pytest.approx(0.03 * PX, abs=1.5)
    ball = drawn_frames(load("bob"), CAMERA, POSES[:, :1])
    thin, thick = typical_widths(ball)
    values = load("bob").values
    assert thin == pytest.approx(values["link1.width"] * PX, abs=1.5)
    assert thick == pytest.approx(values["link1.sphere.width"] * PX, abs=1.5)


def test_what_is_not_known_makes_nothing_thin() -> None:
    wide = load("double").with_values({"link1.width": 0.05, "link2.width": 0.05})
    frames = drawn_frames(wide, CAMERA, POSES)
    (width,) = typical_widths(frames)
    trust = np.ones_like(frames.coarse_trust)
    # lines of the scene behind it cut the foreground into strips
    trust[::8] = 0.0
    cut = replace(frames, coarse_trust=trust)
    assert typical_widths(cut) == pytest.approx([width, width], abs=3.0)


def test_thickness_is_not_more_than_the_width() -> None:
    begun = start()
    thick = begun.mechanism.with_values({"link1.thickness": 50.0})
    frames = drawn_frames(TRUE, CAMERA, POSES[:2])
    best = grown(frames, SceneStart(thick, begun.camera, frozenset()), [root()])[0]
    # before the camera even what lies behind the front shows
    assert best.mechanism.values["link1.thickness"] == best.mechanism.values["link1.width"]
    values = whole(best, SceneStart(thick, begun.camera, frozenset())).mechanism.values
    assert values["link1.thickness"] == values["link1.width"]
    assert values["link2.thickness"] <= values["link2.width"]


def test_the_mean_of_the_better_frames() -> None:
    assert better_mean(np.array([0.1, 0.9, 0.2, 0.3])) == pytest.approx(0.2)
    assert better_mean(np.array([0.4])) == 0.4


def test_what_is_left_over_within_reach_counts_twice() -> None:
    none = (np.zeros((1, 1)),)
    structure = Structure(TRUE, CAMERA, 0, (0,), None, none, (0.6,), (0.7,))
    assert structure.score == 0.6
    # 0.4 of the foreground is explained, 0.3 more could have been
    assert structure.strict_score == pytest.approx(0.9)
    # a long link over several short ones explains more than the first of these, and leaves more over
    short = replace(structure, steps=(7,), shares=(0.8,), near=(0.2,))
    assert short.score > structure.score
    assert short.strict_score < structure.strict_score
    dull = replace(structure, steps=(4,), shares=(0.9,), near=(0.9,))
    assert _alternately([dull, short, structure]) == [structure, short, dull]


@pytest.mark.parametrize("radius", [0.02, 0.3])
def test_a_ball_alone_is_found_whatever_part_the_file_takes_for_the_main_one(
    tmp_path: Path, radius: float
) -> None:
    """The thread is not drawn; a ball that is wider than the thread is long is the main part of its body."""
    text = """<mujoco><worldbody><body name="a"><joint name="j" axis="0 -1 0"/>
<geom type="capsule" size="{0}" fromto="0 0 0 0.2 0 0"/><geom type="sphere" size="{1}" pos="0.2 0 0"/>
</body></worldbody></mujoco>"""
    frames = drawn_frames(read(tmp_path, text.format(1e-5, 0.03)), CAMERA, POSES[:, :1])
    wrong = scaled(read(tmp_path, text.format(0.004, radius)), 5.0)
    begun = SceneStart(wrong, Camera(160, 120, 150.0, depth=1.0), frozenset())
    x, y = root_in(CAMERA)
    found = settled(frames, whole(grown(frames, begun, [Root(x, y, 0.23 * PX)])[0], begun), begun).mechanism
    ball = next(
        p.name for p in found.parameters if p.kind == "width" and ("sphere" in p.name) == (radius < 0.1)
    )
    assert found.values["a.length"] * 150.0 == pytest.approx(0.2 * PX, abs=2.0)
    assert found.values[ball] * 150.0 == pytest.approx(0.06 * PX, abs=2.0)
