"""Which parameters the motion is asked for, and in which coordinates.

Positive parameters are searched as logarithms, so that a step is a ratio and none can turn negative; dampings
and centres of mass are searched as they are, because they may be zero or negative. Sizes that neither the
motion nor a picture tells keep their proportion to the length of their body: a file's width would pose as a
ruler.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from monodyn.mechanism import Mechanism

SEEN_ONLY = ("width", "tail", "tip", "offset")
"""Sizes that the motion hardly depends on, if at all: asked for only where a picture has measured them."""
PICTURE_ONLY = ("offset",)
"""Those of them that the motion does not depend on at all."""
POSITIVE = (
    "length",
    "width",
    "tail",
    "tip",
    "thickness",
    "density",
    "mass",
    "inertia",
    "gravity",
    "time_scale",
    "period",
)
"""Kinds that are searched as logarithms."""

SEEN = 16.0
"""A picture has measured a size when it knows it better than to a quarter: information of the logarithm."""
LONGEST = 1.5
"""A logarithm moves by at most this much in one step of a search: a factor of 4.5."""

MASS_KINDS = (
    "thickness",
    "density",
    "mass",
    "inertia",
    "damping",
    "friction",
    "stiffness",
    "armature",
    "torque",
)
"""Kinds that are proportional to the scale of masses, which motion without a measured torque leaves open."""


def kind_of(name: str) -> str:
    """Return the last part of a parameter's name, ``length`` of ``link1.length``; ``torque`` of torques."""
    parts = name.split(".")
    return "torque" if len(parts) > 2 and parts[-2] == "torque" else parts[-1]


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The shared unknowns of an identification.

    Attributes:
        names: Parameter names, in the mechanism's order.
        start: Start values, (param,).
        log: True where the coordinate is the logarithm, (param,).
        lower: Lower bounds of the coordinates, (param,).
        upper: Upper bounds of the coordinates, (param,).
        tied: Sizes that keep their proportion to a length.
        tied_to: For each of them the unknown it follows, (tied,).
        tied_start: Their start values, (tied,).
    """

    names: tuple[str, ...]
    start: np.ndarray
    log: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    tied: tuple[str, ...]
    tied_to: np.ndarray
    tied_start: np.ndarray

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def x0(self) -> np.ndarray:
        """Coordinates of the start, (param,)."""
        return self.coordinates(self.start)

    @cached_property
    def reach(self) -> np.ndarray:
        """Longest step of each coordinate in a search, (param,); what is searched as it is has none."""
        return np.where(self.log, LONGEST, np.inf)

    def coordinates(self, values: np.ndarray) -> np.ndarray:
        """Return the coordinates of parameter values, both (param,)."""
        return np.where(self.log, np.log(np.where(self.log, values, 1.0)), values)

    def values(self, x: np.ndarray) -> np.ndarray:
        """Return the parameter values at coordinates ``x``, both (param,)."""
        return np.where(self.log, np.exp(np.where(self.log, x, 0.0)), x)

    def slope(self, x: np.ndarray) -> np.ndarray:
        """Return d value / d coordinate at ``x``, (param,)."""
        return np.where(self.log, self.values(x), 1.0)

    def named(self, x: np.ndarray) -> dict[str, float]:
        """Return the values at ``x`` by name, tied sizes included."""
        values = self.values(x)
        tied = self.tied_start * values[self.tied_to] / self.start[self.tied_to]
        return dict(zip((*self.names, *self.tied), (*values.tolist(), *tied.tolist()), strict=True))

    def chain(self, x: np.ndarray) -> np.ndarray:
        """Return the derivatives of the parameters ``names`` and ``tied`` by coordinate at ``x``.

        Args:
            x: Coordinates, (param,).

        Returns:
            d value / d coordinate, (param + tied, param).
        """
        count = len(self)
        chain = np.zeros((count + len(self.tied), count))
        chain[range(count), range(count)] = self.slope(x)
        values = self.values(x)
        follow = self.tied_start / self.start[self.tied_to]
        chain[count + np.arange(len(self.tied)), self.tied_to] = follow * values[self.tied_to]
        return chain

    def carried(self, x: np.ndarray, other: Unknowns) -> np.ndarray:
        """Return coordinates with those of other unknowns by name, this start for the rest, (param,).

        Args:
            x: Coordinates of the others, (other param,).
            other: The others.
        """
        known = other.named(x)
        values = [known.get(name, value) for name, value in zip(self.names, self.start, strict=True)]
        return np.clip(self.coordinates(np.array(values)), self.lower, self.upper)

    def index(self, names: tuple[str, ...]) -> np.ndarray:
        """Return the position of each of ``names`` among the unknowns, -1 where it is none."""
        where = {name: i for i, name in enumerate(self.names)}
        return np.array([where.get(name, -1) for name in names], dtype=int)


def choose_unknowns(mechanism: Mechanism, *, torques_only: bool = False) -> Unknowns:
    """Pick the free parameters that the motion, or the picture's knowledge of sizes, can say something about.

    Args:
        mechanism: The mechanism with its free and fixed parameters.
        torques_only: Leave out all but the torques of the drive.

    Returns:
        The unknowns; bounds of logarithms stay finite.
    """
    measured: set[str] = set()
    if mechanism.measured is not None:
        known = np.diag(np.asarray(mechanism.measured.information))
        # what is not a number stays in, for `size_prior` to complain about
        measured = {name for name, k in zip(mechanism.measured.names, known, strict=True) if not k < SEEN}
    chosen = [p for p in mechanism.parameters if p.free and not p.follows and _wanted(p.name, measured)]
    if torques_only:
        chosen = [p for p in chosen if kind_of(p.name) == "torque"]
    log = np.array([kind_of(p.name) in POSITIVE and p.value > 0 for p in chosen], dtype=bool)
    start = np.array([p.value for p in chosen], dtype=float)
    lower = np.array([p.lower for p in chosen], dtype=float)
    upper = np.array([p.upper for p in chosen], dtype=float)
    floor = np.where(log, 1e-9 * np.where(log, start, 1.0), -np.inf)
    lower, upper = (
        np.where(log, np.maximum(lower, floor), lower),
        np.where(log, np.minimum(upper, 1e300), upper),
    )
    names = tuple(p.name for p in chosen)
    where = {name: i for i, name in enumerate(names) if log[i]}
    tied = [
        (p.name, where[length], p.value)
        for p in mechanism.parameters
        if p.free and kind_of(p.name) in SEEN_ONLY and p.name not in names
        if (length := f"{p.name.split('.')[0]}.length") in where
    ]
    blank = Unknowns(
        names, start, log, lower, upper, tuple(t[0] for t in tied), np.array([t[1] for t in tied], dtype=int),
        np.array([t[2] for t in tied], dtype=float),
    )  # fmt: skip
    return replace(blank, lower=blank.coordinates(lower), upper=blank.coordinates(upper))


def _wanted(name: str, measured: set[str]) -> bool:
    kind = kind_of(name)
    if name.startswith("camera."):
        return False
    return kind not in SEEN_ONLY or (name in measured and kind in POSITIVE)


@dataclass(frozen=True, eq=False)
class Prior:
    """What the picture knows of the sizes: 1/2 d.information.d with d the change of the coordinates.

    Attributes:
        information: Information matrix over the unknowns, (param, param); zero for those not measured.
        weights: Share of each unknown in the logarithm of the common scale, (param,).
        unusable: Unknowns about which the picture's knowledge is not a finite number; it is left out.
        negative: Size of the part of the information that was below zero, which no information is, against
            the largest; it is left out.
    """

    information: np.ndarray
    weights: np.ndarray
    unusable: tuple[str, ...] = ()
    negative: float = 0.0

    @cached_property
    def rank(self) -> int:
        """Number of directions that the picture, or what is assumed, says something about."""
        return int(np.linalg.matrix_rank(self.information)) if self.information.size else 0


def size_prior(mechanism: Mechanism, unknowns: Unknowns) -> Prior:
    """Bring the picture's knowledge of log sizes to the unknowns, and define the common scale.

    The common scale s of the identified sizes against the start is the mean of log(size / start) over the
    measured sizes, weighted by the diagonal of their information; without measured sizes it is the mean over
    the free lengths. Sizes that are fixed count with a ratio of one.

    Args:
        mechanism: The mechanism, with ``measured`` or without.
        unknowns: Its unknowns.

    Returns:
        The information matrix, without what is negative or not finite in it, and the weights of the common
        scale.
    """
    count = len(unknowns)
    information, weights = np.zeros((count, count)), np.zeros(count)
    measured = mechanism.measured
    if measured is None:
        lengths = [
            i for i, name in enumerate(unknowns.names) if kind_of(name) == "length" and unknowns.log[i]
        ]
        weights[lengths] = 1.0 / max(len(lengths), 1)
        return Prior(information, weights)
    where = unknowns.index(measured.names)
    known = np.flatnonzero(where >= 0)
    known = known[unknowns.log[where[known]]]
    given = np.asarray(measured.information)
    block, bad = given[np.ix_(known, known)], ~np.isfinite(given[np.ix_(known, known)])
    unusable = tuple(measured.names[i] for i in known[bad.all(axis=0) | np.diag(bad)])
    if bad.any():
        unusable = unusable or tuple(measured.names[i] for i in known[bad.any(axis=0)])
        return Prior(information, weights, unusable)
    at = where[known]
    values, vectors = np.linalg.eigh(0.5 * (block + block.T))
    information[np.ix_(at, at)] = (vectors * np.maximum(values, 0.0)) @ vectors.T
    diagonal = np.diag(given).copy()
    diagonal[known] = np.diag(information)[at]
    diagonal = np.where(np.isfinite(diagonal), np.maximum(diagonal, 0.0), 0.0)
    total = float(diagonal.sum())
    if total > 0:
        weights[at] = diagonal[known] / total
    largest = float(values.max(initial=0.0))
    negative = max(-float(values.min(initial=0.0)), 0.0)
    relative = negative / largest if largest > 0 else float(negative > 0)
    return Prior(0.5 * (information + information.T), weights, (), relative)


def scaled_start(unknowns: Unknowns, factor: float, mechanism: Mechanism) -> Mapping[str, float]:
    """Return start values with all lengths, or the gravity or the time scale instead, changed by one factor.

    Making everything ``factor`` times as long slows a mechanism down by sqrt(factor); where the lengths are
    fixed, gravity or the time scale can do the same.

    Args:
        unknowns: The unknowns.
        factor: Ratio of lengths.
        mechanism: The mechanism they belong to.

    Returns:
        Values by name, of the unknowns that change; empty where nothing can.
    """
    powers = {"length": 1, "width": 1, "tail": 1, "tip": 1, "com_x": 1, "com_y": 1, "inertia": 2}
    names = unknowns.names
    if any(kind_of(name) in ("length", "inertia") for name in names):
        scaled = {name: powers[kind_of(name)] for name in names if kind_of(name) in powers}
    elif "gravity" in names:
        scaled = {"gravity": -1}
    elif "time_scale" in names:
        scaled = {"time_scale": -0.5}
    else:
        return {}
    values = mechanism.values
    return {name: values[name] * factor**power for name, power in scaled.items()}
