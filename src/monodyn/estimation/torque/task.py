"""One way to explain a motion for each torque model: friction, a periodic torque, or any torque."""

from __future__ import annotations

from dataclasses import dataclass, replace

from monodyn.estimation.record.samples import Data
from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.shooting.search import Search, hopeless
from monodyn.estimation.shooting.shoot import Grown
from monodyn.estimation.shooting.starts import sized
from monodyn.estimation.torque.evidence import (
    dry_friction,
    likeliest,
    more_terms,
    periodic,
    series,
    simpler_series,
    stands_out,
)
from monodyn.estimation.torque.free import MOST_TORQUES, fit_torques, left_over
from monodyn.estimation.torque.periods import Guess, Undriven
from monodyn.estimation.verdict.advice import no_harmonic
from monodyn.mechanism import Mechanism
from monodyn.types import Progress

NO_PERIOD = (
    "The period of the torque cannot be estimated: no period that the record shows more than once explains "
    "the motion better than friction alone. Give more frames, or the period with "
    "--fix torque.period=SECONDS, or leave out --identify.torque fourier."
)


@dataclass(frozen=True, eq=False)
class Task:
    """What is to be explained, and how the search goes.

    Attributes:
        data: The samples of all records.
        smoothed: Smooth motion of each record.
        settings: How to search.
        progress: Called with the stages done.
    """

    data: Data
    smoothed: tuple[Smoothed, ...]
    settings: IdentifySettings
    progress: Progress | None

    def search(self, problem: Problem) -> Search:
        """Return the search of one problem."""
        return Search(problem, self.smoothed, self.settings, self.progress)


@dataclass(frozen=True, eq=False)
class Explained:
    """A problem with its optimum, or the reason why there is none.

    Attributes:
        problem: The problem that was solved last.
        grown: Its optimum, or None.
        tried: Number of starts.
        reason: Why there is no optimum, a sentence for the user.
        advice: Sentences for the user about the torque.
    """

    problem: Problem
    grown: Grown | None
    tried: int = 1
    reason: str = ""
    advice: tuple[str, ...] = ()


def by_friction(mechanism: Mechanism, task: Task) -> Explained:
    """Viscous friction (Case I), and dry friction where the motion shows it.

    Args:
        mechanism: The start.
        task: What is to be explained.
    """
    problem = posed(mechanism.with_torque("friction"), task.data)
    reason = hopeless(problem, task.smoothed)
    if reason is not None:
        return Explained(problem, None, reason=reason)
    search = task.search(problem)
    grown, tried = search.from_starts()
    return Explained(*dry_friction(problem, grown, search.route), tried)


def by_series(mechanism: Mechanism, task: Task) -> Explained:
    """A periodic torque as a Fourier series (Case II), beside viscous friction or alone.

    Args:
        mechanism: The start; a period that is not free in it counts as known.
        task: What is to be explained.
    """
    settings = task.settings
    if settings.series == "alone":
        mechanism = frictionless(mechanism)
    least = posed(mechanism.with_torque("fourier", terms=settings.terms or 1, period=1.0), task.data)
    clock = least.mechanism.parameter("torque.period")
    reason = hopeless(least, task.smoothed)
    if reason is not None:
        return Explained(least, None, reason=reason)
    undriven = Undriven.of(mechanism, task.data, task.smoothed)
    guesses = undriven.guesses(settings.terms)
    if not guesses:
        return Explained(least, None, reason=NO_PERIOD)
    route = task.search(undriven.problem).route
    tried = [_from_guess(mechanism, task, undriven, guess) for guess in guesses]
    problem, grown = tried[likeliest(tried)]
    if settings.terms == 0:
        problem, grown = more_terms(*simpler_series(problem, grown, route, divide=clock.free), route)
    seen = periodic(problem, grown, route) and stands_out(problem, grown.x, undriven.motion)
    if clock.free and not seen:
        return Explained(problem, None, reason=NO_PERIOD)
    doubt = () if seen else tuple(no_harmonic(problem.mechanism_at(grown.x)))
    return Explained(problem, grown, len(guesses), advice=doubt)


def _from_guess(mechanism: Mechanism, task: Task, undriven: Undriven, guess: Guess) -> tuple[Problem, Grown]:
    """Grow a fit from one guess of the period."""
    problem = posed(series(mechanism, guess.terms, guess.period), task.data)
    search = task.search(problem)
    return problem, search.grown(undriven.start(guess, problem), search.route)


def by_torques(mechanism: Mechanism, task: Task) -> Explained:
    """One torque a joint and time stamp (Case III); sizes and masses are held.

    Where friction explains the motion it is held too, and the torque comes on top of it; else it is part of
    the torque.

    Args:
        mechanism: The start.
        task: What is to be explained.
    """
    plain = posed(mechanism.with_torque("friction"), task.data)
    joints, stamps = len(mechanism.joints), task.data.times[task.data.measured.any(axis=1)]
    reason = hopeless(plain, task.smoothed)
    if len(task.data.first) > 2:
        reason = "Free torques belong to one record each; identify one record at a time."
    elif len(stamps) * joints > MOST_TORQUES:
        reason = (
            f"{len(stamps) * joints} torques, one a joint and time stamp, are too many at once; fit at most "
            f"{MOST_TORQUES // joints} frames."
        )
    if reason is not None:
        return Explained(plain, None, reason=reason)
    search = replace(task, settings=replace(task.settings, starts=1)).search(plain)
    grown, _ = search.from_starts()
    passive = search.explained(grown)
    x = grown.x if passive else sized(plain, search.motion)
    held = plain.mechanism_at(x) if passive else frictionless(plain.mechanism_at(x))
    driven = held.with_torque("free", knots=stamps * plain.stretch(x))
    problem = replace(posed(driven, task.data, torques_only=True), base=plain.size(x))
    noise = max(left_over(plain, grown), 1.0) if passive else 1.0
    return Explained(*fit_torques(problem, task.smoothed, search.route, noise, search.report))


def frictionless(mechanism: Mechanism) -> Mechanism:
    """Return a copy without friction, but for what the user chose.

    Args:
        mechanism: The mechanism.
    """
    names = [f"{joint.name}.{what}" for joint in mechanism.joints for what in ("damping", "friction")]
    return mechanism.with_choices(fix={name: 0.0 for name in names if name not in mechanism.chosen})


EXPLAIN = {"friction": by_friction, "fourier": by_series, "free": by_torques}
"""How a motion is explained, by torque model."""
