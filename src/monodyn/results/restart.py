"""An identified mechanism in, the same from another start out: any state, or any moment of its record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from monodyn.arrays import usual_step
from monodyn.errors import SettingsError
from monodyn.estimation.fit import Fit
from monodyn.estimation.parts import Start
from monodyn.estimation.wording import listed
from monodyn.mechanism import Mechanism
from monodyn.mechanism.simulate import acceleration_derivatives
from monodyn.names import known
from monodyn.results.fill import fill, moment

FARTHEST = 1e6
"""Positions and rates beyond which no mechanism is [SI]."""
MOST_STEPS = 1e5
"""Steps of a record over which its motion is carried on at most."""


def restart(
    fit: Fit,
    positions: Mapping[str, float] | None = None,
    rates: Mapping[str, float] | None = None,
    *,
    at: float | None = None,
    fix: Mapping[str, float] | None = None,
    record: int = 0,
) -> Fit:
    """Let an identified mechanism begin in another state, or at another moment of its record.

    A given state is exact: the bands of what follows are from the parameters, and what the model lacks.
    That of a moment has the errors of the fit, with their correlation to the parameters.

    Args:
        fit: The identified mechanism.
        positions: Position of every joint [rad or m], by name; None begins where the record is at ``at``.
        rates: Rates [rad/s or m/s], by name; those left out are zero.
        at: Time stamp at which it begins [s]; torques over time depend on it. Without it a given state begins
            at 0, and a record is carried on from its last fitted frame.
        fix: Parameters that have another value than was identified, by name; they are exact then.
        record: Which record.

    Returns:
        The fit with one record, which ends at ``at``: ``predict`` carries it on from there.

    Raises:
        SettingsError: Nothing was identified, there is no such record or joint, a joint has no position,
            rates are given without positions, something is not given by name, the time is far from the
            record, or a parameter that is fixed does not act on the motion, as a width beside a given mass,
            or the roll of the camera: positions are against gravity.
        MechanismError: From the mechanism: there is no such parameter, or it cannot have that value.

    Example:
        >>> let_go = monodyn.restart(fit, {"joint1": 0.5, "joint2": 0.0})  # doctest: +SKIP
        >>> monodyn.predict(let_go, until=5.0)  # doctest: +SKIP
    """
    begins = fit.start_of(record, "restart").time
    stamps = fit.time[record]
    usual = 0.0 if positions is not None else float(stamps[-1])
    time, step = usual if at is None else float(at), usual_step(stamps) or 1.0
    if not abs(time - begins) < MOST_STEPS * step:
        raise SettingsError(
            f"restart: expected a time stamp near the record, which begins at {begins:g} s, "
            f"got {time:g}; give one of the clip's clock."
        )
    if positions is None:
        if rates:
            raise SettingsError(
                "restart: expected rates together with positions, got rates alone; give both, or neither."
            )
        state, covariance = _moment(fit, time, record)
    else:
        dofs = len(fit.mechanism.joints)
        state = np.concatenate((_by_joint(fit, positions, whole=True), _by_joint(fit, rates or {})))
        covariance = np.zeros((len(fit.shared) + 2 * dofs,) * 2)
        covariance[: len(fit.shared), : len(fit.shared)] = fit.shared_covariance
    dofs = len(state) // 2
    # how far off the record's motion was is in the covariance of a moment, and a given state is exact
    lacks = fit.unmodelled
    start = Start(time, state[:dofs], state[dofs:], covariance[-2 * dofs :, -2 * dofs :])
    begun = replace(
        fit,
        starts=(start,),
        covariance=covariance,
        time=(stamps - stamps[-1] + time,),
        residual=(),
        torques=fit.torques[record : record + 1],
        common=fit.common[record : record + 1],
        unmodelled=None if lacks is None else lacks._replace(off=0.0 * lacks.off),
    )
    return _changed(begun, fix or {})


def _by_joint(fit: Fit, given: Mapping[str, float], *, whole: bool = False) -> np.ndarray:
    """Return what is given by joint, zero where nothing is, (dof,)."""
    _check_named(given, fit.mechanism.joints[0].name)
    joints = [joint.name for joint in fit.mechanism.joints]
    for name, value in given.items():
        if name not in joints:
            raise SettingsError(
                f"restart: joint '{name}' is not in the mechanism; {known('joints', joints, name)}"
            )
        if not abs(value) <= FARTHEST:
            raise SettingsError(
                f"restart: expected a number within {FARTHEST:g} of 0 for {name}, got {value:g}; correct it."
            )
    missing = [name for name in joints if whole and name not in given]
    if missing:
        every = ",".join(f"{name}={given.get(name, 0.0):g}" for name in joints)
        raise SettingsError(
            f"restart: expected a position of every joint, got none of {', '.join(missing)}; give all of "
            f"them, as {every}."
        )
    return np.array([float(given.get(name, 0.0)) for name in joints])


def _check_named(given: object, name: str) -> None:
    """Refuse what does not go by names."""
    if not isinstance(given, Mapping):
        raise SettingsError(
            f"restart: expected numbers by name, got {given}; name them, as {{'{name}': 0.5}}."
        )


def _moment(fit: Fit, time: float, record: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the state of a record at a time, and its covariance together with that of the parameters."""
    state, slopes = moment(fit, time, record=record)
    count, own = len(fit.shared), fit.motion_covariance(record)
    by_unknowns = np.concatenate((np.eye(count, len(own)), slopes))
    covariance = by_unknowns @ own @ by_unknowns.T
    # what the model lacks comes on top after the fitted frames
    at, there = count + np.arange(len(state)), fill(fit, np.array([time]), record=record)
    covariance[at, at] = np.concatenate((there.std[0], there.velocity_std[0])) ** 2
    return state, covariance


def _changed(fit: Fit, fix: Mapping[str, float]) -> Fit:
    """Return a fit some of whose parameters have another value, exactly."""
    if not fix:
        return fit
    _check_named(fix, "gravity")
    mechanism = fit.mechanism.with_choices(fix=fix)
    idle = set(fix) - acting(mechanism, list(fix), logged=bool(fit.torques))
    if idle:
        others = [p.name for p in mechanism.parameters if not p.follows]
        useful = sorted(acting(mechanism, others, logged=bool(fit.torques)), key=others.index)
        raise SettingsError(
            f"fix: expected parameters on which the motion depends ({', '.join(useful)}), got "
            f"{listed(sorted(idle), 12)}; leave {'it' if len(idle) == 1 else 'them'} out."
        )
    kept = [k for k, name in enumerate(fit.names) if name not in fix]
    estimates = tuple(
        replace(row, value=fix[row.name], std=0.0, lower=fix[row.name], upper=fix[row.name], free=False)
        if row.name in fix
        else row
        for row in fit.parameters
    )
    return replace(
        fit,
        mechanism=mechanism,
        parameters=estimates,
        covariance=fit.covariance[np.ix_(kept, kept)],
        tied=tuple(pair for pair in fit.tied if not set(pair) & set(fix)),
    )


def acting(mechanism: Mechanism, names: Sequence[str], *, logged: bool = False) -> set[str]:
    """Return which parameters the motion depends on: others are of the picture alone, or of no consequence.

    Args:
        mechanism: The mechanism.
        names: Names of parameters whose values do not follow from others.
        logged: True where known torques act, whose lag counts then.
    """
    directions, dofs = mechanism.directions(names), len(mechanism.joints)
    # any state will do, as long as everything moves, and nothing is in equilibrium
    rows = np.random.default_rng(0).uniform(0.5, 1.5, (3, 4, dofs))
    slopes = acceleration_derivatives(mechanism.tree, directions, *rows)[1][:, :, : len(names)]
    moved = np.any(slopes != 0.0, axis=(0, 1)) | (directions.clock != 0.0)
    moved[directions.entry[directions.entry >= 0]] = True
    moved |= logged & (directions.lag != 0.0)
    # at such rates friction has long turned, whatever its lead is; another clock of the stamps is another
    # motion on theirs
    values = mechanism.values
    turning = {f"{j.name}.lead" for j in mechanism.joints if values[f"{j.name}.friction"] > 0.0}
    always = {"time_scale", *turning}
    return {name for name, moves in zip(names, moved, strict=True) if moves or name in always}
