"""From masks and topology to the scene: camera, sizes up to one common scale, and the first pose.

A global search on reduced key frames finds the mechanism; a joint refinement on the sub-pixel edges of the
key frames fits camera, sizes and poses; then the background is taken again with the mechanism masked out,
and the refinement repeated on the better masks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.vision.drawing.camera import PARAMETERS, with_values
from monodyn.vision.drawing.follow import EdgeSearch
from monodyn.vision.drawing.outline import covered_pixels
from monodyn.vision.drawing.rig import SIZE_KINDS
from monodyn.vision.drawing.shutter import Shutter
from monodyn.vision.foreground.masks import GeomColours, Masks
from monodyn.vision.locating.advice import scene_advice
from monodyn.vision.locating.arrange import BETTER, freed
from monodyn.vision.locating.body import beside
from monodyn.vision.locating.bundle import SETTLE, Bundle, KeyMasks, refine
from monodyn.vision.locating.coarse import reconsidered, refined_coarsely, variables_of
from monodyn.vision.locating.colours import geom_colours
from monodyn.vision.locating.doubt import doubt_of
from monodyn.vision.locating.ends import with_seen_ends
from monodyn.vision.locating.everywhere import poses_everywhere
from monodyn.vision.locating.exactness import exactness_of
from monodyn.vision.locating.keyframes import KeyFrames, key_frames
from monodyn.vision.locating.knowledge import hidden_advice, hidden_places, size_information
from monodyn.vision.locating.mixing import lit_sizes
from monodyn.vision.locating.oblique import Looking, looking, open_turns
from monodyn.vision.locating.places import with_departed, without_names, without_unseen
from monodyn.vision.locating.scene import Scene
from monodyn.vision.locating.search import SceneGuess, left_shares, search_poses, search_scene
from monodyn.vision.locating.sought import STEPS, Sought, refined_names, whole_variables
from monodyn.vision.locating.unit import in_metres, scaled, units_per_metre
from monodyn.vision.locating.variables import SceneVariables
from monodyn.vision.locating.widths import rewidened

FEWEST = 3
"""Frames, besides a quarter of all, without which a choice of frames says nothing."""
REFINED = 3
"""Guesses of the search that are refined on the reduced key frames."""
SAME_SHARE, SAME_LENGTH = 1e-3, 0.02
"""Difference of the shares of the foreground that two guesses leave, and of their lengths as a share, up to
which they ended in one place."""
MARGIN_PX = 3.0
"""Band around the located mechanism that does not count as background either [px]."""
FINE = EdgeSearch(np.array([8.0, 7.0, 6.0, 5.0, 5.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0]), 3.0)
"""How they are looked for in the whole pictures after that [px]."""
LAST = EdgeSearch(np.array([5.0, 4.0, 4.0, 4.0, 3.0, 3.0, 3.0, 3.0]), 3.0)
"""How they are looked for over the better background [px]."""


def find_scene(sought: Sought) -> Scene:
    """Find camera, sizes and first pose from the topology alone.

    Args:
        sought: The masks, the mechanism, and what is known of the camera.

    Returns:
        The scene.
    """
    settings, start, unit = sought.settings, sought.start, sought.unit
    names, geoms = refined_names(sought), len(start.mechanism.shapes.radius)
    _, masks, frames, guess, variables, bundle, rows = _first_refined(sought, names)
    bundle, more = with_departed(_whole(frames, rows), bundle, variables, FINE)
    tied = without_unseen(bundle, start.mechanism)
    # what seemed to stand elsewhere may have been an edge of the first background: it is judged anew
    departed = [name for name in more.names if name not in variables.names] if tied is bundle else []
    if tied is not bundle:
        guess = SceneGuess(tied.mechanism, tied.camera, tied.positions, np.zeros(len(rows)))
        tied = replace(tied, variables=whole_variables(sought, guess, start, names))
    sought, ended = with_seen_ends(sought, _whole(frames, rows), tied, FINE)
    start = replace(start, mechanism=scaled(sought.mechanism, unit))
    camera = camera_looks(sought, _whole(frames, rows), ended)
    sought.step(7)
    poses = poses_everywhere(frames, camera.bundle, guess.positions if tied is bundle else None)
    del frames
    masks, guess = _with_background(masks, camera.bundle, *poses)
    sought.step(8)
    frames = key_frames(masks, geoms)
    sought.step(9)
    variables = without_names(camera.bundle.variables, departed)
    guess = replace(guess, mechanism=guess.mechanism.with_following(departed, follow=True))
    better = reconsidered(frames, guess, variables, start)
    search = FINE if departed or better is not guess else LAST
    if better is not guess:
        # colours that were measured while a geom was missing are not those of all of the mechanism
        again, _ = refined_whole(frames, better, variables, FINE, settings.refine_frames)
        poses = poses_everywhere(frames, again)
        del frames
        masks, better = _with_background(masks, again, *poses)
        frames = key_frames(masks, geoms)
    bundle, rows = refined_whole(frames, better, variables, search, settings.refine_frames)
    if departed:
        bundle, _ = with_departed(_whole(frames, rows), bundle, variables, FINE)
    bundle = replace(bundle, alternatives=camera.bundle.alternatives)
    if departed:
        camera = camera_looks(sought, _whole(frames, rows), bundle)
        bundle = camera.bundle
    sought.step(STEPS)
    return found_scene(sought, masks, frames.only(rows), bundle, camera)


def first_scene(sought: Sought) -> tuple[SceneGuess, Scene]:
    """Find about where the mechanism is: the first steps of `find_scene` alone.

    Args:
        sought: The masks, the mechanism, and what is known of the camera.

    Returns:
        The mechanism before a camera, with poses in a few key frames; and the scene of it, refined once in
        the whole pictures: it can be followed there, and nothing is said of how well its sizes are known.
    """
    guess, masks, frames, _, _, bundle, rows = _first_refined(sought, refined_names(sought))
    return guess, _in_metres(sought, masks, frames.only(rows), bundle)[0]


def _first_refined(
    sought: Sought, names: Sequence[str]
) -> tuple[SceneGuess, Masks, KeyFrames, SceneGuess, SceneVariables, Bundle, list[int]]:
    """Search, and refine once in whole pictures; return what was guessed, the masks with its colours, their
    key frames, its poses there, what was refined, and the refinement with the rows of its key frames."""
    start, geoms = sought.start, len(sought.mechanism.shapes.radius)
    sought.step(0)
    frames = key_frames(sought.masks, geoms)
    sought.step(1)
    guess = sought.guess or _searched(sought, frames, names)
    sought.step(4)
    # What is known of the mechanism makes the masks better, twice: first their colours, measured inside of
    # the outlines, then the background, taken where the outlines leave it free.
    posed = search_poses(frames, guess.mechanism, guess.camera)
    # of pictures in 4K the whole masks of two sets of key frames would fill the memory
    del frames
    masks = _with_colours(sought.masks, posed)
    sought.step(5)
    frames = key_frames(masks, geoms)
    sought.step(6)
    posed = reconsidered(frames, posed, variables_of(posed, start, names), start)
    variables = whole_variables(sought, posed, start, names)
    refined = refined_whole(frames, posed, variables, FINE, sought.settings.refine_frames)
    return guess, masks, frames, posed, variables, *refined


def _searched(sought: Sought, frames: KeyFrames, names: Sequence[str]) -> SceneGuess:
    """Return what explains most of the masks, refined on the reduced pictures."""
    start, count = sought.start, sought.settings.search_frames
    guesses = [_placed(sought, g) for g in search_scene(frames, start, count)]
    sought.step(2)
    few = frames.only(frames.most_distinct(count))
    # two starts that end in one place are enough
    refined = on_all_cores(lambda guess: refined_coarsely(few, guess, start, names), guesses[:2])
    sought.step(3)
    if not (len(refined) == 2 and _alike(*refined)):
        refined += [refined_coarsely(few, guess, start, names) for guess in guesses[2:REFINED]]
    return min(refined, key=lambda g: g.score + BETTER * len(freed(g.mechanism, start.mechanism)))


def camera_looks(sought: Sought, masks: KeyMasks, bundle: Bundle) -> Looking:
    """Find out whether the camera looks obliquely, where that was not found out before.

    Args:
        sought: What is known of the camera.
        masks: Masks of the key frames.
        bundle: A refinement over them.

    Returns:
        What was found.
    """
    held = {*sought.fix, *bundle.variables.names, *(["camera.focal"] if sought.settings.focal else [])}
    return looking(masks, bundle, open_turns(sought.mechanism, held), sought.free, FINE)


def _whole(frames: KeyFrames, rows: Sequence[int]) -> KeyMasks:
    """Return the whole masks of some key frames."""
    return KeyMasks([frames.frames[i].planes for i in rows], frames.view)


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


def _with_colours(masks: Masks, guess: SceneGuess) -> Masks:
    """Measure the colours of the geoms by their poses in the sample frames."""
    # the better half of the frames always counts, so that a hard clip has its colours too
    fits = guess.mismatch <= max(0.5, float(np.median(guess.mismatch)))
    return masks.coloured(_colours(masks, guess, fits))


def _colours(masks: Masks, guess: SceneGuess, fits: np.ndarray) -> GeomColours | None:
    """Measure the colours of the geoms where the sample frames show them."""
    away = [masks.away(frame.index) for frame in masks.samples.frames]
    return geom_colours(masks.samples.frames, masks.background, guess, fits, away)


def _with_background(
    masks: Masks, bundle: Bundle, positions: np.ndarray, fits: np.ndarray
) -> tuple[Masks, SceneGuess]:
    """Take the background again without the mechanism, and the colours over it.

    The poses in the sample frames, (frame, dof), are given with whether they lie on the masks, bool (frame,).
    """
    mechanism, camera = bundle.mechanism, bundle.camera
    guess = SceneGuess(mechanism, camera, positions, np.zeros(len(positions)))
    if fits.sum() < max(FEWEST, len(fits) // 4):
        # so few frames show no background, and nothing would be left of the mechanism before it
        return masks, guess
    # a frame in which the mechanism was not found shows nothing that is surely background
    everything = np.ones((camera.height, camera.width), dtype=bool)
    masks = masks.refined(
        [
            covered_pixels(mechanism, camera, q, margin=MARGIN_PX) if lies else everything
            for q, lies in zip(positions, fits, strict=True)
        ]
    )
    return masks.coloured(_colours(masks, guess, fits)), guess


def refined_whole(
    frames: KeyFrames,
    guess: SceneGuess,
    variables: SceneVariables,
    search: EdgeSearch,
    count: int,
    shutter: Shutter | None = None,
) -> tuple[Bundle, list[int]]:
    """Refine on whole pictures over key frames that fit.

    Args:
        frames: Masks to choose from.
        guess: Where to start, with a pose for each of them.
        variables: What is refined in addition to the poses.
        search: How the edges are looked for.
        count: Most key frames.
        shutter: How each of the frames is exposed while the mechanism moves; None for one instant.

    Returns:
        The refined bundle and the rows of its key frames.
    """
    rows = sorted(frames.most_distinct(count))
    half = len(search.reaches) // 2
    moving = None if shutter is None else shutter.only(rows)
    masks = replace(_whole(frames, rows), shutter=moving)
    guess = replace(guess, positions=guess.positions[rows])
    begin = search._replace(reaches=search.reaches[:half])
    first = rewidened(masks, refine(masks, guess, variables, begin), begin)
    # A frame with a wrong pose pulls at sizes and camera. It shows by agreeing much less than the typical
    # frame does; where most would be left out the measure itself is in doubt, and all stay.
    good = (first.matched > 0.6 * np.median(first.matched)) & (first.inside > 0.6 * np.median(first.inside))
    enough = good.sum() >= max(FEWEST, len(rows) // 4)
    kept = np.flatnonzero(good) if enough else np.arange(len(rows))
    again = SceneGuess(first.mechanism, first.camera, first.positions[kept], guess.mismatch)
    rest = search._replace(reaches=search.reaches[half:])
    return refine(masks.only(kept.tolist()), again, variables, rest, settle=SETTLE), [rows[i] for i in kept]


def found_scene(
    sought: Sought, masks: Masks, frames: KeyFrames, bundle: Bundle, looks: Looking,
    sharp: Sequence[int] | None = None,
) -> Scene:  # fmt: skip
    """Collect the result in metres of the file, and what the key frames of the bundle know of the sizes.

    Args:
        sought: What was to be located.
        masks: The masks in which it was.
        frames: The key frames of the bundle.
        bundle: The refined mechanism over them.
        looks: How the camera looks at the plane.
        sharp: Rows of those in which it is judged what is outside of the mechanism; None for all.

    Returns:
        The scene.
    """
    rows = list(range(len(frames.frames)) if sharp is None else sharp)
    judged = frames.only(rows)
    shown = SceneGuess(bundle.mechanism, bundle.camera, bundle.positions[rows], bundle.rms_px[rows])
    whole, picture_of = _whole(frames, rows), {frame.index: frame for frame in masks.samples.frames}
    pictures = [picture_of[frame.index] for frame in judged.frames]
    lit = lit_sizes(whole, pictures, masks.background, bundle, rows)
    exact = exactness_of(whole, bundle, np.array(rows))
    bundle = exact.of(bundle)
    looks = replace(looks, doubted=exact.of(looks.doubted))
    names = bundle.variables.names
    sizes = [p.name for p in bundle.mechanism.parameters if p.kind in SIZE_KINDS and not p.follows]
    # a single size that is held, or the depth, pins the common scale
    scale_free = "camera.depth" in names and all(name in names for name in sizes)
    allowed = replace(bundle, alternatives=(*bundle.alternatives, lit))
    measured = size_information(allowed, scale_free=scale_free)
    std = looks.camera_std(bundle, scale_free=scale_free)
    freed = {name: value for name, value in std.items() if name in sought.free}
    share = float(np.median(left_shares(judged, shown.mechanism, shown.camera, shown.positions)))
    advice = scene_advice(bundle, freed, share, varied=masks.varied)
    advice += hidden_advice(hidden_places(allowed, scale_free=scale_free))
    scene, metre = _in_metres(sought, masks, frames, bundle)
    return replace(
        scene,
        mechanism=scene.mechanism.with_measured(measured),
        camera_std={n: value / metre if PARAMETERS[n].unit == "m" else value for n, value in std.items()},
        beside=beside(judged, shown),
        advice=tuple(advice),
        doubt=doubt_of(bundle, looks.known(bundle), looks.off(bundle), metre, scale_free=scale_free),
    )


def _in_metres(sought: Sought, masks: Masks, frames: KeyFrames, bundle: Bundle) -> tuple[Scene, float]:
    """Return the scene of a bundle over key frames in metres of the file, and how many units are one."""
    camera, order = bundle.camera, [frame.index for frame in frames.frames]
    metre = units_per_metre(bundle.mechanism, camera, sought.mechanism, sought.fix, sought.pinned)
    mechanism = in_metres(bundle.mechanism, sought.mechanism, metre, sought.pinned)
    camera = replace(camera, x=camera.x / metre, y=camera.y / metre, depth=camera.depth / metre)
    positions = np.where(mechanism.slides, bundle.positions / metre, bundle.positions)
    camera = with_values(camera, dict(sought.fix))
    first = int(np.argmin(order))
    frame, place = order[first], positions[first]
    rms = float(np.sqrt(np.mean(bundle.rms_px**2)))
    scene = Scene(
        mechanism, camera, masks, frame, place, tuple(order), positions, {}, rms, (), frames.thicker
    )
    return scene, metre
