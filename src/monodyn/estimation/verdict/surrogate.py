"""An optimum in, the record's residuals as closed forms of sizes and frictions out.

The motion depends on sizes through a few regrouped inertias (``regrouped``), which it shows so well that it
is linear in these, however far it is from linear in the sizes. How the inertias follow from the sizes, and
what is assumed of these, are closed forms, so that a point costs no simulation.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from monodyn.arrays import plain
from monodyn.cores import on_all_cores
from monodyn.estimation.shooting.common import whitened_shifts
from monodyn.estimation.shooting.prior import PROPORTION_STD, size_ratios
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.trial import Trial
from monodyn.estimation.shooting.unknowns import FORCES
from monodyn.estimation.verdict.regrouped import Trees, features
from monodyn.mechanism.assembled import links_of_many
from monodyn.mechanism.parts import PLACE_KINDS
from monodyn.mechanism.plan import JOINT_COLUMNS
from monodyn.optimize import SearchSettings, minimize

UNEXPLAINED = 1e-3
"""Share of the record's information about the unknowns that the inertias may leave out."""
HELD = 1e-12
"""Directions with less than this share of the largest information count as without any."""
BESIDES = ("roll", "time_scale", "period", "lag", "torque")
"""Kinds on which the motion depends in addition to the inertias."""
AT_ONCE = 64
"""Draws whose features are computed at a time."""
STEP = 1e-30
"""Complex step, whose square vanishes."""
SMALLEST = 0.1
"""Least ratio of an overhang that is assumed, of the file's."""
LONGEST = 1.0
"""Longest step of the logarithm of an overhang's ratio."""
EXACT = SearchSettings(evaluations=200, decrease=1e-6, relative=1e-9)
"""The search for the peak; an evaluation takes a millisecond."""


@dataclass(frozen=True, eq=False)
class Sizes:
    """The unknowns in coordinates in which what is assumed of them is normal, many at once.

    They are the coordinates of the search, but the logarithm of an overhang's ratio; and frictions in
    proportion to the inertia by which all is divided, where the motion shows nothing but that.

    Attributes:
        problem: The problem.
        unit: That inertia at the optimum; None where frictions are not in proportion to it.
    """

    problem: Problem
    unit: float | None = None

    @cached_property
    def overhang(self) -> np.ndarray:
        """True for overhangs, bool (param,)."""
        unknowns = self.problem.unknowns
        return unknowns.ratio & ~unknowns.of_kind(*PLACE_KINDS, *FORCES)

    @cached_property
    def relative(self) -> np.ndarray:
        """True for frictions that are in proportion to the inertia, bool (param,)."""
        unknowns = self.problem.unknowns
        return unknowns.of_kind(*FORCES) & (self.unit is not None)

    @cached_property
    def rows(self) -> np.ndarray:
        """Rows of the unknowns, then of what is tied to them, in the mechanism's table, int (row,)."""
        unknowns = self.problem.unknowns
        return self.problem.mechanism.rows((*unknowns.names, *unknowns.tied))

    @cached_property
    def frictions(self) -> list[tuple[int, int]]:
        """Link and column of the frictions that are in proportion to the inertia."""
        moved = self.rows[: len(self.problem.unknowns)][self.relative]
        links, terms = np.nonzero(np.isin(self.problem.mechanism.plan.joints, moved))
        return [(i, JOINT_COLUMNS[term]) for i, term in zip(links.tolist(), terms.tolist(), strict=True)]

    def of(self, x: np.ndarray) -> np.ndarray:
        """Return these coordinates at the optimum, (param,).

        Args:
            x: Coordinates of the search, (param,).
        """
        with np.errstate(divide="ignore"):
            return np.where(self.overhang, np.log(np.where(self.overhang, np.maximum(x, 0.0), 1.0)), x)

    def searched(self, points: np.ndarray) -> np.ndarray:
        """Return the coordinates of the search, frictions still in proportion, (draw, param).

        Args:
            points: Points, (draw, param).
        """
        return np.where(self.overhang, np.exp(np.where(self.overhang, points, 0.0)), points)

    def at(self, points: np.ndarray) -> tuple[np.ndarray, Trees]:
        """Return values and trees.

        Args:
            points: Points, (draw, param).

        Returns:
            Values by row of the mechanism's plan, (param, draw), and the trees; frictions are themselves.
        """
        mechanism, unknowns = self.problem.mechanism, self.problem.unknowns
        plan, count = mechanism.plan, len(mechanism.plan.table.names)
        found = unknowns.with_tied(self.searched(points)).T
        values = np.repeat(mechanism.numbers[:count, None].astype(found.dtype), len(points), axis=1)
        rows, inner = self.rows, self.rows < count
        values[rows[inner]] = found[inner]
        gravity = np.array([0.0 * values[0], -values[plan.index["gravity"]]])
        trees = Trees(
            plan.parent, plan.kind, links_of_many(plan.packed, values, plain(mechanism.own)), gravity
        )
        if self.unit is not None:
            unit = features(trees, absolute=False)[1] / self.unit
            values[rows[: len(unknowns)][self.relative]] *= unit
            for i, column in self.frictions:
                trees.links[i, column] *= unit
        return values, trees

    def unknowns(self, points: np.ndarray) -> np.ndarray:
        """Return the values of the unknowns, (draw, param).

        Args:
            points: Points, (draw, param).
        """
        mechanism, names = self.problem.mechanism, self.problem.unknowns.names
        own, values = self.problem.unknowns.values(self.searched(points)), self.at(points)[0]
        rows = mechanism.rows(names)
        inner = rows < len(values)
        own[:, inner] = values[rows[inner]].T
        return own

    def shown(self, points: np.ndarray) -> np.ndarray:
        """Return what the motion depends on, (feature, draw).

        Args:
            points: Points, (draw, param).
        """
        data, unknowns = self.problem.data, self.problem.unknowns
        trees = self.at(points)[1]
        found, unit = features(trees, absolute=bool(data.torques))
        more = [
            points[:, i] / (unit if kind == "torque" else 1.0)
            for i, kind in enumerate(unknowns.kinds)
            if kind in BESIDES
        ]
        if data.slide.any():
            more.append(points @ self.problem.prior.weights)
        return np.array([*found, *more])

    def differentiated(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what the motion depends on and its derivatives, (draw, feature) and (draw, feature, param).

        Args:
            points: Points, (draw, param).
        """
        count = points.shape[1]
        steps = np.concatenate((1j * STEP * np.eye(count), np.zeros((1, count))))

        def some(first: int) -> tuple[np.ndarray, np.ndarray]:
            """Return both of some of the draws."""
            near = points[first : first + AT_ONCE]
            found = self.shown((near[:, None] + steps).reshape(-1, count)).reshape(-1, len(near), count + 1)
            slopes = np.ascontiguousarray(np.moveaxis(np.imag(found[:, :, :-1]), 1, 0))
            return np.real(found[:, :, -1]).T, slopes / STEP

        parts = on_all_cores(some, range(0, max(len(points), 1), AT_ONCE))
        if len(parts) == 1:
            return parts[0]
        shown, slopes = (np.concatenate(part) for part in zip(*parts, strict=True))
        return shown, slopes


@dataclass(frozen=True, eq=False)
class Surrogate:
    """Residuals of the record and of what is known before, linear in what the motion depends on.

    Attributes:
        sizes: The coordinates.
        start: The optimum in them, (param,).
        load: What the record's residuals change by, (row, feature).
        level: Their value where all features are zero, (row,).
        shift: What shifts of all positions change these residuals by, (row, direction).
        belief: What is known before, by coordinate, (belief, param).
        aims: What these should be, (belief,).
    """

    sizes: Sizes
    start: np.ndarray
    load: np.ndarray
    level: np.ndarray
    shift: np.ndarray
    belief: np.ndarray
    aims: np.ndarray

    @cached_property
    def reach(self) -> np.ndarray:
        """Longest step of each coordinate, (param,)."""
        return np.where(self.sizes.overhang, LONGEST, self.sizes.problem.unknowns.reach)

    def rows(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the residuals, those of the record first, and their Jacobian.

        Args:
            points: Points, (draw, param).

        Returns:
            Residuals (draw, row) and derivatives (draw, row, param).
        """
        shown, slopes = self.sizes.differentiated(points)
        record = shown @ self.load.T + self.level
        before = points @ self.belief.T - self.aims
        steep = np.broadcast_to(self.belief, (len(points), *self.belief.shape))
        return np.hstack((record, before)), np.concatenate((self.load @ slopes, steep), axis=1)

    def peak(self) -> np.ndarray:
        """Return the point of least residuals, (param,)."""

        def single(point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            with np.errstate(all="ignore"):
                residuals, jacobian = self.rows(point[None])
            return residuals[0], jacobian[0]

        return minimize(single, self.start, settings=EXACT, reach=self.reach).x


def surrogate_of(problem: Problem, trial: Trial, at_bound: np.ndarray) -> Surrogate | None:
    """Bring what a record says about the unknowns into the form of a surrogate.

    Args:
        problem: The problem, weighted with the noise as found.
        trial: Its optimum.
        at_bound: True for unknowns on a bound, (param,): there the optimum counts as the best point.

    Returns:
        The surrogate; None where the motion depends on more than the regrouped inertias, or an overhang has
        ended at zero, which has no logarithm.
    """
    sizes = Sizes(problem)
    start = sizes.of(trial.x)
    if not np.isfinite(start).all():
        return None
    information, pull, shift = _information(problem, trial)
    pull = np.where(at_bound, 0.0, pull)
    # an overhang's ratio changes by itself where its logarithm changes by one
    steep = np.where(sizes.overhang, trial.x, 1.0)
    information, pull, shift = information * np.outer(steep, steep), pull * steep, shift * steep[:, None]
    shown, slopes = (part[0] for part in sizes.differentiated(start[None]))
    size = np.linalg.norm(slopes, axis=1)
    size = np.where(size > 0, size, np.inf)
    back = np.linalg.pinv(slopes / size[:, None], rcond=1e-9)
    inner = back.T @ information @ back
    again = (slopes / size[:, None]).T @ inner @ (slopes / size[:, None])
    if np.abs(again - information).max(initial=0.0) > UNEXPLAINED * np.abs(information).max(initial=0.0):
        return None
    values, vectors = np.linalg.eigh(inner)
    used = values > HELD * values.max(initial=0.0)
    root, basis = np.sqrt(values[used]), vectors[:, used]
    load = root[:, None] * basis.T / size
    level = (basis.T @ (back.T @ pull)) / root - load @ shown
    # what the record says is now told by what the motion depends on, whatever the coordinates
    if not problem.data.torques:
        unit = features(sizes.at(start[None])[1], absolute=False)[1]
        sizes = Sizes(problem, float(unit[0]))
    moved = (basis.T @ (back.T @ shift)) / root[:, None]
    return Surrogate(sizes, start, load, level, moved, *_beliefs(problem, sizes, trial.x))


def _information(problem: Problem, trial: Trial) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return information of the record about the unknowns (param, param), the cost's gradient (param,) and
    how shifts of all positions move that, (param, direction), start states fitted."""
    residuals, jacobian = problem.rows(trial)
    count, shifts = len(trial.x), whitened_shifts(problem.data)
    information, pull, moved = np.zeros((count, count)), np.zeros(count), np.zeros((count, shifts.shape[2]))
    for first, stop in zip(trial.pieces.first[:-1], trial.pieces.first[1:], strict=True):
        rows, off = jacobian[first:stop].reshape(-1, jacobian.shape[2]), residuals[first:stop].ravel()
        states, _ = np.linalg.qr(rows[:, count:])
        shared = rows[:, :count] - states @ (states.T @ rows[:, :count])
        information += shared.T @ shared
        pull += shared.T @ off
        moved += shared.T @ shifts[first:stop].reshape(len(shared), -1)
    return information, pull, moved


def _beliefs(problem: Problem, sizes: Sizes, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what is known of the unknowns before the motion is, and what it is about: (belief, param) and
    (belief,)."""
    unknowns, prior = problem.unknowns, problem.prior
    information, rows, aims = prior.information.copy(), [], []
    centre = unknowns.x0 if prior.centre is None else unknowns.x0 + prior.centre
    # a normal ratio may be drawn below zero, where it has no logarithm
    usual = sizes.of(np.where(sizes.overhang, np.maximum(centre, SMALLEST * unknowns.x0), centre))
    for ratio in size_ratios(problem.mechanism, unknowns):
        at = unknowns.names.index(ratio.size.name)
        if sizes.overhang[at]:
            # the search assumes a normal ratio in place of a normal logarithm
            information -= np.outer(ratio.change, ratio.change) / ratio.std**2
            row = np.zeros(len(x))
            row[at] = 1.0 / PROPORTION_STD
            rows.append(row)
            aims.append(row @ usual)
    values, vectors = np.linalg.eigh(information)
    used = values > 1e-9 * np.abs(values).max(initial=0.0)
    others = np.sqrt(values[used])[:, None] * vectors[:, used].T
    steep = np.where(sizes.overhang, x, 1.0)
    rows += list(others * steep)
    aims += list(others * steep @ sizes.of(x) - others @ (x - centre))
    return np.array(rows).reshape(-1, len(x)), np.array(aims)
