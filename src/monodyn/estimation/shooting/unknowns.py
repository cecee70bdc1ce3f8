"""A mechanism in, the unknowns of its identification out.

Positive parameters are searched as logarithms, so that a step is a ratio and none can turn negative; dampings
and centres of mass are searched directly, because they may be zero or negative; places of geoms as their
ratio to the size that they stand against, so that they grow with it, and so are overhangs. Sizes that neither
the motion nor a picture determines keep their proportion to the length of their body: held at the values of
the file, they would act as a known length. Once the search is over those that count in the inertia of a
uniform body are unknowns as well, near that proportion (``prior``), so that intervals contain what is not
known of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from monodyn.mechanism import Mechanism, Parameter
from monodyn.mechanism.parts import PLACE_KINDS

SEEN_ONLY = ("width", "tail", "tip", "extent", *PLACE_KINDS, "offset", "turn")
"""Sizes that the motion hardly depends on, if at all."""
PICTURE_ONLY = ("offset", "turn")
"""Those of them on which the motion does not depend at all."""
LOGARITHMIC = (
    "length",
    "width",
    "tail",
    "tip",
    "extent",
    "thickness",
    "density",
    "mass",
    "inertia",
    "gravity",
    "time_scale",
    "period",
)
"""Kinds that are searched as logarithms."""

OVERHANGS = ("tail", "tip")
"""Sizes that are searched as ratios to the length where nothing measures them: the moments of a body are
nearly linear in them, and are known far better than they."""
CENTRE_KINDS = ("com_x", "com_y")
"""Kinds that are one vector, either part of which may be zero or negative."""

FORCES = ("damping", "friction", "stiffness", "drag", "air")
"""Kinds that are in proportion to the scale of masses and may be zero."""
WEIGHTS = ("density", "thickness", "mass")
"""Kinds that stand for that scale, the first that there is."""

ONE_FOR_ALL = ("density", "lead")
"""Kinds of which all that are free without the user's choice keep their proportion."""

MEASURED = 16.0
"""Information of the logarithm above which a picture has measured a size: it determines it to a quarter."""
LONGEST_STEP = 1.5
"""A logarithm moves by at most this much in one step of a search: a factor of 4.5."""


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The shared unknowns of an identification.

    Attributes:
        names: Parameter names, in the mechanism's order.
        kinds: Their kinds, as in `Parameter`.
        owners: Names of the bodies and joints that they belong to, empty for ``gravity`` and the like.
        start: Start values, (param,).
        log: True where the coordinate is the logarithm, (param,).
        against: Unknown that a place, or under known torques a friction, is searched as a ratio to, -1 for
            none, int (param,).
        unit: What else the coordinate is a ratio to: the value of the size where that is no unknown; 1 for
            what is no ratio, (param,).
        lower: Lower bounds of the coordinates, (param,).
        upper: Upper bounds of the coordinates, (param,).
        tied: Sizes that keep their proportion to a length, densities and leads that keep theirs to the first
            one that is not zero.
        tied_to: For each of them the unknown it follows, (tied,).
        tied_share: Their start values as shares of that one's; 1 where both are zero, (tied,).
    """

    names: tuple[str, ...]
    kinds: tuple[str, ...]
    owners: tuple[str, ...]
    start: np.ndarray
    log: np.ndarray
    against: np.ndarray
    unit: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    tied: tuple[str, ...]
    tied_to: np.ndarray
    tied_share: np.ndarray

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def x0(self) -> np.ndarray:
        """Coordinates of the start, (param,)."""
        return self.coordinates(self.start)

    @cached_property
    def reach(self) -> np.ndarray:
        """Longest step of each coordinate in a search, (param,); infinite where there is no logarithm."""
        return np.where(self.log, LONGEST_STEP, np.inf)

    @cached_property
    def uniform(self) -> bool:
        """True when inertias follow from sizes: none of them is itself an unknown."""
        return "inertia" not in self.kinds

    def of_kind(self, *kinds: str) -> np.ndarray:
        """Mark the unknowns of some kinds.

        Args:
            kinds: The kinds.

        Returns:
            True for an unknown of one of them, (param,).
        """
        return np.array([kind in kinds for kind in self.kinds], dtype=bool)

    def only(self, name: str) -> np.ndarray:
        """Return 1 for the unknown of a name and 0 for all others, (param,).

        Args:
            name: The name, of an unknown or none.
        """
        return np.array([other == name for other in self.names], dtype=float)

    @cached_property
    def ratio(self) -> np.ndarray:
        """True for places and other sizes whose coordinate is a ratio, bool (param,)."""
        return self.of_kind(*PLACE_KINDS) | (self.of_kind(*OVERHANGS) & ~self.log & (self.start > 0.0))

    def coordinates(self, values: np.ndarray) -> np.ndarray:
        """Return the coordinates of parameter values.

        Args:
            values: Parameter values, (param,).

        Returns:
            Coordinates, (param,).
        """
        return np.where(self.log, np.log(np.where(self.log, values, 1.0)), values / self._units(values))

    def values(self, x: np.ndarray) -> np.ndarray:
        """Return the parameter values at coordinates.

        Args:
            x: Coordinates, (param,), or (draw, param) for many at once.

        Returns:
            Values, (param,) or (draw, param).
        """
        values = np.where(self.log, np.exp(np.where(self.log, x, 0.0)), x)
        return values * self._units(values)

    def _units(self, values: np.ndarray) -> np.ndarray:
        """Return what the coordinates are ratios to at parameter values, 1 but for places, (..., param)."""
        if not self._relative:
            return self.unit
        return np.where(self.against >= 0, values[..., self.against], self.unit)

    @cached_property
    def _relative(self) -> bool:
        """True where the coordinate of any unknown is a ratio to another one."""
        return bool(np.any(self.against >= 0))

    def slope(self, x: np.ndarray) -> np.ndarray:
        """Differentiate the parameters by the coordinates.

        Args:
            x: Coordinates, (param,).

        Returns:
            d value / d coordinate, (param, param): diagonal but for places, which grow with another size.
        """
        values = self.values(x)
        slope = np.diag(np.where(self.log, values, self._units(values)))
        at = np.flatnonzero(self.against >= 0)
        slope[at, self.against[at]] = values[at]
        return slope

    def named(self, x: np.ndarray) -> dict[str, float]:
        """Return the values at coordinates by name, tied sizes included.

        Args:
            x: Coordinates, (param,).

        Returns:
            Value by parameter name.
        """
        return dict(zip((*self.names, *self.tied), self.with_tied(x).tolist(), strict=True))

    def with_tied(self, x: np.ndarray) -> np.ndarray:
        """Return the values at coordinates, tied sizes after the unknowns.

        Args:
            x: Coordinates, (param,), or (draw, param) for many at once.

        Returns:
            Values, (param + tied,) or (draw, param + tied).
        """
        values = self.values(x)
        return np.concatenate((values, self.tied_share * values[..., self.tied_to]), axis=-1)

    def chain(self, x: np.ndarray) -> np.ndarray:
        """Return the derivatives of the parameters ``names`` and ``tied`` by coordinate at ``x``.

        Args:
            x: Coordinates, (param,).

        Returns:
            d value / d coordinate, (param + tied, param).
        """
        count = len(self)
        chain = np.zeros((count + len(self.tied), count))
        chain[:count] = self.slope(x)
        # what is tied is s = (s0 / l0) l
        chain[count:] = self.tied_share[:, None] * chain[self.tied_to]
        return chain

    def carried(self, x: np.ndarray, other: Unknowns, begun: Mapping[str, float] | None = None) -> np.ndarray:
        """Take over the coordinates of other unknowns by name; the rest begin at their start.

        Args:
            x: Coordinates of the others, (param,).
            other: The others.
            begun: Values at which some of the rest begin instead, by name.

        Returns:
            Coordinates of these, within their bounds, (param,).
        """
        known = {**(begun or {}), **other.named(x)}
        values = [known.get(name, value) for name, value in zip(self.names, self.start, strict=True)]
        return np.clip(self.coordinates(np.array(values)), self.lower, self.upper)

    def index(self, names: tuple[str, ...]) -> np.ndarray:
        """Look names up among the unknowns.

        Args:
            names: Parameter names.

        Returns:
            Place of each, -1 for one that is no unknown, int (param,).
        """
        where = {name: i for i, name in enumerate(self.names)}
        return np.array([where.get(name, -1) for name in names], dtype=int)


def choose_unknowns(mechanism: Mechanism, *, torques_only: bool = False, near: bool = False) -> Unknowns:
    """Choose the free parameters that the motion, or the picture's knowledge of sizes, can determine.

    Args:
        mechanism: The mechanism with its free and fixed parameters.
        torques_only: Leave out all but the torques of the drive.
        near: Sizes that nothing measures are unknowns, about in the file's proportion; else they are exactly
            in it.

    Returns:
        The unknowns; bounds of logarithms stay finite.
    """
    assumed = {p.name for p in assumed_sizes(mechanism)} if near else set()
    known = _measured_names(mechanism) | assumed
    followed = _followed(mechanism)
    # what follows from other parameters is not itself an unknown, and neither is what nothing depends on
    chosen = [
        p
        for p in mechanism.parameters
        if p.free and not p.follows and _wanted(p, known) and p.name not in followed
    ]
    if torques_only:
        chosen = [p for p in chosen if p.kind == "torque"]
    # what a picture knows of an overhang, however little, is known of its logarithm
    unseen = assumed - set(mechanism.measured.names if mechanism.measured else ())
    ratios = [p.kind in PLACE_KINDS or (p.kind in OVERHANGS and p.name in unseen) for p in chosen]
    log = np.array([p.kind in LOGARITHMIC and p.value > 0 for p in chosen], dtype=bool)
    log &= ~np.array(ratios, dtype=bool)
    start = np.array([p.value for p in chosen], dtype=float)
    lower = np.array([p.lower for p in chosen], dtype=float)
    upper = np.array([p.upper for p in chosen], dtype=float)
    # the logarithm of a bound at zero or infinity is no number that a search can step to
    floor = np.where(log, 1e-9 * np.where(log, start, 1.0), -np.inf)
    lower, upper = (
        np.where(log, np.maximum(lower, floor), lower),
        np.where(log, np.minimum(upper, 1e300), upper),
    )
    names = tuple(p.name for p in chosen)
    lengths = {p.owner: i for i, p in enumerate(chosen) if p.name == f"{p.owner}.length" and log[i]}
    tied = [
        p
        for p in mechanism.parameters
        if p.free and p.kind in SEEN_ONLY and p.kind != "turn" and p.name not in names and p.owner in lengths
    ]
    tied_to = [lengths[p.owner] for p in tied]
    for name, first in followed.items() if not torques_only else ():
        tied.append(mechanism.parameter(name))
        tied_to.append(names.index(first))
    values = mechanism.values
    against = [
        names.index(p.against) if is_ratio and p.against in names else -1
        for p, is_ratio in zip(chosen, ratios, strict=True)
    ]
    unit = [
        values.get(p.against, 1.0) if is_ratio else 1.0 for p, is_ratio in zip(chosen, ratios, strict=True)
    ]
    heavy = _mass_unknown(mechanism, chosen, log)
    for i, p in enumerate(chosen):
        if heavy >= 0 and p.kind in FORCES:
            against[i], unit[i] = heavy, chosen[heavy].value
    blank = Unknowns(
        names=names,
        kinds=tuple(p.kind for p in chosen),
        owners=tuple(p.owner for p in chosen),
        start=start,
        log=log,
        against=np.array(against, dtype=int),
        unit=np.array(unit, dtype=float),
        lower=lower,
        upper=upper,
        tied=tuple(p.name for p in tied),
        tied_to=np.array(tied_to, dtype=int),
        # leads of zero are equal when they grow
        tied_share=np.array(
            [1.0 if p.value == start[i] else p.value / start[i] for p, i in zip(tied, tied_to, strict=True)],
            dtype=float,
        ),
    )
    # a place's bounds are ratios to the size at the start: the size's own bounds have no part in them
    fixed = replace(blank, against=np.full(len(names), -1))
    return replace(blank, lower=fixed.coordinates(lower), upper=fixed.coordinates(upper))


def _mass_unknown(mechanism: Mechanism, chosen: list[Parameter], log: np.ndarray) -> int:
    """Place of the unknown that frictions are ratios to; -1 for none.

    Under known torques the scale of masses is an unknown like others, which the motion may show far less
    clearly than what masses and frictions are to one another: a search can follow straight lines alone.
    """
    kinds = [p.kind for p in chosen]
    if mechanism.torque != "known" or "inertia" in kinds:
        return -1
    return next((i for k in WEIGHTS for i, kind in enumerate(kinds) if kind == k and log[i]), -1)


def _followed(mechanism: Mechanism) -> dict[str, str]:
    """Return what keeps its proportion to the first of its kind: densities, and leads of dry friction, that
    are free without the user's choice. The bodies are of one material, and one simulator has one setting."""
    found = {}
    for kind in ONE_FOR_ALL:
        alike = [
            p for p in mechanism.parameters if p.kind == kind and p.free and p.name not in mechanism.chosen
        ]
        # a share of zero would be none
        first = next((p for p in alike if p.value != 0.0), alike[0] if alike else None)
        found |= {p.name: first.name for p in alike if first is not None and p is not first}
    return found


def assumed_sizes(mechanism: Mechanism) -> list[Parameter]:
    """List the sizes that count in the motion and that nothing measures.

    What is known of them is that they are about in the file's proportion to the length of their body. Bodies
    whose inertia is itself an unknown do not depend on them.

    Args:
        mechanism: The mechanism.

    Returns:
        Free sizes and places of uniform bodies which no picture determines.
    """
    free = [p for p in mechanism.parameters if p.free and not p.follows]
    if any(p.kind == "inertia" for p in free):
        return []
    measured, values = _measured_names(mechanism), mechanism.values
    return [
        p
        for p in free
        if p.kind in SEEN_ONLY and p.kind not in PICTURE_ONLY and p.name not in measured
        and p.value != 0.0 and f"{p.owner}.length" in values
    ]  # fmt: skip


def _measured_names(mechanism: Mechanism) -> set[str]:
    """Names of the sizes that a picture has measured."""
    if mechanism.measured is None:
        return set()
    known = np.diag(np.asarray(mechanism.measured.information))
    # what is not a number counts as measured, so that `size_prior` can name it to the user
    return {name for name, k in zip(mechanism.measured.names, known, strict=True) if not k < MEASURED}


def _wanted(p: Parameter, known: set[str]) -> bool:
    """True for what the motion determines, or something is known of on a scale that the motion shares."""
    return p.kind not in SEEN_ONLY or (p.name in known and p.kind in (*LOGARITHMIC, *PLACE_KINDS))
