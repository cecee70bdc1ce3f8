"""Directions of the search: equal effect, no effect of the rest on what they make up for."""

import numpy as np

from monodyn.paper.modes import modes


def test_directions_turn_the_curvature_into_the_identity():
    """With more values than unknowns, and none weak, J D has orthonormal columns for the turned unknowns."""
    rng = np.random.default_rng(0)
    jacobian = rng.normal(size=(40, 7)) * np.geomspace(1.0, 10.0, 7)
    turned = np.array([False, True, True, False, True, True, True])
    found = modes(jacobian, turned, 1e-9)
    along = jacobian @ found
    np.testing.assert_allclose((along.T @ along)[np.ix_(turned, turned)], np.eye(5), atol=1e-6)
    # the others move nothing that the turned ones can move, and have the same size
    np.testing.assert_allclose((along.T @ along)[np.ix_(turned, ~turned)], 0.0, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(along[:, ~turned], axis=0), 1.0)
    # single unknowns stay single: their bounds remain bounds
    single = found[np.ix_(~turned, ~turned)]
    np.testing.assert_allclose(single, np.diag(np.diag(single)))


def test_more_torques_than_values():
    """What moves nothing counts as the weakest: every direction is finite, and they span the whole space."""
    jacobian = np.random.default_rng(1).normal(size=(5, 9))
    turned = np.arange(9) > 1
    found = modes(jacobian, turned, 0.01)
    assert np.isfinite(found).all()
    assert np.linalg.matrix_rank(found) == 9
