"""Levenberg-Marquardt on arrows: blocks against the dense solution, steps that are no numbers."""

import numpy as np
import pytest

from monodyn.optimize import Arrow, SearchSettings, dense, minimize, minimize_arrow, minimize_together
from monodyn.optimize.arrow import diagonals
from monodyn.optimize.levenberg import damped_step


def test_a_step_that_is_no_number_is_not_tried():
    """Squares of the derivative overflow: the model has no step, and the search says so."""
    tried = []

    def arrow(shared, local):
        tried.append(shared)
        return Arrow(1.0, np.array([[1e-320]]), np.array([1e10]), *(np.zeros((0, 1, 0)), np.zeros((0, 0, 0))),
                     np.zeros((0, 0)))  # fmt: skip

    found = minimize_arrow(arrow, np.zeros(1), np.zeros((0, 0)), (np.array([-np.inf]), np.array([np.inf])))
    assert np.isfinite(tried).all()
    assert not found.converged


def test_arrow_is_the_dense_solution():
    """Curves a exp(-b t) + c_k with one offset a block: the blocks give what the dense search gives."""
    rng = np.random.default_rng(4)
    t = np.linspace(0.0, 2.0, 9)
    offsets = rng.normal(size=5)
    data = 2.0 * np.exp(-0.7 * t) + offsets[:, None] + 0.01 * rng.normal(size=(5, 9))

    def parts(shared, local):
        decay = np.exp(-shared[1] * t)
        residual = shared[0] * decay + local - data
        return residual, np.stack((decay, -shared[0] * t * decay), axis=1)

    def arrow(shared, local):
        residual, slope = parts(shared, local)
        return Arrow(
            0.5 * float(np.sum(residual**2)), 5 * slope.T @ slope, np.sum(residual @ slope, axis=0),
            np.repeat(slope.sum(axis=0)[None, :, None], 5, axis=0), np.full((5, 1, 1), 9.0),
            residual.sum(axis=1, keepdims=True),
        )  # fmt: skip

    def dense(x):
        residual, slope = parts(x[:2], x[2:, None])
        jacobian = np.zeros((5, 9, 7))
        jacobian[:, :, :2] = slope
        jacobian[np.arange(5), :, 2 + np.arange(5)] = 1.0
        return residual.ravel(), jacobian.reshape(45, 7)

    blocks = minimize_arrow(arrow, np.ones(2), np.zeros((5, 1)), (np.full(2, -9.0), np.full(2, 9.0)))
    whole = minimize(dense, np.concatenate((np.ones(2), np.zeros(5))), (-9.0, 9.0))
    np.testing.assert_allclose(blocks.shared, whole.x[:2], atol=1e-8)
    np.testing.assert_allclose(blocks.local[:, 0], whole.x[2:], atol=1e-8)
    assert blocks.evaluations == whole.evaluations


def test_what_is_known_least_is_not_held_back():
    """One direction is 1e12 times stiffer than the other, which no coordinate is along."""
    hessian = 5e9 * np.array([[1.0, 1.0], [1.0, 1.0]]) + 5e-3 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    goal = np.array([1.0, -1.0])

    def arrow(shared, local):
        off = shared - goal
        # along and across one by one: their sizes differ by more than a sum of both can hold
        across, along = np.sqrt(5e9) * (off[0] + off[1]), np.sqrt(5e-3) * (off[0] - off[1])
        gradient = np.sqrt(5e9) * across * np.ones(2) + np.sqrt(5e-3) * along * np.array([1.0, -1.0])
        nothing = (np.zeros((0, 2, 0)), np.zeros((0, 0, 0)), np.zeros((0, 0)))
        return Arrow(0.5 * (across**2 + along**2), hessian, gradient, *nothing)

    box = (np.full(2, -9.0), np.full(2, 9.0))
    found = minimize_arrow(arrow, np.zeros(2), np.zeros((0, 0)), box, settings=SearchSettings(evaluations=30))
    assert found.converged
    np.testing.assert_allclose(found.shared, goal, atol=1e-2)


def valley(x):
    """Residuals and slope of a parabolic valley: 100 (y - x^2), 1 - x."""
    return np.array([100.0 * (x[1] - x[0] ** 2), 1.0 - x[0]]), np.array([[-200.0 * x[0], 100.0], [-1.0, 0.0]])


def valley_arrow(shared, local):
    residual, slope = valley(shared)
    nothing = (np.zeros((0, 2, 0)), np.zeros((0, 0, 0)), np.zeros((0, 0)))
    return Arrow(0.5 * float(residual @ residual), slope.T @ slope, slope.T @ residual, *nothing, slope)


def valley_bend(model, shared, local, step, local_step):
    """The first residual has the second derivative -200 along x, the other one is straight."""
    return model.kept.T @ np.array([-200.0 * step[0] ** 2, 0.0]), local_step


def test_a_bent_step_follows_a_curved_valley():
    ends = []
    for bend in (None, valley_bend):
        start, box = np.array([-1.5, 2.25]), (np.full(2, -9.0), np.full(2, 9.0))
        found = minimize_arrow(
            valley_arrow, start, np.zeros((0, 0)), box, settings=SearchSettings(evaluations=1000), bend=bend
        )
        ends.append(found)
        assert ends[-1].converged
        np.testing.assert_allclose(ends[-1].shared, 1.0, atol=1e-6)
    assert ends[1].evaluations < 0.2 * ends[0].evaluations


def test_a_bent_step_leaves_what_has_met_its_bound_there():
    box = np.full(2, -9.0), np.array([9.0, 0.5])
    found = minimize_arrow(valley_arrow, np.array([-1.5, 0.4]), np.zeros((0, 0)), box, bend=valley_bend)
    assert found.shared[1] == 0.5
    assert found.at_bound[1]


def test_no_bend_is_asked_for_where_the_last_one_tells_that_it_is_small():
    lengths = []

    def bend(model, shared, local, step, local_step):
        lengths.append(float(np.linalg.norm(step)))
        return valley_bend(model, shared, local, step, local_step)

    box = (np.full(2, -9.0), np.full(2, 9.0))
    found = minimize_arrow(valley_arrow, np.array([-1.5, 2.25]), np.zeros((0, 0)), box, bend=bend)
    np.testing.assert_allclose(found.shared, 1.0, atol=1e-9)
    # Gauss-Newton steps fall by themselves at the end; all but those were bent
    assert found.evaluations - 6 <= len(lengths) < found.evaluations - 1
    assert min(lengths) > 1e-6


@pytest.mark.parametrize(("reach", "start"), [(1.0, (-3.0, -3.0)), (0.3, (-1.5, 4.0)), (0.1, (-1.5, 4.0))])
def test_steps_that_end_at_their_room_are_bent_on(reach, start):
    """What has met its room is not bent, which tells nothing of a later step."""
    box, asked = (np.full(2, -9.0), np.full(2, 9.0)), []

    def bend(*given):
        asked.append(given)
        return valley_bend(*given)

    found = minimize_arrow(valley_arrow, np.array(start), np.zeros((0, 0)), box, reach=reach, bend=bend)
    np.testing.assert_allclose(found.shared, 1.0, atol=1e-6)
    assert found.evaluations < 60
    assert len(asked) > 3


def test_a_block_that_nothing_determines_is_damped():
    """Without damping the block is singular: the step counts as rejected, and the next one is damped."""

    def arrow(shared, local):
        residual = shared - 3.0
        return Arrow(
            0.5 * float(residual @ residual), np.eye(1), residual, np.zeros((1, 1, 2)),
            np.array([[[1.0, 1.0], [1.0, 1.0]]]), np.zeros((1, 2)),
        )  # fmt: skip

    bounds, settings = (np.array([-9.0]), np.array([9.0])), SearchSettings(damping=1e-17)
    found = minimize_arrow(arrow, np.zeros(1), np.zeros((1, 2)), bounds, settings=settings)
    assert found.converged
    assert found.shared[0] == pytest.approx(3.0)
    assert not found.local.any()


@pytest.mark.parametrize("size", [3, 80])
def test_a_step_within_bounds_is_the_best_one(size):
    """Against scipy's bounded least squares on the same quadratic; 80 unknowns take the library's solver."""
    from scipy.optimize import lsq_linear

    rng = np.random.default_rng(size)
    rows, off = (
        rng.normal(size=(2 * size, size)) * 10.0 ** rng.uniform(-2, 2, size),
        rng.normal(size=2 * size),
    )
    off = 10.0 * off + rows @ rng.normal(size=size)
    low, high = -rng.uniform(0.0, 0.5, size), rng.uniform(0.0, 0.5, size)
    blocks = np.zeros((0, size, 0)), np.zeros((0, 0, 0)), np.zeros((0, 0))
    model = Arrow(0.5 * off @ off, rows.T @ rows, rows.T @ off, *blocks)
    step, _, predicted = damped_step(model, 0.0, (np.ones(size), np.zeros((0, 0))), low, high)
    best = lsq_linear(rows, -off, (low, high), tol=1e-14)
    cost = 0.5 * np.sum((rows @ step + off) ** 2)
    assert np.all((step >= low) & (step <= high))
    assert cost <= best.cost * (1.0 + 1e-9)
    assert np.isclose(predicted, model.cost - cost, rtol=1e-9)


def test_a_system_without_one_solution_takes_the_shortest():
    blocks = np.zeros((0, 2, 0)), np.zeros((0, 0, 0)), np.zeros((0, 0))
    model = Arrow(1.0, np.ones((2, 2)), np.ones(2), *blocks)
    far = np.full(2, 9.0)
    step, _, _ = damped_step(model, 0.0, (np.ones(2), np.zeros((0, 0))), -far, far)
    assert np.allclose(step, [-0.5, -0.5])


def test_searches_together_are_those_one_by_one():
    """Rosenbrock's valley and a wall of numbers that are none, from many starts."""

    def rows(x):
        residual = np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])
        return (residual if x[0] > -3.0 else residual * np.nan), np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])

    starts = [np.array(start) for start in ([-1.2, 1.0], [2.0, -4.0], [0.0, 30.0], [-4.0, 1.0], [1.0, 1.0])]
    settings = SearchSettings(evaluations=60)
    asked = []

    def models(points):
        asked.append(len(points))
        return [dense(*rows(point)) for point in points]

    together = minimize_together(models, starts, settings=settings, reach=2.0)
    for start, found in zip(starts, together, strict=True):
        alone = minimize(rows, start, settings=settings, reach=2.0)
        assert np.array_equal(alone.x, found.shared)
        assert (alone.status, alone.evaluations) == (found.status, found.evaluations)
    assert asked[0] == len(starts) > asked[-1]
    assert minimize_together(models, []) == []


def test_diagonals_are_one_where_nothing_is_known():
    rng = np.random.default_rng(2)
    hessian, local = rng.normal(size=(4, 4)), rng.normal(size=(3, 2, 2))
    hessian[1, 1] = local[0, 1, 1] = 0.0
    shared, blocks = diagonals(hessian, local)
    own, inner = np.diag(hessian), np.diagonal(local, axis1=1, axis2=2)
    np.testing.assert_array_equal(shared, np.where(own > 0, own, 1.0))
    np.testing.assert_array_equal(blocks, np.where(inner > 0, inner, 1.0))
    assert (own > 0).any()
    assert (inner > 0).any()
    assert (inner < 0).any()
