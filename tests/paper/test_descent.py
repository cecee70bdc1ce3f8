"""The search of (14): what it counts, its cap, its parts, bounds of torques, when it is at a minimum."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.record.samples import prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.mechanism import load
from monodyn.optimize import Minimum
from monodyn.paper import descent, fit_starts
from monodyn.paper.fit_bounds import bounded
from monodyn.paper.fixed_start import FixedStart
from swings import TIMES, motion, record
from waves import PAPER

GIVEN = replace(PAPER, begin="given", evaluations=5)
"""One start, as it is, and a short search."""


def swing(torque="friction", *, model="single", frames=12, size=1.0, metric=True):
    """Return the problem of a swing that the file's own bodies made exactly, the record, and its start."""
    mechanism = load(model).with_torque(torque, terms=1, period=1.0, knots=TIMES[:frames])
    q0 = [0.0] * (len(mechanism.joints) - 1) + [0.5]
    units = [size] * (len(q0) - 1) + [1.0]
    position = motion(load(model), TIMES[:frames], q0, np.zeros(len(q0))) * units
    poses = record(load(model), TIMES[:frames], position, noise=0.0, metric=metric)
    poses = replace(poses, covariance=np.tile(1e-8 * np.eye(len(q0)), (frames, 1, 1)))
    problem = posed(replace(mechanism, measured=None), prepare((poses,), mechanism))
    start = np.concatenate((position[0], np.zeros(len(q0))))[None]
    fixed = FixedStart(
        problem=problem, start=start,
        target=position, white=None, scale=np.ones(len(problem.unknowns)), substeps=4,
    )  # fmt: skip
    return fixed, (smooth(poses),), problem.unknowns.x0


@pytest.fixture
def simulated(monkeypatch):
    """Count the motions that are simulated, by the functions that simulate them."""
    calls = []

    def counting(owner, name):
        plain = getattr(owner, name)
        monkeypatch.setattr(
            owner, name, lambda *given, **named: (calls.append(name), plain(*given, **named))[1]
        )

    def counting_each(moving):
        """Count what ``moving`` returns as often as it simulates."""

        def counted(problem, x):
            simulate = moving(problem, x)
            return lambda *given: (calls.append("moving"), simulate(*given))[1]

        return counted

    counting(Problem, "rows")
    monkeypatch.setattr(Problem, "moving", counting_each(Problem.moving))
    counting(descent, "led")
    counting(fit_starts, "led")
    return calls


@pytest.mark.parametrize(
    ("torque", "model", "metric"),
    [
        ("friction", "single", True),
        ("fourier", "single", True),
        ("free", "single", True),
        ("fourier", "cartpole", False),
    ],
)
def test_evaluations_are_simulated_motions(simulated, torque, model, metric):
    """Those of Jacobians by differences, of the choice of steps and of the parts among them."""
    fixed, smoothed, _ = swing(torque, model=model, metric=metric)
    shown = []
    found = descent.descend(
        fixed, smoothed, None, replace(GIVEN, torque=torque), lambda *step: shown.append(step)
    )
    assert found is not None
    assert found.evaluations == len(simulated) > 10
    assert [step[1] // 50 for step in shown] == list(range(1, found.evaluations // 50 + 1))
    # who looks at the end afterwards spends none of the search's, and shows no progress
    before = len(shown)
    for _ in range(60):
        found.fixed.residuals(found.x)
    assert len(shown) == before


@pytest.mark.parametrize("most", [60, 200])
def test_the_cap_holds_for_jacobians_by_differences(monkeypatch, simulated, most):
    """A Jacobian of a slide in the start scale takes two rollouts for each unknown."""
    fixed, smoothed, x = swing("fourier", model="cartpole", metric=False)
    monkeypatch.setattr(descent, "MOST_ROLLOUTS", most)
    descent.descend(fixed, smoothed, None, replace(GIVEN, torque="fourier", evaluations=100))
    # on top of it: the directions of a search, the verdict on its end (a Jacobian each), and its steps
    assert len(simulated) <= most + 3 * (2 * len(x) + 2) + 16


@pytest.mark.parametrize("allowed", [1, 5, 20, 45, 60])
def test_a_search_spends_no_more_than_it_may(simulated, allowed):
    """The solver counts a Jacobian by differences as one evaluation; the search knows what it takes."""
    fixed, smoothed, x = swing("fourier", model="cartpole", metric=False)
    fixed, bounds = bounded(fixed, x, smoothed)
    away = x + 0.1 * fixed.problem.unknowns.of_kind("thickness")
    directions = descent._directions(fixed, away)
    before = fixed.rollouts.spent
    # one more: the residuals at the start, which weigh what is out of bounds
    end = descent._searched(fixed, away, bounds, directions, (before + 1 + allowed, 1e-6))
    assert np.isfinite(end.value)
    assert fixed.rollouts.spent == len(simulated) <= before + 1 + allowed


def test_a_torque_out_of_bounds_finds_its_way_back(monkeypatch):
    """How far it is beyond is a residual: the cost rises outside, where the motion stays as it is."""
    fixed, smoothed, x = swing("fourier")
    fixed, bounds = bounded(fixed, x, smoothed)
    turned = fixed.problem.unknowns.of_kind("torque")
    kept = {}

    def caught(residuals, start, limits, *, jacobian, **_):
        kept.update(residuals=residuals, jacobian=jacobian)
        return Minimum(start, 0.0, 1, True, np.zeros((1, 2)), "")

    monkeypatch.setattr("monodyn.optimize.bounded_bfgs", caught)
    x = x + 0.1 * fixed.scale
    descent._searched(fixed, x, bounds, np.diag(fixed.scale), (1000, 1e-6))
    place = int(np.flatnonzero(turned)[0])
    out = np.zeros(len(x))
    edge = (bounds[1] - x)[place] / fixed.scale[place]
    costs = []
    for beyond in (0.0, 1.0, 2.0):
        out[place] = edge + beyond
        found = kept["residuals"](out)
        rest = found[: fixed.target.size]
        costs.append(float(found @ found - rest @ rest))
    weight = float(np.linalg.norm(fixed.residuals(x)))
    np.testing.assert_allclose(costs, np.array([0.0, 1.0, 4.0]) * weight**2, atol=1e-12)
    slopes = kept["jacobian"](out)[:, place]
    assert not slopes[: fixed.target.size].any()
    np.testing.assert_allclose(np.linalg.norm(slopes), weight)


def test_the_gain_is_small_at_a_minimum_alone():
    """The file's own values explain the motion exactly; a wrong length costs what can be gained."""
    fixed, smoothed, x = swing()
    fixed, bounds = bounded(fixed, x, smoothed)
    directions = np.diag(fixed.scale)
    assert descent._gain(fixed, x, bounds, directions) < 1e-3
    away = x + 0.05 * fixed.problem.unknowns.of_kind("length")
    assert descent._gain(fixed, away, bounds, directions) > 0.9


def test_a_torque_held_at_its_bound_gains_nothing():
    """With the bound in the way of the only torque that is off, the search is at its minimum there."""
    fixed, smoothed, x = swing("fourier")
    fixed, bounds = bounded(fixed, x, smoothed)
    turned = fixed.problem.unknowns.of_kind("torque")
    at = np.where(turned, x + 0.5 * fixed.scale, x)
    # everything but one torque is held by bounds without room; that one is wanted lower, where its bound is
    single = int(np.flatnonzero(turned)[0])
    bounds = np.stack((at, at))
    bounds[1, single] += 1.0
    at_edge = at.copy()
    directions = descent._directions(fixed, at)
    free = bounds.copy()
    free[0, single] -= 1.0
    assert descent._gain(fixed, at_edge, free, directions) > 0.1
    slope = fixed.jacobian(at).reshape(-1, len(x)).T @ fixed.residuals(at).ravel()
    assert slope[single] > 0
    assert descent._gain(fixed, at_edge, bounds, directions) < 1e-12


def test_the_motion_is_followed_up_to_the_first_row_that_is_off():
    fixed, _, x = swing()
    assert descent._followed(fixed, x) == 12
    target = fixed.target.copy()
    target[7] += 2.0 * np.std(target)
    assert descent._followed(replace(fixed, target=target), x) == 7


def test_parts_grow_by_what_is_followed(monkeypatch):
    """Rows compared: 1.5 for each of seven unknowns, then eight more or as many as are followed."""
    fixed, smoothed, x = swing("fourier", frames=40)
    compared = []

    def minimum(part, x, bounds, until, *, whole=True):
        compared.append((part.compared, whole))
        return Minimum(x, 0.0, 1, True, np.zeros((1, 2)), "")

    monkeypatch.setattr(descent, "_minimum", minimum)
    for followed, expected in (
        (0, [(11, False), (19, False), (27, False), (35, False), (43, True)]),
        (30, [(11, False), (30, False), (38, False), (46, True)]),
    ):
        compared.clear()
        monkeypatch.setattr(descent, "_followed", lambda *_, row=followed: row)
        descent._in_parts(fixed, x, np.stack((x - 1.0, x + 1.0)), smoothed[0], 10**6)
        assert [c for c, _ in compared] == [min(rows, 40) for rows, _ in expected]
        assert [whole for _, whole in compared] == [whole for _, whole in expected]


def test_a_turn_that_gains_nothing_damps_the_next(monkeypatch):
    """And one that gains takes the damping away."""
    fixed, smoothed, x = swing("fourier")
    fixed, bounds = bounded(fixed, x, smoothed)
    length = fixed.problem.unknowns.of_kind("length")
    ends = iter([0.1, 0.1, 0.05, 0.05])
    dampings = []

    def searched(*given):
        return Minimum(x + next(ends, 0.0) * length, 1.0, 1, False, np.zeros((1, 2)), "")

    plain = descent._directions
    monkeypatch.setattr(descent, "_searched", searched)
    monkeypatch.setattr(descent, "_gain", lambda *_: 1.0 if len(dampings) < 4 else 0.0)
    monkeypatch.setattr(
        descent, "_directions",
        lambda fixed, x, *damping: (dampings.extend(damping), plain(fixed, x, *damping))[1],
    )  # fmt: skip
    end = descent._minimum(fixed, x + 0.1 * length, bounds, 10**6)
    factor = descent.MORE_DAMPING
    assert dampings == [factor, factor**2, 1.0, factor]
    assert end.converged


def test_torques_without_effect_have_no_modes(monkeypatch):
    fixed, _, x = swing("fourier")
    for slope in (0.0, np.nan):
        monkeypatch.setattr(
            FixedStart, "jacobian", lambda self, x, slope=slope: np.full((12, 1, len(x)), slope)
        )
        np.testing.assert_array_equal(descent._directions(fixed, x), np.diag(fixed.scale))
    assert descent._gain(fixed, x, np.stack((x - 1.0, x + 1.0)), np.diag(fixed.scale)) == np.inf


@pytest.mark.parametrize(("gradients", "spent"), [(1, True), (1000, False)])
def test_what_ends_the_search(monkeypatch, gradients, spent):
    """Five gradients end it; five thousand are as many as any."""
    monkeypatch.setattr(descent, "GRADIENT_EVALUATIONS", gradients)
    fixed, smoothed, _ = swing(frames=40)
    fixed = replace(fixed, start=fixed.start + 0.3)
    found = descent.descend(fixed, smoothed, None, GIVEN)
    assert found is not None
    assert found.spent == spent
