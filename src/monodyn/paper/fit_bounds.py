"""A start in, scales and bounds of the unknowns out, as the published search needs them.

The paper names no bounds. Here sizes stay within a factor of what file or picture give, and torques and
frictions within what weight and inertia of the motion itself require.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.estimation.record.smooth import Smoothed
from monodyn.mechanism.tree import BRAKES, PASSIVE
from monodyn.paper.fixed_start import FixedStart
from monodyn.paper.torque import inverse_dynamics

SIZE_REACH = float(np.log(10.0))
"""Positive parameters are looked for within a factor of ten of what file or picture give."""
FREE_LENGTH_REACH = float(np.log(3.0))
"""Lengths under free torques within a factor of three: any of them explains the motion."""
MOST_LOADS = {"fourier": 10.0, "free": 3.0}
"""Torques up to this many times that of weight and inertia."""
TYPICAL_CHANGE = 0.1
"""Typical change of a logarithm, by which the search scales it."""


def bounded(
    fixed: FixedStart, x: np.ndarray, smoothed: tuple[Smoothed, ...]
) -> tuple[FixedStart, np.ndarray]:
    """Choose scales and bounds of the unknowns for a start.

    Args:
        fixed: The problem.
        x: Coordinates of the start, (param,).
        smoothed: Smooth motion of each record.

    Returns:
        The problem with the scales, and lower and upper bounds of the coordinates, (2, param).
    """
    centre, reach = centred(fixed, x)
    load, rate = _loads(fixed, centre, smoothed)
    unknowns, loads = fixed.problem.unknowns, MOST_LOADS.get(fixed.problem.mechanism.torque, 0.0)
    joints = {joint.name: i for i, joint in enumerate(fixed.problem.mechanism.joints)}
    scale, low, high = np.full(len(x), TYPICAL_CHANGE), centre - reach, centre + reach
    # logarithms keep the bounds of a factor; everything else is bounded by what the motion's own loads are
    for p in np.flatnonzero(~unknowns.log):
        kind, joint = unknowns.kinds[p], joints.get(unknowns.owners[p], 0)
        if kind == "torque":
            scale[p], low[p], high[p] = 0.1 * load[joint], -loads * load[joint], loads * load[joint]
        elif kind in BRAKES:
            most = load[joint] / rate[joint] ** BRAKES[kind]
            scale[p], low[p], high[p] = 0.01 * most, 0.0, max(most, 10.0 * x[p])
        else:
            scale[p], low[p], high[p] = max(abs(x[p]), 1e-2), -np.inf, np.inf
    low, high = np.maximum(low, unknowns.lower), np.minimum(high, unknowns.upper)
    return replace(fixed, scale=scale), np.stack((np.minimum(low, high), high))


def centred(fixed: FixedStart, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle of the bounds of logarithms and their half width.

    Sizes are looked for about those of file or picture, lengths in the common scale of the start: a start
    that matches accelerations may have bodies that are a tenth or a thousand times as thick.

    Args:
        fixed: The problem.
        x: Coordinates of the start, (param,).

    Returns:
        Coordinates of the middle and half widths, both (param,).
    """
    unknowns = fixed.problem.unknowns
    length, thickness = unknowns.of_kind("length"), unknowns.of_kind("thickness")
    sized = unknowns.x0 + np.where(length, np.log(fixed.problem.size(x)), 0.0)
    centre = np.where((length | thickness) & unknowns.log, sized, x)
    free = fixed.problem.mechanism.torque == "free"
    return centre, np.where(length & free, FREE_LENGTH_REACH, SIZE_REACH)


def _loads(fixed: FixedStart, x: np.ndarray, smoothed: tuple[Smoothed, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Typical torque of weight and inertia [N m or N] and rate [rad/s or m/s] of each joint, (dof,)."""
    mechanism = fixed.problem.mechanism_at(x)
    links = mechanism.tree.links.copy()
    links[:, PASSIVE] = 0.0
    bare = replace(mechanism.tree, links=links)
    # without gravity inertia remains; each is taken separately, because they may cancel in a slow swing
    floating = replace(bare, gravity=np.zeros(2))
    squares, rates, rows = np.zeros(len(links)), np.zeros(len(links)), 0
    for k, found in enumerate(smoothed):
        q, v, a = true_motion(fixed, x, k, found)
        still = np.zeros_like(v)
        weight = inverse_dynamics(mechanism, q, still, still, tree=bare)
        inertia = inverse_dynamics(mechanism, q, v, a, tree=floating)
        squares += (weight**2 + inertia**2).sum(axis=0)
        rates += (v**2).sum(axis=0)
        rows += len(q)
    return np.maximum(np.sqrt(squares / rows), 1e-12), np.maximum(np.sqrt(rates / rows), 1e-6)


def true_motion(
    fixed: FixedStart, x: np.ndarray, record: int, found: Smoothed
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bring the smooth motion of a record into metres and true time.

    Args:
        fixed: The problem.
        x: Coordinates, (param,).
        record: Which record.
        found: Its smooth motion.

    Returns:
        Positions, rates and accelerations, each (frame, dof).
    """
    problem = fixed.problem
    unit, stretch = np.where(problem.data.slide[record], problem.size(x), 1.0), problem.stretch(x)
    return found.position * unit, found.velocity * unit / stretch, found.acceleration * unit / stretch**2
