"""The data of the figures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fits import made_fit, record
from monodyn.mechanism import load
from monodyn.results import curves
from monodyn.results.curves import motion_curves, torque_curves
from monodyn.results.predict import predict
from monodyn.results.torques import Torques
from monodyn.results.trace import trace_of


def test_curves_hold_what_was_measured_fitted_and_predicted() -> None:
    fit = made_fit()
    poses = record(fit)
    trace = trace_of(fit, poses, predict(fit, times=poses.time[20:]))
    (plot,) = motion_curves(fit, trace, several=False)
    assert (plot["title"], plot["unit"]) == ("joint1", "deg")
    assert len(plot["observed"]) == 30
    assert plot["observed"][7] is None
    assert plot["window"] == [0.0, pytest.approx(19 / 30)]
    assert len(plot["fitted"]["time"]) == 20
    assert len(plot["predicted"]["time"]) == 10
    assert plot["predicted"]["error"] == pytest.approx([-0.0573] * 10, abs=1e-3)  # 1 mrad, six digits kept
    assert plot["predicted"]["upper"][3] > plot["predicted"]["value"][3]


def test_a_record_has_its_name_in_the_titles_of_several() -> None:
    fit = made_fit()
    trace = trace_of(fit, record(fit), name="a.csv")
    (plot,) = motion_curves(fit, trace, several=True)
    assert plot["title"] == "a.csv: joint1"
    assert plot["predicted"] is None
    assert torque_curves(fit, trace, several=True) == []


@pytest.mark.parametrize(("torque", "count"), [("free", 20), ("fourier", 30)])
def test_free_torques_are_drawn_at_the_fitted_frames_alone(torque: str, count: int) -> None:
    plain, fit = made_fit(), made_fit(torque=torque)
    trace = trace_of(plain, record(plain), name="a.csv")
    acting = Torques(trace.poses.time, np.ones((30, 1)), np.full((30, 1), np.inf))
    (plot,) = torque_curves(fit, replace(trace, torques=acting), several=True)
    assert (plot["title"], plot["unit"]) == ("a.csv: torque at joint1", "N m")
    assert plot["fitted"]["value"] == [1.0] * count
    assert plot["fitted"]["upper"] == [1.0] * count  # no band where nothing is known


def test_a_slide_is_shown_in_millimetres() -> None:
    from monodyn.numbers import shown_in

    assert [shown_in(joint) for joint in load("cartpole").joints] == [
        (1000.0, "mm"),
        (pytest.approx(57.29578), "deg"),
    ]


def test_long_records_are_drawn_by_fewer_points_that_belong_together(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With 20,000 rows a page was larger than a mailbox takes."""
    monkeypatch.setattr(curves, "MOST", 10)
    fit = made_fit()
    poses = record(fit)
    (plot,) = motion_curves(fit, trace_of(fit, poses, predict(fit, times=poses.time[20:])), several=False)
    np.testing.assert_allclose(plot["time"], poses.time[::3], atol=1e-6)
    assert len(plot["observed"]) == 10
    fitted = plot["fitted"]
    assert {len(fitted[name]) for name in ("time", "value", "upper", "lower", "error", "error_time")} == {10}
    np.testing.assert_allclose(fitted["time"], poses.time[:20:2], atol=1e-6)
