"""Which kind of torque acts, by the evidence: from the simplest on, until nothing is lacking.

The rule: friction stays as long as what it leaves over is no slower or smaller than the noise, or is what a
picture leaves open of all positions together; quadratic drag, and bodies whose mass may lie anywhere, are
taken where Schwarz's criterion prefers them; a torque over time only where, in rows that it was found
without, it halves the error of the best of these, at the beginnings and at the ends of the records. What does
not explain the motion has to leave less than tilted gravity, another clock or a base that swings, and such a
torque half of it. Where no kind explains the motion, it is searched from further starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from monodyn.estimation.parts import TriedTorque
from monodyn.estimation.shooting.accelerations import mismatch_cost
from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.shooting.search import difference_size
from monodyn.estimation.shooting.shoot import Optimum, Route, fit_pieces
from monodyn.estimation.shooting.starts import match, matched
from monodyn.estimation.torque import friction
from monodyn.estimation.torque.bodies import fit_free_bodies
from monodyn.estimation.torque.evidence import at_noise, cleared, likeliest, pays
from monodyn.estimation.torque.fourier import fit_series, series_of
from monodyn.estimation.torque.free import fit_free_torques, residual_rms
from monodyn.estimation.torque.friction import fit_friction
from monodyn.estimation.torque.laws import drag_laws, middles, sprung
from monodyn.estimation.torque.task import Task, TorqueSolution
from monodyn.estimation.torque.withheld import withheld_errors
from monodyn.estimation.wording import listed, two_digits
from monodyn.mechanism import Mechanism
from monodyn.mechanism.tree import BRAKES

FRICTION = "friction"
"""The simplest kind."""
CLEARLY = 2.0
"""How many times more another reason has to leave for free bodies to be taken before it."""
FREE_BODIES = "friction with free bodies"
"""The same of bodies whose mass may lie anywhere."""
SAME_END = 0.9
"""Share of the cost above which further starts have found nothing better."""
HALVED = 2.0
"""Factor by which a torque over time lowers the error of rows that it was found without, at least, and what
another reason leaves over; and a drag what is left over of the accelerations, to be sought from the start."""
DECISIVE = 10.0
"""Factor from which what one unknown takes off is the reason, unless a torque leaves the noise alone."""
FEWEST_FREE = 3.0
"""Residual in units of the noise up to which free torques follow a record."""
ONLY_FREE = (
    "Neither friction nor a periodic torque explains the motion. One torque a joint and time stamp was "
    "taken, which explains any motion: it is right only as far as the given sizes and masses are, and "
    "predicts nothing."
)
"""What speaks against a torque that nothing but the record itself supports."""


@dataclass(frozen=True, eq=False)
class _Tried:
    """A kind with its solution and its errors of rows kept back; none where they were not asked for."""

    kind: str
    solution: TorqueSolution
    errors: tuple[float, ...] = ()


def fit_auto(mechanism: Mechanism, task: Task) -> TorqueSolution:
    """Explain the motion by the simplest kind of torque that the evidence supports.

    Args:
        mechanism: The start.
        task: What is to be explained.

    Returns:
        The solution; where more than friction was tried it has the comparison.
    """
    # where the first start explains the motion no other is tried; where it does not the reason is a torque as
    # often as the start, and many starts in vain take longer than the search of a period
    once = replace(task, settings=replace(task.settings, starts=1))
    solution = fit_friction(mechanism, once)
    if solution.optimum is None or _explained(solution) or _explained_by_the_picture(solution, once):
        return solution
    found = _further(mechanism, once, solution)
    if found.problem.mechanism.torque != "friction" or _explained(found) or task.settings.starts == 1:
        return found
    # free bodies may follow a motion that others follow from another start
    same = found.problem.unknowns.uniform == solution.problem.unknowns.uniform
    judged = found if same else solution
    if judged.optimum is None or task.search(judged.problem).explained(judged.optimum):
        return found
    again = _from_further_starts(mechanism, task, solution.optimum)
    if again is None:
        return found
    if not (_explained(again) or _explained_by_the_picture(again, once)):
        again = _further(mechanism, once, again)
    if again.optimum is None or found.optimum is None:
        return found
    better = likeliest([(found.problem, found.optimum), (again.problem, again.optimum)])
    return again if better == 1 else found


def _from_further_starts(mechanism: Mechanism, task: Task, before: Optimum) -> TorqueSolution | None:
    """Search for friction from all starts but the first; None where none leads nearer to the record."""
    problem = posed(mechanism.with_torque("friction"), task.data)
    optimum, tried = task.search(problem).from_starts(1, give_up=True)
    if not optimum.complete or optimum.cost > SAME_END * before.cost:
        return None
    return friction.settled(problem, optimum, task, tried)


def _further(mechanism: Mechanism, task: Task, solution: TorqueSolution) -> TorqueSolution:
    """Try more than friction, whose solution leaves something over; return the best."""
    route = task.search(solution.problem).route
    tried = _with_drags(mechanism, _Tried(FRICTION, solution), task, route)
    left_otherwise = cache(partial(_left_otherwise, task))
    first = tried[0].solution
    bodies = task.settings.bodies == "auto" and first.problem.unknowns.uniform
    if not any(_explained(one.solution) for one in tried) and (bodies or len(tried) > 1):
        left = left_otherwise(first)
        tried = [tried[0], *(one for one in tried[1:] if _size(one.solution) < left)]
        for free in _loosened(first, task) if bodies else []:
            # bodies whose mass may lie anywhere take in a part of any other reason, and most of a single one
            if CLEARLY * _size(free.solution) < left:
                tried += _with_drags(mechanism, free, task, route)
    best = _likeliest(tried)
    if _explained(best.solution):
        return _told(best, tried) if len(tried) > 1 else best.solution
    spring = cache(partial(_sprung, mechanism, tried[0], _size(best.solution), task, route))
    place, passive = tried.index(best), best.solution
    best = tried[place] = replace(best, errors=_withheld(best, task, route))
    # rows that are missed by less than that much cannot be halved: their noise is left
    if best.errors and min(best.errors) > HALVED:
        for further in (_periodic, _free):
            found = further(mechanism, task, route, best)
            if found is not None:
                tried.append(found)
                # one unknown that explains nearly as much is the likelier reason than some thirty
                left = min(left_otherwise(passive), spring().size) if _halves(best, found) else 0.0
                by_one = DECISIVE * left < _size(passive) and not _explained(found.solution)
                if HALVED * _size(found.solution) < left and not by_one:
                    return _told(found, tried)
    return replace(_told(best, tried) if len(tried) > 1 else best.solution, doubt=spring().said)


class _Spring(NamedTuple):
    """A spring that would explain a motion: size of what it leaves over, infinite for none; a sentence."""

    size: float = np.inf
    said: str = ""


def _explained(solution: TorqueSolution) -> bool:
    optimum = solution.optimum
    return optimum is not None and at_noise(solution.problem, optimum)


def _explained_by_the_picture(solution: TorqueSolution, task: Task) -> bool:
    """Return whether errors of the picture, which all positions share, are what a solution leaves over."""
    problem, optimum = solution.problem, solution.optimum
    return optimum is not None and cleared(problem, optimum, task.search(problem).route) is not None


def _likeliest(tried: list[_Tried]) -> _Tried:
    """Return the kind that Schwarz's criterion prefers."""
    optima = [(one.solution.problem, one.solution.optimum) for one in tried]
    return tried[likeliest([(problem, optimum) for problem, optimum in optima if optimum is not None])]


def _with_drags(mechanism: Mechanism, before: _Tried, task: Task, route: Route) -> list[_Tried]:
    """Return a kind, and what each law of drag makes of it where that explains more."""
    dragged = _dragged(mechanism, before, task, route)
    # where a drag led to dry friction that explains as much, that is the kind
    same = _likeliest([before, *(one for one in dragged if one.kind == before.kind)])
    return [same, *(one for one in dragged if one.kind != before.kind)]


def _dragged(mechanism: Mechanism, before: _Tried, task: Task, route: Route) -> list[_Tried]:
    """Try each law of drag, without dry friction and with it; nothing where none explains more.

    What leads to the right dry friction may be a drag that is none: then it is the kind before once more.
    """
    optimum = before.solution.optimum
    if optimum is None or not optimum.complete:
        return []
    if not before.solution.problem.unknowns.uniform:
        mechanism = mechanism.with_bodies("free")
    found = []
    for law, names in drag_laws(mechanism).items():
        held = [p.name for p in mechanism.parameters if not p.free and p.name not in mechanism.chosen]
        names = [name for name in names if name in held]
        one = _by_law(mechanism, before, optimum, (law, names), task, route) if names else None
        found += [one] if one is not None else []
    return found


def _sprung(mechanism: Mechanism, before: _Tried, left: float, task: Task, route: Route) -> _Spring:
    """Return what a spring at one of the joints would make of the motion; nothing where each leaves something
    over, and more than half of what is ``left`` without.

    None is taken: readings that are wrong by a factor, as of a picture whose pixels are not square, look like
    one, and then lengths are nearer without.
    """
    problem, optimum = before.solution.problem, before.solution.optimum
    # the fits of all of several records would take too long: there no spring is named
    if optimum is None or not optimum.complete or len(task.records) > 1:
        return _Spring()
    mechanism, springs = sprung(mechanism, middles(task.records))
    plain, found = mechanism.with_torque("friction"), []
    for joint, names in springs.items():
        larger = problem.of(plain.with_choices(free=names))
        # where the motion has little to do with the record a fit takes long
        if (
            friction.far_off(problem, optimum)
            and HALVED * _left_of_accelerations(problem, larger, task) >= 1.0
        ):
            continue
        one = _by_law(mechanism, before, optimum, (f"a spring at {joint}", names), task, route)
        size = np.inf if one is None else _size(one.solution)
        if one is not None and (_explained(one.solution) or HALVED * size < left):
            found.append((size, names, one.solution))
    if not found:
        return _Spring()
    size, names, solution = min(found, key=lambda one: one[0])
    return _Spring(size, _spring_named(names, left / size, before.solution, solution))


def _spring_named(
    names: Sequence[str], times: float, without: TorqueSolution, with_it: TorqueSolution
) -> str:
    """Name a spring by its parameters, with the lengths as they are without it and with it."""
    before, after = (
        one.problem.unknowns.named(one.optimum.x) for one in (without, with_it) if one.optimum is not None
    )
    lengths = [
        f"{p.name} is {after[p.name]:.3g} m and not {before[p.name]:.3g} m"
        for p in without.problem.mechanism.parameters
        if p.kind == "length" and p.name in before and p.name in after
    ]
    other = f", and {listed(lengths)}" if lengths else ""
    return (
        f"With a spring at {names[0].partition('.')[0]} the motion comes {two_digits(times)} times as close "
        f"to the record{other}: if there is one, --free {' '.join(names)}."
    )


def _by_law(
    mechanism: Mechanism,
    before: _Tried,
    optimum: Optimum,
    law: tuple[str, list[str]],
    task: Task,
    route: Route,
) -> _Tried | None:
    """Try one law, by its name and its parameters; None where it explains no more."""
    problem, (what, names) = before.solution.problem, law
    # without the dry friction that was found: it may have stood for the drag
    larger = problem.of(mechanism.with_torque("friction").with_choices(free=names))
    x = larger.unknowns.carried(optimum.x, problem.unknowns)
    found = fit_pieces(larger, optimum.trial.at(x, optimum.trial.states), route, route.fine)
    if friction.far_off(larger, found) and HALVED * _left_of_accelerations(problem, larger, task) < 1.0:
        # a motion that the drag has damped may be so far from every other one that no step leads there
        search = replace(task, settings=replace(task.settings, starts=1)).search(larger)
        other, _ = search.from_starts(give_up=True)
        found = other if pays(found, other, len(names)) else found
    nearer = friction.near_proportions(larger, found, task)
    if likeliest([(larger, found), nearer]) == 1:
        larger, found = nearer
    larger, found = _with_dry(larger, found, task)
    further = len(larger.unknowns) - len(problem.unknowns)
    if likeliest([(problem, optimum), (larger, found)]) == 0 or not pays(optimum, found, further):
        return None
    without = _undragged(mechanism, larger, found, route)
    if without is not None:
        problem, optimum = without
        return replace(before, solution=replace(before.solution, problem=problem, optimum=optimum))
    kind = f"free bodies and {what}" if before.kind == FREE_BODIES else what
    return _Tried(f"friction with {kind}", replace(before.solution, problem=larger, optimum=found))


def _left_of_accelerations(problem: Problem, larger: Problem, task: Task) -> float:
    """Return the share of the accelerations' mismatch that further unknowns leave, of any motion."""
    motion, more = (task.search(one).motion for one in (problem, larger))
    if not len(motion.time):
        return np.inf
    x = matched(problem, motion)
    after = match(larger, more, larger.unknowns.carried(x, problem.unknowns))
    before = mismatch_cost(problem, x, motion)
    return mismatch_cost(larger, after, more) / before if before > 0.0 else np.inf


def _undragged(
    mechanism: Mechanism, problem: Problem, optimum: Optimum, route: Route
) -> tuple[Problem, Optimum] | None:
    """Return the fit of dry friction without the drag that led to it; None where the drag explains more."""
    free = [p for p in problem.mechanism.parameters if p.free]
    rubbing = [p.name for p in free if p.kind == "friction"]
    if not rubbing:
        return None
    undragged = mechanism.with_torque("friction").with_choices(free=rubbing)
    smaller = problem.of(friction.led(undragged, [p.name for p in free if p.kind == "lead"]))
    x = smaller.unknowns.carried(optimum.x, problem.unknowns)
    found = fit_pieces(smaller, optimum.trial.at(x, optimum.trial.states), route, route.fine)
    return (smaller, found) if likeliest([(problem, optimum), (smaller, found)]) == 1 else None


def _loosened(solution: TorqueSolution, task: Task) -> list[_Tried]:
    """Try bodies whose mass may lie anywhere, where the evidence is for it."""
    problem, optimum = solution.problem, solution.optimum
    if optimum is None:
        return []
    found = fit_free_bodies(solution, task)
    if found is None or found.optimum is None:
        return []
    further = len(found.problem.unknowns) - len(problem.unknowns)
    better = likeliest([(problem, optimum), (found.problem, found.optimum)]) == 1
    if not better or not pays(optimum, found.optimum, max(further, 1)):
        return []
    return [_Tried(FREE_BODIES, found)]


def _periodic(mechanism: Mechanism, task: Task, route: Route, passive: _Tried) -> _Tried | None:
    """Try a periodic torque, with dry friction where that is left over."""

    def promising(problem: Problem, optimum: Optimum) -> bool:
        errors = withheld_errors(problem, optimum, task.smoothed, route)
        return all(after < before for after, before in zip(errors, passive.errors, strict=True))

    solution = fit_series(mechanism, task, promising)
    if solution.optimum is None or not solution.optimum.complete:
        return None
    problem, optimum = _with_dry(solution.problem, solution.optimum, task)
    tried = _Tried("periodic torque", replace(solution, problem=problem, optimum=optimum))
    return replace(tried, errors=_withheld(tried, task, route))


def _with_dry(problem: Problem, optimum: Optimum, task: Task) -> tuple[Problem, Optimum]:
    """Free dry friction where something is left over, and little: far from the motion the search is long."""
    if not optimum.complete or at_noise(problem, optimum):
        return problem, optimum
    if friction.far_off(problem, optimum):
        return problem, optimum
    return friction.with_dry_friction(problem, optimum, task)


def _free(mechanism: Mechanism, task: Task, route: Route, passive: _Tried) -> _Tried | None:
    """Try free torques where sizes and masses are given; with these open they explain any mechanism."""
    unknowns = posed(mechanism.with_torque("friction"), task.data).unknowns
    if not set(unknowns.kinds) <= {*BRAKES, "roll"}:
        return None
    solution = fit_free_torques(mechanism, task)
    return None if solution.optimum is None else _Tried("free torque", solution)


def _withheld(tried: _Tried, task: Task, route: Route) -> tuple[float, ...]:
    """Return the errors of rows that a solution is found without."""
    problem, optimum = tried.solution.problem, tried.solution.optimum
    if optimum is None or not optimum.complete:
        return (float("inf"),)
    return withheld_errors(problem, optimum, task.smoothed, route)


def _halves(passive: _Tried, found: _Tried) -> bool:
    """Return whether a torque over time explains rows that it was found without by far better."""
    optimum = found.solution.optimum
    if optimum is None:
        return False
    if found.kind == "free torque":
        # a torque at one time says nothing of other times: none can be kept back
        return residual_rms(found.solution.problem, optimum) < FEWEST_FREE
    pairs = zip(passive.errors, found.errors, strict=False)
    return bool(found.errors) and all(HALVED * max(after, 1.0) <= before for before, after in pairs)


def _left_otherwise(task: Task, solution: TorqueSolution) -> float:
    """Return the size of what tilted gravity, another clock or a base that swings leaves over, each of which
    repeats itself as the motion does; infinite where none of them explains more than a solution."""
    problem, optimum = solution.problem, solution.optimum
    if optimum is None or not optimum.complete:
        return np.inf
    return task.otherwise(task.records, problem, optimum)


def _size(solution: TorqueSolution) -> float:
    """Return the size of what a solution leaves over, likewise."""
    problem, optimum = solution.problem, solution.optimum
    if optimum is None or not optimum.complete:
        return np.inf
    return difference_size(problem, optimum, [joint.name for joint in problem.mechanism.joints])


def _told(chosen: _Tried, tried: list[_Tried]) -> TorqueSolution:
    """Return a solution with the comparison, and with the reason before its advice."""
    rows = sorted(tried, key=lambda one: one is not chosen)
    compared = tuple(TriedTorque(one.kind, one is chosen, _said(one)) for one in rows)
    solution = replace(chosen.solution, compared=compared)
    if chosen.kind == "free torque":
        return replace(solution, doubt=ONLY_FREE)
    if chosen is tried[0]:
        return solution
    reason = f"{_reason(chosen)} Friction alone: {_said(tried[0])}"
    return replace(solution, advice=(reason, *solution.advice))


def _reason(chosen: _Tried) -> str:
    """Write which kind was chosen."""
    optimum = chosen.solution.optimum
    if chosen.kind != "periodic torque" or optimum is None:
        # of what does not follow a motion the nearest is no evidence
        if not _explained(chosen.solution):
            return f"Nearest comes {chosen.kind}, which leaves more than the stated noise: {_said(chosen)}"
        return f"The evidence is for {chosen.kind}: {_said(chosen)}"
    terms, period = series_of(chosen.solution.problem, optimum)
    waves = "1 harmonic" if terms == 1 else f"{terms} harmonics"
    return f"The evidence is for a periodic torque, of period {period:.4g} s with {waves}: {_said(chosen)}"


def _said(tried: _Tried) -> str:
    """Write how well a kind follows the record, and rows that it was found without."""
    problem, optimum = tried.solution.problem, tried.solution.optimum
    if optimum is None or not optimum.complete:
        return "does not follow the record."
    said = (
        f"residuals of {residual_rms(problem, optimum):.3g} times the noise, {len(problem.unknowns)} unknowns"
    )
    if not tried.errors:
        return f"{said}."
    return f"{said}; rows kept back are off by {listed([f'{e:.3g}' for e in tried.errors])} times the noise."
