"""What a model lacks as an unknown function of the state: intervals of records whose truth is known."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter
from scipy.stats import multivariate_normal

from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.verdict import repeating, summary
from monodyn.estimation.verdict.combinations import inertial_ratios
from monodyn.estimation.verdict.repeating import _along, _pushed, _Residuals, _strengths, _waves
from monodyn.estimation.verdict.shares import Share
from monodyn.mechanism import load
from monodyn.mechanism.simulate import accelerations, rollout, transitions
from monodyn.stages import identify
from swings import motion, record

VISCOUS = IdentifySettings(torque="friction")
FREE = IdentifySettings(torque="friction", bodies="free")
TIMES = np.arange(120) / 60.0
LACKING = {
    "dry": ("double", {"joint1.friction": 2e-3, "joint2.friction": 1e-3}),
    "drag": ("double", {"joint1.drag": 3e-4, "joint2.drag": 2e-4}),
    "dry slide": ("cartpole", {"slide.friction": 0.05}),
    "stretched": ("double", {}),
}
"""Mechanism, and forces of the truth that the model has not, by name; in one case angles are read from a
picture that is stretched."""


def lacking(kind: str, seed: int):
    """Return a record with a force that is held at zero in the model, the model, and the truth."""
    (name, forces), rng = LACKING[kind], np.random.default_rng(seed)
    truth, start = load(name).with_values(forces), [-0.4, 0.0] + np.array([0.5, 0.6]) * rng.normal(size=2)
    position = motion(truth, TIMES, start, [0.0, 0.0])
    if kind == "stretched":
        seen = np.cumsum(position, axis=1)
        seen += np.arctan2(0.04 * np.sin(seen) * np.cos(seen), 1.0 + 0.04 * np.cos(seen) ** 2)
        position = np.diff(seen, axis=1, prepend=0.0)
    found = record(truth, TIMES, position, noise=2e-4, seed=seed)
    return found, load(name).with_choices(fix=dict.fromkeys(forces, 0.0)), truth


def deviations(fit, truth) -> np.ndarray:
    """Return how many deviations the combinations of inertia are off."""
    true = {
        name: float(np.real(value)) for name, value in inertial_ratios(truth, truth.tree, full=True).items()
    }
    return np.array([(one.value - true[one.name]) / one.std for one in fit.combinations if one.name in true])


@pytest.mark.slow
@pytest.mark.parametrize("kind", LACKING)
def test_intervals_contain_what_is_unknown_to_the_model(kind, monkeypatch):
    with_it, without = [], []
    for seed in range(3):
        poses, start, truth = lacking(kind, seed)
        fit = identify(poses, start, VISCOUS)
        with_it.extend(deviations(fit, truth))
        with monkeypatch.context() as patch:
            patch.setattr(summary, "repeating_share", lambda *_: Share({}, {}))
            without.extend(deviations(identify(poses, start, VISCOUS), truth))
    assert len(with_it) == len(without) >= 12
    # as the residuals are white noise the intervals are several times too narrow
    assert np.sqrt(np.mean(np.square(without))) > 3.0
    assert 0.3 < np.sqrt(np.mean(np.square(with_it))) < 1.6
    assert np.mean(np.abs(with_it) < 2.0) > 0.85


@pytest.mark.slow
def test_a_record_that_states_too_much_noise_hides_nothing():
    """What the model lacks is compared with the noise that the record shows, whatever it states."""
    poses, start, truth = lacking("dry", 0)
    loud = replace(poses, covariance=100.0 * poses.covariance)
    one, other = (deviations(identify(given, start, VISCOUS), truth) for given in (poses, loud))
    np.testing.assert_allclose(other, one, atol=0.3)


def test_forces_widen_what_the_motion_tells_and_not_what_is_known_before():
    """Against the posterior of the sandwich covariance of the motion together with what is known before."""
    rng = np.random.default_rng(5)
    jacobian, waves = rng.normal(size=(30, 3)), 30.0 * rng.normal(size=(30, 6))
    information, tension = jacobian.T @ jacobian, np.array([0.0, 0.3, -2.0])
    # the first unknown nobody knows before, the last one well
    before = np.diag([0.0, 1.0, 400.0])
    about = SimpleNamespace(
        followed=np.linalg.inv(information + before), alone=np.linalg.inv(information), tension=tension
    )
    more = _Residuals.wider(about, jacobian.T @ waves)
    # the waves act on what the unknowns follow: within the columns of the derivatives
    pull = jacobian.T @ waves
    motion_tells = information @ np.linalg.inv(information + pull @ pull.T) @ information
    whole = np.linalg.inv(motion_tells + before)
    best = np.linalg.solve(information, tension)
    shift = whole @ (motion_tells @ best - tension)
    np.testing.assert_allclose(about.followed + more, whole + np.outer(shift, shift), atol=1e-9)
    assert np.sqrt(whole[2, 2]) < 1.0 / 20.0
    # without knowledge before it is what the unknowns follow the waves by
    free = SimpleNamespace(followed=about.alone, alone=about.alone, tension=np.zeros(3))
    plain = about.alone @ pull @ pull.T @ about.alone
    np.testing.assert_allclose(_Residuals.wider(free, pull), plain, rtol=1e-8)


@pytest.mark.slow
def test_what_does_not_repeat_is_laid_to_no_force_of_the_state():
    """Readings that are off slowly and at random: their error averages out, so that intervals are those of
    its spectrum and a longer record has narrower ones."""
    truth, times = load("single").with_values({"joint1.damping": 3e-4}), np.arange(800) * 0.02
    off = []
    for seed in range(2):
        kept, drawn = np.exp(-1.0 / 25.0), np.random.default_rng(seed).normal(size=1300)
        slow = lfilter([np.sqrt(1.0 - kept**2)], [1.0, -kept], lfilter([0.3], [1.0, -0.7], drawn))[500:]
        position = motion(truth, times, [0.9], [0.0]) + 7e-4 * slow[:, None]
        whole = record(truth, times, position, noise=4e-5, seed=seed)
        fits = [identify(whole[:rows], load("single"), FREE) for rows in (200, 800)]
        named = [{one.name: one for one in fit.combinations} for fit in fits]
        for name in ("link1.mx * gravity / link1.J", "link1.my * gravity / link1.J"):
            short, long = (one[name].std for one in named)
            assert long < short < 0.05, name
        off.extend(np.concatenate([deviations(fit, truth) for fit in fits]))
    assert np.all(np.abs(off) < 2.5)


@pytest.mark.slow
def test_where_noise_explains_the_residuals_next_to_nothing_is_added(poses, double, monkeypatch):
    shares = []

    def share(found, _):
        shares.append((np.diag(repeating.repeating(found, np.zeros(2))), np.diag(found.known.covariance)))
        return Share({}, {})

    monkeypatch.setattr(summary, "repeating_share", share)
    identify(poses, double, VISCOUS)
    added, before = shares[0]
    known = np.isfinite(before) & (before > 0.0)
    assert known.any()
    assert np.all(added[known] < 0.5 * before[known])


def test_pushes_are_carried_on_as_an_integration_has_them():
    """Against the motion of a pendulum that each wave accelerates, by another integrator (within 1 %:
    waves are linear between rows)."""
    single, times, small = load("single"), np.arange(0.0, 1.0, 0.01), 1e-4
    begin = np.array([0.8]), np.array([-0.5])
    q, v = rollout(single.tree, times, *begin, substeps=4)
    waves = _waves(np.concatenate([np.cos(q), np.sin(q), v], axis=1), 1)
    trial = SimpleNamespace(runs=[(0, len(times), begin)])
    carried = transitions(single.tree, times, np.concatenate((q, v), axis=1), substeps=4)
    found = _pushed(times, carried, trial, [waves])[0][:, 0]
    for wave in (0, 7, 30):

        def moved(time, at, wave, push):
            along = np.interp(time, times, waves[0][:, wave])
            free = accelerations(single.tree, at[None, :1], at[None, 1:], np.zeros((1, 1)))[0]
            return [at[1], float(free[0]) + push * along]

        there, here = (
            solve_ivp(
                partial(moved, wave=wave, push=push), times[[0, -1]], np.concatenate(begin), t_eval=times,
                rtol=1e-9, atol=1e-11, max_step=0.01,
            ).y[0]
            for push in (small, -small)
        )  # fmt: skip
        slope = (there - here) / (2.0 * small)
        np.testing.assert_allclose(found[:, wave], slope, atol=1e-2 * np.abs(slope).max())


def test_waves_are_a_smooth_function_of_the_state():
    """Their sum has the variance and correlation of a Gaussian process, within what chance leaves."""
    state = np.random.default_rng(0).normal(size=(40, 3))
    waves = _waves(state, 1)[0]
    distance = np.linalg.norm(state[:, None] - state[None], axis=2)
    off = waves @ waves.T - np.exp(-(distance**2) / 2.0)
    assert np.sqrt(np.mean(off**2)) < 1.5 / np.sqrt(waves.shape[1])
    assert sum(one.shape[1] for one in _waves(state, 8)) == repeating.MOST_WAVES // 2


@pytest.mark.slow
def test_strengths_are_those_of_the_density_of_all_rows():
    rng = np.random.default_rng(3)
    moved = rng.normal(size=(60, 8)).cumsum(axis=0)
    seen = moved @ (0.4 * rng.normal(size=8)) + rng.normal(size=60)
    normal, right = moved.T @ moved, moved.T @ seen
    strengths, value = _strengths(normal, right, np.full(2, np.inf), float(seen @ seen))

    def density(first: float, second: float) -> float:
        weight = np.repeat([first, second], 4) ** 2
        return float(multivariate_normal(np.zeros(60), np.eye(60) + (moved * weight) @ moved.T).logpdf(seen))

    tried = np.geomspace(1e-2, 1e2, 41)
    along = _along(normal, right, slice(4, 8), np.repeat([0.3, 0.0], 4), tried)
    # but for a constant, that of no waves at all
    slow = [density(0.3, one) - density(0.0, 0.0) for one in tried]
    np.testing.assert_allclose(along, slow, atol=1e-6)
    tables = np.array([[density(first, second) for second in tried] for first in tried])
    best = np.unravel_index(np.argmax(tables), tables.shape)
    # grids of a fifth and a third: neither meets the maximum itself
    assert value == pytest.approx(tables[best] - density(0.0, 0.0), abs=0.1)
    for cause, values in enumerate((tables[:, best[1]], tables[best[0]])):
        weight = np.exp(values - values.max())
        mean_square = np.sum(weight * tried**2) / np.sum(weight)
        assert strengths[4 * cause] == pytest.approx(np.sqrt(mean_square), rel=0.05)


def test_strengths_without_bound_do_not_break_it():
    """Residuals of ten thousands of deviations, and waves that are all alike."""
    moved = np.ones((50, 6))
    seen = np.full(50, 1e9)
    strengths, value = _strengths(moved.T @ moved, moved.T @ seen, np.full(2, np.inf), float(seen @ seen))
    assert np.all(np.isfinite(strengths))
    assert np.isfinite(value)
