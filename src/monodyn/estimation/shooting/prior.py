"""Unknowns in, what is known of them before the motion is: by the picture, and by the file's proportions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from monodyn.estimation.shooting.unknowns import Unknowns, assumed_sizes
from monodyn.mechanism import Mechanism, Parameter
from monodyn.mechanism.parts import PLACE_KINDS
from monodyn.mechanism.upright import ROLL, ROLL_STD

THICKNESS_STD = 0.7
"""Standard deviation of the logarithm of a further geom's thickness over that of its body's main one, about
the file's: a factor of two. No picture shows a thickness."""
PROPORTION_STD = 0.5
"""Standard deviation of the logarithm of a size that nothing measures over its body's length, about the
file's: a factor of 1.6; of a place, of its ratio to the size that it stands against."""
RATIO_STD = float(np.sqrt(np.exp(2.0 * PROPORTION_STD**2) - 2.0 * np.exp(0.5 * PROPORTION_STD**2) + 1.0))
"""Root mean square of a ratio's distance from one whose logarithm has that standard deviation about zero:
what is searched as a ratio is larger than the file's more often by a factor than it is smaller."""
HARDLY = 0.5
"""Share of these from which on a ratio is hardly known better than it was assumed."""


@dataclass(frozen=True, eq=False)
class Proportion:
    """A ratio that is about the file's.

    Attributes:
        size: What is in proportion to another one: a thickness, a size, a place.
        change: Derivative of the logarithm of the ratio, or of a place's ratio, by coordinate, (param,).
        std: Its standard deviation.
    """

    size: Parameter
    change: np.ndarray
    std: float

    def hardly_known(self, covariance: np.ndarray) -> bool:
        """Return whether the motion has hardly added to what was assumed.

        Args:
            covariance: Covariance of the coordinates, (param, param).
        """
        return bool(self.change @ covariance @ self.change > (HARDLY * self.std) ** 2)


@dataclass(frozen=True, eq=False)
class Prior:
    """The picture's information about sizes: the cost 1/2 d.information.d of a change d of the coordinates.

    Attributes:
        information: Information matrix over the unknowns, (param, param); zero for those not measured.
        weights: Share of each unknown in the logarithm of the common scale, (param,).
        unusable: Unknowns about which the picture's knowledge is not a finite number; it is left out.
        negative: Size of the part of the information that was below zero, which no information is, against
            the largest; it is left out.
        centre: What it has the change d from the start at, (param,); None for no change.
    """

    information: np.ndarray
    weights: np.ndarray
    unusable: tuple[str, ...] = ()
    negative: float = 0.0
    centre: np.ndarray | None = None

    def away(self, change: np.ndarray) -> np.ndarray:
        """Return a change of the coordinates as seen from what the picture has it at, (param,).

        Args:
            change: Of the coordinates from the start, (param,).
        """
        return change if self.centre is None else change - self.centre

    def drawn_about(self, change: np.ndarray, rng: np.random.Generator) -> Prior:
        """Return the information that another picture of the same could have given.

        Args:
            change: What is true of the coordinates, as a change from the start, (param,).
            rng: Draws the picture's noise.
        """
        values, vectors = np.linalg.eigh(self.information)
        seen = values > 1e-12 * max(float(values.max(initial=0.0)), 1e-300)
        noise = vectors[:, seen] @ (rng.normal(size=int(seen.sum())) / np.sqrt(values[seen]))
        return replace(self, centre=change + noise)

    def assuming(self, assumed: np.ndarray) -> Prior:
        """Return the information together with what is assumed.

        Args:
            assumed: Information matrix over the unknowns, (param, param).
        """
        return replace(self, information=self.information + assumed)

    @cached_property
    def rank(self) -> int:
        """Number of directions about which the picture, or what is assumed, gives information."""
        return int(np.linalg.matrix_rank(self.information)) if self.information.size else 0


def size_prior(mechanism: Mechanism, unknowns: Unknowns) -> Prior:
    """Collect what is known before the motion is: of sizes by the picture; of thicknesses, and of sizes that
    nothing measures, by the file; of the camera, that it stands about level.

    Args:
        mechanism: The mechanism, with ``measured`` or without.
        unknowns: Its unknowns.

    Returns:
        The information matrix, and the weights of the common scale.
    """
    assumed = np.zeros((len(unknowns), len(unknowns)))
    for ratio in (*thickness_ratios(mechanism, unknowns), *size_ratios(mechanism, unknowns)):
        assumed += np.outer(ratio.change, ratio.change) / ratio.std**2
    if ROLL in unknowns.names and ROLL not in mechanism.chosen:
        at = unknowns.names.index(ROLL)
        assumed[at, at] += 1.0 / ROLL_STD**2
    return _seen_sizes(mechanism, unknowns).assuming(assumed)


def thickness_ratios(mechanism: Mechanism, unknowns: Unknowns) -> list[Proportion]:
    """Return the thicknesses that are assumed to be about in the file's proportion to the main geom's.

    The motion determines them where it depends on them; where it does not, masses of geoms on one body could
    otherwise take any ratio, and sizes with them. One that the user freed has no such assumption.

    Args:
        mechanism: The mechanism.
        unknowns: Its unknowns.

    Returns:
        Each of them.
    """
    place = {name: i for i, name in enumerate(unknowns.names)}
    place |= {name: int(i) for name, i in zip(unknowns.tied, unknowns.tied_to, strict=True)}
    found = []
    for p in mechanism.parameters:
        if p.kind == "thickness" and p.against and p.name in place and p.name not in mechanism.chosen:
            change = np.zeros(len(unknowns))
            change[place[p.name]] = 1.0
            if p.against in place:
                change[place[p.against]] -= 1.0
            found.append(Proportion(p, change, THICKNESS_STD))
    return found


def size_ratios(mechanism: Mechanism, unknowns: Unknowns) -> list[Proportion]:
    """Return the sizes that are assumed to be about in the file's proportion to the length of their body.

    The motion determines what they do together; held in exact proportion they would act as a known inertia,
    and lengths would seem to be known far better than they are.

    Args:
        mechanism: The mechanism.
        unknowns: Its unknowns.

    Returns:
        Each of them.
    """
    found = []
    for p in assumed_sizes(mechanism):
        if p.name in unknowns.names:
            change, at, std = np.zeros(len(unknowns)), unknowns.names.index(p.name), PROPORTION_STD
            length = f"{p.owner}.length"
            change[at] = 1.0
            if unknowns.ratio[at] and p.kind not in PLACE_KINDS:
                change[at], std = 1.0 / unknowns.x0[at], RATIO_STD
            # a place is a ratio to begin with, and may be zero; a length that is given does not change
            elif not unknowns.ratio[at] and length in unknowns.names:
                change[unknowns.names.index(length)] -= 1.0
            found.append(Proportion(p, change, std))
    return found


def _seen_sizes(mechanism: Mechanism, unknowns: Unknowns) -> Prior:
    """Bring the picture's knowledge of log sizes and places to the unknowns, and define the common scale.

    The common scale s of the identified sizes against the start is the mean of log(size / start) over the
    measured sizes, weighted by the diagonal of their information; without measured sizes it is the mean over
    the free lengths. Sizes that are fixed count with a ratio of one. What is negative or not finite in the
    information is left out.
    """
    count = len(unknowns)
    information, weights = np.zeros((count, count)), np.zeros(count)
    measured = mechanism.measured
    if measured is None:
        lengths = np.flatnonzero(unknowns.of_kind("length") & unknowns.log)
        weights[lengths] = 1.0 / max(len(lengths), 1)
        return Prior(information, weights)
    where = unknowns.index(measured.names)
    known = np.flatnonzero(where >= 0)
    known = known[(unknowns.log | unknowns.ratio)[where[known]]]
    given = np.asarray(measured.information)
    block, bad = given[np.ix_(known, known)], ~np.isfinite(given[np.ix_(known, known)])
    unusable = tuple(measured.names[i] for i in known[bad.all(axis=0) | np.diag(bad)])
    if bad.any():
        unusable = unusable or tuple(measured.names[i] for i in known[bad.any(axis=0)])
        return Prior(information, weights, unusable)
    at = where[known]
    # information is never negative; where rounding or two pictures that disagree made it so, the nearest
    # matrix without negative eigenvalues takes its place, and the user learns how much was cut off
    values, vectors = np.linalg.eigh(0.5 * (block + block.T))
    information[np.ix_(at, at)] = (vectors * np.maximum(values, 0.0)) @ vectors.T
    # sizes that are fixed keep their weight in the total: they have not changed, and so hold the scale near 1
    diagonal = np.diag(given).copy()
    diagonal[known] = np.diag(information)[at]
    diagonal = np.where(np.isfinite(diagonal), np.maximum(diagonal, 0.0), 0.0)
    # a place has no logarithm, and so no part in the mean of them
    diagonal[[mechanism.parameter(name).kind in PLACE_KINDS for name in measured.names]] = 0.0
    total = float(diagonal.sum())
    if total > 0:
        weights[at] = diagonal[known] / total
    largest = float(values.max(initial=0.0))
    negative = max(-float(values.min(initial=0.0)), 0.0)
    relative = negative / largest if largest > 0 else float(negative > 0)
    return Prior(0.5 * (information + information.T), weights, (), relative)
