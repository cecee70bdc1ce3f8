"""What is reported, drawn again: the pictures refuse what they contradict."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

import monodyn.redrawn
from films import film
from fits import identified, record
from monodyn.mechanism import load
from monodyn.redrawn import redrawn
from monodyn.types import Camera, Poses
from monodyn.vision.drawing.outline import outline
from monodyn.vision.locating.scene import Scene

CAMERA = Camera(640, 480, 640.0, 0.0, 0.0, 1.0)


def scene_of(size: float, **changes: Any) -> Any:
    """A scene in which the mechanism of the fit was located, of which the outline has a given size [px]."""
    fit = identified()
    located = SimpleNamespace(
        mechanism=fit.mechanism, camera=CAMERA, camera_std={}, shutter=None, extent_px=size,
        masks=SimpleNamespace(video=None),
    )  # fmt: skip
    return SimpleNamespace(**{**vars(located), **changes})


def followed() -> Poses:
    """The fitted record, as it was followed before that camera."""
    return replace(record(identified(), 20), roll=None)


@pytest.fixture(scope="module")
def filmed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Scene, Poses]:
    """Film a swinging chain."""
    return film(tmp_path_factory.mktemp("chain"))


@pytest.fixture(autouse=True)
def _unit_scale() -> None:
    # the start scale is that of the fit: camera and sizes are the same in both
    assert identified().scale == pytest.approx(1.0, rel=0.2)


def scaled() -> Any:
    """A scene in the scale of the fit's start."""
    fit = identified()
    size = fit.mechanism.values["link1.length"] / fit.scale
    mechanism = fit.mechanism.with_values({"link1.length": size})
    return scene_of(100.0, mechanism=mechanism)


def test_what_lies_where_it_was_followed_is_not_doubted() -> None:
    fit = identified()
    assert redrawn(fit, scaled(), followed()).doubts == fit.doubts


def test_a_motion_beside_the_pictures_is_refused() -> None:
    fit, poses = identified(), followed()
    # the pictures showed a swing three times as wide
    wide = replace(poses, position=3.0 * poses.position)
    doubts = redrawn(fit, scaled(), wide).doubts
    assert [doubt.grade for doubt in doubts] == ["refused"]
    assert doubts[0].reason == (
        "The identified motion contradicts the pictures: drawn again, 'link1' lies up to 255 px beside where "
        "they show it, 255% of the outline's size of 100 px. Sizes and camera do not go with this motion: "
        "compare overlay.mp4, and give a length or the camera's turns with --fix."
    )


def test_a_motion_that_nearly_follows_is_not_trusted() -> None:
    """By 13 % of the outline's size, as of a small ball on a long thread that swings in no plane."""
    fit, poses = identified(), followed()
    doubts = redrawn(fit, scaled(), replace(poses, position=1.1 * poses.position)).doubts
    assert [doubt.grade for doubt in doubts] == ["approximate"]
    assert doubts[0].reason.startswith("The identified motion contradicts the pictures")


def test_poses_that_were_changed_on_the_way_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    fit, poses = identified(), followed()
    shrunk = replace(poses, position=0.01 * poses.position)
    monkeypatch.setattr("monodyn.results.filmed.metric", lambda *_: shrunk)
    doubts = redrawn(fit, scaled(), poses).doubts
    assert [doubt.reason.split(":")[0] for doubt in doubts] == [
        "The poses that are reported contradict the pictures"
    ]


def test_a_tenth_of_the_frames_may_be_gross_errors() -> None:
    fit, poses = identified(), followed()
    position = poses.position.copy()
    position[3] += 1.0
    assert not redrawn(fit, scaled(), replace(poses, position=position)).doubts
    position[4:7] += 1.0
    assert redrawn(fit, scaled(), replace(poses, position=position)).doubts


def test_an_outline_over_bare_background_is_not_trusted(
    filmed: tuple[Scene, Poses], monkeypatch: pytest.MonkeyPatch
) -> None:
    fit, (scene, _) = identified(), filmed
    located = replace(scene, mechanism=scaled().mechanism, camera=CAMERA)
    for size, px, grades in ((32.0, 3.9, []), (100.0, 4.5, []), (100.0, 7.0, ["approximate"])):
        monkeypatch.setattr(monodyn.redrawn, "_size", lambda *_, size=size: size)
        monkeypatch.setattr(monodyn.redrawn.Sight, "bare_px", px)
        doubts = redrawn(fit, located, followed()).doubts
        assert [doubt.grade for doubt in doubts] == grades
    assert doubts[0].reason == (
        "The pictures show 7 px of bare background where the outline would be, 7% of its size of 100 px. A "
        "joint may give way, by which sizes come out wrong, or something stands before the mechanism and "
        "looks like what is behind it: diagnosis.png shows where; fasten what gives way, or give a length "
        "with --fix."
    )


def test_where_a_mechanism_turns_that_sways_is_not_trusted(
    filmed: tuple[Scene, Poses], monkeypatch: pytest.MonkeyPatch
) -> None:
    fit, (scene, _) = identified(), filmed
    doubt: Any = SimpleNamespace(bundle=None)
    located = replace(scene, mechanism=scaled().mechanism, camera=CAMERA, doubt=doubt)
    monkeypatch.setattr(monodyn.redrawn.Sight, "bare_px", 0.0)
    monkeypatch.setattr(monodyn.redrawn, "_size", lambda *_: 100.0)
    for px, grades in ((4.9, []), (5.2, ["approximate"])):
        monkeypatch.setattr(monodyn.redrawn, "hinge_px", lambda _, px=px: px)
        doubts = redrawn(fit, located, followed()).doubts
        assert [doubt.grade for doubt in doubts] == grades
    assert doubts[0].reason == (
        "The hinge of 'link1' may be 5 px farther up or down the body, 5% of the outline's size: the whole "
        "mechanism moves in the picture beside its turns, as where a pivot gives way, and lengths may be off "
        "by more than their intervals say. Fasten the pivot, let it swing farther, or give the length with "
        "--fix link1.length."
    )


def test_a_ball_is_compared_that_stands_beside_its_thread() -> None:
    """The end of its thread may be outside of the picture, and the ball is what is seen."""
    bob = load("bob").with_following(["link1.sphere.across"], follow=False)
    aside = bob.with_values({"link1.sphere.across": 0.1 * bob.values["link1.length"]})
    for mechanism in (bob, aside):
        for q in (-1.2, 0.4):
            ball = monodyn.redrawn._shown([], mechanism, CAMERA, np.array([[q]]))[0, 0]
            (corners,) = [
                corners for _, corners in outline(mechanism, CAMERA, np.array([q])) if len(corners) > 8
            ][-1:]
            # the outline of a ball beside the optical axis is an ellipse, a little beside the ball's middle
            assert ball == pytest.approx(0.5 * (corners.min(axis=0) + corners.max(axis=0)), abs=1.0)


def test_the_size_is_that_of_a_disc_as_large_as_what_is_in_the_picture(
    filmed: tuple[Scene, Poses],
) -> None:
    scene, poses = filmed
    outlines = [corners for _, corners in outline(scene.mechanism, scene.camera, poses.position[0])]
    area = sum(cv2.contourArea(corners.astype(np.float32)) for corners in outlines)
    size = monodyn.redrawn._size(scene, poses.position[:1])
    assert size == pytest.approx(np.sqrt(4.0 * area / np.pi))
    # half the focal length shows it half as large
    near = replace(scene, camera=replace(scene.camera, focal=0.5 * scene.camera.focal))
    assert monodyn.redrawn._size(near, poses.position[:1]) == pytest.approx(0.5 * size, rel=0.01)
    assert monodyn.redrawn._size(scene, poses.position[:0]) == float("inf")
