"""Turns and focal length of the camera: estimated where the key frames determine them, else held and doubted.

A link that turns before a camera that looks obliquely seems to change its length; how much, and how its ends
grow as they come nearer, is what determines the turns and, less well, the focal length. Before a camera that
looks squarely they would only take up the errors of the edges, which are systematic in part.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.mechanism import Mechanism
from monodyn.mechanism.upright import ROLL, by_roll
from monodyn.types import Camera
from monodyn.vision.drawing import camera as pinhole
from monodyn.vision.drawing.edges import MATCHED_PX
from monodyn.vision.drawing.follow import EdgeSearch
from monodyn.vision.locating.bundle import NOISE_PX, SETTLE, Bundle, KeyMasks, refine, spread
from monodyn.vision.locating.knowledge import camera_std
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.locating.variables import SceneVariables, scene_variables, springs

CLEAR = 4.0
"""Standard deviations from a camera that looks squarely, by noise alone, and by which the edges come nearer,
from which its turns are estimated. A part of the noise of edges is the same in all frames: of 48 drawn clips
square ones came up to 3.2. Of those turned by 4 deg or more one stayed below, at 3.9, and is held."""
DECISIVE = 0.5
"""Share of the squared residuals that what differs from the file, or from a camera that looks squarely, has
to take away to be the only answer. A codec rounds the corners of narrow bars in all frames, lenses bend and
pivots give way: ends that are not the true ones took away up to a fifth, and so did turns, but for those by a
lens or a thread that stretches, up to nine tenths (``BENDS``, ``STRETCHES``); true ones 9 to 93 %."""
OTHER_ENDING = 6.0
"""Standard deviations, by turns or by edges, from which two endings of the search are not the same."""
AS_USUAL = 1.0
"""Squared standard deviations from the usual camera by which two are as usual."""
ASIDE = 0.3
"""Turn of the cameras from which it is looked for again once it is known to be turned [rad]."""
FOLLOWED, WORTH = 1.0, 3.0
"""Standard deviations after the steps of ``TRIED``, which go only a part of the way: from the first on the
way is followed, to know what is in doubt; from the second on, then and at its end, the other sides are looked
at and the best ending may be believed."""
TRIED = (8.0, 4.0, 3.0)
"""Lengths of the edge search in the steps by which it is found out [px]: the ends of links, which show a turn
most, are far off before a camera that is taken to look squarely."""


@dataclass(frozen=True, eq=False)
class Looking:
    """How a camera looks at the plane, as far as the key frames tell.

    Attributes:
        bundle: The refinement, its camera turned where that is clear.
        doubted: A refinement in which the camera was free to turn, whatever came of it.
    """

    bundle: Bundle
    doubted: Bundle

    def known(self, bundle: Bundle) -> Bundle:
        """Return a later refinement of the same variables with what is known if the camera may be turned.

        Args:
            bundle: The later refinement.
        """
        if bundle.variables.names == self.doubted.variables.names:
            return bundle
        doubted = self.doubted
        return replace(
            bundle, variables=doubted.variables, information=doubted.information, unsettled=doubted.unsettled
        )

    def off(self, bundle: Bundle) -> np.ndarray:
        """Return how far the camera would turn, and all else with it, if it were free to, (param,).

        Args:
            bundle: A later refinement.
        """
        variables = self.known(bundle).variables
        if variables is bundle.variables:
            return np.zeros(len(variables.names))
        doubted, held = self.doubted, self.bundle
        return variables.read(doubted.mechanism, doubted.camera) - variables.read(held.mechanism, held.camera)

    def camera_std(self, bundle: Bundle, *, scale_free: bool) -> dict[str, float]:
        """Return the standard deviations of the camera's parameters [m, rad, px].

        Args:
            bundle: The last refinement.
            scale_free: True where nothing pins the common scale.

        Returns:
            Standard deviation by name; of what is held, about the value that it is held at.
        """
        return std_about(bundle, self.known(bundle), self.doubted.camera, scale_free=scale_free)


def std_about(held: Bundle, known: Bundle, away: Camera, *, scale_free: bool) -> dict[str, float]:
    """Return the standard deviations of the camera's parameters [m, rad, px].

    Args:
        held: The last refinement, in which turns may be held.
        known: The same with what is known if the camera may be turned.
        away: The camera where it was free to turn.
        scale_free: True where nothing pins the common scale.

    Returns:
        Standard deviation by name; of what is held, about the value that it is held at.
    """
    std = camera_std(known, scale_free=scale_free)
    for name in set(std) & set(pinhole.CAMERA_STD) - set(held.variables.names):
        std[name] = float(
            np.hypot(std[name], pinhole.value_of(away, name) - pinhole.value_of(held.camera, name))
        )
    return std


def open_turns(mechanism: Mechanism, held: Collection[str]) -> list[str]:
    """List the turns and the focal length of the camera that the pictures of a mechanism may show.

    Args:
        mechanism: The mechanism.
        held: Parameters of the camera that are given.

    Returns:
        The names; without the roll where the world has one hinge alone, for a turn of the picture looks like
        a turn of that hinge.
    """
    hidden = {ROLL} if by_roll(mechanism).any() else set()
    return [name for name in pinhole.CAMERA_STD if name not in held and name not in hidden]


def looking(
    masks: KeyMasks, bundle: Bundle, names: Sequence[str], asked: Sequence[str], search: EdgeSearch
) -> Looking:
    """Find out whether the camera looks obliquely, and then how.

    Args:
        masks: Masks of the key frames.
        bundle: A refinement before a camera that looks squarely, or as it was given.
        names: Turns and focal length that are open.
        asked: Those of them that are estimated whether or not the key frames determine them.
        search: How the edges are looked for.

    Returns:
        What was found.
    """
    if not names:
        return Looking(bundle, bundle)
    if ROLL in names and len(names) > 1:
        # it shows by itself, and what it takes away says nothing of the other turns
        bundle = looking(masks, bundle, [ROLL], asked, search).bundle
        names = [name for name in names if name not in bundle.variables.names]
    every = with_camera(bundle.variables, bundle.mechanism, names)
    tried = _refined(masks, bundle, every, search._replace(reaches=np.array(TRIED)))
    wanted, turned = any(name in asked for name in names), turned_by(tried, bundle, names)
    found = _refined(masks, tried, every, search, SETTLE) if wanted or turned > FOLLOWED else tried
    if wanted or (turned > WORTH and turned_by(found, bundle, names) > WORTH):
        found, others = from_other_sides(masks, bundle, found, search)
        if wanted or _believed(found, bundle, names):
            square = replace(bundle, variables=every)
            decided = fall(found, bundle) > DECISIVE * explicable(bundle, found)
            ways = [spread(found, other) for other in (*others, *([] if decided else [square]))]
            found = replace(found, alternatives=(*bundle.alternatives, *ways))
            return Looking(found, found)
    return Looking(bundle, found)


def from_other_sides(
    masks: KeyMasks, bundle: Bundle, found: Bundle, search: EdgeSearch
) -> tuple[Bundle, list[Bundle]]:
    """Return the best of what is found from cameras that look from either side, from above and from below.

    A link before a camera on the left is foreshortened as before one on the right: from where it looks
    squarely the steps may lead to the wrong side, and stay there. How the ends of links grow as they come
    nearer tells the sides apart, where the camera is near enough for that.

    Args:
        masks: Masks of the key frames.
        bundle: The refinement before a camera that looks squarely.
        found: One before a camera that is turned.
        search: How the edges are looked for.

    Returns:
        The one that is clearly likelier, or ``found``; this, too, where the camera's place is given. And one
        whose camera is turned otherwise and that is as likely, none without one.
    """
    wide = search._replace(reaches=np.array(TRIED))
    square = pinhole.around_origin(bundle.camera)

    def ended(aside: dict[str, float]) -> Bundle:
        camera = pinhole.from_origin(pinhole.with_values(square, aside))
        tried = _refined(masks, replace(bundle, camera=camera), found.variables, wide)
        return _refined(masks, tried, found.variables, search, SETTLE)

    names = ("camera.yaw", "camera.pitch") if found.variables.about_origin else ()
    sides = [{name: turn} for name in names if name in found.variables.names for turn in (ASIDE, -ASIDE)]
    endings = [found, *on_all_cores(ended, sides)]
    gains = [_gain(ending, bundle, bundle) for ending in endings]
    # of those that nothing clearly tells apart the first whose camera is about as usual as that of any
    near = [one for one, gain in zip(endings, gains, strict=True) if gain > max(gains) - OTHER_ENDING**2]
    unusual = [_unusual(ending, bundle) for ending in near]
    best = near[int(np.argmax(np.array(unusual) < min(unusual) + AS_USUAL))]
    turns = [name for name in pinhole.CAMERA_TURNS if name in found.variables.names]
    for other in endings:
        if _gain(best, other, bundle) < OTHER_ENDING**2 and turned_by(best, other, turns) > OTHER_ENDING:
            return best, [other]
    return best, []


def with_camera(before: SceneVariables, mechanism: Mechanism, names: Sequence[str]) -> SceneVariables:
    """Return the variables of a refinement and further parameters of the camera.

    Args:
        before: The variables.
        mechanism: The mechanism.
        names: The parameters.
    """
    more = scene_variables(mechanism, [*before.names, *names])
    return replace(
        more, start=before.start, length=before.length, thick=before.thick, focal=before.focal,
        creeps=np.concatenate((before.creeps, np.zeros(len(names), dtype=bool))),
        about_origin=before.about_origin,
    )  # fmt: skip


def _refined(
    masks: KeyMasks, bundle: Bundle, variables: SceneVariables, search: EdgeSearch, settle: int = 0
) -> Bundle:
    guess = SceneGuess(bundle.mechanism, bundle.camera, bundle.positions, np.zeros(len(bundle.positions)))
    return refine(masks, guess, variables, search, settle=settle)


def _believed(found: Bundle, before: Bundle, names: Sequence[str]) -> bool:
    """Return whether turns are clear, by what is known of them and by the edges that they bring nearer.

    Edges that are wrong where the mechanism moves fast, blurred ones, draw the camera far round; then they
    stay farther from the outline than the noise by which the turns would seem to be known.
    """
    within = float(np.sqrt(np.mean(found.rms_px**2))) <= NOISE_PX
    nearer = float(np.sqrt(max(_gain(found, before, before), 0.0)))
    clear = min(turned_by(found, before, names), nearer)
    return within and clear > CLEAR


def _gain(found: Bundle, before: Bundle, held: Bundle) -> float:
    """Return by how much a refinement is likelier than another, as a fall of squared deviations: what its
    edges come nearer, less what its camera is farther from what is usual, ``held``.

    Before a telephoto lens both sides look alike, so that a few edges may prefer one that hardly anybody has.
    """
    return fall(found, before) - _unusual(found, held) + _unusual(before, held)


def _unusual(found: Bundle, held: Bundle) -> float:
    """Return how far a camera is from the usual one, in squared standard deviations."""
    off = 0.0
    for name in set(pinhole.CAMERA_STD) & set(found.variables.names):
        value, usual = pinhole.value_of(found.camera, name), pinhole.value_of(held.camera, name)
        away = value - usual if name in pinhole.CAMERA_TURNS else np.log(value / usual)
        off += float(away / pinhole.CAMERA_STD[name]) ** 2
    return off


def fall(found: Bundle, before: Bundle) -> float:
    """Return by how much the squared residuals have fallen, over the variance of an edge.

    Args:
        found: A refinement.
        before: Another one of the same key frames, whose number of samples counts.
    """
    return remaining(before, before.samples) - remaining(found, before.samples)


def explicable(bundle: Bundle, other: Bundle) -> float:
    """Return the squared residuals that another refinement can take away, over the variance of an edge.

    Samples on which that one has no edge, as where something hides the outline, tell nothing of the two.

    Args:
        bundle: The refinement.
        other: The other one, of the same key frames.
    """
    met = replace(other, rms_px=np.zeros(len(other.rms_px)))
    return remaining(bundle, bundle.samples) - remaining(met, bundle.samples)


def remaining(bundle: Bundle, samples: np.ndarray) -> float:
    """Return the squared residuals of a refinement, over the variance of an edge.

    A sample without an edge is at least as far off as an edge may be; an outline that left the picture has no
    samples: both count with those of another refinement.

    Args:
        bundle: The refinement.
        samples: The number of samples that count in each key frame, (key frame,).
    """
    squares = bundle.matched * bundle.rms_px**2 + (1.0 - bundle.matched) * MATCHED_PX**2
    return float(samples @ squares) / NOISE_PX**2


def turned_by(found: Bundle, before: Bundle, names: Sequence[str]) -> float:
    """Return how far the camera has turned away from what was held, in standard deviations.

    Args:
        found: A refinement with its turns free.
        before: The one before.
        names: What was free in addition.
    """
    variables = found.variables
    x = variables.read(found.mechanism, found.camera)
    information = found.information + np.diag(
        np.where([name in pinhole.PARAMETERS for name in variables.names], 0.0, springs(variables, x)[1])
    )
    at = [variables.names.index(name) for name in names if name in pinhole.CAMERA_TURNS]
    if not at:
        return 0.0
    off = np.array([pinhole.value_of(found.camera, variables.names[i]) for i in at])
    off -= [pinhole.value_of(before.camera, variables.names[i]) for i in at]
    # the weak springs make the matrix regular along the common scale
    covariance = np.linalg.pinv(information, hermitian=True)[np.ix_(at, at)]
    return float(np.sqrt(off @ np.linalg.solve(covariance, off)))
