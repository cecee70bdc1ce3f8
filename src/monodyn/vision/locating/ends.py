"""Whether bodies end flat or round, and how far beyond their hinges: as the pictures show it, not the file.

Where a body of one bar ends otherwise than its file says, its edges pull at its length, which comes out by a
part of its width too short or too long. So each such body is refined once more with flat ends and with round
ones, both free to reach beyond its hinges. What brings the edges clearly nearer is how the body ends. What
brings them about as near may be, too: the sizes that it has are a direction in which they are not known.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from monodyn.mechanism import Mechanism
from monodyn.vision.locating.bundle import Bundle
from monodyn.vision.locating.oblique import CLEAR, fall

Refined = Callable[[Bundle, Mapping[str, float]], Bundle]
"""Refines a bundle whose bodies have other ends, as ``with_ends`` takes them."""


def seen_ends(bundle: Bundle, bodies: Sequence[str], refined: Refined) -> tuple[Bundle, dict[str, float]]:
    """Find how bodies end.

    Args:
        bundle: The refinement with the ends of the file.
        bodies: Names of the bodies that may end otherwise.
        refined: Refines it with other ends.

    Returns:
        The best of the refinements, with what else is as likely, and the ends that are not the file's.
    """
    T0=__import__('time').time()
    best, ends = refined(bundle, {}), {}
    alternatives: list[dict[str, float]] = []
    # all bodies at once first: one that ends otherwise draws the others from their places, too
    for some in (bodies, *([body] for body in bodies if len(bodies) > 1)):
        kept = {body: share for body, share in ends.items() if body not in some}
        flat = refined(best, kept | dict.fromkeys(some, 0.0))
        shares = {body: round_share(flat.mechanism, body) for body in some}
        tried = [(best, ends), (flat, kept | dict.fromkeys(some, 0.0)), (refined(best, kept | shares), kept | shares)]
        if ends.keys() & some:
            tried.append((refined(best, kept), kept))
        print(round(__import__('time').time()-T0,1), some, [(round(fall(one, best)), round(one.agreement,4), one.rms_px.mean().round(3), {k:round(v,5) for k,v in one.mechanism.values.items() if k.split('.')[0] in some and k.split('.')[-1] in ('length','width','tail','tip','thickness')}) for one, _ in tried])
        # of those that nothing clearly tells apart the first
        most = max(fall(one, best) for one, _ in tried)
        near = [(one, how) for one, how in tried if fall(one, best) > most - CLEAR**2]
        best, ends = near[0]
        if len(some) == 1:
            alternatives += [_change(best, other) for other, _ in near[1:]]
    return replace(best, alternatives=tuple(alternatives)), ends


def round_share(mechanism: Mechanism, body: str) -> float:
    """Return the share of a body's whole length that half of its width is.

    Args:
        mechanism: The mechanism.
        body: The body, of one bar.
    """
    known = mechanism.values
    whole = sum(known.get(f"{body}.{kind}", 0.0) for kind in ("length", "tail", "tip"))
    return min(0.5 * known[f"{body}.width"] / whole, 0.5)


def _change(bundle: Bundle, other: Bundle) -> dict[str, float]:
    """Return by how much the refined variables are others in another refinement, by name."""
    here, there = (
        dict(zip(one.variables.names, one.variables.read(one.mechanism, one.camera).tolist(), strict=True))
        for one in (bundle, other)
    )
    return {name: there[name] - value for name, value in here.items() if name in there}
