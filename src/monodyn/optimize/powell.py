"""Powell's conjugate directions: a least value without derivatives, by searches along lines."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from monodyn.optimize.bracket import line_search
from monodyn.optimize.minimum import DirectSettings, Minimum, Tally, as_history, checked_sizes
from monodyn.optimize.status import EXHAUSTED, NOT_EVALUABLE, REACHED

USUAL_DIRECT = DirectSettings()
LEAST_DETERMINANT = 1e-3
"""Determinant of the unit directions below which the set counts as collapsed."""
LEAST_REACH = 4.0
"""First step along a line at least, in tolerances."""
SHRINK = 0.1
"""Share of its last first step that a line keeps when it did not move."""
LOOSE = 0.2
"""A line is searched to this share of its first step, as long as that is above the tolerance."""


def powell(
    function: Callable[[np.ndarray], float],
    start: np.ndarray,
    step: np.ndarray | float,
    *,
    settings: DirectSettings = USUAL_DIRECT,
) -> Minimum:
    """Minimize a function by line searches along directions that become conjugate.

    A round searches each direction in turn and then, where Powell's test allows it, the direction from the
    round's start to its end, which replaces the direction of the largest decrease. Nearly dependent
    directions are replaced by the axes. Where a round does not move, another set is tried before the search
    is taken as done (the axes, or the ones between them): along a kink no axis may go down. NaN counts as
    infinite. A single unknown takes one line.

    Args:
        function: Gives the value at x (param,).
        start: First x, (param,).
        step: First step of each unknown, (param,) or one for all; above 0.
        settings: When to stop. The tolerance is a share of each unknown's step: done when a round moves none
            further, and lines are searched to the same share. The evaluations are never exceeded.

    Returns:
        The best point evaluated, with the value after each line search.

    Raises:
        SettingsError: A step is not above 0.

    Source:
        Powell, An efficient method for finding the minimum of a function of several variables without
        calculating derivatives, 1964; the paper's inner search.

    Example:
        >>> found = powell(lambda x: (x[0] - 1.0) ** 2 + (x[0] + x[1]) ** 2, np.zeros(2), 0.5)
        >>> [round(float(x), 2) for x in found.x]
        [1.0, -1.0]
    """
    x = np.array(start, dtype=float)
    step = checked_sizes(step, len(x), "step")
    lines = _Lines(Tally(function), x, step, settings)
    if not np.isfinite(lines.value):
        return lines.end(False, NOT_EVALUABLE)
    if len(x) == 1:
        lines.round()
        done = lines.tally.evaluations < settings.evaluations
        return lines.end(done, REACHED if done else EXHAUSTED)
    return _rounds(lines)


def _rounds(lines: _Lines) -> Minimum:
    """Search round after round until two in a row stand still, or the evaluations run out."""
    while lines.tally.evaluations < lines.most:
        before, x_before = lines.value, lines.x
        tight = lines.round()
        moved = float(np.max(np.abs(lines.x - x_before) / lines.step, initial=0.0))
        if moved > lines.tolerance and lines.value < before:
            lines.stalled = False
            lines.conjugate(x_before, before)
        elif lines.tally.evaluations < lines.most:
            # A round that stood still proves little while its lines were searched loosely, or along one set
            # of directions alone: search them to the tolerance, then other directions, and only then end.
            if tight and lines.stalled:
                return lines.end(True, REACHED)
            lines.shorten()
            if tight:
                lines.turn()
    return lines.end(False, EXHAUSTED)


class _Lines:
    """The best point, the directions, and how far each is expected to reach.

    Directions have unit length in steps; a place along one is in steps as well.
    """

    def __init__(self, tally: Tally, x: np.ndarray, step: np.ndarray, settings: DirectSettings) -> None:
        self.tally, self.step = tally, step
        self.tolerance, self.most = settings.tolerance, settings.evaluations
        self.x, self.value = x, tally(x)
        self.history = [(tally.evaluations, self.value)]
        self.directions = np.eye(len(x))
        self.reach = [1.0] * len(x)
        self.falls = [0.0] * len(x)
        self.along_axes = True
        self.stalled = False

    def round(self) -> bool:
        """Search every direction once; True when each was searched to the tolerance."""
        least = LEAST_REACH * self.tolerance
        tight = True
        for i, direction in enumerate(self.directions):
            # Exact minima along lines that will be replaced are wasted; the reach shrinks as the search
            # converges, and the last rounds are searched to the tolerance. A single unknown has one round
            # alone.
            loose = LOOSE * self.reach[i] if len(self.x) > 1 else 0.0
            tight = tight and loose <= self.tolerance
            self.falls[i], moved = self.along(direction, self.reach[i], max(self.tolerance, loose))
            # The next move along a direction is likely as long as the last one, but a first step of zero
            # would end all search along it.
            self.reach[i] = max(abs(moved), SHRINK * self.reach[i], least)
        return tight

    def along(self, direction: np.ndarray, reach: float, tolerance: float) -> tuple[float, float]:
        """Move to the least value along a direction; how far the value fell, and how far it is there."""
        left = self.most - self.tally.evaluations
        if left <= 0:
            return 0.0, 0.0
        before, origin, move = self.value, self.x, direction * self.step
        found = line_search(
            lambda t: self.tally(origin + t * move),
            0.0,
            reach,
            value=before,
            settings=DirectSettings(tolerance, left),
        )
        # where the line is flat another place may have the same value: without a gain the point stays
        if found.value < before:
            self.x, self.value = origin + found.x * move, found.value
        self.history.append((self.tally.evaluations, self.value))
        return before - self.value, found.x

    def conjugate(self, x_before: np.ndarray, before: float) -> None:
        """Replace the direction of the largest fall by the round's own where Powell's test requires it."""
        if self.tally.evaluations >= self.most:
            return
        # The round's own direction takes the place of that of the largest fall, unless the value rises beyond
        # the round's end (then it adds nothing) or that fall was most of the round's (then the two directions
        # nearly agree and the new set would be dependent), both of which the inequality below tests.
        move = (self.x - x_before) / self.step
        length = float(np.linalg.norm(move))
        # As far again in the same direction: with both ends of the round it gives the curvature along the
        # move.
        beyond = self.tally(2.0 * self.x - x_before)
        largest = int(np.argmax(self.falls))
        fall = self.falls[largest]
        others, farther = before - self.value - fall, before - beyond
        bend = (before - 2.0 * self.value + beyond) * others * others
        if not (beyond < before and 2.0 * bend < fall * farther * farther):
            return
        # For a quadratic function the direction between two minima over the same set is conjugate to that
        # set: later searches along the kept directions do not undo what is gained along this one.
        _, moved = self.along(move / length, length, max(self.tolerance, LOOSE * length))
        kept = [i for i in range(len(self.x)) if i != largest]
        self.directions = np.vstack((self.directions[kept], move / length))
        self.reach = [self.reach[i] for i in kept] + [max(abs(moved), LEAST_REACH * self.tolerance)]
        self.along_axes = False
        # Dependent directions no longer span the space, and the search would end in the plane that they span.
        if abs(np.linalg.det(self.directions)) < LEAST_DETERMINANT:
            self.directions, self.along_axes = np.eye(len(self.x)), True
            self.reach = [max(self.reach)] * len(self.x)

    def shorten(self) -> None:
        """Begin the next lines with the shortest steps, so that they are searched to the tolerance."""
        self.reach = [LEAST_REACH * self.tolerance] * len(self.x)

    def turn(self) -> None:
        """Take other directions after a round that did not move: the axes, or between them."""
        size = len(self.x)
        self.directions = _between_axes(size) if self.along_axes else np.eye(size)
        self.along_axes = not self.along_axes
        self.stalled = True

    def end(self, converged: bool, status: str) -> Minimum:
        """Return the best point evaluated."""
        x = self.x if self.tally.x is None else self.tally.x
        value = min(self.value, self.tally.value)
        return Minimum(x, value, self.tally.evaluations, converged, as_history(self.history), status)


def _between_axes(size: int) -> np.ndarray:
    """Return orthogonal unit directions that mix the axes (cosine transform), (size, size)."""
    k = np.arange(size)
    mixed = np.cos(np.pi * np.outer(k, k + 0.5) / size)
    return mixed / np.linalg.norm(mixed, axis=1, keepdims=True)
