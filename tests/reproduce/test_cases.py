"""The fits of the experiment: how each is measured."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments import DESIGN, NOISE, evidence, mechanism, moved, seen, truth
from monodyn.mechanism import Measured, load
from monodyn.reproduce.cases import parameter_errors, run_case, slides_scaled
from monodyn.reproduce.plans import FitPlan, start_scale, started
from monodyn.reproduce.truth import Truth, identifiable
from monodyn.reproduce.vision import Seen
from support import slow
from swings import SIZES, motion, white


def test_a_fit_is_measured_against_the_truth() -> None:
    case = run_case(FitPlan("fast", "I", 40), seen(), truth(), DESIGN)
    assert case.fit is not None
    assert case.ok
    overall = evidence().overall
    # the noise of the poses stays in the residual; the fitted motion is well below it
    assert overall(case.residual) == pytest.approx(NOISE, rel=0.25)
    # 12 unknowns from 80 angles carry sqrt(12 / 80) of the noise into the motion; twice that at most
    assert overall(case.error) < 2.0 * np.sqrt(12 / 80) * NOISE
    assert overall(case.ahead) < 2.0 * NOISE
    assert case.parameters is not None
    assert abs(case.parameters["l1"]) < 0.01
    assert abs(case.parameters["l2"]) < 0.01
    values = case.fit.mechanism.values
    share = values["link2.mass"] / values["link1.mass"] / (0.19 * 0.026 * 0.005 / (0.24 * 0.030 * 0.006))
    assert case.parameters["m2/m1"] == pytest.approx(share - 1.0, abs=1e-9)
    assert set(parameter_errors(replace(case, plan=replace(case.plan, case="III")), truth())) == {
        "l1", "l2", "m2/m1"
    }  # fmt: skip


def test_the_fitted_frames_hold_their_span_by_the_period() -> None:
    case = moved("II", 0.0)
    fit: Any = SimpleNamespace(
        **{**vars(case.fit), "mechanism": mechanism().with_torque("fourier", terms=1, period=0.5)}
    )
    # 40 frames at 30 a second span 1.3 s
    assert replace(case, fit=fit).periods == pytest.approx(2.6)
    assert moved("I", 0.0).periods is None


def test_of_a_hinge_without_friction_there_is_no_share() -> None:
    told = replace(truth(), values={"b1/m1": 1e-3, "b2/m1": 0.0})
    assert list(parameter_errors(moved("I", 0.0), told)) == ["b1/m1"]


def test_a_fit_without_poses_has_a_status() -> None:
    nothing = Seen("paper", "failed: lost", mechanism().joints)
    case = run_case(FitPlan("paper", "I", 40), nothing, None, DESIGN)
    assert (case.status, case.fit, case.ok, case.unknowns) == ("no poses: failed: lost", None, False, None)


def test_slides_are_in_the_scale_of_the_start_values() -> None:
    cart = load("cartpole")
    poses = white(tuple(joint.name for joint in cart.joints), np.arange(9) / 30.0, np.ones((9, 2)), 0.01)
    seen_poses = replace(poses, metric=False)
    factor = start_scale(3, 7)
    begun = started(cart, 3, 7)
    length = next(p.name for p in cart.parameters if p.kind == "length")
    assert begun.values[length] / cart.values[length] == pytest.approx(factor)
    scaled = slides_scaled(seen_poses, cart, factor)
    assert not scaled.metric
    kinds = [joint.kind for joint in cart.joints]
    np.testing.assert_allclose(scaled.position[0], [factor if kind == "slide" else 1.0 for kind in kinds])
    assert slides_scaled(poses, cart, factor) is poses
    assert start_scale(0, 7) == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("start", [1, slow(2)])
def test_a_drawn_start_of_a_slide_is_the_same_problem(start: int) -> None:
    cart = load("cartpole")
    true = cart.with_values({p.name: 1.5 * p.value for p in cart.parameters if p.kind in SIZES})
    time = np.arange(60) / 30.0
    swung = motion(true, time, [0.1, 0.8], [0.2, 0.0])
    # a picture gives the slide in the scale of the file, whose sizes are a third too small
    shown = swung / np.array([1.5 if joint.kind == "slide" else 1.0 for joint in cart.joints])
    poses = white(tuple(joint.name for joint in cart.joints), time, shown, 1e-4, metric=False)
    # and the proportions of the sizes, so that none of them is free to take the scale of the slide
    sizes = tuple(p.name for p in cart.parameters if p.kind in SIZES and p.value)
    known = 1e8 * (np.eye(len(sizes)) - 1.0 / len(sizes))
    cart = cart.with_measured(Measured(sizes, known))
    scene: Any = SimpleNamespace(mechanism=cart, camera=None)
    found = Seen("fast", "done", cart.joints, scene, poses, 1.0, 0.02, 0.0 * shown)
    told = Truth(time, swung, 0.0 * swung, identifiable(true))
    case = run_case(FitPlan("fast", "I", 40, start=start), found, told, replace(DESIGN, ahead=10, starts=2))
    assert case.ok
    assert case.parameters is not None
    assert abs(case.parameters["l1"]) < 0.01
    assert case.poses is not None
    # in metres whatever the start
    np.testing.assert_allclose(case.poses[:, 0], swung[: len(case.poses), 0], rtol=0.01, atol=1e-3)
