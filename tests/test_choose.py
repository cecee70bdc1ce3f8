"""The choice between the bundled mechanisms: the rule on made figures, and what is said of it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fits import made_fit
from monodyn import choose as module
from monodyn.choose import (
    Tried,
    ball_alone,
    candidates,
    choose,
    compared,
    left_by_motion,
    left_by_picture,
    nearest,
)
from monodyn.errors import FitError, MechanismError, SettingsError, VideoError
from monodyn.estimation.fit import Doubt
from monodyn.job import Job
from monodyn.mechanism import load
from monodyn.results.log import RunLog
from monodyn.settings import RunSettings
from monodyn.stages import segment
from monodyn.types import Poses
from monodyn.vision.clip.video import read
from support import ClipMaker, refuses


def tried(model: str, mismatch: float, *, lies: int = 12, still: bool = False, **more: Any) -> Tried:
    """Return a mechanism as if it had been located in 12 key frames, its joints moving or not."""
    mechanism = load(model)
    places = np.linspace(-1.0, 1.0, 12)[:, None] * np.ones(len(mechanism.joints))
    if still:
        places[:, -1] = 0.3
    scene: Any = SimpleNamespace(mechanism=mechanism, key_frames=tuple(range(12)), key_positions=places)
    return Tried(model, mechanism, scene=scene, mismatch=mismatch, lies=lies, frames=12, **more)


def left(*given: Tried) -> list[str]:
    return [one.model for one in left_by_picture(given)]


def test_a_link_too_few_leaves_foreground_and_one_too_many_explains_no_more() -> None:
    assert left(tried("single", 0.5), tried("double", 0.05), tried("triple", 0.049)) == ["double"]
    assert left(tried("single", 0.04), tried("double", 0.037)) == ["single"]
    # a tenth for each of two joints and two geoms
    assert left(tried("single", 0.1), tried("triple", 0.05)) == ["triple", "single"]


def test_frames_in_which_it_does_not_lie_on_its_mask_count_against_it() -> None:
    assert left(tried("double", 0.05), tried("cartpole", 0.05)) == ["double", "cartpole"]
    assert left(tried("double", 0.05, lies=6), tried("cartpole", 0.05)) == ["cartpole"]


def test_what_lies_on_its_mask_nowhere_explains_nothing() -> None:
    nowhere = tried("double", 0.0, lies=0)
    assert left(nowhere, tried("ball", 0.35), tried("cartpole", 0.4, lies=2)) == ["ball"]
    assert nowhere.unexplained == np.inf
    # without any other it is the nearest
    assert left(nowhere, tried("triple", 0.3, lies=0)) == ["double"]


def test_what_was_not_located_is_not_left() -> None:
    assert left(Tried("single", load("single"), refusal="No."), tried("double", 0.2)) == ["double"]


def test_the_grade_decides_before_the_prediction_and_the_prediction_before_the_parts() -> None:
    good = made_fit()
    bad = good.doubted([Doubt("refused", "No.")])
    single, double = tried("single", 0.05, fit=good, off=0.2), tried("double", 0.05, fit=good, off=0.05)
    assert left_by_motion([single, double]) is double
    assert left_by_motion([single, tried("double", 0.05, fit=bad, off=0.0)]) is single
    # both as exact as can be told
    exact = tried("double", 0.05, fit=good, off=0.001)
    assert left_by_motion([exact, tried("single", 0.05, fit=good, off=0.015)]).model == "single"


def test_every_mechanism_has_its_figures_and_its_reason() -> None:
    fit = made_fit()
    best = tried("double", 0.05, fit=fit, off=0.03)
    rows = compared(
        [
            tried("single", 0.5, lies=6),
            best,
            tried("triple", 0.05, still=True),
            tried("cartpole", 0.06, fit=fit, off=0.3),
            tried("ball", 0.0, lies=0),
            Tried("bob", load("bob"), refusal="Nothing moves."),
        ],
        best,
    )
    assert [row.chosen for row in rows] == [True, False, False, False, False, False]
    assert {row.model: row.said for row in rows} == {
        "double": "off the foreground by 5.0% of its area, on it in 12 of 12 key frames, fit trusted, "
        "prediction off by at most 3% of the motion.",
        "cartpole": "off the foreground by 6.0% of its area, on it in 12 of 12 key frames, fit trusted, "
        "prediction off by at most 30% of the motion; the motion decided.",
        "triple": "off the foreground by 5.0% of its area, on it in 12 of 12 key frames, joint3 does not "
        "move; it has more parts and explains no more.",
        "single": "off the foreground by 50.0% of its area, on it in 6 of 12 key frames; 20 times as much "
        "unexplained as double leaves.",
        "ball": "off the foreground by 0.0% of its area, on it in 0 of 12 key frames.",
        "bob": "not located: Nothing moves.",
    }
    assert (rows[0].key_frames, rows[0].mismatch, rows[-1].mismatch) == ((12, 12), 0.05, None)


@pytest.mark.parametrize(
    ("model", "lies", "seen", "named"),
    [
        ("bob", 9, 0.1, True),
        ("single", 12, 0.0, True),
        ("bob", 8, 0.1, False),
        ("bob", 12, 0.3, False),
        ("ball", 12, 0.0, False),
        ("double", 12, 0.0, False),
    ],
)
def test_where_only_a_round_thing_moves_the_ball_is_named(
    monkeypatch: pytest.MonkeyPatch, model: str, lies: int, seen: float, named: bool
) -> None:
    monkeypatch.setattr(module, "_looked", lambda job, masks, one: tried(one.model, 0.1, lies=lies))
    nothing: Any = None
    mechanism = load(model)
    position = np.zeros((100, len(mechanism.joints)))
    position[np.arange(100) >= 100 * seen] = np.nan
    names = tuple(joint.name for joint in mechanism.joints)
    covariance = np.tile(np.eye(len(names)), (100, 1, 1))
    poses = Poses(
        names, np.arange(100), np.arange(100) / 30.0, position, covariance, ~np.isnan(position).any(axis=1)
    )
    text = (
        f"Only a round thing seems to move: a ball alone, its thread unseen, lies on it in {lies} of 12 key "
        f"frames, '{model}' was tracked in {round(100 * seen)} of 100; take the model 'ball'."
    )
    assert ball_alone(nothing, nothing, mechanism, poses) == ([text] if named else [])


def test_where_no_mechanism_fits_the_nearest_is_named() -> None:
    rows = compared([tried("double", 0.4)], tried("double", 0.4))
    assert nearest(made_fit(), rows) == []
    refused = made_fit().doubted([Doubt("refused", "No.")])
    assert nearest(refused, []) == []
    assert nearest(refused, rows) == [
        "'double' is the nearest of the bundled mechanisms: where it is not what was filmed, draw a "
        "mechanism file, for example from model.xml of this run, and name it with --model."
    ]


def test_a_parameter_that_the_user_names_leaves_those_that_have_it() -> None:
    assert {"single", "bob", "ball", "cartpole", "double", "triple", "chain:10"} <= set(
        candidates(RunSettings())
    )
    named = candidates(RunSettings(fix={"link2.length": 0.1}))
    assert not {"single", "bob", "ball", "cartpole"} & set(named)
    assert named["triple"].values["link2.length"] == 0.1
    with pytest.raises(MechanismError, match="nothing"):
        candidates(RunSettings(fix={"nothing.length": 0.1}))


@pytest.mark.parametrize(
    "settings",
    [RunSettings(points=Path("tracks.csv")), RunSettings(masks=Path("masks"))],
    ids=["points", "masks"],
)
def test_without_the_pictures_of_a_clip_a_model_is_needed(settings: RunSettings) -> None:
    with refuses(
        SettingsError,
        "model: expected a mechanism file or a bundled name next to --points or --masks, got none; it is "
        "looked for in the pictures of a clip alone, name it with --model.",
    ):
        candidates(settings)


def test_a_clip_in_which_none_is_located_is_refused(
    monkeypatch: pytest.MonkeyPatch, make_clip: ClipMaker
) -> None:
    def lost(*args: object, **kwargs: object) -> None:
        raise VideoError("Nothing moves.")

    monkeypatch.setattr(module, "locate", lost)
    clip, settings = make_clip(), RunSettings()
    job = Job(settings, RunLog("run", {"model": "auto"}, settings), None, None)
    models = {name: load(name) for name in ("single", "double")}
    with refuses(
        FitError,
        f"clip '{clip}': expected one of the bundled mechanisms, found none of single, double; single: "
        "Nothing moves. Draw a mechanism file of what the clip shows, and name it with --model.",
    ):
        choose(job, segment(read(clip)), models)


@pytest.mark.parametrize("located", [True, False])
def test_each_mechanism_is_listed_once(monkeypatch: pytest.MonkeyPatch, located: bool) -> None:
    """A quick look locates one, and a longer one in a part of the picture may not."""

    def looked(job: object, masks: object, one: Tried, *, whole: bool = False) -> Tried:
        if whole and not located:
            return Tried(one.model, one.mechanism, refusal="Nothing moves.")
        return tried(one.model, 0.2 if whole else 0.3)

    monkeypatch.setattr(module, "_looked", looked)
    monkeypatch.setattr(module, "agreement", lambda scene: 0.0)
    nothing: Any = SimpleNamespace(settings=RunSettings())
    models = {"single": load("single")}
    _, rows = choose(nothing, nothing, models)
    assert [row.said for row in rows] == [
        f"off the foreground by {20 if located else 30}.0% of its area, on it in 12 of 12 key frames."
    ]
