"""What a fit does not know, why, and which one extra measurement would tell: plain sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from monodyn.estimation.fit import Estimate
from monodyn.estimation.shooting.unknowns import MASS_KINDS, kind_of
from monodyn.mechanism import Mechanism

LENGTH_KINDS = ("length", "width", "tail", "tip", "gravity", "time_scale")


def listed(names: Sequence[str], most: int = 6) -> str:
    """Write names as a list: ``a, b and c``; a long one is cut short."""
    names = list(names)
    if len(names) > most:
        names = [*names[:most], f"{len(names) - most} more"]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def amount(mechanism: Mechanism, joint: str, value: float) -> str:
    """Write a joint position difference: degrees for a hinge, millimetres for a slide."""
    kind = next(j.kind for j in mechanism.joints if j.name == joint)
    return f"{np.degrees(value):.3g} deg" if kind == "hinge" else f"{1000.0 * value:.3g} mm"


def open_parameters(parameters: tuple[Estimate, ...], without_effect: Sequence[str]) -> list[str]:
    """Say which parameters the data leave open and what would fix them."""
    lost = [p.name for p in parameters if p.free and not np.isfinite(p.std) and p.name not in without_effect]
    weak = [p.name for p in parameters if p.free and np.isfinite(p.std) and not p.identifiable]
    regrouped = any(kind_of(name) == "com_x" for name in lost)
    masses = [name for name in lost if kind_of(name) in MASS_KINDS]
    centres = [name for name in lost if kind_of(name) in ("com_x", "com_y")]
    lengths = [name for name in lost if kind_of(name) in LENGTH_KINDS]
    advice = []
    if regrouped:
        advice.append(
            "Planar motion fixes how the inertias of free bodies act together (see the combinations), not "
            f"{listed([*masses, *centres], 20)} one by one; measured masses and centres of mass, given with "
            "--fix, would fix the rest."
        )
    elif masses:
        advice.append(
            f"The motion fixes {listed(masses, 12)} only in ratios (see the combinations); one of them, "
            "measured and given with --fix, fixes the mass scale."
        )
    if lengths:
        advice.append(_open_lengths(lengths))
    if without_effect:
        verb, it = ("does", "it") if len(without_effect) == 1 else ("do", "them")
        advice.append(
            f"{listed(without_effect, 12)} {verb} not change the motion, which says nothing about {it}."
        )
    if weak:
        advice.append(
            f"The data hardly fix {listed(weak)}: the error is as large as the value; a longer record or a "
            "livelier motion would help."
        )
    return advice


def _open_lengths(names: Sequence[str]) -> str:
    """Say that the data leave the scale of lengths open, and what would fix it."""
    them = listed(names, 12)
    sizes = [name for name in names if name not in ("gravity", "time_scale")]
    if "time_scale" not in names:
        return (
            f"The data do not fix {them} one by one; a measured length, or known values of gravity and of "
            "the time scale, given with --fix, would fix them."
        )
    rate = "the true frame rate (--rate for a clip, or --fix time_scale=VALUE)"
    if not sizes:
        return f"The data do not fix {them} one by one; {rate} or the value of gravity would fix the rest."
    known = f"A measured length, given with --fix, or {rate} would fix them."
    if "gravity" in names:
        known = f"Two of these would fix them: a measured length, the value of gravity, {rate}."
    return (
        f"The data do not fix {them} one by one: lengths are only known up to the time scale (see the "
        f"combinations). {known}"
    )


def percent(share: float) -> str:
    """Write a share in per cent."""
    return f"{100 * share:.0f} %" if abs(share) >= 0.095 else f"{100 * share:.2g} %"


def without_use(names: Sequence[str]) -> list[str]:
    """Say which given values nothing depends on, as thicknesses of bodies whose file states their mass."""
    if not names:
        return []
    verb = "was" if len(names) == 1 else "were"
    return [
        f"{listed(names, 12)} {verb} given, but the motion of this mechanism does not depend on "
        f"{'it' if len(names) == 1 else 'them'}: its file states masses; give those."
    ]


def no_harmonic(mechanism: Mechanism) -> list[str]:
    """Say that a periodic torque of a given period does not stand out from weight and inertia."""
    period = mechanism.values["torque.period"]
    return [
        f"A torque of period {period:.4g} s is under a hundredth of weight and inertia at every joint: it "
        "may be what the model lacks; nothing periodic need act."
    ]


def bounds(parameters: tuple[Estimate, ...]) -> list[str]:
    """Say which parameters ended on a bound."""
    zero = [p.name for p in parameters if p.at_bound and p.value == 0]
    other = [p.name for p in parameters if p.at_bound and p.value != 0]
    advice = []
    if zero:
        advice.append(f"{listed(zero)} came out as zero, the smallest value allowed: too small to be seen.")
    if other:
        advice.append(f"{listed(other)} ended on a bound; widen the bound or check the mechanism file.")
    return advice


def misfit(
    mechanism: Mechanism,
    rms: Mapping[str, float],
    against_noise: np.ndarray,
    autocorrelated: np.ndarray,
    *,
    uniform: bool,
    frictionless: Sequence[str],
    pictured: bool,
) -> list[str]:
    """Say where the residual is far above the stated noise, and what the model may lack.

    Args:
        mechanism: Gives the joints.
        rms: Root mean square of the residual by joint [rad or m].
        against_noise: The same in units of the stated noise, (dof,).
        autocorrelated: What neighbouring residuals share, from ``noise_factors``, (dof,).
        uniform: Whether to say that bodies were taken to be uniform.
        frictionless: Dry frictions that were taken to be zero and may not be.
        pictured: Whether the record comes from pictures, whose camera may have been tilted.

    Returns:
        Sentences; none where every residual is near its noise.
    """
    advice = []
    for (joint, value), ratio, spread in zip(rms.items(), against_noise, autocorrelated, strict=True):
        if ratio > 3.0:
            slow = " and changes slowly" if spread > 1.5 else ""
            advice.append(
                f"The residual of {joint}, {amount(mechanism, joint, value)}, is {ratio:.3g} times the "
                f"stated noise{slow}: the model lacks something, or the record is less exact than it says; "
                "the intervals are widened accordingly."
            )
    if advice and uniform:
        advice.append("Bodies were taken to be uniform; if they are not, try --identify.bodies free.")
    if advice and frictionless:
        advice.append(f"Dry friction was taken to be zero; --free {' '.join(frictionless)} estimates it.")
    if advice and pictured:
        advice.append(
            "Gravity was taken straight down in the picture; where the camera was not level, give its tilt "
            "with --fix camera.roll=VALUE [rad] (positive turns the picture of the mechanism clockwise)."
        )
    return advice


def beginning(mechanism: Mechanism, frames: Sequence[int], rms: Mapping[str, float]) -> str:
    """Say that the beginning of a record, ``frames`` of it, fits though the whole does not."""
    each = [f"{amount(mechanism, name, value)} ({name})" for name, value in rms.items()]
    return (
        f"The first {len(frames)} frames alone do fit, with rms residual {listed(each, 12)}: --fit-frames "
        f"{frames[0]}:{frames[-1] + 1} for a clip, or a table that ends there. Small faults of the model "
        "grow along a long or chaotic record."
    )


def free_torques(mechanism: Mechanism) -> list[str]:
    """Say what free torques rest on, and that they end with the record."""
    kinds = ("length", "thickness", "mass", "inertia")
    held = [p.name for p in mechanism.parameters if p.free and not p.follows and kind_of(p.name) in kinds]
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
    """Say that the integration error of the fitted motion, ``error``, stays above its bound [rad or m]."""
    if error <= bound:
        return []
    return [
        f"With {substeps} integration steps between time stamps, the most there are, the motion is exact to "
        f"{error:.2g} rad (m for slides) and not to the {bound:.2g} asked for; fit a shorter record, or give "
        "a larger --identify.error-bound if that is exact enough."
    ]


def limits(mechanism: Mechanism, simulated: np.ndarray) -> list[str]:
    """Say which joints the simulated motion carries to their limits, which it does not know."""
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
    """Say that the picture's knowledge of sizes was partly negative; rounding is not worth a word."""
    if negative <= 1e-6:
        return []
    return [
        "What the picture knows of the sizes contradicts itself (its information matrix is negative in some "
        "direction); that part was left out, so sizes rest on the motion alone there."
    ]


def proportions(tied: tuple[str, ...]) -> list[str]:
    """Say which sizes that count in the motion were neither measured nor estimated."""
    tied = tuple(name for name in tied if kind_of(name) in ("width", "tail", "tip"))
    if not tied:
        return []
    if len(tied) == 1:
        return [
            f"Nothing tells {tied[0]}; it keeps its proportion to the length of its body, and the intervals "
            "take that for exact. Give a measured value with --fix where its share of the inertia counts."
        ]
    return [
        f"Nothing tells {listed(tied, 12)}; they keep their proportion to the length of their body, and the "
        "intervals take that for exact. Give measured values with --fix where their share of the inertia "
        "counts."
    ]


def clock(parameters: tuple[Estimate, ...]) -> list[str]:
    """Say what identified lengths rest on; a time scale that stays open is as good as none."""
    free = {p.name: p for p in parameters if p.free}
    if "gravity" in free or ("time_scale" in free and np.isfinite(free["time_scale"].std)):
        return []
    if not any(kind_of(name) == "length" for name in free):
        return []
    return [
        "Lengths follow from gravity and take the time stamps for real time: in a clip k times slower than "
        "life they come out k^2 times too long."
    ]


def outliers(samples: int, count: int, frames: Sequence[int]) -> list[str]:
    """Say how many samples were left out as gross errors; ``frames`` may be empty."""
    if count == 0:
        return []
    verb = "sample was" if samples == 1 else "samples were"
    where = f" (frame {listed([str(frame) for frame in frames], 12)})" if len(frames) else ""
    return [f"{count} of {samples} {verb} left out as gross errors{where}."]


def few(samples: int, unknowns: int) -> list[str]:
    """Say that the record is short for what is asked of it."""
    if samples >= 4 * unknowns:
        return []
    return [
        f"{samples} measured positions are few for {unknowns} unknowns; more frames give smaller intervals."
    ]
