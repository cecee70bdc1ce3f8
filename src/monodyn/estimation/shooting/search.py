"""Fits from one start after the other, until the motion is explained."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from monodyn.estimation.record.samples import Data
from monodyn.estimation.record.smooth import NORMAL, Smoothed
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting import shoot
from monodyn.estimation.shooting.accelerations import smooth_motion
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.starts import STATES_ALONE, starts
from monodyn.estimation.wording import listed
from monodyn.optimize import SearchSettings, first_good
from monodyn.types import Progress

FOLLOWED_NOISE = 3.0
"""A motion is explained when the typical residual is below this many times the stated noise ..."""
FOLLOWED_SHARE = 0.005
"""... or below this share of the motion."""
HOPELESS_NOISE = 10.0
"""A start is given up after its first stage if the typical residual is above this many times the noise ..."""
HOPELESS_SHARE = 0.01
"""... and above this share of the motion: pieces so short follow any motion that the model has."""
NEGLIGIBLE = 0.01
"""Integration error that does not count, as a share of the typical residual."""
ALIKE = 15.0
"""Twice the logarithm of the likelihood by which the data tell two optima apart."""
SAME = 0.01
"""Two searches led to the same motion if their residuals differ by less than this share of themselves."""
STILL_NOISE = 4.0
"""A joint whose positions scatter by less than this many times their noise does not move."""
RIGID_NOISE = 1.5
"""A joint whose positions scatter by less than this many times their noise shows no motion at all ..."""
MOVING_NOISE = 50.0
"""... where another one's scatter by more than this many times theirs: through the dynamics it would move."""
NOTHING_MOVES = "Nothing moves in the record: no joint leaves its noise; give frames with motion."
"""Status of a fit to a record at rest, whatever the method."""


class Search:
    """Fits of one problem from one start after the other.

    Attributes:
        problem: The problem.
        route: How each of them goes.
        motion: Smooth motion at the measured rows.
    """

    def __init__(
        self,
        problem: Problem,
        smoothed: tuple[Smoothed, ...],
        settings: IdentifySettings,
        progress: Progress | None,
    ) -> None:
        fine = SearchSettings(evaluations=settings.evaluations, decrease=1e-4, relative=1e-7)
        self.problem = problem
        self.route = shoot.Route(settings.piece, settings.error_bound, fine, NEGLIGIBLE)
        self.motion = smooth_motion(problem, smoothed)
        self._speed = _speed(problem.data, smoothed)
        self._smoothed, self._settings = smoothed, settings
        self._progress, self._done = progress, 0

    def from_starts(self, first: int = 0, *, give_up: bool = False) -> tuple[shoot.Optimum, int]:
        """Search from one start after the other until the motion is explained, or two lead to one optimum.

        Args:
            first: The start to begin with.
            give_up: Give a start up after any stage, and stay with the pieces of the best where all were.

        Returns:
            The best optimum and the number of starts up to the last that was tried.
        """
        # starts are made one by one, when it is their turn: the first usually explains the motion
        tried = starts(
            self.problem, self.motion, self._smoothed, self.route, self._settings.starts, self._settings.seed
        )
        endings: list[shoot.Optimum] = []

        def ending(start: tuple[np.ndarray, shoot.Route]) -> shoot.Optimum:
            endings.append(self._shot(*start, give_up=True, patient=not give_up))
            return endings[-1]

        best, count = first_good(
            ending, islice(tried, first, None), cost=residual_size, good=self.explained, same=_same
        )
        if not best.complete and not give_up:
            # where every start was given up the best of them goes all the way after all, as exactly as it
            # follows the record: no valley is near
            best = self._shot(best.x, self.route, give_up=False, patient=False, share=NEGLIGIBLE)
        return replace(best, twins=self._twins(best, endings)), first + count

    def _twins(self, best: shoot.Optimum, endings: Sequence[shoot.Optimum]) -> tuple[np.ndarray, ...]:
        """Return where other starts ended that explain the record as well, beyond a rise of the cost."""
        apart = 0.5 * ALIKE * max(best.sigma, 1.0) ** 2
        found: list[shoot.Optimum] = []
        for other in endings:
            near = other.complete and best.complete and abs(other.cost - best.cost) < apart
            if other is not best and near and all(self._rise(one, other) > apart for one in (best, *found)):
                found.append(other)
        return tuple(other.x for other in found)

    def _rise(self, one: shoot.Optimum, other: shoot.Optimum) -> float:
        """Return by how much the cost half-way between two optima is above theirs: along a direction that is
        open it does not rise, and the intervals say so."""
        start = one.trial.at(0.5 * (one.x + other.x), 0.5 * (one.trial.states + other.trial.states))
        middle = shoot.fit_pieces(self.problem, start, self.route, STATES_ALONE, held=True)
        return middle.cost - max(one.cost, other.cost)

    def from_start(self, x: np.ndarray, *, give_up: bool = False) -> shoot.Optimum:
        """Return the optimum to which one start leads.

        Args:
            x: Coordinates of the start, (param,).
            give_up: Stay with the pieces of a stage where these cannot be followed.
        """
        return self._shot(x, self.route, give_up=give_up, patient=False)

    def _shot(
        self, x: np.ndarray, route: shoot.Route, *, give_up: bool, patient: bool, share: float = 0.0
    ) -> shoot.Optimum:
        """Search from one start; where it may be given up, after the first stage or, impatiently, any."""
        hopeless = self.hopeless if give_up else None
        return shoot.multiple_shooting(
            self.problem, x, self._smoothed, route, self.report, hopeless, patient=patient, share=share
        )

    def explained(self, optimum: shoot.Optimum) -> bool:
        """Return whether the motion follows the record, within its noise or nearly.

        A sample counts as much as its joint is fast: where most of a record is rest, anything that comes to
        rest there would follow most of it.

        Args:
            optimum: The optimum.
        """
        if not optimum.complete:
            return False
        near = _weighted_median(np.abs(optimum.residuals), self._speed) < FOLLOWED_NOISE * NORMAL
        off = np.abs(self.problem.differences(optimum.trial)) / np.maximum(
            self.problem.data.motion_size, 1e-12
        )
        return near or all(
            _weighted_median(values, speed) < FOLLOWED_SHARE * NORMAL
            for values, speed in zip(off.T, self._speed.T, strict=True)
        )

    def report(self, stage: shoot.Optimum) -> None:
        """Count a stage for the progress display.

        Args:
            stage: Its result, which is not shown.
        """
        self._done += 1
        if self._progress is not None:
            self._progress("identify", self._done, None)

    def hopeless(self, optimum: shoot.Optimum) -> bool:
        """Return whether short pieces are not even followed, which any motion is that the model has.

        Args:
            optimum: Their fit.
        """
        if not np.isfinite(optimum.cost):
            return True
        difference = shoot.relative_difference(self.problem, optimum.trial)
        return optimum.sigma > HOPELESS_NOISE and difference > HOPELESS_SHARE


def _speed(data: Data, smoothed: tuple[Smoothed, ...]) -> np.ndarray:
    """Return the speed of each joint over its usual one, 0 where it was not measured, (row, dof)."""
    parts = [
        np.abs(found.velocity[data.source[a:b]])
        for found, a, b in zip(smoothed, data.first[:-1], data.first[1:], strict=True)
    ]
    speed = np.where(data.measured, np.nan_to_num(np.concatenate(parts)), 0.0)
    usual = np.sqrt(np.mean(speed**2, axis=0))
    return speed / np.where(usual > 0.0, usual, 1.0)


def _weighted_median(values: np.ndarray, weights: np.ndarray) -> float:
    """Return the value below which half of the weight lies; infinity without any weight."""
    known = np.isfinite(values) & (weights > 0.0)
    values, weights = values[known], weights[known]
    if not len(values):
        return float("inf")
    order = np.argsort(values)
    share = np.cumsum(weights[order])
    return float(values[order][int(np.searchsorted(share, 0.5 * share[-1]))])


def residual_size(optimum: shoot.Optimum) -> float:
    """Return the mean size of the whitened residuals, by which results are ranked: gross errors do not rule.

    Args:
        optimum: The optimum; one that was given up ranks after all that were not.
    """
    size = float(np.mean(np.abs(optimum.residuals)))
    return size if optimum.complete else 1e12 + size


def difference_size(problem: Problem, optimum: shoot.Optimum, joints: Sequence[str]) -> float:
    """Return the mean size of what is left over of some joints, in units of the stated noise, as it compares
    with that of another model, which may have more of them.

    Args:
        problem: The problem.
        optimum: Its optimum.
        joints: Names of the joints.
    """
    every = [joint.name for joint in problem.mechanism.joints]
    columns = [every.index(name) for name in joints]
    sizes = np.abs(problem.differences(optimum.trial)[:, columns]) / problem.data.std[:, columns]
    return float(np.nanmean(sizes))


def _same(one: shoot.Optimum, other: shoot.Optimum) -> bool:
    """Return whether two searches led to one motion, whatever the unknowns that it does not determine."""
    if not (one.complete and other.complete):
        return False
    apart = float(np.median(np.abs(one.residuals - other.residuals)))
    return apart < SAME * max(residual_size(one), residual_size(other))


def obstacle(problem: Problem, smoothed: tuple[Smoothed, ...]) -> str | None:
    """Find the reason why there is no point in a search.

    Args:
        problem: The problem.
        smoothed: Smooth motion of each record.

    Returns:
        The reason, a sentence for the user; None where nothing stands in the way.
    """
    data, unusable = problem.data, problem.prior.unusable
    records, dofs = data.slide.shape
    if unusable:
        return (
            f"The picture's information about {listed(unusable, 12)} is not finite; locate the "
            "mechanism in a clearer part of the clip, or give measured values with --fix."
        )
    # the picture's information about the sizes counts as data
    known = problem.prior.rank
    unknowns = len(problem.unknowns) - known + 2 * dofs * records
    if data.samples <= unknowns:
        return (
            f"{data.samples} measured joint positions cannot determine {unknowns} unknowns (parameters and "
            "start states); give more frames or fix parameters."
        )
    # without smooth motion there is neither a start state nor an acceleration to match
    names = [joint.name for joint in problem.mechanism.joints]
    for i, found in enumerate(smoothed):
        for dof in range(dofs):
            if not np.isfinite(found.noise[dof]):
                record = f" in record {i}" if records > 1 else ""
                return f"Joint {names[dof]!r} was measured under 5 times{record}; give more frames."
    moves = [_moves(data, dof) for dof in range(dofs)]
    if max(moves) <= STILL_NOISE:
        return NOTHING_MOVES
    rigid = [name for name, moved in zip(names, moves, strict=True) if moved <= RIGID_NOISE]
    if rigid and max(moves) > MOVING_NOISE:
        return (
            f"{listed(rigid)} never moves, while {names[int(np.argmax(moves))]} does: what is in the record "
            "has no such joint, or it is stuck. Take a mechanism without it, its bodies made one."
        )
    return None


def _moves(data: Data, dof: int) -> float:
    """Return the scatter of a joint over its noise, of the record where it moves most."""
    most = 0.0
    for first, stop in zip(data.first[:-1], data.first[1:], strict=True):
        use = data.measured[first:stop, dof]
        if use.any():
            values = data.position[first:stop, dof][use]
            noise = float(np.median(data.std[first:stop, dof][use]))
            most = max(most, float(np.std(values)) / max(noise, 1e-300))
    return most
