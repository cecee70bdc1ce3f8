"""Widths that have settled on wrong edges, tried anew.

A rod that hardly stands out shows a line inside of it, or its bolts, as clearly as its sides. A width that
began near the one stays there however well the other would fit. So where much of the outline lies on no edge,
each width begins once more from those of wider geoms.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from monodyn.vision.drawing.follow import EdgeSearch
from monodyn.vision.locating.bundle import SETTLE, Bundle, KeyMasks, refine
from monodyn.vision.locating.search import SceneGuess

WELL_MATCHED = 0.9
"""Share of the outline on edges from which no width is tried anew."""
FEW = 8
"""Key frames, at most, in which they are tried."""
OTHER = 1.5
"""Ratio of two widths from which one is not the other."""
MORE_AGREE = 0.01
"""Share of the outline's samples that must agree in addition for a width to be another."""
REMAIN = 0.97
"""Share of the samples on edges that must be there still: a geom that hides inside of another loses more."""


def rewidened(masks: KeyMasks, bundle: Bundle, search: EdgeSearch) -> Bundle:
    """Begin each width once more from those of wider geoms, and keep what agrees better.

    Args:
        masks: Masks of the key frames of the bundle.
        bundle: What was refined so far.
        search: How the edges are looked for.

    Returns:
        The bundle, refined once more over all key frames where a width has changed, else as it is.
    """
    if np.median(bundle.matched) >= WELL_MATCHED:
        return bundle
    rows = np.unique(np.linspace(0, len(bundle.matched) - 1, FEW).astype(int)).tolist()
    few = masks.only(rows)
    begun = best = _settled(few, replace(bundle, positions=bundle.positions[rows]), {}, search)
    variables = bundle.variables
    for name in (n for n, kind in zip(variables.names, variables.kinds, strict=True) if kind == "width"):
        now = best
        for width in _wider(now, name):
            tried = _settled(few, now, {name: width}, search)
            # what hides inside of another geom has no outline left that could lie beside its edges
            if tried.agreement > best.agreement + MORE_AGREE and _met(tried) >= REMAIN * _met(best):
                best = tried
    if best is begun:
        return bundle
    return _settled(masks, replace(best, positions=bundle.positions), {}, search)


def _met(bundle: Bundle) -> float:
    """Return how many outline samples lie on an edge."""
    return float(np.sum(bundle.matched * bundle.samples))


def _wider(bundle: Bundle, name: str) -> Iterator[float]:
    """Return the widths of wider geoms as far as they differ from one another and from that of one."""
    values = bundle.mechanism.values
    known = [values[name]]
    for other in (p.name for p in bundle.mechanism.parameters if p.kind == "width" and not p.follows):
        width = values[other]
        if width > known[0] and all(max(width, k) >= OTHER * min(width, k) for k in known):
            known.append(width)
            yield width


def _settled(masks: KeyMasks, bundle: Bundle, sizes: dict[str, float], search: EdgeSearch) -> Bundle:
    """Refine a bundle over some masks from other sizes until nothing changes."""
    guess = SceneGuess(
        bundle.mechanism.with_values(sizes), bundle.camera, bundle.positions, np.zeros(len(bundle.positions))
    )
    return refine(masks, guess, bundle.variables, search, settle=SETTLE)
