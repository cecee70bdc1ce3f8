"""What the key frames of a refinement know of the sizes, the places of geoms and the camera."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monodyn.mechanism import Measured, Mechanism
from monodyn.mechanism.upright import ROLL
from monodyn.types import Camera
from monodyn.vision.drawing.camera import CAMERA_TURNS, PARAMETERS, pixels, value_of
from monodyn.vision.drawing.rig import longest_reach, rig_of, root_slides
from monodyn.vision.locating.bundle import Bundle

UNSEEN = 16.0
"""Information of a logarithm, or of a ratio to a length, below which a size or place is not determined."""
STEP = 1e-6
"""Step of the differences by variable of the refinement."""
THREAD_PX = 3.0
"""Width below which what holds a ball is a thread and not a rod [px]."""
STRETCHES = 0.015
"""Standard deviation of the logarithm of a thread's length as the path of its ball shows it. Cotton stretches
by half a per cent under its ball, and most at the lowest point, where it is pulled most: the radius of the
path changes by three times as much. A hook that gives way by millimetres does the same."""
BENDS = 0.006
"""Standard deviation of what a lens bends in the picture's corner, as a share of the distance from the
middle: makers correct to a per cent, and it may be anywhere within. It is less elsewhere, with the square of
the distance."""
TURNS = 0.05
"""Standard deviation of the turns of a body from which they show where its hinge is [rad]."""
LOADED = 0.02
"""Share of a direction that is not seen from which on a place is part of it."""


def size_information(bundle: Bundle, *, scale_free: bool) -> Measured:
    """Return what the key frames know of the sizes, camera and offsets eliminated.

    Args:
        bundle: A refined bundle.
        scale_free: True where nothing pins the common scale; then the information along it, which stems
            only from thicknesses and offsets held at their start, is taken out.

    Returns:
        Information matrix on the logarithms of the sizes and the places' ratios. A place that no picture
        shows is known to where it stays hidden.
    """
    names, known, _ = _known(bundle, scale_free=scale_free)
    return Measured(names, 0.5 * (known + known.T))


def pendant_lengths(mechanism: Mechanism, camera: Camera) -> list[str]:
    """Name the lengths of which a picture shows the far end alone: from a pivot outside of it, and those of
    bodies that are a ball on a thread.

    Args:
        mechanism: The mechanism.
        camera: The camera.

    Returns:
        The names.
    """
    shapes, border = mechanism.shapes, np.array([camera.width, camera.height]) - 0.5
    width_px = 2.0 * shapes.radius * camera.focal / camera.depth
    round_, thin = np.diff(shapes.first) == 1, (width_px > 0.0) & (width_px < THREAD_PX)
    pivot = pixels(camera, np.zeros((1, 3)))[0]
    outside = not root_slides(mechanism) and bool(np.any((pivot < -0.5) | (pivot > border)))
    found = []
    for body in dict.fromkeys(shapes.body):
        own = np.array([name == body for name in shapes.body])
        thread = np.any(own & round_) and np.all(round_ | thin | ~own)
        if thread or (outside and body == mechanism.bodies[0]):
            found.append(f"{body}.length")
    return found


def hinge_px(bundle: Bundle) -> float:
    """Return the standard deviation of where along its first body a mechanism turns [px].

    A pivot that gives way in step with the swing looks like a hinge elsewhere. It is taken to do so by as
    much as the mechanism sways, which is what it does out of step.

    Args:
        bundle: A refined bundle; 0 where the first length is given or a thread's, the root slides or hangs
            outside of the picture, or it hardly turns, which shows no hinge at all.
    """
    length, turns = f"{bundle.mechanism.bodies[0]}.length", float(np.std(np.exp(1j * bundle.positions[:, 0])))
    known = length not in bundle.variables.names or length in pendant_lengths(bundle.mechanism, bundle.camera)
    return 0.0 if known or root_slides(bundle.mechanism) or turns < TURNS else bundle.sway_px / turns


def hidden_places(bundle: Bundle, *, scale_free: bool) -> list[str]:
    """Name the places of geoms that no picture determines, because an end lies inside of another geom.

    Args:
        bundle: A refined bundle.
        scale_free: True where nothing pins the common scale.

    Returns:
        The names.
    """
    return _known(bundle, scale_free=scale_free)[2]


def hidden_advice(places: Sequence[str]) -> list[str]:
    """Write the sentence for the user about places of geoms that no picture determines.

    Args:
        places: Their names.

    Returns:
        The sentence; none without such places.
    """
    if not places:
        return []
    names = ", ".join(places)
    return [
        f"An end that lies inside of another geom cannot be seen: {names} and the extent in that direction "
        "are known to half the width of what hides it. Give a measured value with --fix where that counts."
    ]


def _known(bundle: Bundle, *, scale_free: bool) -> tuple[tuple[str, ...], np.ndarray, list[str]]:
    """Return names of sizes and places, the information about them, and which places are hidden."""
    variables, values = bundle.variables, bundle.mechanism.values
    shown = variables.is_size | variables.is_place
    sizes, others = np.flatnonzero(shown), np.flatnonzero(~shown)
    # The Schur complement of the others: what is known of the sizes when the others are free to follow.
    # What no picture shows of these has no part in it, and may leave their matrix singular.
    rest = np.linalg.pinv(bundle.information[np.ix_(others, others)], hermitian=True)
    cross = bundle.information[np.ix_(sizes, others)]
    known = bundle.information[np.ix_(sizes, sizes)] - cross @ rest @ cross.T
    # Adding the same number to all logarithms is the common scale; places are ratios and do not change by it.
    # Eliminating that direction, instead of setting it to zero, keeps what is known of the ratios and makes
    # the matrix exactly blind to it.
    gauge = variables.is_size[sizes].astype(np.float64)
    along = known @ gauge
    if scale_free and gauge @ along > 1e-9 * np.trace(known):
        known = known - np.outer(along, along) / (gauge @ along)
    names = tuple(variables.names[i] for i in sizes)
    px = np.array([values[variables.against[i] or variables.names[i]] for i in sizes])
    px = px * bundle.camera.focal / bundle.camera.depth
    # (K^-1 + D)^-1 for a K that may be singular, D the variance that no number of frames takes away
    stretches = [{name: STRETCHES} for name in pendant_lengths(bundle.mechanism, bundle.camera)]
    allowed = [*bundle.alternatives, *stretches]
    ways = np.array([[way.get(name, 0.0) for name in names] for way in allowed])
    drawn = bundle.unsettled[sizes] if len(bundle.unsettled) else np.zeros(len(names))
    variance = np.diag((bundle.systematic_px / px) ** 2) + ways.T @ ways + np.outer(drawn, drawn)
    known = np.linalg.solve(np.eye(len(names)) + known @ variance, known)
    known = 0.5 * (known + known.T)
    is_place, hidden = variables.is_place[sizes], []
    while (worst := _worst_hidden(known, gauge, is_place)) is not None:
        hidden.append(names[worst])
        # each of them is named once
        is_place = is_place & (np.arange(len(names)) != worst)
        known[worst, worst] += 1.0 / _room(bundle.mechanism, names[worst]) ** 2
    return names, known, hidden


def _worst_hidden(known: np.ndarray, gauge: np.ndarray, places: np.ndarray) -> int | None:
    """Return the row of the place that no picture determines together with the other sizes, None without any.

    An end of a geom that lies inside of another one moves its middle and its extent together, unseen: each
    of them alone would seem to be known.
    """
    candidates = np.flatnonzero(places)
    if not len(candidates):
        return None
    # a stiff spring on the common scale, so that it does not count as a direction that is not seen
    part = known + UNSEEN / len(known) * 1e3 * np.outer(gauge, gauge)
    values, vectors = np.linalg.eigh(part)
    for value, loads in zip(values, np.abs(vectors.T), strict=True):
        if value >= UNSEEN:
            return None
        worst = int(candidates[np.argmax(loads[candidates])])
        if loads[worst] >= LOADED:
            return worst
    return None


def _room(mechanism: Mechanism, name: str) -> float:
    """Return the standard deviation of a hidden place, as a ratio to the size that it stands against: half of
    the largest width of the other geoms of its body, within which an end can hide."""
    place, stem = mechanism.parameter(name), name.rsplit(".", 1)[0]
    widths = [
        p.value
        for p in mechanism.parameters
        if p.kind == "width" and p.owner == place.owner and p.name != f"{stem}.width"
    ]
    return 0.5 * max(widths, default=place.value) / mechanism.values.get(place.against, 1.0)


def camera_std(bundle: Bundle, *, scale_free: bool) -> dict[str, float]:
    """Return the standard deviations of the refined camera parameters [m, rad, px].

    Args:
        bundle: A refined bundle.
        scale_free: True where nothing pins the common scale; then it is held, as for the mean size.

    Returns:
        Standard deviation by name.
    """
    names = bundle.variables.names
    information = bundle.information + 1e-6 * np.eye(len(names))
    covariance = covariance_of(information, bundle.variables.is_size, scale_free=scale_free)
    cameras = [name for name in PARAMETERS if name in names]
    slope = _camera_slope(bundle, cameras)
    variance = np.einsum("ci,ij,cj->c", slope, covariance, slope)
    variance += [shifted_turn(bundle, name, bent=True) ** 2 for name in cameras]
    for way in bundle.alternatives:
        variance += (slope @ [way.get(name, 0.0) for name in names]) ** 2
    return dict(zip(cameras, np.sqrt(np.maximum(variance, 0.0)).tolist(), strict=True))


def covariance_of(information: np.ndarray, sizes: np.ndarray, *, scale_free: bool) -> np.ndarray:
    """Return the covariance of refined variables, (param, param).

    Args:
        information: What is known of them, (param, param).
        sizes: True for sizes, which are logarithms, bool (param,).
        scale_free: True where nothing pins the common scale; then the mean logarithm of the sizes is held.
    """
    along = sizes.astype(np.float64)
    if scale_free and sizes.any():
        # a spring as stiff as all that is known holds it
        information = information + np.trace(information) * np.outer(along, along) / along.sum()
    # Each variable in the unit in which it alone would be known to 1: else the pseudo-inverse takes what is
    # hardly known, beside what is known a million times better, for rounding, and so for exactly known.
    unit = np.sqrt(np.maximum(np.diag(information), 0.0))
    unit = np.where(unit > 0, unit, 1.0)
    return np.linalg.pinv(information / np.outer(unit, unit), hermitian=True) / np.outer(unit, unit)


def shifted_turn(bundle: Bundle, name: str, *, bent: bool = False) -> float:
    """Return the turn of the camera that looks like edges shifted alike in all frames, or like a mechanism
    that sways as a whole between them [rad].

    Args:
        bundle: A refined bundle.
        name: A parameter of the camera; 0 for one that is no turn.
        bent: Or like a lens that bends and a thread that stretches, which leave the poses as they are shown.
    """
    if name not in CAMERA_TURNS:
        return 0.0
    camera, off_px = bundle.camera, [bundle.systematic_px, bundle.sway_px]
    corner_px = 0.5 * float(np.hypot(camera.width, camera.height))
    # of a long thread the picture shows the end alone
    reach_px = min(longest_reach(rig_of(bundle.mechanism, camera)) * camera.focal / camera.depth, corner_px)
    if bent and name != ROLL:
        stretches = STRETCHES if pendant_lengths(bundle.mechanism, camera) else 0.0
        off_px += [stretches * reach_px, BENDS * reach_px**3 / corner_px**2]
    # turned about the line of sight the outermost edges go along a circle; turned aside they come nearer
    return float(np.linalg.norm(off_px)) / (reach_px if name == ROLL else reach_px**2 / camera.focal)


def _camera_slope(bundle: Bundle, cameras: list[str]) -> np.ndarray:
    """Differentiate camera parameters by the variables of the refinement, (camera, param)."""
    variables, mechanism, camera = bundle.variables, bundle.mechanism, bundle.camera
    x = variables.read(mechanism, camera)
    slope = np.zeros((len(cameras), len(x)))
    for i in range(len(x)):
        ends = []
        for sign in (1.0, -1.0):
            moved = x.copy()
            moved[i] += sign * STEP
            there = variables.camera_at(moved, camera)
            ends.append(np.array([value_of(there, name) for name in cameras]))
        slope[:, i] = (ends[0] - ends[1]) / (2.0 * STEP)
    return slope
