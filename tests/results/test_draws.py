"""Mechanisms drawn from the covariance of a fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from controllable import TIMES, identified
from monodyn.errors import SettingsError
from monodyn.mechanism.simulate import acceleration_derivatives, rollout
from monodyn.results import draws
from monodyn.results.draws import Response, drawn
from monodyn.results.fill import fill
from support import refuses


def test_draws_move_as_the_data_allow() -> None:
    """Not so draws of the parameters themselves, whose covariance is tangent to a curve."""
    _, fit = identified("double")
    start, states = fit.starts[0], fill(fit, TIMES)
    others = drawn(fit, 30)
    assert len(others) == 30
    motions = [rollout(one.tree, TIMES, start.position, start.velocity, substeps=16)[0] for one in others]
    away = [float(np.sqrt(np.mean((q - states.position) ** 2))) for q in motions]
    # the start is held, so that a motion may leave the band of the fit, in which start and sizes make up
    assert max(away) < 0.05
    assert min(away) > 1e-5
    # along the tangent the same deviations lead elsewhere
    values, vectors = np.linalg.eigh(fit.shared_covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    best = np.array([fit.mechanism.values[name] for name in fit.shared])
    rng, worse = np.random.default_rng(0), []
    for _ in range(30):
        moved = np.maximum(best + root @ rng.normal(size=len(best)), 1e-4)
        one = fit.mechanism.with_values(dict(zip(fit.shared, moved.tolist(), strict=True)))
        q, _ = rollout(one.tree, TIMES, start.position, start.velocity, substeps=16)
        worse.append(float(np.sqrt(np.mean((q - states.position) ** 2))))
    assert np.median(worse) > 5.0 * np.median(away)


def test_draws_have_the_response_to_a_torque_in_common_where_masses_are_open() -> None:
    _, fit = identified("double")
    q, zero = np.array([[1.0, 0.5]]), np.zeros((1, 2))
    nothing = replace(fit.directions(), links=np.zeros((2, 16, 0)), gravity=np.zeros((2, 0)))
    responses = [
        acceleration_derivatives(one.tree, nothing, q, zero, zero)[1][0, 1, 5]
        for one in (fit.mechanism, *drawn(fit, 5, response=Response(q[0], 1)))
    ]
    # a draw is found where all features are met within 1e-4
    np.testing.assert_allclose(responses[1:], responses[0], rtol=2e-4)


@pytest.mark.parametrize("seed", range(5))
def test_a_few_draws_are_found_where_one_in_ten_is(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """The tries that a small number gets do not run out by bad luck: 20 would find none every eighth time."""
    _, fit = identified("cartpole")
    luck, nearest = np.random.default_rng(seed), draws._nearest

    def seldom(*given):
        return nearest(*given) if luck.uniform() < 0.1 else None

    monkeypatch.setattr(draws, "_nearest", seldom)
    assert [len(drawn(fit, count)) for count in (1, 2, 3)] == [1, 2, 3]


def test_draws_follow_from_the_seed_and_stay_within_the_bounds() -> None:
    _, fit = identified("cartpole")
    first, again, other = (drawn(fit, 3, seed=seed) for seed in (1, 1, 2))
    assert [one.values for one in first] == [one.values for one in again]
    assert first[0].values != other[0].values
    for one in first:
        assert all(p.lower <= p.value <= p.upper for p in one.parameters if p.name in fit.shared)
    given = replace(fit, parameters=tuple(replace(p, free=False) for p in fit.parameters))
    assert drawn(given, 3) == []
    with refuses(SettingsError, f"draws: expected 0 to 100, got {2**70}; give a whole number."):
        drawn(fit, 2**70)
