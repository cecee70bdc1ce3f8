"""From masks and topology to the scene: camera, sizes up to one common scale, and the first pose.

A global search on reduced key frames finds the mechanism; a joint refinement on the sub-pixel edges of the
key frames fits camera, sizes and poses; then the background is taken again with the mechanism masked out,
and the refinement repeated on the better masks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.types import Camera, Progress
from monodyn.vision.drawing.camera import PARAMETERS, X, with_values
from monodyn.vision.drawing.follow import EdgeSearch, MoveLimits, follow
from monodyn.vision.drawing.mismatch import pose_balance
from monodyn.vision.drawing.outline import covered_pixels
from monodyn.vision.drawing.rig import (
    SHOWN_KINDS,
    SIZE_KINDS,
    joint_limits,
    longest_reach,
    rig_of,
    root_slides,
)
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.locating.arrange import BETTER, arranged, freed
from monodyn.vision.locating.body import beside
from monodyn.vision.locating.bundle import (
    CAMERA_TURNS,
    SIDES,
    Bundle,
    KeyMasks,
    SceneVariables,
    refine,
    scene_variables,
)
from monodyn.vision.locating.colours import geom_colours
from monodyn.vision.locating.grow import SceneStart
from monodyn.vision.locating.keyframes import KeyFrames, key_frames
from monodyn.vision.locating.knowledge import camera_std, hidden_places, size_information
from monodyn.vision.locating.places import with_departed, with_names, without_unseen
from monodyn.vision.locating.scene import Scene
from monodyn.vision.locating.search import SceneGuess, as_thick, search_poses, search_scene, thinned
from monodyn.vision.locating.unit import growth, in_metres, scaled, units_per_metre
from monodyn.vision.settings import LocateSettings

VAGUE_FOCAL, VAGUE_TURN = 0.2, 0.1
"""Standard deviation of the focal length as a share of it, and of a turn [rad], from which it is called
vague."""
UNEXPLAINED_SHARE = 0.35
"""Share of the foreground outside of the mechanism, or of the mechanism outside of it, from which there is
advice."""
LEAST_MATCHED, LEAST_INSIDE = 0.55, 0.65
"""Share of outline samples on an edge and coverage inside of the outline above which a pose lies on its
mask."""
FEWEST = 3
"""Frames, besides a quarter of all, without which a choice of frames says nothing."""
LEAST_FITTING = 0.7
"""Share of the key frames in which the mechanism should lie on its mask."""
REFINED = 3
"""Guesses of the search that are refined on the reduced key frames."""
SAME_SHARE, SAME_LENGTH = 1e-3, 0.02
"""Difference of the shares of the foreground that two guesses leave, and of their lengths as a share, up to
which they ended in one place."""
MARGIN_PX = 3.0
"""Band around the located mechanism that does not count as background either [px]."""
COARSE = EdgeSearch(np.array([9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 4.0, 3.0, 3.0, 3.0]), 1.5)
"""How the edges are looked for in the reduced pictures [reduced px]."""
FINE = EdgeSearch(np.array([8.0, 7.0, 6.0, 5.0, 5.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0]), 3.0)
"""How they are looked for in the whole pictures after that [px]."""
LAST = EdgeSearch(np.array([5.0, 4.0, 4.0, 4.0, 3.0, 3.0, 3.0, 3.0]), 3.0)
"""How they are looked for over the better background [px]."""
POSE = EdgeSearch(np.array([8.0, 6.0, 5.0, 4.0, 4.0]), 3.0)
"""How they are looked for in a single frame, for its pose alone [px]."""


@dataclass(frozen=True, eq=False)
class Sought:
    """What is to be located.

    Attributes:
        masks: The soft foreground of the clip.
        mechanism: Topology, shape kinds and start sizes; its fixed parameters stay as they are.
        settings: How the search goes.
        fix: Values of ``camera.*`` parameters that must stay.
        free: ``camera.*`` parameters to estimate in addition to x, y and depth.
        progress: Called as the steps go.
    """

    masks: Masks
    mechanism: Mechanism
    settings: LocateSettings
    fix: Mapping[str, float]
    free: Sequence[str]
    progress: Progress

    @property
    def start_camera(self) -> Camera:
        """The camera that the search starts from."""
        video = self.masks.video
        focal = self.settings.focal or float(max(video.width, video.height))
        return with_values(Camera(video.width, video.height, focal), dict(self.fix))

    @property
    def pinned(self) -> frozenset[str]:
        """Parameters that may not change."""
        held = [p for p in self.mechanism.parameters if not p.free and not p.follows]
        # thicknesses of bodies of given mass are held in an identification, but nobody measured them
        told = [p.name for p in held if p.kind != "thickness" or p.name in self.mechanism.chosen]
        return frozenset([*self.fix, *told])

    @property
    def start(self) -> SceneStart:
        """Mechanism and camera that the search starts from, in units of the distance from the camera."""
        camera, mechanism = self.start_camera, self.mechanism
        if "camera.depth" in self.fix:
            factor = 1.0 / camera.depth
        else:
            factor = 1.0 / longest_reach(rig_of(mechanism, camera))
        camera = replace(camera, x=camera.x * factor, y=camera.y * factor, depth=1.0)
        # without a scale a place in metres says nothing of where things are in the picture
        open_places = set() if "camera.depth" in self.fix else {"camera.x", "camera.y"}
        return SceneStart(scaled(mechanism, factor), camera, self.pinned - open_places)


def find_scene(sought: Sought) -> Scene:
    """Find camera, sizes and first pose from the topology alone.

    Args:
        sought: The masks, the mechanism, and what is known of the camera.

    Returns:
        The scene.
    """
    masks, settings, start = sought.masks, sought.settings, sought.start
    names = _refined_names(sought)
    sought.progress("locate", 0, 4)
    frames = key_frames(masks, len(start.mechanism.shapes.radius))
    guesses = [_placed(sought, g) for g in search_scene(frames, start, settings.search_frames)]
    sought.progress("locate", 1, 4)
    few = frames.only(frames.most_distinct(settings.search_frames))
    refined: list[SceneGuess] = []
    for guess in guesses[:REFINED]:
        refined.append(_refined_coarsely(few, guess, start, names))
        # two starts that end in one place are enough
        if len(refined) == 2 and _alike(*refined):
            break
    guess = min(refined, key=lambda g: g.score + BETTER * len(freed(g.mechanism, start.mechanism)))
    variables = _variables(guess, start, names)
    sought.progress("locate", 2, 4)
    # What is known of the mechanism makes the masks better, twice: first their colours, measured inside of
    # the outlines, then the background, taken where the outlines leave it free.
    masks, frames, guess = _with_colours(masks, frames, guess)
    bundle, rows = _refined_whole(frames, guess, variables, FINE, settings.refine_frames)
    whole = KeyMasks([frames.frames[i].planes for i in rows], frames.view)
    bundle, variables = with_departed(whole, bundle, variables, FINE)
    tied = without_unseen(bundle, start.mechanism)
    sought.progress("locate", 3, 4)
    masks, frames, guess = _with_background(masks, frames, tied)
    variables = variables if tied is bundle else _variables(guess, start, names)
    bundle, rows = _refined_whole(frames, guess, variables, LAST, settings.refine_frames)
    sought.progress("locate", 4, 4)
    return _scene(sought, masks, frames.only(rows), bundle)


def _alike(one: SceneGuess, other: SceneGuess) -> bool:
    """Return whether two guesses have the same lengths and leave as much of the foreground."""
    names = [p.name for p in one.mechanism.parameters if p.kind == "length"]
    mine, others = (np.array([guess.mechanism.values[name] for name in names]) for guess in (one, other))
    return abs(one.score - other.score) < SAME_SHARE and np.allclose(mine, others, rtol=SAME_LENGTH, atol=0.0)


def _placed(sought: Sought, guess: SceneGuess) -> SceneGuess:
    """Move the camera of a guess to where it has to stay."""
    metre = units_per_metre(guess.mechanism, guess.camera, sought.mechanism, sought.fix, sought.pinned)
    held = {name: value * metre for name, value in sought.fix.items() if name in ("camera.x", "camera.y")}
    return replace(guess, camera=with_values(guess.camera, held))


def _variables(guess: SceneGuess, start: SceneStart, names: Sequence[str]) -> SceneVariables:
    """Return what is refined of a guess, held by weak springs: lengths, and what has left its place in the
    file, to those of the guess, other sizes to their proportions in the file."""
    file = scaled(start.mechanism, growth(guess.mechanism, start.mechanism))
    lengths = {p.name: p.value for p in guess.mechanism.parameters if p.kind == "length"}
    variables = scene_variables(file.with_values(lengths), names)
    more = freed(guess.mechanism, file)
    return with_names(variables, guess.mechanism, more) if more else variables


def _refined_names(sought: Sought) -> list[str]:
    """List the parameters that the pictures determine."""
    mechanism = sought.mechanism
    shown = [p for p in mechanism.parameters if p.kind in (*SHOWN_KINDS, SIDES) and not p.follows]
    names = [p.name for p in shown if p.name not in sought.pinned]
    # where a slide of the root is zero is a matter of choice: the camera's place is held and fixes it
    held = {"camera.x" if column == X else "camera.y" for _, column in root_slides(mechanism)}
    cameras = [name for name in ("camera.x", "camera.y", "camera.depth", *sought.free) if name not in held]
    return names + [name for name in dict.fromkeys(cameras) if name not in sought.fix]


def _refined_coarsely(
    frames: KeyFrames, guess: SceneGuess, start: SceneStart, names: Sequence[str]
) -> SceneGuess:
    """Refine a guess on the reduced key frames, search the poses again, and refine once more."""
    planes = [frame.coarse[np.newaxis] for frame in frames.frames]
    masks = KeyMasks(planes, frames.coarse_view, frames.shrink)
    for _ in range(2):
        # better poses show better where the further geoms of a body are
        guess = arranged(frames, guess, start)
        variables = _variables(guess, start, names)
        thick = replace(guess, mechanism=as_thick(frames, guess.mechanism, guess.camera))
        bundle = refine(masks, thick, variables, COARSE)
        mechanism = thinned(frames, bundle.mechanism, bundle.camera)
        new = search_poses(frames, mechanism, bundle.camera, bundle.positions)
        if new.score > guess.score:
            return guess
        guess = new
    return guess


def _with_colours(masks: Masks, frames: KeyFrames, guess: SceneGuess) -> tuple[Masks, KeyFrames, SceneGuess]:
    """Find the pose in every sample frame and measure the colours of the geoms there."""
    guess = search_poses(frames, guess.mechanism, guess.camera)
    # the better half of the frames always counts, so that a hard clip has its colours too
    fits = guess.mismatch <= max(0.5, float(np.median(guess.mismatch)))
    masks = masks.coloured(geom_colours(masks.samples.frames, masks.background, guess, fits))
    return masks, key_frames(masks, len(guess.mechanism.shapes.radius)), guess


def _with_background(masks: Masks, frames: KeyFrames, bundle: Bundle) -> tuple[Masks, KeyFrames, SceneGuess]:
    """Take the background again without the mechanism, and the colours over it."""
    mechanism, camera = bundle.mechanism, bundle.camera
    positions, fits = _all_poses(frames, bundle)
    if fits.sum() < max(FEWEST, len(fits) // 4):
        # so few frames show no background, and nothing would be left of the mechanism before it
        return masks, frames, SceneGuess(mechanism, camera, positions, np.zeros(len(positions)))
    # a frame in which the mechanism was not found shows nothing that is surely background
    everything = np.ones(frames.view.trust.shape[1:], dtype=bool)
    masks = masks.refined(
        [
            covered_pixels(mechanism, camera, q, margin=MARGIN_PX) if lies else everything
            for q, lies in zip(positions, fits, strict=True)
        ]
    )
    guess = SceneGuess(mechanism, camera, positions, np.zeros(len(positions)))
    masks = masks.coloured(geom_colours(masks.samples.frames, masks.background, guess, fits))
    return masks, key_frames(masks, len(mechanism.shapes.radius)), guess


def _all_poses(frames: KeyFrames, bundle: Bundle) -> tuple[np.ndarray, np.ndarray]:
    """Find the pose in every sample frame, (frame, dof), and whether it lies on the mask, bool (frame,)."""
    guess = search_poses(frames, bundle.mechanism, bundle.camera)
    rig = rig_of(bundle.mechanism, bundle.camera)
    lower, upper = joint_limits(bundle.mechanism)
    limits = MoveLimits(lower, upper, np.full(len(lower), 1.0))
    positions, good = [], []
    for frame, start in zip(frames.frames, guess.positions, strict=True):
        q, _, found = follow(frame.planes, frames.view, rig, start, limits, POSE)
        positions.append(q)
        good.append(found.matched > LEAST_MATCHED and found.inside > LEAST_INSIDE)
    return np.array(positions), np.array(good)


def _refined_whole(
    frames: KeyFrames, guess: SceneGuess, variables: SceneVariables, search: EdgeSearch, count: int
) -> tuple[Bundle, list[int]]:
    """Refine on whole pictures over key frames that fit; return their rows too."""
    rows = sorted(frames.most_distinct(count))
    half = len(search.reaches) // 2
    masks = KeyMasks([frames.frames[i].planes for i in rows], frames.view)
    guess = replace(guess, positions=guess.positions[rows])
    first = refine(masks, guess, variables, search._replace(reaches=search.reaches[:half]))
    # A frame with a wrong pose pulls at sizes and camera. It shows by agreeing much less than the typical
    # frame does; where most would be left out the measure itself is in doubt, and all stay.
    good = (first.matched > 0.6 * np.median(first.matched)) & (first.inside > 0.6 * np.median(first.inside))
    enough = good.sum() >= max(FEWEST, len(rows) // 4)
    kept = np.flatnonzero(good) if enough else np.arange(len(rows))
    masks = replace(masks, planes=[masks.planes[int(i)] for i in kept])
    again = SceneGuess(first.mechanism, first.camera, first.positions[kept], guess.mismatch)
    rest = search._replace(reaches=search.reaches[half:])
    return refine(masks, again, variables, rest, settle=10), [rows[i] for i in kept]


def _scene(sought: Sought, masks: Masks, frames: KeyFrames, bundle: Bundle) -> Scene:
    """Collect the result in metres of the file, and what the key frames of the bundle know of the sizes."""
    names = bundle.variables.names
    sizes = [p.name for p in bundle.mechanism.parameters if p.kind in SIZE_KINDS and not p.follows]
    # a single size that is held, or the depth, pins the common scale
    scale_free = "camera.depth" in names and all(name in names for name in sizes)
    measured = size_information(bundle, scale_free=scale_free)
    std = camera_std(bundle, scale_free=scale_free)
    order = [frame.index for frame in frames.frames]
    first = int(np.argmin(order))
    rms = float(np.sqrt(np.mean(bundle.rms_px**2)))
    advice = scene_advice(bundle, std, _mismatch_share(frames, bundle), varied=masks.varied)
    advice += hidden_advice(hidden_places(bundle, scale_free=scale_free))
    camera = bundle.camera
    metre = units_per_metre(bundle.mechanism, camera, sought.mechanism, sought.fix, sought.pinned)
    mechanism = in_metres(bundle.mechanism, sought.mechanism, metre, sought.pinned)
    camera = replace(camera, x=camera.x / metre, y=camera.y / metre, depth=camera.depth / metre)
    slides = np.array([joint.kind == "slide" for joint in mechanism.joints])
    positions = np.where(slides, bundle.positions / metre, bundle.positions)
    return Scene(
        mechanism=mechanism.with_measured(measured),
        camera=with_values(camera, dict(sought.fix)),
        masks=masks,
        frame=order[first],
        position=positions[first],
        key_frames=tuple(order),
        key_positions=positions,
        camera_std={n: value / metre if PARAMETERS[n].unit == "m" else value for n, value in std.items()},
        rms_px=rms,
        beside=beside(frames, SceneGuess(bundle.mechanism, bundle.camera, bundle.positions, bundle.rms_px)),
        advice=tuple(advice),
        thicker=frames.thicker,
    )


def _mismatch_share(frames: KeyFrames, bundle: Bundle) -> float:
    """Return the mean mismatch of outline and mask as a share of the mask's area (paper eq. 3)."""
    rig = rig_of(as_thick(frames, bundle.mechanism, bundle.camera), bundle.camera, shrink=frames.shrink)
    shares = []
    for frame, q in zip(frames.frames, bundle.positions, strict=True):
        cost = pose_balance(frame.balance, rig, q[np.newaxis], len(rig.radius))[0]
        shares.append((frame.area + float(cost)) / max(frame.area, 1.0))
    return float(np.median(shares))


def scene_advice(bundle: Bundle, std: Mapping[str, float], outside: float, *, varied: bool) -> list[str]:
    """Write the sentences for the user about a located mechanism.

    Args:
        bundle: The refined mechanism over its key frames.
        std: Standard deviations of the refined camera parameters by name [m, rad, px].
        outside: Share of the foreground outside of the mechanism, or of the mechanism outside of it.
        varied: True where any difference from the background counts as foreground.

    Returns:
        The sentences; none where all is well.
    """
    advice = []
    share = float(np.mean((bundle.matched > LEAST_MATCHED) & (bundle.inside > LEAST_INSIDE)))
    if share < LEAST_FITTING:
        advice.append(
            f"The mechanism lies on its mask in only {share:.0%} of the key frames: look in "
            "diagnosis.png whether the outline is in the right place and what else moves (--roi and "
            "--time-range leave that out), and check the mechanism file."
        )
    vague = [name for name, value in std.items() if value > _vague_from(bundle.camera, name)]
    if vague:
        advice.append(
            f"The clip hardly determines {', '.join(vague)}: leave out --free, or give the value with --fix."
        )
    if outside > UNEXPLAINED_SHARE and not varied:
        advice.append(
            f"{min(outside, 1.0):.0%} of what stands out from the background is not the mechanism as it "
            "was found: it may be in the wrong place or of the wrong size, or other things move; look at "
            "diagnosis.png. --roi and --time-range leave other things out; where the background shows parts "
            "of the mechanism, give --background a picture without it."
        )
    return advice


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


def _vague_from(camera: Camera, name: str) -> float:
    """Return the deviation from which a freed camera parameter is called vague [px or rad]; places never
    are."""
    if name == "camera.focal":
        return VAGUE_FOCAL * camera.focal
    return VAGUE_TURN if name in CAMERA_TURNS else np.inf
