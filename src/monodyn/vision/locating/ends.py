"""Whether bodies end flat or round, and how far beyond their hinges: as the pictures show it, not the file.

Where a body of one bar ends otherwise than its file says, its edges pull at its length, which comes out by a
part of its width too short or too long. So each such body is refined once more with flat ends and with round
ones, both free to reach beyond its hinges. What brings the edges clearly nearer is how the body ends. What
brings them about as near may be, too: the sizes that it has are a direction in which they are not known.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.mechanism.ends import plain_bodies, with_ends
from monodyn.vision.drawing.follow import EdgeSearch
from monodyn.vision.locating.arrange import freed
from monodyn.vision.locating.bundle import SETTLE, Bundle, KeyMasks, refine, spread
from monodyn.vision.locating.oblique import CLEAR, DECISIVE, explicable, fall
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.locating.sought import Sought, refined_names, whole_variables
from monodyn.vision.locating.unit import drawn, growth, scaled

FEW = 8
"""Key frames, at most, in which it is tried how bodies end."""

Refined = Callable[[Bundle, Mapping[str, float]], Bundle]
"""Refines a bundle whose bodies have other ends, as ``with_ends`` takes them."""


def with_seen_ends(
    sought: Sought, masks: KeyMasks, bundle: Bundle, search: EdgeSearch
) -> tuple[Sought, Bundle]:
    """Find out how the bodies end.

    Args:
        sought: The mechanism, and what is known of the camera.
        masks: Masks of the key frames.
        bundle: A refinement over them.
        search: How the edges are looked for.

    Returns:
        Both with the ends that are seen.
    """

    def exchanged(ends: Mapping[str, float]) -> Sought:
        return replace(sought, mechanism=with_ends(sought.mechanism, ends))

    def refined(begun: Bundle, ends: Mapping[str, float]) -> Bundle:
        other, known = exchanged(ends), begun.mechanism.values
        file = scaled(other.mechanism, sought.unit)
        grown, own = growth(begun.mechanism, file), freed(begun.mechanism, file)
        file = file.with_following(own, follow=False)
        sizes = {p.name: known.get(p.name, grown * p.value) for p in drawn(file)}
        # an overhang that the file has not begins where a round end at the hinge does, a flat one before that
        new = [p for p in drawn(file) if p.name not in known and p.kind in ("tail", "tip")]
        reach = {p.name: 0.5 if ends[p.owner] else 0.25 for p in new}
        sizes |= {p.name: reach[p.name] * known[f"{p.owner}.width"] for p in new}
        mechanism = file.with_values(sizes)
        count = len(begun.positions)
        guess = SceneGuess(mechanism, begun.camera, begun.positions, np.zeros(count))
        # what no edge shows stays where it is, not where the file has it
        start = replace(sought.start, mechanism=mechanism)
        variables = whole_variables(sought, guess, start, refined_names(other))
        return refine(few if count == len(rows) else masks, guess, variables, search, settle=SETTLE)

    rows = np.unique(np.linspace(0, len(bundle.positions) - 1, FEW).round().astype(int))
    few, tried = masks.only(rows.tolist()), replace(bundle, positions=bundle.positions[rows])
    bodies = plain_bodies(sought.mechanism)
    if not bodies:
        return sought, bundle
    seen, ends = seen_ends(tried, bodies, refined)
    if not ends:
        return sought, replace(bundle, alternatives=seen.alternatives)
    whole = refined(replace(seen, positions=bundle.positions), ends)
    return exchanged(ends), replace(whole, alternatives=seen.alternatives)


def seen_ends(
    bundle: Bundle, bodies: Mapping[str, bool], refined: Refined
) -> tuple[Bundle, dict[str, float]]:
    """Find how bodies end.

    Args:
        bundle: The refinement with the ends of the file.
        bodies: The bodies that may end otherwise, and whether they end round in the file.
        refined: Refines it with other ends.

    Returns:
        The best of the refinements, with what else is as likely, and the ends that are not the file's.
    """
    best, ends = refined(bundle, {}), {}
    alternatives: list[dict[str, float]] = []
    # all bodies at once first: one that ends otherwise draws the others from their places, too
    for some in (list(bodies), *([body] for body in bodies if len(bodies) > 1)):
        file = {body: share for body, share in ends.items() if body not in some}
        shares = {body: round_share(best.mechanism, body) for body in some}
        other = file | {body: 0.0 if bodies[body] else share for body, share in shares.items()}
        first, second = (best if how.keys() == ends.keys() else refined(best, how) for how in (file, other))
        gain = fall(second, first)
        if gain > -(CLEAR**2):
            # the other ends have overhangs, which are nothing that speaks for them
            reaching = file | {body: share if bodies[body] else 0.0 for body, share in shares.items()}
            gain -= max(fall(refined(best, reaching), first), 0.0)
        clear = max(CLEAR**2, DECISIVE * explicable(first, second))
        best, ends = (second, ends | other) if gain > clear else (first, file)
        if -(CLEAR**2) < gain < clear and len(some) == 1:
            alternatives.append(spread(first, second))
    return replace(best, alternatives=tuple(alternatives)), ends


def round_share(mechanism: Mechanism, body: str) -> float:
    """Return the share of a body's whole length that half of its width is.

    Args:
        mechanism: The mechanism.
        body: The body, of one bar.
    """
    known = mechanism.values
    cap = 0.5 * known[f"{body}.width"]
    whole = known[f"{body}.length"] + known.get(f"{body}.tail", cap) + known.get(f"{body}.tip", 0.0)
    return min(cap / whole, 0.5)
