"""Which part of the picture, and which frames, the mechanism is located in."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from films import film
from monodyn.errors import VideoError
from monodyn.mechanism import Mechanism, load
from monodyn.types import FULL, Frame
from monodyn.vision.drawing.outline import covered_pixels
from monodyn.vision.foreground.background import Samples
from monodyn.vision.foreground.parts import Parts
from monodyn.vision.foreground.thumbnails import Thumbnails, Window
from monodyn.vision.locating import region
from monodyn.vision.locating.region import (
    agreement,
    candidates,
    find_in_region,
    is_cut_off,
    least_blurred,
    without_fuller,
)
from support import refuses


def samples_of(areas: list[int], parts: Parts | None = None) -> Samples:
    """Make samples whose frames show a dark place of so many cells, each somewhere else."""
    planes = np.full((len(areas), 1, 40, 60), 150, np.uint8)
    for i, area in enumerate(areas):
        planes[i, 0].reshape(-1)[60 * (i % 30) : 60 * (i % 30) + area] = 40
    frames = tuple(Frame(i, i / 30, np.zeros((4, 4), np.uint8)) for i in range(len(areas)))
    thumbnails = Thumbnails(np.arange(len(areas)), planes, 4.0)
    whole = Window(0, 160, 0, 240)
    return Samples(frames, whole, span=(0, len(areas)), thumbnails=thumbnails, parts=parts)


def two_parts() -> Parts:
    labels = np.zeros((40, 60), dtype=np.int64)
    labels[5:20, 5:25], labels[10:30, 35:55] = 1, 2
    return Parts(labels, 2, (240, 160))


def test_frames_that_are_fuller_than_usual_are_left_out() -> None:
    usual = [20 + i % 5 for i in range(40)]
    assert without_fuller(samples_of(usual)) is None
    held = without_fuller(samples_of([80] * 12 + usual))
    assert held is not None
    assert [frame.index for frame in held.frames] == list(range(12, 52))
    # with a hand in nearly all frames there is no telling what is usual
    assert without_fuller(samples_of([20] * 8 + [80] * 10)) is None
    assert without_fuller(replace(samples_of(usual), thumbnails=None)) is None
    # what moves elsewhere does not count
    nowhere = np.zeros((40, 60), dtype=np.bool_)
    assert without_fuller(samples_of([80] * 12 + usual), nowhere) is None


def test_frames_that_motion_blurs_least_are_those_of_the_least_foreground() -> None:
    assert least_blurred(samples_of([20 + i % 3 for i in range(40)])) is None
    swing = [20 + round(36 * abs(np.sin(0.37 * i))) for i in range(40)]
    calm = least_blurred(samples_of(swing))
    assert calm is not None
    kept = {frame.index for frame in calm.frames}
    assert kept == {i for i, area in enumerate(swing) if area <= np.quantile(swing, 0.4)}
    # too few to locate anything in, and samples without thumbnails
    assert least_blurred(samples_of(swing[:20])) is None
    assert least_blurred(replace(samples_of(swing), thumbnails=None)) is None
    assert [frame.index for frame in list(candidates(samples_of(swing)))[-1].frames] == sorted(kept)


def test_a_part_is_tried_without_the_hand_that_holds_it() -> None:
    one = Parts(np.ones((40, 60), dtype=np.int64), 1, (240, 160))
    part = list(candidates(samples_of([80] * 12 + [20] * 40, one)))[-1]
    assert [frame.index for frame in part.frames] == list(range(12, 52))


def test_the_whole_comes_first_then_the_frames_then_the_parts() -> None:
    samples = samples_of([80] * 12 + [20] * 40, two_parts())
    found = list(candidates(samples))
    assert found[0] is samples
    assert len(found[1].frames) == 40
    assert [part.window for part in found[2:]] == [Window(4, 96, 4, 116), Window(24, 136, 124, 236)]
    assert all(part.others is not None and part.parts is None for part in found[2:])
    assert list(candidates(samples_of([20] * 40)))[1:] == []


@dataclass(frozen=True, eq=False)
class Tried:
    """Masks or scene that know only their samples."""

    samples: Samples

    def over(self, samples: Samples) -> Tried:
        return Tried(samples)


def found_with(
    monkeypatch: pytest.MonkeyPatch,
    shares: list[float | None],
    mechanism: Mechanism | None = None,
    guess: Any = None,
    given: list[Any] | None = None,
) -> tuple[Any, list[Samples]]:
    """Return what is found where the candidates agree so well; None refuses."""
    samples = samples_of([80] * 12 + [20] * 40, two_parts())
    tried: list[Samples] = []

    @dataclass(frozen=True, eq=False)
    class Sought:
        masks: Tried
        mechanism: Mechanism
        pinned: frozenset[str]
        guess: Any = None

    def find(sought: Any) -> Any:
        tried.append(sought.masks.samples)
        if given is not None:
            given.append(sought.guess)
        if shares[len(tried) - 1] is None:
            raise VideoError(f"refused {len(tried)}")
        return shares[len(tried) - 1]

    monkeypatch.setattr(region, "agreement", lambda share: share)
    monkeypatch.setattr(region, "is_cut_off", lambda whole, part: (whole, part) == (0.41, 0.99))
    sought = Sought(Tried(samples), mechanism or load("double"), frozenset(), guess)
    return find_in_region(sought, find), tried  # type: ignore[arg-type]


def test_what_explains_the_whole_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, tried = found_with(monkeypatch, [0.97])
    assert (scene, len(tried)) == (0.97, 1)


def test_a_guess_is_refined_first_and_dropped_where_it_explains_too_little(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given: list[Any] = []
    assert found_with(monkeypatch, [0.97], guess="the guess", given=given)[0] == 0.97
    assert given == ["the guess"]
    given.clear()
    scene, tried = found_with(monkeypatch, [0.4, 0.99], guess="the guess", given=given)
    assert (scene, given) == (0.99, ["the guess", None])
    assert tried[0] is tried[1]


def test_parts_are_tried_until_one_is_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, tried = found_with(monkeypatch, [0.4, None, 0.99])
    assert (scene, len(tried)) == (0.99, 3)
    assert tried[2].window == Window(4, 96, 4, 116)


def test_of_poor_explanations_the_best_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, tried = found_with(monkeypatch, [0.4, 0.6, None, 0.2])
    assert (scene, len(tried)) == (0.6, 4)


def test_a_part_that_cuts_the_scene_off_is_not_taken_for_agreeing_better(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene, tried = found_with(monkeypatch, [0.41, 0.99, 0.3, 0.2])
    assert (scene, len(tried)) == (0.41, 4)


def test_usual_proportions_are_tried_before_parts_of_the_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    usual = load("double").with_values({"link1.width": 0.01})
    monkeypatch.setattr(region, "in_usual_proportions", lambda mechanism, pinned: usual)
    scene, tried = found_with(monkeypatch, [0.4, 0.96])
    assert (scene, len(tried)) == (0.96, 2)
    assert tried[0] is tried[1]


def test_the_refusal_of_the_whole_is_the_users(monkeypatch: pytest.MonkeyPatch) -> None:
    with refuses(VideoError, "refused 1"):
        found_with(monkeypatch, [None] * 4)


def test_agreement_is_high_at_the_truth_and_low_elsewhere(tmp_path: Path) -> None:
    scene, poses = film(tmp_path)
    numbers = tuple(frame.index for frame in scene.masks.samples.frames)
    true = replace(scene, key_frames=numbers, key_positions=poses.position[list(numbers)])
    assert agreement(true) > 0.95
    wrong = replace(true, key_positions=true.key_positions + 0.5)
    assert agreement(wrong) < 0.7


@pytest.mark.parametrize(("share", "expected"), [(0.5, 1.0), (0.1, 0.4)])
def test_a_sliver_of_something_large_agrees_less(tmp_path: Path, share: float, expected: float) -> None:
    scene, _ = film(tmp_path)
    camera = replace(scene.camera, x=0.0, y=0.0)
    # the bar lies level, and begins in the middle of the picture
    half = 0.5 * camera.width * camera.depth / camera.focal
    sizes = {"link1.length": half / share, "link1.width": 0.5 * half, "link1.thickness": 1e-4}
    bar = load("single").with_values({**sizes, "link1.tail": 0.0})
    shown = covered_pixels(bar, camera, np.zeros(1), margin=0.0)
    mask = SimpleNamespace(coverage=np.where(shown, FULL, 0))
    masks = SimpleNamespace(
        samples=SimpleNamespace(frames=(SimpleNamespace(index=0),)),
        background=SimpleNamespace(known=np.ones(shown.shape, dtype=np.bool_)),
        of=lambda frame: mask,
    )
    large = SimpleNamespace(
        mechanism=bar, camera=camera, masks=masks, key_frames=(0,), key_positions=np.zeros((1, 1))
    )
    assert agreement(large) == pytest.approx(expected, rel=0.03)  # type: ignore[arg-type]


def test_half_of_the_picture_cuts_off_a_mechanism_that_swings_through_both(tmp_path: Path) -> None:
    scene, poses = film(tmp_path)
    whole = replace(scene, key_positions=poses.position[::4])
    drawn = np.any(
        [covered_pixels(scene.mechanism, scene.camera, q, margin=0.0) for q in poses.position], axis=0
    )
    columns = np.flatnonzero(drawn.any(axis=0))
    rows = np.flatnonzero(drawn.any(axis=1))
    middle = int(columns.mean())
    around = Window(int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1)

    def part(window: Window) -> Any:
        background = replace(scene.masks.background, window=window, others=None)
        return replace(whole, masks=replace(scene.masks, background=background))

    assert not is_cut_off(whole, part(around))
    assert is_cut_off(whole, part(around._replace(right=middle)))
    # another scene there is another matter
    other = replace(part(around._replace(right=middle)), camera=replace(scene.camera, x=scene.camera.x + 0.1))
    assert not is_cut_off(whole, other)
