"""Print how often a periodic torque of unknown period is found on random records.

Run: ``python benchmarks/periodic.py [--count N] [--first K] [--seed SEED] [--torque fourier|auto]
[--to FILE.jsonl] [--json FILE] [--gate]``. MuJoCo moves mechanisms drawn from ``RANGES``; each fit begins
with the bundled file, whose sizes are others. Case ``K`` of a seed depends on nothing but both; ``--to``
keeps a line a case, and a run that is repeated does only those that are not there. ``SEED`` is a whole number
or a commit's hash.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import beta

import monodyn
from figures import Figure, command_line, finish, say, table
from monodyn.estimation.record.samples import cut, prepare
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.shooting.shoot import choose_substeps
from monodyn.estimation.shooting.trial import Trial
from torque_kinds import Drawn, Torque, recorded


@dataclass(frozen=True)
class Ranges:
    """What the records are drawn from; all of it uniformly, what is marked so in logarithms.

    Attributes:
        models: Bundled mechanisms.
        rates: Rows a second [Hz].
        seconds: Length of a record [s].
        periods: Periods of the torque in a record.
        harmonics: Harmonics of the series.
        amplitude: Root of the sum of the squared amplitudes of a joint, over what holds the joint level (of a
            cart: over the weight of all), in logarithms.
        driven: Share of the joints that a torque acts at, at least one.
        period_limit: Relative Cramer-Rao limit of the period that a record may have.
        length_limit: The same of the lengths that the motion determines; others are not judged.
        growth: By what a deviation of the start state has grown at the most, anywhere in a record [rad or m
            over rad, m, rad/s or m/s]: beyond, the motion is beyond anybody's prediction.
    """

    models: tuple[str, ...] = ("double", "triple", "cartpole")
    rates: tuple[float, ...] = (30.0, 60.0, 120.0)
    seconds: tuple[float, float] = (3.0, 8.0)
    periods: tuple[float, float] = (4.0, 10.0)
    harmonics: tuple[int, ...] = (1, 2)
    amplitude: tuple[float, float] = (0.1, 2.0)
    driven: float = 0.5
    period_limit: float = 1.5e-3
    length_limit: float = 5e-3
    growth: float = 1e3


RANGES = Ranges()
"""Frozen: figures compare only with those of the same ranges."""
PERIOD_WITHIN, LENGTH_WITHIN = 0.005, 0.02
"""Largest relative errors of a period and of a length that count as right."""
DEVIATIONS = 4.0
"""A trusted value farther off the truth than this many of its deviations is wrong."""
NUDGE = 1e-6
"""Step of the finite differences, of coordinates and start states."""
LINEAR = 0.02
"""How far a limit may change with twice the step: more, and the record has no linear limit."""
REACHED = 1.3
"""Typical residual at the truth, over the noise, up to which MuJoCo and the model moved alike."""
MOST_DRAWS = 200
"""Draws for one case at most."""


@dataclass(frozen=True)
class Limits:
    """What a record tells at best.

    Attributes:
        std: Cramer-Rao limit of each unknown, lengths and period relative, by name.
        growth: Largest derivative of a position by the start state.
        residual: Rms residual at the truth, over the noise.
    """

    std: dict[str, float]
    growth: float
    residual: float


def main() -> int:
    """Run the cases and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``.
    """
    parser = command_line(__doc__, RANGES.models)
    parser.add_argument("--count", type=int, default=40, metavar="N", help="cases (40)")
    parser.add_argument("--first", type=int, default=0, metavar="K", help="first case (0)")
    parser.add_argument("--seed", default="1", help="whole number, or a commit's hash (1)")
    parser.add_argument("--torque", choices=("fourier", "auto"), default="fourier", help="as identify has it")
    parser.add_argument("--to", type=Path, metavar="FILE", help="JSON lines, gone on with where it is there")
    options = parser.parse_args()
    rows = list(judged(options))
    figures = counted(rows)
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def judged(options: Any) -> Iterator[dict[str, Any]]:
    """Yield a row for each case, from the file where it is there.

    Args:
        options: The command line.
    """
    known: dict[tuple[str, str, int], dict[str, Any]] = {}
    if options.to is not None and options.to.exists():
        lines = options.to.read_text(encoding="utf-8").splitlines()
        known = {(row["seed"], row["torque"], row["case"]): row for row in map(json.loads, lines)}
    for case in range(options.first, options.first + options.count):
        row = known.get((options.seed, options.torque, case))
        if row is None:
            row = {
                "seed": options.seed,
                "torque": options.torque,
                **judge(options.seed, case, options.torque),
            }
            if options.to is not None:
                with options.to.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
        if not options.only or row["model"] in options.only:
            say(f"{case}: {row['became']}, {row['about']}: {row['said']}")
            yield row


def counted(rows: list[dict[str, Any]]) -> list[Figure]:
    """Return how many cases were right, refused, wrong, or neither, with intervals.

    Args:
        rows: Rows of the cases.
    """
    count, figures = len(rows), []
    for became, target in (("right", 95.0), ("refused", None), ("off", None), ("wrong", 0.0)):
        number = sum(row["became"] == became for row in rows)
        low, high = interval(number, count)
        name = f"{became} ({number} of {count}, 95 % of {100 * low:.1f} to {100 * high:.1f})"
        figures.append(Figure("cases", name, 100.0 * number / count, "%", target, least=became == "right"))
    right = sum(row["period_error"] is not None and row["period_error"] < PERIOD_WITHIN for row in rows)
    figures.append(Figure("period", "within 0.5 %", 100.0 * right / count, "%", 95.0, least=True))
    seconds = [row["seconds"] for row in rows]
    figures.append(Figure("time", "median", float(np.median(seconds)), "s"))
    figures.append(Figure("time", "longest", float(np.max(seconds)), "s", 30.0))
    return figures


def interval(number: int, count: int) -> tuple[float, float]:
    """Return the interval that contains a share with 95 %.

    Args:
        number: How often it happened.
        count: In how many cases.

    Source:
        Clopper and Pearson, The use of confidence or fiducial limits illustrated in the case of the binomial,
        1934.
    """
    low = beta.ppf(0.025, number, count - number + 1) if number else 0.0
    high = beta.ppf(0.975, number + 1, count - number) if number < count else 1.0
    return float(low), float(high)


def judge(seed: str, case: int, torque: str) -> dict[str, Any]:
    """Return what became of one case.

    Args:
        seed: Of all cases.
        case: Its number.
        torque: ``fourier`` or ``auto``.
    """
    drawn, limits, terms = draw(seed, case)
    mechanism = monodyn.load(drawn.model)
    given = {name: value for name, value in drawn.sizes.items() if name in mechanism.values}
    began = time.process_time()
    settings = IdentifySettings(torque=torque)  # pyright: ignore[reportArgumentType]
    fit = monodyn.identify(drawn.poses, mechanism.with_choices(fix=given), settings)
    took = time.process_time() - began
    true = {"torque.period": drawn.period, **drawn.lengths}
    errors = {
        name: fit.mechanism.values[name] / true[name] - 1.0
        for name in limits.std
        if name in true and name in fit.names and fit.starts
    }
    period = abs(errors.get("torque.period", np.inf))
    within = period < PERIOD_WITHIN and all(
        abs(error) < LENGTH_WITHIN for name, error in errors.items() if name != "torque.period"
    )
    off = [
        name
        for name, error in errors.items()
        if abs(error) * true[name] > DEVIATIONS * fit.parameter(name).std
    ]
    found = (fit.mechanism.drive.table.shape[1] - 1) // 2 if fit.torque == "fourier" else 0
    worst = max((abs(error) for name, error in errors.items() if name != "torque.period"), default=np.inf)
    return {
        "case": case,
        "model": drawn.model,
        "about": drawn.about,
        "became": became(fit.grade, within=within, off=bool(off)),
        "grade": fit.grade,
        "period": drawn.period,
        "period_error": float(period) if np.isfinite(period) else None,
        "length_error": float(worst) if np.isfinite(worst) else None,
        "harmonics": [terms, found],
        "off": off,
        "limit": limits.std["torque.period"],
        "growth": limits.growth,
        "rows": len(drawn.poses.time),
        "seconds": took,
        "said": f"period off by {100 * period:.2g} %, lengths by {100 * worst:.2g} %, {found} harmonics, "
        f"{fit.grade}, {took:.1f} s{'' if fit.grade == 'trusted' else ': ' + fit.status}",
    }


def became(grade: str, *, within: bool, off: bool) -> str:
    """Return what a fit counts as: ``right``, ``refused``, ``wrong``, or ``off`` where it is none of them.

    Args:
        grade: Its grade.
        within: Period and lengths are within their tolerances.
        off: One of them is farther off than its own interval can be.
    """
    if grade == "refused":
        return "refused"
    if grade == "trusted" and off:
        return "wrong"
    return "right" if within else "off"


def draw(seed: str, case: int) -> tuple[Drawn, Limits, int]:
    """Return a record that tells its period, what it tells at best, and the number of harmonics.

    Args:
        seed: Of all cases.
        case: Its number.

    Raises:
        RuntimeError: None of ``MOST_DRAWS`` draws does.
    """
    number = int(seed) if seed.isdigit() and len(seed) < 7 else int(seed, 16)
    rng = np.random.default_rng([number, 3, case])
    for _ in range(MOST_DRAWS):
        drawn, terms, table_ = driven(rng)
        found = limits(drawn, terms, table_)
        if found is not None and found.std["torque.period"] < RANGES.period_limit:
            kept = {k: v for k, v in found.std.items() if k == "torque.period" or v < RANGES.length_limit}
            return drawn, Limits(kept, found.growth, found.residual), terms
    raise RuntimeError(f"case {case} of seed {seed}: no draw of {MOST_DRAWS} tells its period")


def driven(rng: np.random.Generator) -> tuple[Drawn, int, np.ndarray]:
    """Return one draw: a record, the number of harmonics and the coefficients, (dof, 1 + 2 terms).

    Args:
        rng: Where everything comes from.
    """
    model, rate = str(rng.choice(RANGES.models)), float(rng.choice(RANGES.rates))
    seconds, cycles = float(rng.uniform(*RANGES.seconds)), float(rng.uniform(*RANGES.periods))
    terms, share = int(rng.choice(RANGES.harmonics)), float(np.exp(rng.uniform(*np.log(RANGES.amplitude))))
    period, tables = seconds / cycles, []

    def series(level: np.ndarray) -> Torque:
        acts = rng.uniform(size=len(level)) < RANGES.driven
        acts[int(rng.integers(len(level)))] = True
        size = rng.uniform(0.3, 1.0, (terms, len(level))) * acts
        size *= share * level / np.maximum(np.sqrt(np.sum(size**2, axis=0)), 1e-9)
        phase = rng.uniform(0.0, 2.0 * np.pi, size.shape)
        order = 2.0 * np.pi * np.arange(1, terms + 1) / period
        pairs = np.stack((size * np.sin(phase), size * np.cos(phase)), axis=1).reshape(2 * terms, -1)
        tables.append(np.vstack((np.zeros(len(level)), pairs)).T)
        return lambda now: np.sum(size * np.sin(order[:, None] * now + phase), axis=0)

    about = (
        f"{model}, {rate:g}/s, {seconds:.1f} s, {cycles:.1f} periods of {period:.4g} s, {terms} harmonics, "
        f"{share:.2g} of the weight"
    )
    drawn = recorded(model, rng, seconds, series, about, ("damping",), period, rate=rate)
    return drawn, terms, tables[0]


def limits(drawn: Drawn, terms: int, table_: np.ndarray) -> Limits | None:
    """Return what a record tells at best; None where its motion is beyond prediction.

    Args:
        drawn: The record.
        terms: Number of harmonics.
        table_: Coefficients, (dof, 1 + 2 terms).
    """
    problem, trial = at_the_truth(drawn, terms, table_)
    residual = float(np.sqrt(np.mean(problem.residuals(trial) ** 2)))
    if not residual < REACHED:
        return None
    stds, growth = [], 0.0
    for step in (NUDGE, 2.0 * NUDGE):
        jacobian = _differences(problem, trial, step)
        count = len(trial.x)
        by_start = (
            jacobian[:, count:].reshape(*problem.data.position.shape, -1) * problem.data.std[:, :, None]
        )
        growth = float(np.abs(by_start).max())
        if not growth < RANGES.growth:
            return None
        stds.append(_deviations(jacobian))
    names = problem.unknowns.names
    once, twice = (std[names.index("torque.period")] for std in stds)
    if abs(twice / once - 1.0) > LINEAR:
        return None
    logs = [name for name in names if name == "torque.period" or name.endswith(".length")]
    return Limits({name: float(stds[0][names.index(name)]) for name in logs}, growth, residual)


def at_the_truth(drawn: Drawn, terms: int, table_: np.ndarray) -> tuple[Problem, Trial]:
    """Return the identification of a record and the true point of it.

    Args:
        drawn: The record.
        terms: Number of harmonics.
        table_: Coefficients, (dof, 1 + 2 terms).
    """
    true = drawn.truth.with_torque("fourier", terms=terms, period=drawn.period)
    columns = ["mean", *(f"{wave}{k}" for k in range(1, terms + 1) for wave in ("cos", "sin"))]
    values = {
        f"{joint.name}.torque.{column}": float(value)
        for joint, row in zip(true.joints, table_, strict=True)
        for column, value in zip(columns, row, strict=True)
    }
    true = true.with_values(values).with_choices(fix=drawn.sizes)
    problem = posed(true, prepare((drawn.poses,), true))
    trial = Trial(problem.unknowns.x0, drawn.state[None], cut(problem.data, 10**9))
    return problem, Trial(trial.x, trial.states, trial.pieces, choose_substeps(problem, trial, 1e-7)[0])


def _deviations(jacobian: np.ndarray) -> np.ndarray:
    """Return the least standard deviations that whitened residuals allow; infinite where nothing depends."""
    scale = np.linalg.norm(jacobian, axis=0)
    deviations, shown = np.full(len(scale), np.inf), scale > 0.0
    columns = jacobian[:, shown] / scale[shown]
    inverse = np.linalg.pinv(columns.T @ columns, rcond=1e-13, hermitian=True)
    deviations[shown] = np.sqrt(np.maximum(np.diag(inverse), 0.0)) / scale[shown]
    return deviations


def _differences(problem: Problem, trial: Trial, step: float) -> np.ndarray:
    """Return the derivative of the residuals by all unknowns and the start state, (sample, param + 2 dof)."""
    count, columns = len(trial.x), []
    for k in range(count + trial.states.size):
        ends = []
        for side in (step, -step):
            x, states = trial.x.copy(), trial.states.copy()
            if k < count:
                x[k] += side
            else:
                states[0, k - count] += side
            ends.append(problem.residuals(trial.at(x, states)).ravel())
        columns.append((ends[0] - ends[1]) / (2.0 * step))
    return np.array(columns).T


if __name__ == "__main__":
    sys.exit(main())
