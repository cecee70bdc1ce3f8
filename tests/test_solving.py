"""Small systems of equations against numpy."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.solving import banded_root, banded_solved, eliminate, inverted, product, shortest, solved


@pytest.mark.parametrize("size", [1, 2, 7, 80])
def test_systems_are_solved(size: int) -> None:
    rng = np.random.default_rng(size)
    matrix, right = rng.normal(size=(size, size)), rng.normal(size=(size, 3))
    found = right.copy()
    assert eliminate(matrix.copy(), found)
    # what rounding leaves grows with the condition of the matrix
    close = {"rtol": 1e-14 * np.linalg.cond(matrix) * size, "atol": 0.0}
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), **close)
    np.testing.assert_allclose(solved(matrix, right[:, 0]), found[:, 0])
    np.testing.assert_allclose(inverted(matrix), np.linalg.inv(matrix), **close)
    np.testing.assert_allclose(product(matrix, right[:, 1]), matrix @ right[:, 1], rtol=1e-13, atol=1e-14)


def test_a_singular_system_has_no_solution() -> None:
    matrix = np.array([[1.0, 2.0], [2.0, 4.0]])
    assert not eliminate(matrix.copy(), np.ones((2, 1)))
    assert not eliminate(np.full((2, 2), np.nan), np.ones((2, 1)))
    assert np.isnan(solved(matrix, np.ones(2))).all()
    assert np.isnan(inverted(matrix)).all()


@pytest.mark.parametrize(("size", "rank"), [(1, 0), (2, 1), (6, 3), (6, 6), (40, 25)])
def test_the_shortest_solution_is_that_of_singular_values(size: int, rank: int) -> None:
    rng = np.random.default_rng(size)
    rows = rng.normal(size=(rank, size))
    matrix, right = rows.T @ rows, rng.normal(size=size)
    expected = np.linalg.lstsq(matrix, right, rcond=1e-12)[0]
    np.testing.assert_allclose(shortest(matrix, right), expected, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize(("size", "width"), [(1, 1), (5, 1), (40, 2)])
def test_banded_systems_are_solved(size: int, width: int) -> None:
    rng = np.random.default_rng(size)
    lower = np.tril(np.triu(rng.uniform(0.1, 1.0, (size, size)), -width)) + np.eye(size)
    matrix, right = lower @ lower.T, rng.normal(size=(size, 2))
    bands = np.zeros((width + 1, size))
    for band in range(min(width + 1, size)):
        bands[width - band, band:] = np.diag(matrix, band)
    root = banded_root(bands)
    np.testing.assert_allclose(root[width], np.diag(lower), rtol=1e-10)
    np.testing.assert_allclose(banded_solved(root, right), np.linalg.solve(matrix, right), rtol=1e-8)


def test_no_banded_root_where_a_matrix_is_not_positive() -> None:
    assert np.isnan(banded_root(np.array([[0.0, 2.0], [1.0, 1.0]]))).any()
