"""Where the published search begins: at the given values alone, and with the torque of (11) to (13)."""

from dataclasses import replace

import numpy as np

from monodyn.estimation.record.samples import prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.shooting.problem import posed
from monodyn.mechanism import load
from monodyn.mechanism.tree import DAMPING, INERTIA, MASS
from monodyn.paper.fit_starts import fit_starts, led, required
from monodyn.paper.fixed_start import FixedStart
from monodyn.paper.pose_series import PoseSeries
from swings import TIMES, record
from waves import PAPER

PERIOD, SWUNG = 0.8, 0.3
"""Period [s] and amplitude [rad] of the motion, a cosine about hanging down."""


def cosine(torque):
    """Return the problem of a pendulum that hangs at -pi/2 and swings as a cosine, and the record."""
    mechanism = load("single").with_torque(torque, terms=3, period=PERIOD, knots=TIMES[:30])
    mechanism = mechanism.with_choices(fix={"torque.period": PERIOD}) if torque == "fourier" else mechanism
    position = (-np.pi / 2 + SWUNG * np.cos(2 * np.pi * TIMES[:30] / PERIOD))[:, None]
    poses = record(load("single"), TIMES[:30], position, noise=1e-6)
    problem = posed(replace(mechanism, measured=None), prepare((poses,), mechanism))
    fixed = FixedStart(
        problem=problem, start=np.array([[position[0, 0], 0.0]]), target=position, white=None,
        scale=np.ones(len(problem.unknowns)), substeps=4,
    )  # fmt: skip
    return fixed, (smooth(poses),)


SERIES = PoseSeries(PERIOD, 1.2, np.array([[-np.pi / 2], [SWUNG], [0.0]]), (1,), 0.0)
"""The series of that motion: mean, cosine and sine."""


def test_a_series_starts_as_the_torque_that_the_motion_requires():
    """tau = I q'' + b q' + m g c sin(A cos wt), whose Bessel coefficients are 2 J1(A) and -2 J3(A)."""
    from scipy.special import jv

    fixed, _ = cosine("fourier")
    unknowns, mechanism = fixed.problem.unknowns, fixed.problem.mechanism
    values, link = mechanism.values, mechanism.tree.links[0]
    com = np.hypot(values["link1.com_x"], values["link1.com_y"])
    inertia, weight, w = link[INERTIA] + link[MASS] * com**2, link[MASS] * 9.81 * com, 2 * np.pi / PERIOD
    expected = {
        "mean": 0.0,
        "cos1": -SWUNG * inertia * w**2 + weight * 2.0 * jv(1, SWUNG),
        "sin1": -SWUNG * link[DAMPING] * w,
        "cos2": 0.0,
        "sin2": 0.0,
        "cos3": -weight * 2.0 * jv(3, SWUNG),
        "sin3": 0.0,
    }
    found = unknowns.named(required(fixed, unknowns.x0, SERIES))
    torques = {name.rsplit(".", 1)[1]: found[name] for name in found if ".torque." in name}
    assert set(torques) == set(expected)
    for name, value in expected.items():
        assert abs(torques[name] - value) < 1e-6 * weight, name
    others = ~unknowns.of_kind("torque")
    np.testing.assert_array_equal(required(fixed, unknowns.x0, SERIES)[others], unknowns.x0[others])


def test_given_starts_are_those_of_the_file_alone():
    fixed, smoothed = cosine("friction")
    (only,) = fit_starts(fixed, smoothed, None, replace(PAPER, begin="given"))
    np.testing.assert_array_equal(only, fixed.problem.unknowns.x0)
    matched = list(fit_starts(fixed, smoothed, None, replace(PAPER, starts=2)))
    # those of the default search, which tries the file's among others
    assert any(not np.array_equal(x, only) for x in matched)


def test_given_starts_leave_the_sizes_under_a_torque():
    for torque, series in (("fourier", SERIES), ("free", None)):
        fixed, smoothed = cosine(torque)
        (only,) = fit_starts(fixed, smoothed, series, replace(PAPER, begin="given", torque=torque))
        turned = fixed.problem.unknowns.of_kind("torque")
        np.testing.assert_array_equal(only[~turned], fixed.problem.unknowns.x0[~turned])
        assert only[turned].any()


def test_a_start_that_diverges_gives_way_to_the_file(monkeypatch):
    """With damping that the integration steps cannot hold the led motion leaves all bounds."""
    fixed, smoothed = cosine("free")
    x0, damping = fixed.problem.unknowns.x0, fixed.problem.unknowns.of_kind("damping")
    stiff = np.where(damping, 1e4, x0)
    assert led(fixed, stiff, smoothed[0]) is None
    monkeypatch.setattr("monodyn.paper.fit_starts.starts", lambda *given: iter([(stiff[:3], 0.0)]))
    settings = replace(PAPER, torque="free")
    (only,) = fit_starts(fixed, smoothed, None, settings)
    np.testing.assert_array_equal(only, led(fixed, x0, smoothed[0]))
    monkeypatch.setattr("monodyn.paper.fit_starts.led", lambda *given: None)
    assert list(fit_starts(fixed, smoothed, None, settings)) == []


def test_poses_beyond_all_sense_are_no_start():
    fixed, _ = cosine("fourier")
    wild = replace(SERIES, coefficients=1e150 * SERIES.coefficients)
    assert required(fixed, fixed.problem.unknowns.x0, wild) is None
