"""What is odd about a fit and its record, and what to do about it: plain sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from monodyn.estimation.fit import Estimate
from monodyn.estimation.parts import Premise
from monodyn.estimation.shooting.unknowns import Unknowns
from monodyn.estimation.verdict import gravity
from monodyn.estimation.verdict.uncertainty import NoiseFactors
from monodyn.estimation.wording import amount, listed
from monodyn.mechanism import Mechanism
from monodyn.mechanism.upright import ROLL, ROLL_STD

NOTED = 3.0
"""Residuals above this many times the stated noise are worth a sentence."""
HARDLY = 0.5
"""Share of its assumed standard deviation above which the roll of the camera is hardly known."""
TILTED = 4.0
"""Assumed standard deviations from level above which the roll of the camera is worth a sentence."""


def bounds_met(parameters: Sequence[Estimate]) -> list[str]:
    """Name the parameters that ended on a bound other than zero, and that it keeps from the data's value.

    One of which the data leave open all values may stand anywhere, on a bound too: others make up for it.

    Args:
        parameters: The estimates.

    Returns:
        Sentences; none where no bound was met.
    """
    other = [p.name for p in parameters if p.at_bound and p.value != 0 and np.isfinite(p.std)]
    return (
        [f"{listed(other)} ended on a bound; widen the bound or check the mechanism file."] if other else []
    )


class Assumed(NamedTuple):
    """What a model assumed that may not hold, and then would leave a misfit.

    Attributes:
        uniform: Bodies were taken to be uniform.
        frictionless: Dry frictions that were taken to be zero.
        level: Gravity was taken to act where the measured angles have it.
    """

    uniform: bool
    frictionless: Sequence[str]
    level: bool


def misfit(
    mechanism: Mechanism, rms: Mapping[str, float], noise: NoiseFactors, assumed: Assumed
) -> list[str]:
    """Report where the residual is far above the stated noise, and what the model may lack.

    Args:
        mechanism: Gives the joints.
        rms: Root mean square of the residual by joint [rad or m].
        noise: How residuals compare with the stated noise.
        assumed: What may be the reason.

    Returns:
        Sentences; none where every residual is near its noise.
    """
    advice, systematic = [], False
    for (joint, value), ratio, slow in zip(rms.items(), noise.size, noise.slow, strict=True):
        if ratio > NOTED:
            # what a model lacks changes as slowly as the motion does; noise does not
            reason = " and changes slowly: the model lacks something, or" if slow else ":"
            systematic |= bool(slow)
            advice.append(
                f"The residual of {joint}, {amount(mechanism, joint, value)}, is {ratio:.3g} times the "
                f"noise of its samples{reason} the record is less exact than these suggest; the intervals "
                "are widened accordingly."
            )
    if not systematic:
        return advice
    if assumed.uniform:
        advice.append("Bodies were taken to be uniform; if they are not, try --identify.bodies free.")
    if assumed.frictionless:
        names = " ".join(assumed.frictionless)
        advice.append(f"Dry friction was taken to be zero; --free {names} estimates it.")
    if assumed.level:
        advice.append(
            "Gravity was taken to act straight down where the angles are measured; where it does not (a "
            "camera out of level, the zero of an encoder), --free camera.roll estimates the tilt and --fix "
            "camera.roll=VALUE [rad] gives it (positive turns the picture of the mechanism clockwise)."
        )
    return advice


def tilt(parameters: Sequence[Estimate]) -> list[str]:
    """Report a roll of the camera that is larger than usual, or that the motion hardly determines.

    Args:
        parameters: The estimates.

    Returns:
        Sentences; none where the roll was not estimated, or is as usual.
    """
    found = [p for p in parameters if p.name == ROLL and p.free]
    if not found:
        return []
    roll, usual = found[0], f"{np.degrees(ROLL_STD):.0f} deg"
    if roll.std > HARDLY * ROLL_STD:
        return [
            f"The motion hardly determines camera.roll: the camera is taken to be level within {usual} "
            "(standard deviation), and angles against gravity are known no better than that; give the roll "
            "with --fix camera.roll=VALUE [rad]."
        ]
    if abs(roll.value) > TILTED * ROLL_STD:
        return [
            f"Gravity acts {abs(np.degrees(roll.value)):.3g} deg from straight down in the picture, more "
            "than a camera is usually out of level: if it was not, the mechanism file is not that of the "
            "clip, or the clip is turned; --fix camera.roll=0 holds the camera level."
        ]
    return []


def one_roll(records: int) -> list[str]:
    """Report that one roll of the camera was estimated for several records.

    Args:
        records: Number of records whose positions were measured against the picture.

    Returns:
        Sentences; none for a single record.
    """
    if records < 2:
        return []
    return [
        f"One camera.roll was taken for all {records} records: where the camera was turned otherwise in one "
        "of them, its angles against gravity are off by the difference, which no interval contains. "
        "Positions against gravity (poses.csv of a run of each clip by itself) have no roll in common."
    ]


def free_torques(mechanism: Mechanism) -> list[str]:
    """List the given values on which free torques depend, and that they end with the record.

    Args:
        mechanism: The mechanism under the torques.

    Returns:
        Sentences.
    """
    kinds = ("length", "thickness", "mass", "inertia")
    held = [p.name for p in mechanism.parameters if p.free and not p.follows and p.kind in kinds]
    advice = []
    if held:
        advice.append(
            "Any sizes and masses explain a motion together with free torques: they were held at values that "
            f"explain most of it without ({listed(held, 8)}), and the torques are in proportion to them; "
            "give measured values with --fix."
        )
    advice.append("No torque is known after the fitted frames: a prediction goes on without any.")
    return advice


def integration(substeps: int, error: float, bound: float) -> list[str]:
    """Report that the integration error of the fitted motion stays above its bound.

    Args:
        substeps: Integration steps between two time stamps.
        error: The error [rad or m].
        bound: Its bound [rad or m].

    Returns:
        Sentences; none where the bound is kept.
    """
    if error <= bound:
        return []
    return [
        f"With {substeps} integration steps between time stamps, the most there are, the motion is exact to "
        f"{error:.2g} rad (m for slides) and not to the required {bound:.2g}; fit a shorter record, or give "
        "a larger --identify.error-bound if that is exact enough."
    ]


def limits(mechanism: Mechanism, simulated: np.ndarray) -> list[str]:
    """Name the joints that the simulated motion, which has no stops, carries past their limits.

    Args:
        mechanism: Gives the joints.
        simulated: Simulated positions [rad or m], (row, dof).

    Returns:
        Sentences; none where all limits are kept.
    """
    advice = []
    for i, joint in enumerate(mechanism.joints):
        if simulated[:, i].min() < joint.lower or simulated[:, i].max() > joint.upper:
            low, high = (amount(mechanism, joint.name, end) for end in (joint.lower, joint.upper))
            advice.append(
                f"The motion takes {joint.name} past its limits, {low} to {high}; stops are not simulated, "
                "so leave out the frames in which it touches them."
            )
    return advice


def contradictions(negative: float) -> list[str]:
    """Report that the picture's knowledge of sizes was partly negative, by more than rounding.

    Args:
        negative: Size of that part against the largest, as in `Prior`.

    Returns:
        Sentences.
    """
    if negative <= 1e-6:
        return []
    return [
        "The picture's information about the sizes contradicts itself (its matrix is negative in some "
        "direction); that part was left out, so that the motion alone determines the sizes there."
    ]


def weightless(mechanism: Mechanism) -> bool:
    """Return whether nothing has weight in the file's plane of motion, and no motion tells sizes.

    Args:
        mechanism: The mechanism.
    """
    return mechanism.values["gravity"] == 0.0 and not mechanism.parameter("gravity").free


def without_weight(mechanism: Mechanism) -> list[str]:
    """Say that nothing has weight in the file's plane of motion.

    Args:
        mechanism: The mechanism.

    Returns:
        Sentences; none where gravity acts or is estimated.
    """
    if not weightless(mechanism):
        return []
    return [
        "In this mechanism file no gravity acts in the plane of motion: its hinges turn about the vertical, "
        'as on a table, or gravity is off. If it hangs or stands, state level axes, as axis="0 1 0", and '
        "gravity."
    ]


def clock(mechanism: Mechanism, parameters: Sequence[Estimate]) -> list[str]:
    """Name what identified lengths depend on; a time scale that stays open counts as none.

    Args:
        mechanism: Gives the kinds of the parameters.
        parameters: The estimates.

    Returns:
        Sentences.
    """
    free = {p.name: p for p in parameters if p.free}
    if "gravity" in free or ("time_scale" in free and np.isfinite(free["time_scale"].std)):
        return []
    if weightless(mechanism):
        return []
    if not any(p.kind == "length" for p in mechanism.parameters if p.name in free):
        return []
    return [
        Premise(
            "Lengths follow from gravity and take the time stamps for real time: in a clip k times slower "
            "than life they come out k^2 times too long."
        )
    ]


def taken_gravity(mechanism: Mechanism) -> list[str]:
    """Report how well gravity is known where it is the file's.

    Args:
        mechanism: The mechanism.

    Returns:
        Sentences.
    """
    taken = mechanism.values["gravity"]
    std = gravity.GRAVITY_STD * taken
    return [
        Premise(
            f"Gravity in the plane of motion is taken to be {taken:.4g} +- {std:.2g} m/s^2, which the "
            "intervals of what follows from it contain; --fix gravity=VALUE [m/s^2] gives that of the place "
            "exactly."
        )
    ]


def taken_densities(mechanism: Mechanism) -> list[str]:
    """Report how well densities are known where they are those of a bundled mechanism.

    Args:
        mechanism: The mechanism.

    Returns:
        Sentences.
    """
    names = gravity.taken_densities(mechanism)
    if not names:
        return []
    factor = float(np.exp(gravity.DENSITY_STD))
    given = " ".join(f"{name}=VALUE" for name in names)
    return [
        f"Nobody has stated {listed(names)}: {mechanism.values[names[0]]:.4g} kg/m^3 is the bundled "
        f"mechanism's, taken to be right within a factor of {factor:.2g} (one standard deviation), which the "
        f"intervals of lengths, masses and friction contain; --fix {given} [kg/m^3] gives what they are."
    ]


def stamps(error: float) -> list[str]:
    """Report that the time stamps scatter, or something that grows with the rates as they would.

    Args:
        error: Standard deviation of the stamps as the residuals show it [s].

    Returns:
        Sentences; none where the stamps are exact.
    """
    if error == 0:
        return []
    return [
        "The residuals grow with the rate of the motion, as if the time stamps were off by about "
        f"{1e3 * error:.2g} ms from picture to picture. The intervals take that into account."
    ]


def outliers(samples: int, count: int, frames: Sequence[int]) -> list[str]:
    """Report how many samples were left out as gross errors.

    Args:
        samples: Number of measured rows.
        count: Number of those that were left out.
        frames: Their frame numbers; may be empty.

    Returns:
        Sentences; none where all were kept.
    """
    if count == 0:
        return []
    verb = "sample was" if samples == 1 else "samples were"
    where = f" (frame {listed([str(frame) for frame in frames], 12)})" if len(frames) else ""
    return [f"{count} of {samples} {verb} left out as gross errors{where}."]


def few(samples: int, unknowns: int) -> list[str]:
    """Report that the record is short for the number of unknowns.

    Args:
        samples: Number of measured positions.
        unknowns: Number of unknowns.

    Returns:
        Sentences; none for a long record.
    """
    if samples >= 4 * unknowns:
        return []
    return [
        f"{samples} measured positions are few for {unknowns} unknowns; more frames give smaller intervals."
    ]


def search_end(converged: bool) -> list[str]:
    """Report a search that did not reach its minimum.

    Args:
        converged: Whether it did.

    Returns:
        Sentences; none where it did.
    """
    if converged:
        return []
    return ["The search ended before the minimum was certain; allow more with --identify.evaluations."]


def starts_tried(tried: int) -> list[str]:
    """Report from how many starts was searched.

    Args:
        tried: Number of starts.

    Returns:
        Sentences; none for a search from one start.
    """
    return [f"{tried} starts were tried; the best of them is reported."] if tried > 1 else []


def turning_ahead(mechanism: Mechanism, unknowns: Unknowns) -> list[str]:
    """Say of dry friction that turns ahead of the rate where that is a matter of course, and where not.

    Args:
        mechanism: The identified mechanism.
        unknowns: What was estimated.

    Returns:
        One sentence where a lead was estimated, or none.
    """
    found = [p for p in mechanism.parameters if p.kind == "lead" and p.name in unknowns.names and p.value > 0]
    if not found:
        return []
    times = listed([f"{1e3 * p.value:.3g} ms ({p.name})" for p in found])
    return [
        f"Dry friction turns ahead of the rate, by {times}: so does the soft constraint of a simulator (of "
        f"MuJoCo, by half of solreffriction, about 10 ms unless a file says otherwise), but no bearing. In a "
        f"record of a real mechanism it stands for something else that acts where the motion reverses."
    ]


def zero_frictions(mechanism: Mechanism, unknowns: Unknowns) -> list[str]:
    """Name the dry frictions that are zero and were not estimated.

    Args:
        mechanism: The mechanism.
        unknowns: What was estimated.
    """
    dry = [p.name for p in mechanism.parameters if p.kind == "friction" and p.value == 0]
    return [name for name in dry if name not in unknowns.names]
