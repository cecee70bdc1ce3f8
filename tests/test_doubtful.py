"""What a run saw of its clip: whether it is the mechanism, and what of it is not there."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import monodyn.doubtful
from monodyn.doubtful import doubtful_sight, likely_sight, unshown_parts
from monodyn.mechanism import load
from monodyn.types import Poses
from support import DEMO


def poses(seen: int, count: int) -> Poses:
    """Poses of which the first ``seen`` were measured."""
    return Poses(
        ("joint1",), np.arange(count), np.arange(count) / 30.0, np.zeros((count, 1)),
        np.ones((count, 1, 1)), np.arange(count) < seen,
    )  # fmt: skip


def test_a_fit_to_what_is_hardly_the_mechanism_is_doubted() -> None:
    sight = SimpleNamespace(unshown=[], mismatch=0.12, scene=None, points=None)
    assert doubtful_sight(sight, poses(25, 100)) is None  # type: ignore[arg-type]
    assert doubtful_sight(sight, poses(24, 100)) == (  # type: ignore[arg-type]
        "Only 24 of the 100 frames to fit were tracked: too few to trust that the mechanism was followed and "
        "not something like it; diagnosis.png shows what was seen. --time-range A:B and --roi X,Y,W,H choose "
        "frames and a part of the picture in which it shows."
    )
    video = SimpleNamespace(repeats=SimpleNamespace(frames=tuple(range(50, 60))), bare=False)
    repeated = SimpleNamespace(
        unshown=[],
        mismatch=0.12,
        scene=SimpleNamespace(masks=SimpleNamespace(video=video), beside={}),
        points=None,
    )
    assert doubtful_sight(repeated, poses(24, 100)) is None  # type: ignore[arg-type]
    sight = SimpleNamespace(unshown=[], mismatch=0.83, beyond=0.4, scene=None, points=None)
    assert doubtful_sight(sight, poses(100, 100)) == (  # type: ignore[arg-type]
        "The mechanism as it was located differs from what stands out from the background by 83% of its "
        "area; most of that is of the mechanism, where nothing stands out. It may have a link or a part that "
        "the clip does not show, or it is in the wrong place or of the wrong size. diagnosis.png shows what "
        "was seen: check the mechanism file; --roi X,Y,W,H and --time-range A:B leave other things out."
    )
    assert (
        doubtful_sight(
            SimpleNamespace(unshown=[], mismatch=float("nan"), scene=None, points=None), poses(9, 9)
        )  # type: ignore[arg-type]
        is None
    )
    # a mechanism that is lost in half of the frames has to lie twice as well in the others
    sight = SimpleNamespace(unshown=[], mismatch=0.45, beyond=0.3, scene=None, points=None)
    assert doubtful_sight(sight, poses(91, 100)) is None  # type: ignore[arg-type]
    assert doubtful_sight(sight, poses(89, 100)) == (  # type: ignore[arg-type]
        "The mechanism as it was located differs from what stands out from the background by 45% of its "
        "area, and 11 of 100 frames were not tracked; most of that is outside of the mechanism. The clip may "
        "show a link or a part more than it has, other things may move with it, or it is in the wrong place, "
        "of the wrong size or blurred by its motion. diagnosis.png shows what was seen: check the mechanism "
        "file; --roi X,Y,W,H and --time-range A:B leave other things out."
    )
    scene = SimpleNamespace(masks=SimpleNamespace(video=video), beside={"link1": 0.02, "link2": 0.12})
    sight = SimpleNamespace(unshown=[], mismatch=0.2, scene=scene, points=None)
    assert doubtful_sight(sight, poses(100, 100)) == (  # type: ignore[arg-type]
        "Something moves along with 'link2' outside of its outline, 12% of what stands out from the "
        "background: the mechanism file has no geom for it, or a geom was found in another place, and masses "
        "and lengths would come out wrong. Give the file a geom for it, about as it is, or take "
        "--identify.bodies free; diagnosis.png shows it."
    )
    assert doubtful_sight(sight, poses(100, 100), uniform=False) is None  # type: ignore[arg-type]
    scene.beside["link2"] = 0.04
    assert doubtful_sight(sight, poses(100, 100)) is None  # type: ignore[arg-type]


def test_a_mechanism_that_sways_before_a_bare_wall_is_doubted(monkeypatch: pytest.MonkeyPatch) -> None:
    sway = SimpleNamespace(rms_px=12.34)
    monkeypatch.setattr(monodyn.doubtful, "scene_sway", lambda scene: sway)
    video = SimpleNamespace(repeats=SimpleNamespace(frames=()), bare=True)
    scene = SimpleNamespace(masks=SimpleNamespace(video=video), beside={})
    sight = SimpleNamespace(unshown=[], mismatch=0.2, scene=scene, points=None)
    assert doubtful_sight(sight, poses(100, 100)) == (  # type: ignore[arg-type]
        "Beside its motion the whole mechanism sways by 12.3 px in the picture: the camera moves, or what "
        "holds the mechanism, or it is another one, and the background shows too little to tell. Put the "
        "camera on a tripod, film before a background with edges and patterns over much of the picture, or "
        "run the clip without --model: the bundled mechanisms are tried."
    )
    sway.rms_px = 0.4
    assert doubtful_sight(sight, poses(100, 100)) is None  # type: ignore[arg-type]
    sway.rms_px, video.bare = 12.34, False
    assert doubtful_sight(sight, poses(100, 100)) is None  # type: ignore[arg-type]


def test_a_body_that_the_picture_does_not_show_is_not_estimated() -> None:
    video = SimpleNamespace(repeats=SimpleNamespace(frames=()), bare=False)
    scene = SimpleNamespace(masks=SimpleNamespace(video=video), beside={}, mechanism=load("cartpole"))
    sight = SimpleNamespace(unshown=["cart"], mismatch=0.04, scene=scene, points=None)
    assert doubtful_sight(sight, poses(100, 100)) == (  # type: ignore[arg-type]
        "The picture shows nothing of 'cart': where it was looked for it lies outside of the picture, behind "
        "the rest of the mechanism, or where nothing stands out from the background, so that nothing of it "
        "can be estimated. Take a mechanism without it, or, where it is there, give its sizes with --fix; "
        "diagnosis.png shows where it was looked for."
    )
    # who gives its size says that it is there
    scene.mechanism = load("cartpole").with_choices(fix={"cart.length": 0.1})
    assert doubtful_sight(sight, poses(100, 100)) is None  # type: ignore[arg-type]


def test_the_picture_explains_what_the_motion_does_not() -> None:
    sight = SimpleNamespace(unshown=[], mismatch=0.4, beyond=0.35, points=None)
    assert likely_sight(sight) == (  # type: ignore[arg-type]
        "The mechanism as it was located differs from what stands out from the background by 40% of its "
        "area; most of that is outside of the mechanism. The clip may show a link or a part more than it "
        "has, other things may move with it, or it is in the wrong place, of the wrong size or blurred by "
        "its motion. diagnosis.png shows what was seen: check the mechanism file; --roi X,Y,W,H and "
        "--time-range A:B leave other things out."
    )
    assert likely_sight(SimpleNamespace(unshown=[], mismatch=0.3, beyond=0.3, points=None)) is None  # type: ignore[arg-type]


def test_a_link_that_is_never_found_is_named() -> None:
    whole = poses(100, 100)
    shown = np.column_stack([np.ones(100, dtype=bool), np.arange(100) < 4])
    part = Poses(
        ("joint1", "joint2"), whole.frame, whole.time, np.zeros((100, 2)), np.tile(np.eye(2), (100, 1, 1)),
        np.arange(100) < 4, joint_seen=shown,
    )  # fmt: skip
    sight = SimpleNamespace(unshown=[], mismatch=0.1, beyond=0.1, scene=None, points=None)
    assert doubtful_sight(sight, part) == (  # type: ignore[arg-type]
        "joint2 could be measured in at most 4 of the 100 frames in which another joint was: what it moves "
        "does not lie on anything that stands out from the background. The clip may show a mechanism without "
        "such a link; diagnosis.png shows where it was looked for."
    )


def test_a_ball_that_the_picture_has_not_is_named() -> None:
    """A bar found with the model of a rod and a ball has the ball shrunk into the rod."""
    file = load("bob")
    width = next(p.name for p in file.parameters if p.kind == "width" and p.name != "link1.width")
    part = width.removesuffix(".width")
    assert unshown_parts(file, file) is None
    shrunk = file.with_values({width: 0.5 * file.values["link1.width"]})
    assert unshown_parts(file, shrunk) == (
        f"The picture shows nothing of {part}: it was found inside of the rest of its body, where it changes "
        "no outline, although it stands out in the mechanism file. The file may be that of another "
        "mechanism: take one without it, or, where it is there, give its sizes with --fix."
    )
    assert unshown_parts(file, file.with_values({width: 1e-12})) is not None
    # what is hidden in the file as well is no surprise
    assert unshown_parts(shrunk, shrunk) is None
    assert unshown_parts(load(DEMO / "double.xml"), load(DEMO / "double.xml")) is None
