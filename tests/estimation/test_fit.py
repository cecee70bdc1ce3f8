"""What an identification returns: its parts fit together, and it says what is not in it."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from monodyn.errors import FitError, SettingsError
from monodyn.stages import identify
from monodyn.types import Poses
from support import refuses


def test_a_parameter_that_is_not_there(fit):
    # as many names as one line takes
    names = ", ".join(f"'{estimate.name}'" for estimate in fit.parameters[:10])
    rest = len(fit.parameters) - 10
    with refuses(FitError, f"parameter 'x' is not in the fit; parameters: {names} and {rest} more."):
        fit.parameter("x")


def test_names_follow_from_parameters_and_starts(fit, poses, double):
    assert fit.shared == tuple(p.name for p in fit.parameters if p.free)
    assert fit.names[: len(fit.shared)] == fit.shared
    assert fit.names[len(fit.shared) :] == (
        "record0.joint1", "record0.joint2", "record0.joint1_vel", "record0.joint2_vel"
    )  # fmt: skip
    assert fit.covariance.shape == (len(fit.names),) * 2
    refused = identify(poses[:4], double)
    assert refused.names == refused.shared == ()


@pytest.mark.slow
def test_parts_of_the_covariance(double, poses):
    fit = identify([poses, poses[5:60]], double)
    count = len(fit.shared)
    np.testing.assert_array_equal(fit.shared_covariance, fit.covariance[:count, :count])
    for record in (0, 1):
        part = fit.motion_covariance(record)
        np.testing.assert_array_equal(part[:count, :count], fit.shared_covariance)
        np.testing.assert_array_equal(part[count:, count:], fit.starts[record].covariance)


@pytest.mark.parametrize("name", ["link1.length", "joint2.damping"])
def test_directions_move_what_is_tied_along(fit, name):
    """Against a central difference: a length carries its width, tail and tip with it."""
    at, value, step = fit.shared.index(name), fit.mechanism.values[name], 1e-7
    ends = []
    for sign in (1.0, -1.0):
        moved = {name: value + sign * step}
        for size, length in fit.tied:
            if length == name:
                moved[size] = fit.mechanism.values[size] * moved[name] / value
        ends.append(fit.mechanism.with_values(moved).tree.links)
    slope = (ends[0] - ends[1]) / (2.0 * step)
    # the step is good to 1e-7 of the largest entry
    np.testing.assert_allclose(
        fit.directions().links[:, :, at], slope, rtol=0, atol=1e-6 * np.abs(slope).max()
    )


@pytest.mark.slow
def test_a_stretch_of_a_record_is_fitted_as_its_frames_are(double, poses):
    """Cut by hand, row by row, it is the same record, and the same fit to the last digit."""
    rng = np.random.default_rng(3)
    poses = replace(poses, shifts=1e-3 * rng.normal(size=(2, len(poses), 2)))
    rows = range(12, 52)
    by_hand = Poses(
        poses.joints,
        np.array([poses.frame[k] for k in rows]),
        np.array([poses.time[k] for k in rows]),
        np.array([poses.position[k] for k in rows]),
        np.array([poses.covariance[k] for k in rows]),
        np.array([poses.seen[k] for k in rows]),
        shifts=np.array([[one[k] for k in rows] for one in poses.shifts]),
    )
    cut, fitted = identify(poses[12:52], double), identify(by_hand, double)
    assert cut.parameters == fitted.parameters
    assert cut.status == fitted.status
    np.testing.assert_array_equal(cut.covariance, fitted.covariance)
    np.testing.assert_array_equal(cut.residual[0], fitted.residual[0])
    np.testing.assert_array_equal(cut.time[0], poses.time[12:52])
    # what comes before and after does matter
    assert identify(poses[12:50], double).parameters != cut.parameters


def test_a_fit_is_drawn_joint_by_joint(fit, poses):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    axes = fit.plot()
    assert axes.shape == (2, 2)
    degrees = np.degrees(poses.position)
    for dof, (above, below) in enumerate(axes):
        measured, fitted = (line.get_ydata() for line in above.lines)
        # the record is against gravity already, and its motion within the integration's error
        np.testing.assert_allclose(measured, degrees[:, dof], atol=1e-3)
        np.testing.assert_allclose(below.lines[1].get_ydata(), measured - fitted, atol=1e-9)
        assert above.get_ylabel() == f"joint{dof + 1} [deg]"
    assert axes[0, 0].figure.get_suptitle() == repr(fit)[1:-1]
    # what is read back from a run folder has no residuals
    alone = replace(fit, residual=()).plot()
    assert np.isfinite(alone[0, 0].lines[1].get_ydata()).all()
    assert np.isnan(alone[0, 0].lines[0].get_ydata()).all()
    pyplot.close("all")


def test_what_cannot_be_drawn_is_refused(fit, poses, double, monkeypatch):
    with refuses(FitError, "plot: expected one of 1 fitted records, got 3."):
        fit.plot(3)
    with refuses(FitError, "plot: expected one of 0 fitted records, got 0."):
        identify(poses[:4], double).plot()
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with refuses(
        SettingsError,
        "plot: expected the package 'matplotlib', which is not installed; install it with pip install "
        "'monodyn[plots]'.",
    ):
        fit.plot()


def test_a_fit_says_in_one_line_what_it_is(fit, poses, double):
    count = len(fit.shared)
    assert (
        repr(fit) == f"<Fit of 'double': {fit.grade}, {count} estimated parameters from {len(poses)} frames>"
    )
    two = replace(fit, time=(fit.time[0], fit.time[0][:9]))
    assert repr(two).endswith(f" estimated parameters from {len(poses) + 9} frames of 2 records>")
    found = replace(fit, advice=("Measure <one> mass.",))._repr_html_()
    assert fit.status in found
    assert "Measure &lt;one&gt; mass." in found
    assert found.count("<tr>") == 1 + count + (1 + len(fit.combinations) if fit.combinations else 0)
    refused = identify(poses[:4], double)
    assert repr(refused) == "<Fit of 'double': refused, 0 estimated parameters from 4 frames>"
    assert refused.status.split()[0] in refused._repr_html_()


def test_parameters_as_a_table_of_pandas(fit):
    pytest.importorskip("pandas")
    table = fit.to_pandas()
    assert list(table.index) == [p.name for p in fit.parameters]
    row, p = table.loc["link1.length"], fit.parameter("link1.length")
    assert (row["value"], row["std"], row["lower"], row["upper"], row["unit"]) == (
        p.value, p.std, p.lower, p.upper, "m"
    )  # fmt: skip
