"""Levenberg-Marquardt on arrows: blocks against the dense solution, steps that are no numbers."""

import numpy as np

from monodyn.optimize import Arrow, minimize, minimize_arrow


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
