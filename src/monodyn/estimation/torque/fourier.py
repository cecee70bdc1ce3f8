"""A periodic torque as a Fourier series (Case II), its period and number of harmonics found from the motion.

Accelerations say where to look for the period; each candidate is fitted to the positions of short pieces of
the records, and the likeliest goes on to whole ones. The series is made shorter or longer as these require.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from monodyn.estimation.record.samples import cut, spread
from monodyn.estimation.settings import USUAL_TERMS
from monodyn.estimation.shooting.accelerations import SmoothMotion, model_accelerations, torque_response
from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.shooting.search import obstacle
from monodyn.estimation.shooting.shoot import ROUGH, Optimum, Route, fit_pieces
from monodyn.estimation.shooting.starts import match
from monodyn.estimation.torque.evidence import EVIDENCE, FARTHEST, pays, with_more_unknowns
from monodyn.estimation.torque.friction import near_proportions
from monodyn.estimation.torque.periods import PeriodGuess, PeriodSearch
from monodyn.estimation.torque.task import Task, TorqueSolution, frictionless
from monodyn.mechanism import Mechanism

LEAST_SHARE = 0.01
"""Share of weight and inertia at a joint from which a periodic torque stands out."""
MOST_PIECES = 50
"""Pieces by which periods are compared; with more of them the same period wins."""
CANDIDATE = replace(ROUGH, evaluations=20)
"""For one of the candidates: the true period takes some ten evaluations."""
NO_PERIOD = (
    "The period of the torque cannot be estimated: no period that the record shows more than once explains "
    "the motion better than friction alone. Give more frames, or the period with "
    "--fix torque.period=SECONDS, or leave out --identify.torque fourier."
)


def fit_series(
    mechanism: Mechanism, task: Task, promising: Callable[[Problem, Optimum], bool] | None = None
) -> TorqueSolution:
    """Explain the motion by a periodic torque (Case II), in addition to viscous friction or alone.

    Args:
        mechanism: The start; a period that is not free in it counts as known.
        task: What is to be explained.
        promising: Called with the best of the guessed periods; when it returns False the search ends there,
            and so it does where no guess lets short pieces be followed.

    Returns:
        The solution.
    """
    settings = task.settings
    if settings.series == "alone":
        mechanism = frictionless(mechanism)
    least = posed(mechanism.with_torque("fourier", terms=settings.terms or 1, period=1.0), task.data)
    clock = least.mechanism.parameter("torque.period")
    reason = obstacle(least, task.smoothed)
    if reason is not None:
        return TorqueSolution(least, None, reason=reason)
    periods = PeriodSearch.of(mechanism, task.data, task.smoothed)
    guesses = periods.guesses(settings.terms)
    if not guesses:
        return TorqueSolution(least, None, reason=NO_PERIOD)
    route = task.search(periods.problem).route
    best = _simplest([_in_pieces(mechanism, task, periods, guess) for guess in guesses])
    # of a multiple of the true period, and of a series with too many harmonics, the rest is idle
    simpler = periods.simpler(*series_of(*best), settings.terms)
    best = _simplest([best, *(_in_pieces(mechanism, task, periods, guess) for guess in simpler)])
    # a longer period explains anything smooth: where one explains as much, nothing shows that the motion
    # repeats; it is held, for the search would lead to the same period or a multiple of it
    longer = periods.longer(*series_of(*best))
    beyond = [_in_pieces(_held(mechanism, guess.period), task, periods, guess) for guess in longer]
    if _criteria([best, *beyond]).argmin() or not periods.shown(series_of(*best)[1]):
        return TorqueSolution(least, None, reason=NO_PERIOD)
    problem = posed(best[0].mechanism, task.data)
    optimum = task.search(problem).from_start(best[1].x, give_up=promising is not None)
    problem, optimum = near_proportions(problem, optimum, task)
    # harmonics more or fewer make no torque much larger, and none repeat that does not
    if promising and not (
        optimum.complete and stands_out(problem, optimum.x, periods.motion) and promising(problem, optimum)
    ):
        return TorqueSolution(problem, None, reason=NO_PERIOD)
    if settings.terms == 0:
        problem, optimum = more_terms(problem, optimum, route)
    # what is promising was compared with friction already
    seen = promising is not None or periodic(problem, optimum, route)
    seen = seen and stands_out(problem, optimum.x, periods.motion)
    seen = seen and periods.shown(series_of(problem, optimum)[1])
    if clock.free and not seen:
        return TorqueSolution(problem, None, reason=NO_PERIOD)
    doubt = () if seen else (no_harmonic(problem.mechanism_at(optimum.x)),)
    return TorqueSolution(problem, optimum, len(guesses), advice=doubt)


def _in_pieces(
    mechanism: Mechanism, task: Task, periods: PeriodSearch, guess: PeriodGuess
) -> tuple[Problem, Optimum]:
    """Fit a series from one guess of the period to short pieces, the same of every guess.

    A wrong period leaves many times the noise even there, where no motion is hard to follow.
    """
    problem = posed(series(mechanism, guess.terms, guess.period), task.data)
    search = task.search(problem)
    # the guess is one linear step from the start, which may lead far off where the masses are far from the
    # true ones: the accelerations alone bring it back before anything is integrated
    start = match(problem, search.motion, periods.start(guess, problem))
    data, pieces = spread(task.data, cut(task.data, search.route.piece), MOST_PIECES)
    few = problem.with_data(data)
    return few, fit_pieces(few, few.started(start, pieces, task.smoothed), search.route, CANDIDATE)


def _simplest(tried: list[tuple[Problem, Optimum]]) -> tuple[Problem, Optimum]:
    """Return the one with the fewest harmonics, then the shortest period, of those that explain as much."""
    values = _criteria(tried)
    alike = [one for one, value in zip(tried, values, strict=True) if not value > values.min() + EVIDENCE]
    return min(alike, key=lambda one: series_of(*one))


def _criteria(tried: list[tuple[Problem, Optimum]]) -> np.ndarray:
    """Return Schwarz's criterion of fits to the same pieces.

    Each search took the limit of its loss from where it began; only with one limit do the costs compare.
    """
    noise = max(min(optimum.sigma for _, optimum in tried), 1.0)
    costs = [
        problem.model(one.x, problem.rows(one.trial), one.trial.pieces, FARTHEST * noise).cost
        for problem, one in tried
    ]
    charges = [len(problem.unknowns) * np.log(problem.data.samples) for problem, _ in tried]
    return 2.0 * np.array(costs) / noise**2 + charges


def _held(mechanism: Mechanism, period: float) -> Mechanism:
    driven = mechanism.with_torque("fourier", terms=1, period=period)
    return driven.with_choices(fix={"torque.period": period})


def series(mechanism: Mechanism, terms: int, period: float) -> Mechanism:
    """Return the mechanism under a periodic torque; a period that is not free stays.

    Args:
        mechanism: The mechanism.
        terms: Number of harmonics.
        period: Start of the period [s].
    """
    driven = mechanism.with_torque("fourier", terms=terms, period=period)
    return driven.with_values({"torque.period": period} if driven.parameter("torque.period").free else {})


def series_of(problem: Problem, optimum: Optimum) -> tuple[int, float]:
    """Return the number of harmonics and the period [s] at an optimum.

    Args:
        problem: The problem with a periodic torque.
        optimum: Its optimum.
    """
    mechanism = problem.mechanism_at(optimum.x)
    return _terms(mechanism), mechanism.values["torque.period"]


def _terms(mechanism: Mechanism) -> int:
    """Number of harmonics: a series has its mean and two columns for each."""
    return (mechanism.drive.table.shape[1] - 1) // 2


def more_terms(problem: Problem, optimum: Optimum, route: Route) -> tuple[Problem, Optimum]:
    """Add harmonics to a periodic torque as long as one of the next two pays.

    Args:
        problem: The problem with a periodic torque.
        optimum: Its optimum.
        route: How exact the search is.

    Returns:
        The problem with as many harmonics as pay, and its optimum.
    """
    dofs, period = len(problem.mechanism.joints), problem.mechanism.values["torque.period"]
    terms = _terms(problem.mechanism)
    further = terms + 1
    # two ahead, because a torque that is odd or even about its middle lacks every other harmonic
    while further <= min(terms + 2, USUAL_TERMS) and optimum.complete:
        driven = series(problem.mechanism, further, period)
        longer, found = with_more_unknowns(problem, optimum, driven, route)
        if pays(optimum, found, 2 * dofs * (further - terms)):
            problem, optimum, terms = longer, found, further
        further += 1
    return problem, optimum


def periodic(problem: Problem, optimum: Optimum, route: Route) -> bool:
    """Return whether a periodic torque explains the motion by far better than friction alone.

    By far, because the best of many periods was taken.

    Args:
        problem: The problem with a periodic torque.
        optimum: Its optimum.
        route: How exact the search is.
    """
    undriven = problem.of(problem.mechanism.with_torque("friction"))
    x = undriven.unknowns.carried(optimum.x, problem.unknowns)
    passive = fit_pieces(undriven, optimum.trial.at(x, optimum.trial.states), route, route.fine)
    added = len(problem.unknowns) - len(undriven.unknowns)
    return not passive.complete or pays(passive, optimum, added)


def stands_out(problem: Problem, x: np.ndarray, motion: SmoothMotion) -> bool:
    """Return whether the periodic part of a torque counts in comparison with weight and inertia.

    What the model lacks is often periodic as the motion is, and small; a torque of under a hundredth of
    weight and inertia at every joint is taken for that.

    Args:
        problem: The problem with a periodic torque.
        x: Coordinates, (param,).
        motion: Smooth motion.
    """
    # both loads as torques along the measured motion, so that they compare with the drive's
    response, none = torque_response(problem, x, motion), np.zeros_like(motion.position)
    falling = model_accelerations(problem, x, motion.at_rest, none)
    weight, inertia = (
        np.linalg.solve(response, accelerations[:, :, None])[:, :, 0]
        for accelerations in (falling, motion.acceleration)
    )
    load = np.sqrt(np.mean(weight**2 + inertia**2, axis=0))
    torque = problem.at(x).drive.at(motion.time * problem.stretch(x))
    swing = np.sqrt(np.mean((torque - torque.mean(axis=0)) ** 2, axis=0))
    return bool((swing > LEAST_SHARE * load).any())


def no_harmonic(mechanism: Mechanism) -> str:
    """Write that a periodic torque of a given period does not stand out from weight and inertia.

    Args:
        mechanism: The mechanism under the torque.

    Returns:
        The sentence.
    """
    return (
        f"A torque of period {mechanism.values['torque.period']:.4g} s is under a hundredth of weight and "
        "inertia at every joint: it may be what the model lacks; nothing periodic need act."
    )
