"""Other sizes and masses with which the mechanism moves alike, by closed forms, each proven by a fit.

The motion depends on sizes and masses through a few regrouped inertias (``regrouped``). Where several sets of
them give the same inertias, as two distances from the centre of mass do in Kater's reversible pendulum, a
search ends at the one that is nearest to its start, and nothing in the record prefers it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from monodyn.estimation.fit import Estimate
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.search import ALIKE
from monodyn.estimation.shooting.shoot import fit_pieces
from monodyn.estimation.shooting.unknowns import CENTRE_KINDS
from monodyn.estimation.verdict.refine import Refined, route_of
from monodyn.estimation.verdict.surrogate import Surrogate, surrogate_of
from monodyn.estimation.wording import listed
from monodyn.mechanism.parts import PLACE_KINDS
from monodyn.optimize import Arrow, SearchSettings, dense, minimize_together

HIDDEN = ("thickness", "density", "mass", "inertia", *CENTRE_KINDS, *PLACE_KINDS)
"""Kinds of which several values may move alike: what no picture shows."""
STARTS, SEED = 12, 0
"""Starts from which twins are looked for, and the seed of their scatter."""
FACTOR = np.log(8.0)
"""Half width of their scatter, of logarithms ..."""
TIMES, LEAST = 2.0, 0.1
"""... and of what may be negative: in multiples of itself, and of this ratio at least."""
LOOKED = SearchSettings(evaluations=60, decrease=1e-6, relative=1e-6)
"""Each of the searches; an evaluation in closed form takes less than a millisecond."""
HOPELESS = 100.0
"""Cost of what the closed forms take for a twin, over that of the optimum, above which its motion is another
one altogether."""
WIDER = 2.0
"""Times by which a twin lies outside of the interval of one parameter at least."""


def twins_of(
    found: Refined,
    ended: Sequence[Mapping[str, float]],
    estimates: Sequence[Estimate],
    settings: IdentifySettings,
) -> tuple[Mapping[str, float], ...]:
    """Find other optima that the data cannot tell from the one that was found.

    Args:
        found: The optimum, and what is known there.
        ended: Where other starts of the search ended, as close to the record.
        estimates: Its parameters with their intervals.
        settings: How exactly the fits that prove them are searched.

    Returns:
        The unknowns of each by name.
    """
    problem, optimum = found.weighted, found.optimum
    unknowns = problem.unknowns
    hidden = unknowns.of_kind(*HIDDEN) if len(unknowns) else np.zeros(0, dtype=bool)
    tried: list[Mapping[str, float]] = []
    twins: list[Mapping[str, float]] = []
    for values in ended:
        if apart(values, estimates) and not any(_same(values, other) for other in twins):
            twins.append(values)
    # none where the motion depends on more than the regrouped inertias
    surrogate = surrogate_of(problem, optimum.trial, optimum.at_bound) if hidden.any() else None
    if surrogate is None:
        return tuple(twins)
    route, here = route_of(found.problem, optimum, settings), None
    for values in _minima(surrogate, hidden):
        x = unknowns.coordinates(values)
        named = unknowns.named(x)
        within = np.all(x >= unknowns.lower) and np.all(x <= unknowns.upper)
        if not within or not apart(named, estimates) or any(_same(named, other) for other in tried):
            continue
        tried.append(named)
        # the closed forms are those of the optimum's motion: that of the twin itself decides
        start = optimum.trial.at(x, optimum.trial.states)
        here = here or fit_pieces(problem, optimum.trial, route, LOOKED, robust=False)
        # one that moves alike in truth does so before any search; no search is wasted on others
        with np.errstate(invalid="ignore", over="ignore"):
            begun = 0.5 * float(np.sum(problem.residuals(start) ** 2))
        if not begun < HOPELESS * max(here.cost, 1.0):
            continue
        proven = fit_pieces(problem, start, route, LOOKED, robust=False)
        near = proven.complete and proven.cost < here.cost + 0.5 * ALIKE
        named = unknowns.named(proven.x)
        if near and apart(named, estimates) and not any(_same(named, other) for other in twins):
            twins.append(named)
    return tuple(twins)


def apart(values: Mapping[str, float], estimates: Sequence[Estimate]) -> list[Estimate]:
    """Return the parameters that are other than what their intervals leave open.

    Args:
        values: Other values by name.
        estimates: The parameters with their intervals.
    """
    found = []
    for p in estimates:
        if p.free and p.name in values and np.isfinite(p.std):
            low, high = p.value - WIDER * (p.value - p.lower), p.value + WIDER * (p.upper - p.value)
            if not low <= values[p.name] <= high:
                found.append(p)
    return found


def told(twins: Sequence[Mapping[str, float]], estimates: Sequence[Estimate]) -> list[str]:
    """Return a sentence on each of other sets of parameters that move as close to the record.

    Args:
        twins: The others' values by name, each apart from the estimates.
        estimates: The parameters with their intervals.
    """
    said = []
    for values in twins:
        # what is as far off, but for where a search has ended, stays in the order of the mechanism
        far = sorted(
            apart(values, estimates),
            key=lambda p: -float(f"{abs(values[p.name] - p.value) / max(abs(p.value), 1e-300):.2g}"),
        )
        words = [f"{p.name} {values[p.name]:.3g} in place of {p.value:.3g} {p.unit}".rstrip() for p in far]
        said.append(
            f"Other values move as close to the record: {listed(words, 3)}. Nothing in the record prefers "
            "either; a measured value, given with --fix, does."
        )
    return said


def _minima(surrogate: Surrogate, hidden: np.ndarray) -> Iterator[np.ndarray]:
    """Yield values of the unknowns, (param,), with which the closed forms are as near to the record as at
    their peak. ``hidden`` (param,) is True for those whose starts are scattered."""
    sizes, peak = surrogate.sizes, surrogate.peak()
    log = sizes.problem.unknowns.log
    rng = np.random.default_rng(SEED)

    def models(points: list[np.ndarray]) -> list[Arrow]:
        with np.errstate(all="ignore"):
            return [dense(*rows) for rows in zip(*surrogate.rows(np.array(points)), strict=True)]

    starts = []
    for _ in range(STARTS):
        drawn = rng.uniform(-1.0, 1.0, len(peak))
        moved = np.where(log, peak + FACTOR * drawn, TIMES * np.maximum(np.abs(peak), LEAST) * drawn)
        starts.append(np.where(hidden, moved, peak))
    least = models([peak])[0].cost
    for end in minimize_together(models, starts, settings=LOOKED, reach=surrogate.reach):
        if end.model.cost < least + 0.5 * ALIKE:
            yield sizes.unknowns(end.shared[None])[0]


def _same(one: Mapping[str, float], other: Mapping[str, float]) -> bool:
    """Return whether two sets of values are one, but for what a search leaves."""
    return all(np.isclose(value, other[name], rtol=0.02, atol=1e-6) for name, value in one.items())
