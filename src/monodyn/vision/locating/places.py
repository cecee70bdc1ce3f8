"""Which geoms of a body stand elsewhere than where the file puts them: onto another part, exactly.

A place, a turn or an extent that follows other sizes is freed if its edges ask for it: a few steps with all
of them free show how far each departs, and how well it is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress

import numpy as np

from monodyn.mechanism import Mechanism, Parameter
from monodyn.vision.drawing.follow import EdgeSearch
from monodyn.vision.drawing.rig import SHOWN_KINDS
from monodyn.vision.locating.bundle import SETTLE, SYSTEMATIC_PX, Bundle, KeyMasks, refine
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.locating.thin import LEAST_WIDTH_PX
from monodyn.vision.locating.variables import LOG_STD, SceneVariables, scene_variables, springs

DEPARTED = 5.0
"""Standard deviations, blur and light included, from which a geom stands elsewhere than in the file."""

MORE_AGREE = 0.005
"""Share of the outline's samples that must agree in addition for it to stay there."""
SHORT_PX = 4.0
"""Length below which an outline is a speck, of which no edge says how long it is [px]."""
STRIDE = 3
"""Of the search lengths of a refinement every third one is enough to see what departs."""


def with_departed(
    masks: KeyMasks, bundle: Bundle, variables: SceneVariables, search: EdgeSearch
) -> tuple[Bundle, SceneVariables]:
    """Free what departs from the place that the file gives it, and refine with it.

    Args:
        masks: Masks of the key frames of the bundle.
        bundle: What was refined so far.
        variables: What was refined.
        search: How the edges are looked for.

    Returns:
        The bundle and the variables, as they are where nothing departs.
    """
    tied = _following(bundle.mechanism)
    departed = _departed(masks, bundle, variables, tied, search) if tied else []
    if not departed:
        return bundle, variables
    mechanism = bundle.mechanism.with_following(departed, follow=False)
    more = with_names(variables, mechanism, departed)
    guess = SceneGuess(mechanism, bundle.camera, bundle.positions, np.zeros(len(bundle.positions)))
    freed = refine(masks, guess, more, search, settle=SETTLE)
    # along a direction that the edges hardly show a place may go far, and they agree no better than before
    return (freed, more) if freed.agreement > bundle.agreement + MORE_AGREE else (bundle, variables)


def with_names(variables: SceneVariables, mechanism: Mechanism, names: list[str]) -> SceneVariables:
    """Return the variables with further ones, whose springs hold them where they are.

    Args:
        variables: The variables.
        mechanism: The mechanism with its values.
        names: Further parameters of it.
    """
    more = scene_variables(mechanism, [*variables.names, *names])
    start, now = dict(variables.start), mechanism.values
    for name in names:
        # a place is held as a ratio to its size, and that size's own start may be far from its value
        size = mechanism.parameter(name).against
        start[name] = now[name] * (start[size] / now[size] if size else 1.0)
    return replace(
        more, start=start, length=variables.length, thick=variables.thick, focal=variables.focal,
        about_origin=variables.about_origin,
    )  # fmt: skip


def without_names(variables: SceneVariables, names: Sequence[str]) -> SceneVariables:
    """Return the variables without some of them.

    Args:
        variables: The variables.
        names: Those that are left out.
    """
    kept = np.array([name not in names for name in variables.names], dtype=bool)
    return replace(
        variables,
        names=tuple(compress(variables.names, kept)),
        kinds=tuple(compress(variables.kinds, kept)),
        against=tuple(compress(variables.against, kept)),
        creeps=variables.creeps[kept],
    )


def without_unseen(bundle: Bundle, file: Mechanism) -> Bundle:
    """Return a bundle in which what is placed along a body that no picture shows is where the file has it.

    A ball on a thread that cannot be seen tells where the thread ends: of the thread's length and the ball's
    place on it, the pictures determine one, and so of its place across it and the angle of the thread.

    Args:
        bundle: The refined mechanism.
        file: The mechanism with the proportions of its file.

    Returns:
        The bundle, its unseen lengths such that these places follow them. A width that no picture shows is
        that of a thread: with its new length the body may lie in the picture.
    """
    variables, mechanism, positions = bundle.variables, bundle.mechanism, bundle.positions.copy()
    x = variables.read(mechanism, bundle.camera)
    known, values, names = file.values, mechanism.values, variables.names
    sizes: dict[str, float] = {}
    tied = []
    for name, size in zip(names, variables.against, strict=True):
        if not (name.endswith(".along") and size in names and file.parameter(name).follows) or size in sizes:
            continue
        # the length grows, and the places on it stay where they are: what do the pictures say to that?
        i = names.index(size)
        grow = np.where(np.array(variables.against) == size, -x, 0.0)
        grow[i] = 1.0
        short = values[size] * bundle.camera.focal / bundle.camera.depth < SHORT_PX
        hidden = short or grow @ bundle.information @ grow < 1.0 / LOG_STD**2
        if hidden and known[name] * values[name] > 0.0:
            body, across = size.removesuffix(".length"), name.removesuffix("along") + "across"
            before, after = (complex(found[name], found[across]) for found in (values, known))
            sizes[size] = abs(before / after) * known[size]
            tied += [name, *({across} & {*names})]
            link = mechanism.bodies.index(body)
            positions[:, link] += mechanism.joints[link].sign * np.angle(before / after)
            width = f"{body}.width"
            if width in names and np.diag(bundle.information)[names.index(width)] < 1.0 / LOG_STD**2:
                sizes[width] = LEAST_WIDTH_PX * bundle.camera.depth / bundle.camera.focal
    if not tied:
        return bundle
    mechanism = mechanism.with_values(sizes).with_following(tied, follow=True)
    return replace(bundle, mechanism=mechanism, positions=positions)


def _following(mechanism: Mechanism) -> list[str]:
    """Names of the sizes, places and turns that follow others and that the user did not choose."""
    return [
        p.name
        for p in mechanism.parameters
        if p.follows and p.kind in SHOWN_KINDS and p.name not in mechanism.chosen
    ]


def _departed(
    masks: KeyMasks, bundle: Bundle, variables: SceneVariables, tied: list[str], search: EdgeSearch
) -> list[str]:
    """Return those of the followers that leave their place when all of them are free."""
    mechanism = bundle.mechanism.with_following(tied, follow=False)
    every = with_names(variables, mechanism, tied)
    guess = SceneGuess(mechanism, bundle.camera, bundle.positions, np.zeros(len(bundle.positions)))
    # edges far from the outline count little by their robust weights: a few steps bring them near
    stepped = refine(masks, guess, every, search._replace(reaches=search.reaches[::STRIDE]))
    before = every.read(mechanism, bundle.camera)
    after = every.read(stepped.mechanism, stepped.camera)
    information = stepped.information + np.diag(springs(every, before)[1])
    count, found = len(variables.names), []
    for name in tied:
        i = every.names.index(name)
        px = _lever(mechanism.parameter(name), mechanism) * bundle.camera.focal / bundle.camera.depth
        # how well it is known when the others stay where they are: a hidden end would make all of them vague
        alone = [*range(count), i]
        # nothing is known of what no edge shows; without the small ridge that is a singular matrix
        variance = np.linalg.inv(information[np.ix_(alone, alone)] + 1e-9 * np.eye(len(alone)))[-1, -1]
        variance += (SYSTEMATIC_PX / max(px, 1e-9)) ** 2
        if abs(after[i] - before[i]) > DEPARTED * np.sqrt(variance):
            found.append(name)
    return found


def _lever(p: Parameter, mechanism: Mechanism) -> float:
    """Return the size that the coordinate of a follower is a change of [m]: of a turn half of its geom."""
    values = mechanism.values
    if p.kind == "turn":
        stem = p.name.rsplit(".", 1)[0]
        return 0.5 * values.get(f"{stem}.length", values.get(f"{p.owner}.length", 0.0))
    return values.get(p.against, 1.0) if p.kind in ("along", "across") else p.value
