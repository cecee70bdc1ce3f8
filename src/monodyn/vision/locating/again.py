"""The scene found once more after the clip was followed, with the motion while each picture is exposed known.

Background and colours are taken where no motion blurs them, and camera, sizes and poses are refined with
outlines that move during the exposure.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.mechanism.ends import with_ends
from monodyn.types import Camera, Poses
from monodyn.vision.drawing.camera import CAMERA_STD, around_origin, from_origin, value_of, with_values
from monodyn.vision.drawing.outline import covered_pixels
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.drawing.shutter import SLOW_PX, Shutter, way
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.locating import locate
from monodyn.vision.locating.bundle import KeyMasks
from monodyn.vision.locating.colours import geom_colours
from monodyn.vision.locating.keyframes import key_frames
from monodyn.vision.locating.oblique import Looking, open_turns, with_camera
from monodyn.vision.locating.scene import Scene
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.locating.unit import scaled

MOST_TIMES = 16
"""Times of an exposure, at most, at which what the mechanism covers is taken out of the background."""


@dataclass(frozen=True, eq=False)
class _Followed:
    """The sample frames in which the mechanism was followed: their rows among the samples, (frame,), the
    poses, (frame, dof), the shutter, and how far the outline moves while a row of each is exposed and while
    the whole picture is [px], (frame,) each."""

    rows: np.ndarray
    positions: np.ndarray
    shutter: Shutter
    blurs: np.ndarray
    ways: np.ndarray


def find_again(sought: locate.Sought, scene: Scene, tracked: Poses, *, looks: bool) -> Scene:
    """Find colours, background, camera and sizes once more, the motion in every picture being known.

    Args:
        sought: As for the first scene.
        scene: What was found, with its shutter.
        tracked: The poses of the clip, followed in that scene.
        looks: True to find out, too, whether the camera looks obliquely, as far as that is open; it is taken
            to look squarely otherwise.

    Returns:
        The scene, its sizes and places from pictures that are compared with that motion; the same one where
        too few samples were followed.
    """
    sought = replace(sought, mechanism=with_ends(sought.mechanism, scene.mechanism.ends))
    unit = 1.0 / scene.camera.depth
    camera = replace(scene.camera, x=scene.camera.x * unit, y=scene.camera.y * unit, depth=1.0)
    held = {*sought.fix, *(["camera.focal"] if sought.settings.focal else [])}
    square = {name: value_of(sought.start_camera, name) for name in open_turns(sought.mechanism, held)}
    turned = [name for name, value in square.items() if looks and value_of(camera, name) != value]
    if not turned:
        # the hinge stays where it is seen
        camera = from_origin(with_values(around_origin(camera), square))
    mechanism = scaled(scene.mechanism, unit)
    followed = _followed(scene, tracked, mechanism, camera)
    if len(followed.rows) < locate.FEWEST:
        return scene
    masks = _blurred_masks(scene.masks, mechanism, camera, followed)
    frames = key_frames(masks, len(mechanism.shapes.radius)).only(followed.rows.tolist())
    guess = SceneGuess(mechanism, camera, followed.positions, np.zeros(len(followed.rows)))
    variables = locate.whole_variables(sought, guess, sought.start, locate.refined_names(sought))
    variables = with_camera(variables, mechanism, turned)
    bundle, kept = locate.refined_whole(
        frames, guess, variables, locate.FINE, sought.settings.refine_frames, followed.shutter
    )
    planes = [frames.frames[i].planes for i in kept]
    whole = KeyMasks(planes, frames.view, shutter=followed.shutter.only(kept))
    ways = () if scene.doubt is None else scene.doubt.bundle.alternatives
    # turns that are looked for anew are doubted anew
    ways = tuple(way for way in ways if turned or not CAMERA_STD.keys() & way.keys())
    bundle = replace(bundle, alternatives=ways)
    looking = locate.camera_looks(sought, whole, bundle) if looks else Looking(bundle, bundle)
    # blur is foreground beside the outline, and says nothing about what is there
    slow = _slow(followed.blurs[kept]).tolist()
    found = locate.found_scene(sought, masks, frames.only(kept), looking.bundle, looking, slow)
    return replace(found, shutter=scene.shutter)


def _followed(scene: Scene, tracked: Poses, mechanism: Mechanism, camera: Camera) -> _Followed:
    """Return the sample frames in which the whole mechanism was seen, in the unit of ``mechanism``."""
    assert scene.shutter is not None
    metres = np.where(scene.mechanism.slides, 1.0 / scene.camera.depth, 1.0)
    row_of = {int(frame): row for row, frame in enumerate(tracked.frame) if tracked.seen[row]}
    numbers = [frame.index for frame in scene.masks.samples.frames]
    rows = np.array([i for i, number in enumerate(numbers) if number in row_of], dtype=np.int64)
    kept = [numbers[i] for i in rows]
    positions = tracked.position[[row_of[number] for number in kept]] * metres
    shutter = scene.shutter.only(kept, metres)
    rig = rig_of(mechanism, camera)
    blurs = np.array([way(shutter.of(rig, i), q) for i, q in enumerate(positions)])
    whole = replace(shutter, exposure=shutter.span, readout=0.0)
    ways = np.array([way(whole.of(rig, i), q) for i, q in enumerate(positions)])
    return _Followed(rows, positions, shutter, blurs, ways)


def _slow(blurs: np.ndarray) -> np.ndarray:
    """Return the rows of the frames that motion hardly blurs, or of the few that it blurs least."""
    return np.flatnonzero(blurs <= max(SLOW_PX, float(np.sort(blurs)[min(locate.FEWEST, len(blurs) - 1)])))


def _blurred_masks(masks: Masks, mechanism: Mechanism, camera: Camera, followed: _Followed) -> Masks:
    """Take the background where the mechanism is at no time of an exposure, and the colours over it where
    motion hardly blurs them."""
    # a frame in which the mechanism was not seen shows nothing that is surely background
    covered = [np.ones(masks.background.luma.shape, dtype=bool) for _ in masks.samples.frames]
    shutter = followed.shutter
    meanwhile = []
    for i, row in enumerate(followed.rows):
        # the margins of neighbouring times meet
        steps = min(2 + int(followed.ways[i] / (2.0 * locate.MARGIN_PX)), MOST_TIMES)
        times = np.linspace(-0.5, 0.5, steps) * shutter.span
        meanwhile.append(shutter.during(i, followed.positions[i], times))
        marked = [covered_pixels(mechanism, camera, q, margin=locate.MARGIN_PX) for q in meanwhile[i]]
        covered[row] = np.any(marked, axis=0)
    masks = masks.refined(covered)
    slow = _slow(followed.blurs)
    samples = [masks.samples.frames[followed.rows[i]] for i in slow]
    guess = SceneGuess(mechanism, camera, followed.positions[slow], np.zeros(len(slow)))
    good = np.ones(len(slow), dtype=bool)
    during = [meanwhile[i] for i in slow]
    return masks.coloured(geom_colours(samples, masks.background, guess, good, meanwhile=during))
