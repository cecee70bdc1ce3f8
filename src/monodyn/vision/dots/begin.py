"""Tracklets in, the likeliest ways to name some of them out, each with the scene that it makes.

Where as many things move at once as there are dots, each order of names makes a mechanism of them: a pivot,
lengths, a camera. In the right order the things stay where it has them.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from monodyn.errors import VideoError
from monodyn.vision.dots.tracklets import Tracklet
from monodyn.vision.points.adjust import LEAST_NOISE_PX, Adjustment, Fitted, Seen, refine
from monodyn.vision.points.marks import Mark
from monodyn.vision.points.start import SoughtPoints, started

LEAST_ROWS = 8
"""Frames in which as many things move at once as there are dots, at least."""
MOST_ROWS = 48
"""Frames of a stretch from which names are judged, at most."""
STRETCHES = 3
"""Stretches of the clip from which names are judged."""
MOST_SETS = 60
"""Sets of things that may be the dots, at most."""
ROUNDS = 10
"""Steps of a refinement that only compares."""
GUESSES = 4
"""Ways to name the things that are followed through the clip."""
WORSE = 8.0
"""Noise of a guess over the least one up to which it is followed."""
RIGID, RIGID_PX = 2.0, 2.0
"""Change of the distance between two dots of one link over the least one, and in px, up to which they may be
on it."""


@dataclass(frozen=True, eq=False)
class Guess:
    """Names of some tracklets and the scene that they make.

    Attributes:
        tracklets: Numbers of the tracklets, in the order of the dots.
        rows: Rows of the frames from which it was made, (frame,).
        adjustment: What was refined.
        fitted: Where it ended.
        noise: Typical distance of the things from where the mechanism has them [px].
    """

    tracklets: tuple[int, ...]
    rows: np.ndarray
    adjustment: Adjustment
    fitted: Fitted
    noise: float


def guesses(sought: SoughtPoints, marks: tuple[Mark, ...], tracklets: Sequence[Tracklet]) -> list[Guess]:
    """Return the likeliest ways to name things that move at the same time.

    Args:
        sought: The mechanism, and what is known of the camera.
        marks: The dots.
        tracklets: What moves.

    Returns:
        The guesses, the likeliest first; none where too few things move at once.
    """
    found: list[Guess] = []
    for chosen, rows in _together(tracklets, len(marks))[:STRETCHES]:
        for order in _rigid_orders(marks, tracklets, chosen, rows):
            guess = _guess(sought, marks, [tracklets[k] for k in order], rows)
            if guess is not None:
                found.append(replace(guess, tracklets=order))
    found.sort(key=lambda guess: guess.noise * (1.0 + _inverted(guess)))
    # what is much worse than the best may be right only if little tells the best from chance
    likely = WORSE * max(found[0].noise, LEAST_NOISE_PX) if found else 0.0
    return [guess for guess in found[:GUESSES] if guess.noise <= likely]


def seen_in(tracklets: Sequence[Tracklet | None], rows: np.ndarray) -> Seen:
    """Return the places of things in some frames as points.

    Args:
        tracklets: One for each point, or None.
        rows: Rows of the frames, (frame,).
    """
    px = np.full((len(rows), len(tracklets), 2), np.nan)
    for k, tracklet in enumerate(tracklets):
        if tracklet is not None:
            _, mine, own = np.intersect1d(rows, tracklet.row, return_indices=True)
            px[mine, k] = tracklet.px[own]
    return Seen(px, np.isfinite(px[..., 0]).astype(np.float64))


def _together(tracklets: Sequence[Tracklet], count: int) -> list[tuple[tuple[int, ...], np.ndarray]]:
    """Return sets of so many tracklets with the rows in which all of them are seen, the longest first."""
    last = max((int(t.row[-1]) for t in tracklets), default=-1)
    active = np.zeros((len(tracklets), last + 1), dtype=bool)
    for k, tracklet in enumerate(tracklets):
        active[k, tracklet.row] = True
    sets: set[tuple[int, ...]] = set()
    for column in np.unique(active, axis=1).T:
        on = np.flatnonzero(column)
        # of many things that move at once the longest ones are tried
        on = np.sort(on[np.argsort(-active[on].sum(axis=1), kind="stable")[: count + 3]])
        if len(on) >= count:
            sets.update(itertools.combinations(on.tolist(), count))
        if len(sets) > MOST_SETS:
            break
    found = [(chosen, np.flatnonzero(active[list(chosen)].all(axis=0))) for chosen in sets]
    found = [(chosen, rows) for chosen, rows in found if len(rows) >= LEAST_ROWS]
    return sorted(found, key=lambda pair: (-len(pair[1]), pair[0]))


def _rigid_orders(
    marks: tuple[Mark, ...], tracklets: Sequence[Tracklet], chosen: tuple[int, ...], rows: np.ndarray
) -> list[tuple[int, ...]]:
    """Return the orders of names in which the dots of each link keep their distances best."""
    orders = list(itertools.permutations(chosen))
    pairs = [
        (i, j) for i, j in itertools.combinations(range(len(marks)), 2) if marks[i].link == marks[j].link
    ]
    if not pairs:
        return orders
    px = dict(zip(chosen, seen_in([tracklets[k] for k in chosen], rows).px.transpose(1, 0, 2), strict=True))
    change = {
        (a, b): float(np.std(np.linalg.norm(px[a] - px[b], axis=1)))
        for a, b in itertools.permutations(chosen, 2)
    }
    worst = [max(change[order[i], order[j]] for i, j in pairs) for order in orders]
    most = max(RIGID * min(worst), RIGID_PX)
    return [order for order, own in zip(orders, worst, strict=True) if own <= most]


def _guess(
    sought: SoughtPoints, marks: tuple[Mark, ...], tracklets: Sequence[Tracklet], rows: np.ndarray
) -> Guess | None:
    """Return the scene that tracklets in an order of names make; None where they make none."""
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), MOST_ROWS)).astype(int)]
    seen = seen_in(tracklets, rows)
    try:
        adjustment, fitted = started(sought, marks, seen, moving=False)
    except VideoError:
        return None
    with np.errstate(all="ignore"):
        fitted = refine(adjustment, fitted, seen, rounds=ROUNDS)
    noise = float(np.sqrt(np.mean(fitted.noise**2)))
    return Guess((), rows, adjustment, fitted, noise) if np.isfinite(noise) else None


def _inverted(guess: Guess) -> int:
    """Return how many pairs of dots on one link are in another order from the hinge than in the file."""
    places = guess.adjustment.places
    now, _ = places.at(guess.fitted.mechanism, guess.fitted.own)
    far, file = np.hypot(*now.T), [float(np.hypot(*mark.place)) for mark in places.marks]
    pairs = itertools.combinations(range(len(file)), 2)
    return sum(
        (far[i] - far[j]) * (file[i] - file[j]) < 0.0
        for i, j in pairs
        if places.marks[i].link == places.marks[j].link
    )
