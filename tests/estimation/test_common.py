"""Errors that the positions of a record have in common, told from its motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.parts import Common
from monodyn.estimation.record.samples import prepare
from monodyn.estimation.record.shared import growth, moves_a_zero, without_shared
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.common import (
    ALIKE,
    UNSURE,
    by_record,
    common_error,
    left_open,
    less,
    unknown_errors,
)
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.search import Search
from monodyn.mechanism.upright import ROLL_STD, by_roll, with_roll
from monodyn.stages import identify
from swings import NOISE, TIMES, leaning, motion, record

VISCOUS = IdentifySettings(torque="friction", starts=1)


@pytest.mark.slow
def test_the_errors_are_those_of_least_squares_over_all_unknowns(truth, double) -> None:
    """Against derivatives by differences and one dense solve, with a row for each deviation."""
    position = motion(truth, TIMES, [0.3, 0.5], [0.0, 1.0])
    shifts = leaning(position)
    wrong = record(truth, TIMES, position + np.tensordot([1.0, -0.5], shifts, axes=1))
    poses = replace(wrong, shifts=shifts)
    problem = posed(double, prepare([poses], double))
    optimum, _ = Search(problem, (smooth(poses),), IdentifySettings(), None).from_starts()
    trial, so_far = optimum.trial, np.array([0.2, 0.1])
    shifted = problem.with_data(less(problem.data, so_far))
    found = common_error(shifted, trial, so_far)

    def residuals(point: np.ndarray) -> np.ndarray:
        count = len(trial.x)
        at = trial.at(point[:count], point[count : count + 4].reshape(1, 4))
        rows = problem.with_data(less(problem.data, point[count + 4 :])).residuals(at).ravel()
        values, vectors = np.linalg.eigh(problem.prior.information)
        away = problem.prior.away(point[:count] - problem.unknowns.x0)
        known = np.sqrt(np.maximum(values, 0.0)) * (vectors.T @ away)
        return np.concatenate((rows, known, np.sqrt(ALIKE) * point[count + 4 :]))

    point = np.concatenate((trial.x, trial.states.ravel(), so_far))
    step = 1e-6 * np.maximum(1.0, np.abs(point))
    columns = [
        (residuals(point + d) - residuals(point - d)) / (2.0 * s)
        for d, s in zip(np.diag(step), step, strict=True)
    ]
    jacobian = np.stack(columns, axis=1)
    # columns of one length: what nothing shows is then told from what is in small units
    size = np.linalg.norm(jacobian, axis=0)
    inverse = np.linalg.pinv(jacobian / size, rcond=1e-5) / size[:, None]
    best, covariance = point - inverse @ residuals(point), ALIKE * inverse @ inverse.T
    np.testing.assert_allclose(found.mean, best[-2:], atol=1e-3)
    left = (found.covariance - UNSURE**2 * np.eye(2)) / (1.0 - UNSURE**2)
    np.testing.assert_allclose(left, covariance[-2:, -2:], rtol=1e-3, atol=1e-5)


@pytest.mark.slow
def test_what_the_motion_shows_of_a_camera_is_taken_off(truth, double) -> None:
    """Of twelve records each with a common error of its own: lengths come nearer, and are as near as said."""
    rng, position = np.random.default_rng(3), motion(truth, TIMES, [1.8, 0.5], [0.0, 1.0])
    shifts = leaning(position)
    ratio = truth.values["link1.length"] / truth.values["link2.length"]
    off, told, ignored = [], [], []
    for seed in range(12):
        drawn = rng.normal(size=2)
        wrong = record(truth, TIMES, position + np.tensordot(drawn, shifts, axes=1), seed=seed)
        fit = identify(replace(wrong, shifts=shifts), double)
        common = fit.common_of(0)
        assert common is not None
        off.append((common.mean - drawn) @ np.linalg.solve(common.covariance, common.mean - drawn) / 2.0)
        plain = identify(wrong, double)
        told.append(_ratio(fit) / ratio - 1.0)
        ignored.append(_ratio(plain) / ratio - 1.0)
    # the mean of 24 squares of unit variance, or less
    assert np.mean(off) < 1.9
    assert np.std(told) < 0.6 * np.std(ignored)


def _ratio(fit) -> float:
    return fit.parameter("link1.length").value / fit.parameter("link2.length").value


def test_what_was_told_once_is_not_looked_for_again(poses, double) -> None:
    shifts = np.ones((1, 60, 2))
    cleared = replace(poses, shifts=shifts, cleared=True)
    assert prepare([cleared], double).shifts is None
    assert by_record(Common(np.zeros(0), np.zeros((0, 0))), [cleared]) == (None,)
    assert cleared[3:9].cleared


@pytest.mark.slow
def test_a_motion_that_is_not_followed_tells_nothing_of_a_camera(truth, double) -> None:
    position = motion(truth, TIMES, [0.3, 0.5], [0.0, 1.0])
    other = position + 0.3 * np.sin(7.0 * TIMES)[:, None] ** 3
    fit = identify(replace(record(truth, TIMES, other), shifts=leaning(other)), double, VISCOUS)
    assert fit.grade == "refused"
    assert fit.common == ()


def test_each_record_has_its_own_directions(poses) -> None:
    one, two = (replace(poses, shifts=np.ones((count, 60, 2))) for count in (1, 2))
    whole = Common(np.array([1.0, 2.0, 3.0]), np.diag([1.0, 4.0, 9.0]))
    first, none, last = by_record(whole, [one, poses, two])
    assert none is None
    assert first is not None
    assert last is not None
    np.testing.assert_array_equal(first.mean, [1.0])
    np.testing.assert_array_equal(last.covariance, np.diag([4.0, 9.0]))
    np.testing.assert_allclose(last.root @ last.root.T, last.covariance)


def test_without_directions_nothing_is_said(poses, double) -> None:
    data = prepare([poses], double)
    assert unknown_errors(data) is None
    assert unknown_errors(replace(data, shifts=np.zeros((2, 60, 2)))) is None
    assert less(data, np.zeros(0)) is data


def test_errors_are_taken_off_where_something_was_measured(poses, double) -> None:
    gap = np.where(np.arange(60)[:, None] == 5, np.nan, poses.position)
    shifts = NOISE * np.ones((1, 60, 2))
    data = prepare([replace(poses, position=gap, shifts=shifts)], double)
    cleared = less(data, np.array([2.0]))
    np.testing.assert_allclose((data.position - cleared.position)[data.measured], 2.0 * NOISE, rtol=1e-9)
    assert not cleared.position[5].any()
    left = left_open(data, np.array([[0.5]]))
    assert left.shifts is not None
    np.testing.assert_allclose(left.shifts, 0.5 * shifts)


def test_an_error_that_grows_with_the_position_is_a_factor_on_the_noise() -> None:
    position = np.linspace(-0.2, 0.4, 30)[:, None] * [1.0, -3.0]
    measured = np.ones(position.shape, dtype=bool)
    # a factor about 0.1 on the first joint, an offset of the second
    error = np.column_stack((0.5 * (position[:, 0] - 0.1), np.full(30, 0.07)))
    np.testing.assert_allclose(growth(error, position, measured), [0.5, 0.0], atol=1e-12)
    without, factor = without_shared(position, error, measured)
    np.testing.assert_allclose(without[:, 0], 0.1 + np.exp(-0.5) * (position[:, 0] - 0.1), rtol=1e-12)
    np.testing.assert_allclose(without[:, 1], position[:, 1] - 0.07, rtol=1e-12)
    np.testing.assert_allclose(factor, [np.exp(-0.5), 1.0], rtol=1e-12)


def test_no_error_makes_a_record_nothing(poses, double) -> None:
    shifts = 0.5 * np.nan_to_num(poses.position)[np.newaxis]
    data = prepare([replace(poses, shifts=shifts)], double)
    small = less(data, np.array([3.0]))
    # linear it would be -0.5 of the record; the noise is smaller by the same factor
    np.testing.assert_allclose(np.ptp(small.position, axis=0), np.exp(-1.5) * np.ptp(data.position, axis=0))
    np.testing.assert_allclose(small.white, data.white * np.exp(1.5))
    assert small.shifts is not None
    np.testing.assert_allclose(small.shifts, np.exp(-1.5) * data.shifts)


def test_noise_does_not_pull_a_record_to_nothing(truth, double) -> None:
    # what the model lacks is systematic, and would be less if the record were made smaller
    position = motion(truth, TIMES, [0.3, 0.5], [0.0, 1.0])
    poses = record(truth, TIMES, position + 0.02 * np.sin(9.0 * TIMES)[:, None])
    poses = replace(poses, shifts=0.3 * poses.position[np.newaxis])
    problem = posed(double, prepare([poses], double))
    optimum, _ = Search(problem, (smooth(poses),), IdentifySettings(), None).from_starts()
    weighted = problem.with_data(problem.data.scaled(np.full(2, optimum.sigma)))
    assert abs(common_error(weighted, optimum.trial, np.zeros(1)).mean[0]) < 0.5


@pytest.mark.slow
def test_a_roll_that_a_table_states_is_told_as_well_as_that_of_a_clip(truth, double) -> None:
    """A table is against gravity but for an error of that size; a clip has the roll as an unknown."""
    position, roll = motion(truth, TIMES, [0.3, 0.5], [0.0, 1.0]), 0.02
    poses = record(truth, TIMES, position - roll * by_roll(double))
    clip = identify(poses, with_roll(double, 0.0, free=True), VISCOUS)
    turned = np.where(poses.measured, ROLL_STD * by_roll(double), 0.0)[np.newaxis]
    table = identify(replace(poses, shifts=turned), double, VISCOUS)
    assert table.common_of(0) is not None
    assert table.common_of(0).mean[0] * ROLL_STD == pytest.approx(-roll, abs=2e-3)
    for name in ("link1.length", "link2.length"):
        ours, theirs = table.parameter(name), clip.parameter(name)
        assert ours.std == pytest.approx(theirs.std, rel=0.25)
        assert abs(ours.value - theirs.value) < ours.std


def test_an_error_of_a_zero_is_one_joint_off_by_the_same_in_every_row() -> None:
    measured = np.ones((6, 2), dtype=bool)
    measured[0], measured[3, 0] = False, False
    shifts = np.zeros((4, 6, 2))
    shifts[0, :, 0] = 0.05
    # of both joints, from row to row, and in some rows alone
    shifts[1], shifts[2, :, 1], shifts[3, 4:, 1] = 0.05, np.linspace(0.1, 0.2, 6), 0.05
    shifts[3, 1, 1] = 0.05
    assert moves_a_zero(np.where(measured, shifts, 0.0), measured).tolist() == [True, False, False, False]
    assert not len(moves_a_zero(None, measured))
