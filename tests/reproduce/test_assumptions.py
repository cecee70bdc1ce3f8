"""Which assumptions of the paper hold, from evidence that is made."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from experiments import DESIGN, evidence, lost, mechanism, moved, seen
from monodyn.mechanism import load
from monodyn.reproduce.assumptions import assumptions
from monodyn.reproduce.cases import Case
from monodyn.reproduce.evidence import Evidence
from monodyn.reproduce.plans import Design, FitPlan


def judged(published: Evidence, default: Evidence, *, given: bool = False) -> dict[str, tuple[Any, str]]:
    """Judge the assumptions by name."""
    found = assumptions({"paper": published, "fast": default}, given=given)
    return {each.name: (each.held, each.numbers) for each in found}


def test_a_clip_like_the_paper_holds_them() -> None:
    case = moved("II", 1e-3, method="paper")
    fit: Any = SimpleNamespace(
        **{**vars(case.fit), "mechanism": mechanism().with_torque("fourier", terms=1, period=0.5)}
    )
    cases = moved("I", 1e-3, method="paper"), replace(case, fit=fit)
    published = replace(evidence(*cases, method="paper"), design=Design())
    found = judged(published, evidence(moved("I", 1e-3)))
    assert found == {
        "The silhouette shows the pose in every frame.": (True, "90 of 90 frames have a pose."),
        "The mechanism is a double pendulum.": (True, "It has 2 hinges."),
        "40 frames are fitted and as many predicted.": (True, "40 are fitted, 40 predicted."),
        "Uniform bars move under gravity and viscous friction alone (Case I).": (
            True,
            "Case I leaves a residual of 0.206°, 0.0573° in the prediction (published); 0.206°, 0.0573° in "
            "the prediction (default).",
        ),
        "The motion is periodic, and the fitted frames hold multiple periods (Case II).": (
            True,
            "40 frames hold 2.6 of the poses' periods of 0.5 s.",
        ),
    }


def test_what_fails_is_said_with_its_numbers() -> None:
    off = moved("I", 0.1, method="paper")
    fit: Any = SimpleNamespace(**{**vars(off.fit), "advice": ("The bodies may not be uniform.",)})
    refused = Case(FitPlan("paper", "II", 40, series="alone"), "There is no period.")
    published = replace(
        evidence(replace(off, fit=fit), refused, method="paper"), design=replace(DESIGN, frames=40, ahead=10)
    )
    published = replace(published, seen=replace(seen("paper"), joints=load("cartpole").joints))
    found = judged(published, lost("fast"), given=True)
    assert found["The mechanism is a double pendulum."] == (False, "It has 1 hinge and 1 slide.")
    assert found["40 frames are fitted and as many predicted."][0] is False
    held, told = found["Uniform bars move under gravity and viscous friction alone (Case I)."]
    assert held is False
    assert told.startswith("Case I leaves a residual of 5.7")
    assert told.endswith("°, 5.73° in the prediction (published). The bodies may not be uniform.")
    periodic = "The motion is periodic, and the fitted frames hold multiple periods (Case II)."
    assert found[periodic] == (None, "There is no period.")
    assert found["The time stamps are those of the motion."] == (
        None,
        "They are taken as they are, 33.3 ms apart. In a recording k times slower than life lengths come out "
        "k² times too long.",
    )


def test_the_default_method_decides_nothing_where_the_published_fit_is_missing() -> None:
    found = judged(evidence(method="paper"), evidence(moved("I", 1e-3)))
    assert found["Uniform bars move under gravity and viscous friction alone (Case I)."] == (
        None,
        "Case I leaves a residual of 0.206°, 0.0573° in the prediction (default). The published method has "
        "no fit, which would decide.",
    )


def test_without_poses_the_reason_stands_first() -> None:
    found = assumptions({"paper": lost(), "fast": lost("fast")}, given=False)
    assert (found[0].held, found[0].numbers) == (False, "There are no poses: failed: x")
    told = {each.name: each.numbers for each in found}
    assert "There is no fit of Case I to measured angles." in told.values()
    assert "There is no fit of Case II." in told.values()


def test_a_ball_on_a_rod_is_no_bar() -> None:
    published = evidence(moved("I", 1e-2, method="paper"), method="paper")
    name = "Uniform bars move under gravity and viscous friction alone (Case I)."
    scene: Any = SimpleNamespace(mechanism=load("bob"))
    ball = replace(published, seen=replace(published.seen, scene=scene))
    held, told = judged(ball, evidence(moved("I", 0.0)))[name]
    assert held is False
    assert told.endswith("Not every body is a bar: the mechanism has a capsule and a sphere.")


def test_a_residual_of_the_poses_is_not_that_of_the_dynamics() -> None:
    off = replace(moved("I", 1e-2, method="paper"), residual=np.radians([0.7, 0.7]))
    near = replace(moved("I", 1e-2), residual=np.radians([0.03, 0.03]))
    held, told = judged(evidence(off, method="paper"), evidence(near))[
        "Uniform bars move under gravity and viscous friction alone (Case I)."
    ]
    assert held is True
    assert told.endswith(
        "The default method leaves so much less that the published residual is not noise: its poses, sizes "
        "or masses are off."
    )
