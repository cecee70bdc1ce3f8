"""Print how well masses come out where the torque is known: records made with MuJoCo, and a real pendubot.

Run: ``python benchmarks/torques.py [--only GROUP ...] [--json FILE] [--gate]``; ``pendubot`` (its encoders)
and ``film`` need ``MONODYN_DATA``. Every made record starts from the bundled file, whose lengths,
thicknesses, densities and frictions are not those of the mechanism that moved; widths, which no table shows,
are given.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import monodyn
from figures import Figure, command_line, finish, say, table
from monodyn.job import Outcome
from monodyn.pipeline import identify_tables

STEP = 2e-4
"""Integration step of MuJoCo [s]."""
MASS_TARGET = 2.0
"""Error of a mass, at most [%]."""
SOFT, FIRM = 0.02, 1e-3
"""Times in which the dry friction of MuJoCo brings a joint to rest [s]: the first unless a file says so, with
which dry friction turns about half of that ahead of the rate, as no bearing's does."""
LOGGED = (58, 271)
"""Frames of its film that the log of the torque covers, less the last quarter."""
WINDOW = 1.5
"""Seconds of each window of the pendubot."""
EVERY = 4
"""Rows of its encoders, of which one is taken: it moves little within 10 ms. Its torque is taken whole."""


@dataclass(frozen=True)
class Case:
    """One made record, or several of one mechanism.

    Attributes:
        kind: Bundled mechanism.
        joints: Where the torque acts.
        share: Amplitude of the torque as a share of what holds the mechanism level.
        noise: Of the positions [rad or m].
        friction: Dry friction of every joint, as the same share.
        settles: Within which time it brings a joint to rest [s].
        lag: How much later than in the log the torque acts [s].
        log: Rows of the log a second [Hz].
        hold: True where the controller holds what it sent until the next row.
        rate: Rows of the table a second [Hz].
        records: How many records share the mechanism.
        seconds: How long each is [s].
    """

    kind: str
    joints: tuple[str, ...]
    share: float = 0.2
    noise: float = 1e-3
    friction: float = 0.0
    settles: float = SOFT
    lag: float = 0.0
    log: float = 200.0
    hold: bool = False
    rate: float = 60.0
    records: int = 1
    seconds: float = 3.0


CASES = {
    "single": Case("single", ("joint1",)),
    "single, lag": Case("single", ("joint1",), lag=0.03),
    "single, dry": Case("single", ("joint1",), friction=0.03),
    "single, weak": Case("single", ("joint1",), share=0.02),
    "single, held": Case("single", ("joint1",), log=50.0, hold=True),
    "bob": Case("bob", ("joint1",)),
    "double, shoulder": Case("double", ("joint1",)),
    "double, elbow": Case("double", ("joint2",), share=0.1),
    "double, both, lag": Case("double", ("joint1", "joint2"), lag=0.05),
    "double, dry": Case("double", ("joint1",), friction=0.02),
    "double, 30 Hz": Case("double", ("joint1",), rate=30.0, log=500.0, noise=3e-3),
    "double, 2 records": Case("double", ("joint1",), records=2, seconds=1.5),
    "triple": Case("triple", ("joint1", "joint2")),
    "cartpole": Case("cartpole", ("slide",)),
    "cartpole, lag": Case("cartpole", ("slide",), lag=0.02, hold=True, log=100.0),
    "double, firmly dry": Case("double", ("joint1",), friction=0.02, settles=FIRM),
}
"""The made records by name."""


@dataclass(frozen=True)
class Made:
    """Tables, logs and what is true of the mechanism that moved.

    Attributes:
        tables: Tables of positions.
        logs: Logs of torques.
        masses: True masses by name [kg].
        sizes: True sizes that a table does not show and a user would measure, by name [m].
    """

    tables: list[Path]
    logs: list[Path]
    masses: dict[str, float]
    sizes: dict[str, float]


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``, 2 when the data are missing.
    """
    groups: dict[str, Callable[[Path], list[Figure]]] = {"made": made, "pendubot": pendubot, "film": film}
    parser = command_line(__doc__, tuple(groups))
    options = parser.parse_args()
    wanted = options.only or groups
    if {"pendubot", "film"} & {*wanted} and not _pendubot()[0].is_file():
        print("MONODYN_DATA: expected the folder that holds real/; set the variable.", file=sys.stderr)
        return 2
    figures: list[Figure] = []
    with tempfile.TemporaryDirectory() as folder:
        for group in wanted:
            figures += groups[group](Path(folder))
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def made(folder: Path) -> list[Figure]:
    """Return how masses and lag of every made record compare with the truth.

    Args:
        folder: Where the tables go.
    """
    figures, inside, count = [], 0, 0
    for number, (name, case) in enumerate(CASES.items()):
        record = simulated(case, np.random.default_rng(number), folder)
        settings = monodyn.RunSettings(torques=tuple(record.logs), fix=record.sizes)
        outcome = identify_tables(record.tables, case.kind, settings=settings)
        rows = {row["name"]: row for row in outcome.document["parameters"]}
        errors = {m: 100.0 * abs(rows[m]["value"] / true - 1.0) for m, true in record.masses.items()}
        within = [rows[m]["lower"] <= true <= rows[m]["upper"] for m, true in record.masses.items()]
        inside, count = inside + sum(within), count + len(within)
        # a torque that is held until the next row comes half a row late
        late = case.lag + (0.5 / case.log if case.hold else 0.0)
        lag = 1e3 * abs(rows["torque.lag"]["value"] - late)
        shown = ", ".join(f"{m} {rows[m]['value']:.4g} ({true:.4g})" for m, true in record.masses.items())
        say(f"{name}: {outcome.document['grade']}, {outcome.seconds.get('identify', 0.0):.0f} s: {shown}")
        figures.append(Figure(name, "worst mass", max(errors.values()), "%", MASS_TARGET))
        figures.append(Figure(name, "masses outside of their interval", len(within) - sum(within), ""))
        figures.append(Figure(name, "lag", lag, "ms"))
        figures.append(Figure(name, "trusted", float(outcome.document["grade"] == "trusted"), ""))
    share = 100.0 * inside / count
    return [*figures, Figure("all", "true masses within their interval", share, "%", 90.0, least=True)]


def simulated(case: Case, rng: np.random.Generator, folder: Path) -> Made:
    """Return what is measured of a drawn mechanism that is pushed with the torques of a log.

    Args:
        case: What to make.
        rng: Where sizes, starts, torques and noise come from.
        folder: Where the tables go.
    """
    mechanism = monodyn.load(case.kind)
    spread = {"length": 0.4, "width": 0.3, "thickness": 0.4, "mass": 0.7, "damping": 0.5}
    changes = {
        p.name: p.value * float(np.exp(rng.uniform(-spread[p.kind], spread[p.kind])))
        for p in mechanism.parameters
        if p.free and p.kind in spread
    }
    denser = float(np.exp(rng.uniform(-1.0, 1.0)))
    changes |= {p.name: p.value * denser for p in mechanism.parameters if p.kind == "density"}
    mechanism = mechanism.with_values(changes)
    path = folder / "moved.xml"
    monodyn.write_mjcf(mechanism, path)
    body = mujoco.MjModel.from_xml_path(str(path))
    body.opt.timestep, body.opt.integrator = STEP, mujoco.mjtIntegrator.mjINT_RK4
    level = 9.81 * float(body.body_mass.sum()) * 0.1
    body.dof_frictionloss[:] = case.friction * level
    body.dof_solref[:, 0] = case.settles
    masses = {p.name: p.value for p in mechanism.parameters if p.name.endswith(".mass")}
    shown = {p.name: p.value for p in mechanism.parameters if p.free and p.kind in ("width", "tail", "tip")}
    made = Made([], [], masses, shown)
    for record in range(case.records):
        _simulate(case, body, level, rng, made, folder / f"{case.kind}_{record}")
    return made


def _simulate(case: Case, body: Any, level: float, rng: np.random.Generator, made: Made, stem: Path) -> None:
    """Simulate one record; write its table and the log of its torque."""
    dofs = [body.joint(name).dofadr[0] for name in case.joints]
    joints = tuple(body.joint(j).name for j in range(body.njnt))
    waves = rng.uniform(0.5, 1.5, (len(dofs), 3)), rng.uniform(2.0, 15.0, (len(dofs), 3))
    phases = rng.uniform(0.0, 6.3, (len(dofs), 3))
    logged = np.arange(round((case.seconds + 0.5) * case.log)) / case.log - 0.2
    torque = case.share * level * np.sum(waves[0] * np.sin(waves[1] * logged[:, None, None] + phases), axis=2)
    data = mujoco.MjData(body)
    data.qpos[:] = rng.uniform(-1.0, 1.0, body.nq)
    count, every = round(case.rate * case.seconds), round(1.0 / (case.rate * STEP))
    position = np.zeros((count, body.nq))
    for row in range(count):
        position[row] = data.qpos
        for _ in range(every):
            # MuJoCo holds a torque during a step: that of its middle
            at = data.time - case.lag + 0.5 * STEP
            sent = torque[np.searchsorted(logged, at, side="right") - 1]
            for i, dof in enumerate(dofs):
                data.qfrc_applied[dof] = sent[i] if case.hold else np.interp(at, logged, torque[:, i])
            mujoco.mj_step(body, data)
    position += rng.normal(scale=case.noise, size=position.shape)
    time = every * STEP * np.arange(count)
    made.tables.append(_written(f"{stem}.csv", joints, time, position))
    made.logs.append(_written(f"{stem}_torques.csv", case.joints, logged, torque))


def _written(path: str, joints: Sequence[str], time: np.ndarray, values: np.ndarray) -> Path:
    rows = np.column_stack([time, values])
    lines = [",".join(("time", *joints)), *(",".join(f"{value:.9g}" for value in row) for row in rows)]
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")
    return Path(path)


def _pendubot() -> tuple[Path, Path]:
    folder = Path(os.environ.get("MONODYN_DATA") or "missing") / "real"
    return folder / "pendubot_encoders.csv", folder / "pendubot.xml"


def pendubot(folder: Path) -> list[Figure]:
    """Return what is found of the pendubot from its encoders and the torque that its motor reports.

    Args:
        folder: Where the windows go.
    """
    source, model = _pendubot()
    windows = list(_windows(source, folder))
    settings = monodyn.RunSettings(
        torques=(source,) * len(windows),
        fix={"link1.length": 0.3, "link2.length": 0.2},
        free=("joint1.friction",),
    )
    return _found("pendubot", identify_tables(windows, model, settings=settings))


def film(folder: Path) -> list[Figure]:
    """Return what is found of the pendubot from its film and that torque, its first link's length given.

    Args:
        folder: Where the run goes.
    """
    source, model = _pendubot()
    settings = monodyn.RunSettings(
        torques=(source,), fit_frames=LOGGED, fix={"link1.length": 0.3}, free=("joint1.friction",)
    )
    return _found("film", monodyn.run(source.parent / "pendubot.m4v", model, folder / "film", settings))


def _found(case: str, outcome: Outcome) -> list[Figure]:
    """Return masses, dry friction and lag with their intervals."""
    rows = {row["name"]: row for row in outcome.document["parameters"]}
    say(f"{case}: {outcome.document['grade']}: {outcome.document['status']}")
    figures = [Figure(case, "trusted", float(outcome.document["grade"] == "trusted"), "")]
    for name in ("link1.mass", "link2.mass", "joint1.friction", "torque.lag"):
        row = rows[name]
        figures.append(Figure(case, name, row["value"], row["unit"]))
        figures.append(Figure(case, f"{name}, lower end", row["lower"], row["unit"]))
        figures.append(Figure(case, f"{name}, upper end", row["upper"], row["unit"]))
    return figures


def _windows(source: Path, folder: Path) -> Iterator[Path]:
    """Cut the encoders' table into windows: an upright pendulum cannot be predicted for longer."""
    lines = source.read_text(encoding="utf-8").splitlines()
    times = np.array([float(line.split(",")[0]) for line in lines[1:]])
    first = times[0]
    while first + WINDOW <= times[-1]:
        rows = np.flatnonzero((times >= first) & (times < first + WINDOW))[::EVERY]
        path = folder / f"window_{first:.1f}.csv"
        path.write_text("\n".join([lines[0], *(lines[row + 1] for row in rows)]) + "\n", encoding="utf-8")
        yield path
        first += WINDOW


if __name__ == "__main__":
    raise SystemExit(main())
