"""Geoms that a search of sizes has closed, opened again.

A geom inside of another of its body changes nothing while it grows, and one taken for a thread cannot grow by
steps of its logarithm: what explains more of the masks lies beyond sizes that explain as much or less. So
the geoms of a body are given the widths that the foreground has, all of them at once, and settle from there.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

from monodyn.mechanism import Mechanism
from monodyn.vision.locating.arrange import BETTER, resettled
from monodyn.vision.locating.grow import SceneStart, typical_widths
from monodyn.vision.locating.keyframes import KeyFrames
from monodyn.vision.locating.search import SceneGuess, as_thick, thinned
from monodyn.vision.locating.settle import frames_cost
from monodyn.vision.locating.unit import drawn


def reopened(frames: KeyFrames, guess: SceneGuess, start: SceneStart) -> SceneGuess:
    """Give the geoms of each body other widths of the foreground where these explain more of it.

    Args:
        frames: The key frames of the guess.
        guess: A mechanism with its poses.
        start: What may not change.

    Returns:
        The guess with the sizes that explain most of the masks, the poses held; else as it is.
    """
    thick = replace(guess, mechanism=as_thick(frames, guess.mechanism, guess.camera))
    per_px = guess.camera.depth / guess.camera.focal
    widths = [width * per_px for width in typical_widths(frames)]
    best, least = thick, frames_cost(frames, thick.mechanism, thick.camera, thick.positions)
    for names in _widths_by_body(thick.mechanism, start.pinned):
        begun = best
        # as where structures grow: further geoms of a body share the second width
        for pair in itertools.product(widths, repeat=2):
            sizes = {name: pair[min(i, 1)] for i, name in enumerate(names)}
            tried = replace(begun, mechanism=begun.mechanism.with_values(sizes))
            tried = resettled(frames, tried, start)
            cost = frames_cost(frames, tried.mechanism, tried.camera, tried.positions)
            if cost < least - BETTER:
                best, least = tried, cost
    if best is thick:
        return guess
    held = {p.name: p.value for p in drawn(guess.mechanism) if p.name in start.pinned}
    return replace(best, mechanism=thinned(frames, best.mechanism, best.camera).with_values(held))


def _widths_by_body(mechanism: Mechanism, pinned: frozenset[str]) -> list[list[str]]:
    """Name the widths that may change of each body with several geoms, that of its main part first."""
    own = [p for p in drawn(mechanism) if p.kind == "width" and p.name not in pinned]
    bodies = dict.fromkeys(joint.body for joint in mechanism.joints)
    named = [[p.name for p in own if p.owner == body] for body in bodies]
    return [names for names in named if len(names) > 1]
