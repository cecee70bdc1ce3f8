"""A guess of the search refined on the reduced key frames.

Edges are looked for over ten of their pixels there: far enough to mend what the search left off by a tenth of
a body, which the whole pictures, searched over a few of theirs, would not show.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from monodyn.vision.drawing.follow import EdgeSearch
from monodyn.vision.locating.arrange import BETTER, arranged, freed
from monodyn.vision.locating.bundle import KeyMasks, refine
from monodyn.vision.locating.grow import SceneStart
from monodyn.vision.locating.keyframes import KeyFrames
from monodyn.vision.locating.places import with_names
from monodyn.vision.locating.reopen import reopened
from monodyn.vision.locating.search import SceneGuess, as_thick, search_poses, thinned
from monodyn.vision.locating.settle import frames_cost
from monodyn.vision.locating.unit import growth, scaled
from monodyn.vision.locating.variables import SceneVariables, scene_variables

COARSE = EdgeSearch(np.array([9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 4.0, 3.0, 3.0, 3.0]), 1.5)
"""How the edges are looked for in the reduced pictures [reduced px]."""
WELL_EXPLAINED = 0.15
"""Share of the foreground that is not explained up to which a guess is not refined once more on the reduced
masks."""


def refined_coarsely(
    frames: KeyFrames, guess: SceneGuess, start: SceneStart, names: Sequence[str]
) -> SceneGuess:
    """Refine a guess on the reduced key frames, search the poses again, and refine once more.

    Args:
        frames: The key frames of the guess.
        guess: A mechanism with its poses.
        start: What may not change.
        names: What is refined.

    Returns:
        The guess with the sizes, places and poses that explain more of the masks.
    """
    for _ in range(2):
        # better poses show better where the further geoms of a body are
        guess = arranged(frames, guess, start)
        new = _refined(frames, guess, variables_of(guess, start, names))
        if new.score > guess.score:
            return guess
        guess = new
    return guess


def reconsidered(
    frames: KeyFrames, guess: SceneGuess, variables: SceneVariables, start: SceneStart
) -> SceneGuess:
    """Refine a guess on the reduced key frames once their masks are better, where it explains more of them.

    In the first masks, which a shadow or a cable shares, a geom may have lost its size to another one: in the
    better ones it is given a new one.

    Args:
        frames: The key frames of the guess, with better masks than it was found in.
        guess: A mechanism with its poses.
        variables: What is refined.
        start: What may not change.

    Returns:
        The better guess, or the guess as it is.
    """
    frames = frames.afresh()
    thick = as_thick(frames, guess.mechanism, guess.camera)
    left = frames_cost(frames, thick, guess.camera, guess.positions)
    if left < WELL_EXPLAINED:
        return guess
    new = _refined(frames, reopened(frames, guess, start), variables)
    return new if new.score < left - BETTER else guess


def variables_of(guess: SceneGuess, start: SceneStart, names: Sequence[str]) -> SceneVariables:
    """Return what is refined of a guess, held by weak springs: lengths, and what has left its place in the
    file, to those of the guess, other sizes to their proportions in the file.

    Args:
        guess: A mechanism.
        start: The same as in the file.
        names: What is refined.
    """
    file = scaled(start.mechanism, growth(guess.mechanism, start.mechanism))
    lengths = {p.name: p.value for p in guess.mechanism.parameters if p.kind == "length"}
    variables = scene_variables(file.with_values(lengths), names)
    more = freed(guess.mechanism, file)
    return with_names(variables, guess.mechanism, more) if more else variables


def _refined(frames: KeyFrames, guess: SceneGuess, variables: SceneVariables) -> SceneGuess:
    """Refine a guess on the reduced masks and search its poses again."""
    planes = [frame.coarse[np.newaxis] for frame in frames.frames]
    thick = replace(guess, mechanism=as_thick(frames, guess.mechanism, guess.camera))
    bundle = refine(KeyMasks(planes, frames.coarse_view, frames.shrink), thick, variables, COARSE)
    mechanism = thinned(frames, bundle.mechanism, bundle.camera)
    return search_poses(frames, mechanism, bundle.camera, bundle.positions)
