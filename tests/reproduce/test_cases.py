"""The fits of the experiment: which are planned, and how each is measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experiments import DESIGN, JOINTS, NOISE, mechanism, seen
from monodyn.reproduce.cases import Design, FitPlan, parameter_errors, plans, run_case, started
from monodyn.reproduce.claims import overall
from monodyn.reproduce.clip import ClipSettings, Pendulum, simulated
from monodyn.reproduce.tables import case_row
from monodyn.reproduce.vision import Seen


def test_every_fit_is_planned_once() -> None:
    found = plans(Design(), 140)
    assert len(found) == len(set(found)) == 2 * (3 + 4 + 4) + 1
    assert FitPlan("fast", "I", "measured", 60) in found
    assert FitPlan("fast", "I", "measured", 60) not in plans(Design(), 99)


def test_a_fit_is_measured_against_the_truth() -> None:
    rods = Pendulum()
    truth = simulated(ClipSettings(frames=90))
    case = run_case(FitPlan("fast", "I", "measured", 40), seen(), truth, DESIGN)
    assert case.fit is not None
    assert case.fit.ok
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
    assert set(parameter_errors(replace(case, plan=replace(case.plan, case="III")), rods)) == {
        "l1", "l2", "m2/m1"
    }  # fmt: skip


def test_a_fit_that_fails_has_a_status() -> None:
    case = run_case(FitPlan("paper", "I", "measured", 40), Seen("paper", "failed: lost"), None, DESIGN)
    assert case.status == "no poses: failed: lost"
    assert case.fit is None
    row = case_row(case, JOINTS)
    assert row["unknowns"] is None
    assert row["residual_joint1_deg"] is None


def test_other_starts_have_other_values_within_the_factors() -> None:
    first = mechanism().values
    for number in (1, 2):
        other = started(mechanism(), number, 0).values
        scale = other["link1.length"] / first["link1.length"]
        assert other["link2.width"] == pytest.approx(scale * first["link2.width"])
        factors = [
            other[name] / first[name] for name in ("link1.thickness", "joint1.damping", "link2.length")
        ]
        assert all(0.4 <= factor <= 2.5 for factor in factors)
        assert len({round(factor, 6) for factor in factors}) == 3
    assert started(mechanism(), 0, 0).values == first
