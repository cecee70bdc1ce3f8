"""The framework of all four problems, strict and interleaved."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chains import CAMERA, POSE, chain, falls, silhouette_of, view_of
from monodyn.paper import sequential
from monodyn.paper.placed import DEPTH, X
from monodyn.paper.sequential import FRAMEWORKS, RoundSchedule, camera_and_pose, interleaved, strict
from monodyn.paper.start_model import StartModel
from monodyn.paper.subproblems import History, mismatch
from monodyn.paper.view import ModelView, SilhouetteImage

RATIOS = {"link1.width": 0.015, "link2.length": 0.075, "link2.width": 0.012}
"""Sizes of the chain for a first link of 0.1 m, in whose scale the camera is 0.55 m away."""


def wrong_view(folder: Path, depth: float = 0.8) -> ModelView:
    """Return the chain with wrong sizes, camera and pose."""
    mechanism = chain(folder, lengths=(0.1, 0.1), widths=(0.02, 0.02))
    start = StartModel(mechanism, CAMERA, ()).view(reference_held=False)
    camera = start.base.camera.copy()
    camera[X : DEPTH + 1] = [0.0, -0.06, depth]
    return replace(start, position=np.array([-0.7, 0.55])).before(camera)


def left_by_truth(folder: Path) -> float:
    """Return what the true chain leaves of its own silhouette [px^2]: the pixels that the outline cuts."""
    true = view_of(chain(folder))
    return mismatch(silhouette_of(), true.rig, POSE)


def test_interleaved_finds_all_of_them(tmp_path: Path) -> None:
    """From wrong sizes, camera and pose: the scale of the file stays, so the depth takes it."""
    mechanism = chain(tmp_path, lengths=(0.1, 0.1), widths=(0.02, 0.02))
    image = silhouette_of()
    start = view_of(mechanism, replace(CAMERA, depth=0.8, x=0.0, y=0.0), np.array([-0.7, 0.55]))
    found, histories = interleaved(image, start)
    sizes = dict(zip(found.names, found.sizes, strict=True))
    np.testing.assert_allclose(found.position, POSE, atol=np.radians(0.3))
    assert sizes == pytest.approx(RATIOS, rel=0.03)
    np.testing.assert_allclose(found.base.camera[X : DEPTH + 1], [0.015, -0.06, 0.55], rtol=0.02)
    assert mismatch(image, found.rig, found.position) < left_by_truth(tmp_path) + 0.01 * image.area
    assert [h.problem for h in histories[:4]] == ["depth", "place", "pose", "ratios"]
    assert all(falls(h) for h in histories)


@pytest.mark.slow
@pytest.mark.parametrize("depth", [0.5, 0.8])
def test_strict_finds_all_of_them(tmp_path: Path, depth: float) -> None:
    """Fig. 2 from wrong sizes, camera and pose; pose and camera share the error of a zigzag that settled."""
    image = silhouette_of()
    found, histories = strict(image, wrong_view(tmp_path, depth))
    sizes = dict(zip(found.names, found.sizes, strict=True))
    np.testing.assert_allclose(found.position, POSE, atol=np.radians(0.5))
    # every size is searched before the camera that is held; the first length comes back to its value
    assert sizes == pytest.approx(RATIOS | {"link1.length": 0.1}, rel=0.03)
    np.testing.assert_allclose(found.base.camera[X : DEPTH + 1], [0.015, -0.06, 0.55], rtol=0.02)
    assert mismatch(image, found.rig, found.position) < left_by_truth(tmp_path) + 0.01 * image.area
    assert all(falls(h) for h in histories)
    # (1), (2) and (3) alternate, several turns of them before each (4)
    order = [h.problem for h in histories]
    assert order[:6] == ["depth", "place", "pose"] * 2
    first = order.index("ratios")
    assert first % 3 == 0
    assert order[first + 1 : first + 4] == ["depth", "place", "pose"]


@pytest.mark.parametrize("without", [("fit_depth",), ("fit_place",), ("fit_depth", "fit_place")])
def test_strict_has_its_camera_from_depth_and_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, without: tuple[str, ...]
) -> None:
    """With a solver of (1) or (2) replaced by nothing the framework does not find the mechanism."""

    def nothing(image: SilhouetteImage, view: ModelView) -> tuple[ModelView, History]:
        return view, History("none", np.array([1]), np.array([0.0]))

    for name in without:
        monkeypatch.setattr(sequential.subproblems, name, nothing)
    image = silhouette_of()
    found, _ = strict(image, wrong_view(tmp_path))
    assert mismatch(image, found.rig, found.position) > 0.15 * image.area
    assert np.abs(found.base.camera[X : DEPTH + 1] - [0.015, -0.06, 0.55]).max() > 0.05 * 0.55


def test_the_camera_stands_while_pose_and_ratios_are_searched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Strict trials of (3) and (4) know no free camera, and draw one silhouette each."""
    given: list[tuple[bool, ...]] = []

    def watched(name: str) -> None:
        search = getattr(sequential.subproblems, name)

        def watch(image: SilhouetteImage, view: ModelView, **steps: float) -> tuple[ModelView, History]:
            found, history = search(image, view, **steps)
            given.append(view.free)
            np.testing.assert_array_equal(found.base.camera, view.base.camera)
            return found, history

        monkeypatch.setattr(sequential.subproblems, name, watch)

    watched("fit_pose")
    watched("fit_ratios")
    found, _ = strict(silhouette_of(), wrong_view(tmp_path), RoundSchedule(rounds=2))
    assert len(given) > 4
    assert not any(any(free) for free in given)
    assert all(found.free)


def test_a_round_that_gains_is_not_the_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An outline that stands still does not end a framework whose last round has lowered the mismatch."""
    ended = sequential.camera_and_pose
    values: list[float] = []

    def watch(image: SilhouetteImage, view: ModelView, *how: object) -> tuple[ModelView, list[History]]:
        values.append(mismatch(image, view.rig, view.position))
        return ended(image, view, *how)

    monkeypatch.setattr(sequential, "camera_and_pose", watch)
    monkeypatch.setattr(sequential, "_moved_px", lambda *_: 0.0)
    image, schedule = silhouette_of(), RoundSchedule()
    strict(image, wrong_view(tmp_path), schedule)
    gains = -np.diff(np.minimum.accumulate(values)) / image.area
    # the values are those that each round begins with, the wrong start before them
    assert len(gains) >= 2
    assert (gains > schedule.gain).all()


def test_camera_and_pose_end_with_the_best_turn(tmp_path: Path) -> None:
    """The true ratios known: the alternation comes to camera and pose."""
    start = view_of(chain(tmp_path), replace(CAMERA, depth=1.3, x=0.0), np.array([-0.7, 0.6]))
    image = silhouette_of()
    found, histories = camera_and_pose(image, start, RoundSchedule())
    np.testing.assert_allclose(found.position, POSE, atol=np.radians(1.0))
    assert found.base.camera[DEPTH] == pytest.approx(CAMERA.depth, rel=0.01)
    ends = [h.values[-1] for h in histories if h.problem == "pose"]
    assert len(ends) > 2
    assert mismatch(image, found.rig, found.position) == pytest.approx(min(ends))


def test_frameworks_go_by_name() -> None:
    assert FRAMEWORKS["strict"] is strict
    assert FRAMEWORKS["interleaved"] is interleaved
