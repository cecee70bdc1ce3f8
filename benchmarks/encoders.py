"""Print how well real encoder records are fitted from a naive start, and how fast, next to targets.

Run: ``MONODYN_DATA=<folder> python benchmarks/encoders.py [--only alone|together|scaling|units ...]
[--json FILE] [--gate]``; the folder holds ``encoders/*.csv``. ``alone`` fits each window by itself, from a
bundled model all of whose sizes are ``SIZE``, and holds its ratios against those of the other windows;
``together`` all windows of the double pendulum as one fit; ``scaling`` made records of growing length and
number, and of chains of more and more links; ``units`` windows in degrees and milliseconds, which are to be
named as such. Processor time stands next to wall time, which other work on the machine lengthens.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from figures import Figure, command_line, finish, say, table
from monodyn.errors import MonodynError
from monodyn.estimation.fit import Fit
from monodyn.estimation.parts import Combination
from monodyn.estimation.record.tables import read_poses, write_poses
from monodyn.estimation.settings import IdentifySettings
from monodyn.mechanism import Mechanism, load
from monodyn.mechanism.simulate import simulate
from monodyn.pipeline import identify_tables
from monodyn.stages import identify
from monodyn.types import Poses

KNOWN_RATIOS = {
    "link1.J / link2.J": 1.796,
    "link1.length * link2.mx / link2.J": 0.8824,
    "link1.mx * gravity / link2.J": 105.9,
    "link2.mx * gravity / link2.J": 50.11,
}
"""What is published of the double pendulum, by name of the combination; how surely is not published ..."""
ROUNDED = dict(zip(KNOWN_RATIOS, (5e-4, 5e-5, 0.05, 5e-3), strict=True))
"""... beyond half a unit of the last digit."""
SIZES = ("length", "width", "thickness", "tail", "tip", "offset")
"""Kinds of the sizes that the naive start sets ..."""
SIZE = 0.1
"""... to this [m]."""
MOST_RESIDUAL = 3.0
"""Largest residual of a good fit, rms [mrad]."""
FEWEST_GOOD = 19
"""Windows of the double pendulum that must be fitted so, of 20."""
WIDTH = 1.96
"""Half width of a 95 % interval in standard deviations."""
MOST_OFF = 2.0
"""Largest error of a ratio in the window that ``recordings.py`` looks at [%] ..."""
REQUIRED_WINDOW = "double_12"
"""... which is this one."""
MOST_OFF_TOGETHER = 0.5
"""Largest error of a ratio from all windows together [%]."""
MOST_SECONDS = 8.0
"""Longest fit of all windows together on an idle machine [s]."""
FRAMES, RECORDS = (40, 100, 250, 600, 1500, 4000), (1, 2, 5, 10, 20, 50)
"""Rows of one record, and numbers of records of ``RECORD_FRAMES`` rows, whose time is measured."""
RECORD_FRAMES, PACE, NOISE = 80, 0.02, 1e-3
"""Rows of each of several records; time between stamps [s]; noise [rad]."""
UNITS = {"degrees": (180.0 / np.pi, 1.0), "milliseconds": (1.0, 1000.0)}
"""What a table may be in: factors of its angles and times."""
UNIT_SECONDS = 5.0
"""Longest time in which that is to be named [s]."""
LINKS = (1, 2, 3, 4, 5, 6, 8)
"""Links of a chain whose record of ``RECORD_FRAMES`` rows is fitted."""
MOST_GROWTH = {"rows": 1.2, "records": 1.2, "links": 2.0}
"""Largest power of each with which the time may grow over the upper half of the range."""


@dataclass(frozen=True)
class Timed:
    """A fit with what it took.

    Attributes:
        name: What was fitted.
        fit: The fit.
        wall: Wall time [s].
        processor: Processor time of all threads [s].
    """

    name: str
    fit: Fit
    wall: float
    processor: float

    @property
    def rms(self) -> dict[str, float]:
        """Residual of each joint [mrad]."""
        return {joint: 1000.0 * value for joint, value in self.fit.rms.items()}

    @property
    def good(self) -> bool:
        """Whether the fit is to be used and its residuals are small."""
        return self.fit.ok and max(self.rms.values()) <= MOST_RESIDUAL

    @property
    def known(self) -> list[Combination]:
        """The known ratios as this fit has them."""
        found = {combination.name: combination for combination in self.fit.combinations}
        return [found[name] for name in KNOWN_RATIOS]

    @property
    def off(self) -> dict[str, float]:
        """Error of each known ratio [%]."""
        found = {combination.name: combination.value for combination in self.fit.combinations}
        return {name: 100.0 * (found.get(name, np.nan) / value - 1.0) for name, value in KNOWN_RATIOS.items()}

    @property
    def missed(self) -> list[str]:
        """Known ratios that their 95 % interval does not contain, to the digits that are published."""
        found = {c.name: (c.value, c.std) for c in self.fit.combinations}
        return [
            name
            for name, value in KNOWN_RATIOS.items()
            if name not in found or abs(found[name][0] - value) > WIDTH * found[name][1] + ROUNDED[name]
        ]

    def times(self) -> list[Figure]:
        """Return wall and processor time as figures."""
        return [
            Figure(self.name, "time", self.wall, "s"),
            Figure(self.name, "processor time", self.processor, "s"),
        ]


def main() -> int:
    """Measure what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``, 2 when the data are missing.
    """
    groups = {"alone": alone, "together": together, "scaling": scaling, "units": units}
    options = command_line(__doc__, tuple(groups)).parse_args()
    folder = Path(os.environ.get("MONODYN_DATA") or "missing") / "encoders"
    files = sorted(folder.glob("*.csv"))
    if not files:
        print(
            "MONODYN_DATA: expected the folder that holds encoders/*.csv; set the variable.", file=sys.stderr
        )
        return 2
    figures: list[Figure] = []
    for name in options.only or tuple(groups):
        figures += groups[name](files)
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def alone(files: Sequence[Path]) -> list[Figure]:
    """Fit each window by itself.

    Args:
        files: Tables of the windows.

    Returns:
        Figures of each, and how many of the double pendulum are good.
    """
    figures, windows = [], []
    for file in files:
        mechanism = naive(file.stem.split("_")[0])
        found = timed(file.stem, [read_poses(file, mechanism)], mechanism)
        figures += [
            *(Figure(found.name, f"{joint} residual", value, "mrad") for joint, value in found.rms.items()),
            *times_and_use(found),
        ]
        if len(found.rms) == 2:
            windows.append(found)
            figures += ratios(found)
        say(f"{found.name}: {found.fit.status}")
    return [*figures, *counted(windows)]


def counted(windows: Sequence[Timed]) -> list[Figure]:
    """Return how many windows of the double pendulum are good, and how many ratios lie within.

    Args:
        windows: Their fits.
    """
    within = sum(len(KNOWN_RATIOS) - len(window.missed) for window in windows)
    whole = [np.sqrt(np.mean(np.square(list(window.rms.values())))) for window in windows]
    values, stds = (
        np.array([[getattr(c, what) for c in w.known] for w in windows]) for what in ("value", "std")
    )
    weights = stds**-2.0
    # of the windows but one, whose own is compared with it
    rest, total = weights.sum(axis=0) - weights, np.sum(weights * values, axis=0) - weights * values
    apart = np.abs(values - total / rest) / np.sqrt(stds**2 + 1.0 / rest)
    return [
        Figure(
            "alone", "windows good at every joint", sum(w.good for w in windows), "", FEWEST_GOOD, least=True
        ),
        Figure("alone", "ratios within 95 % of other windows", float(np.sum(apart < WIDTH)), ""),
        *(
            Figure(
                "alone", f"{name}: windows scatter by", 100.0 * float(np.std(column) / np.mean(column)), "%"
            )
            for name, column in zip(KNOWN_RATIOS, values.T, strict=True)
        ),
        Figure("alone", "windows good over both joints", sum(r <= MOST_RESIDUAL for r in whole), ""),
        Figure("alone", "ratios within 95 %", within, "", len(KNOWN_RATIOS) * len(windows), least=True),
        Figure("alone", "processor time of a window", float(np.mean([w.processor for w in windows])), "s"),
    ]


def together(files: Sequence[Path]) -> list[Figure]:
    """Fit all windows of the double pendulum together, twice: the first time loads kernels.

    Args:
        files: Tables of the windows.

    Returns:
        Figures of the second fit.
    """
    mechanism = naive("double")
    records = [read_poses(file, mechanism) for file in files if file.stem.startswith("double")]
    timed("together", records, mechanism)
    found = timed("together", records, mechanism)
    say(f"together: {found.fit.status}")
    return [
        *(Figure("together", f"{joint} residual", value, "mrad") for joint, value in found.rms.items()),
        *ratios(found, MOST_OFF_TOGETHER),
        Figure("together", "ratios within 95 %", len(KNOWN_RATIOS) - len(found.missed), ""),
        Figure("together", "time", found.wall, "s", MOST_SECONDS),
        Figure("together", "processor time", found.processor, "s"),
    ]


def scaling(files: Sequence[Path]) -> list[Figure]:
    """Fit made records of growing length and number.

    Args:
        files: Not used.

    Returns:
        The processor time of each, and the power with which it grows over the upper half of them.
    """
    double, figures = load("double"), []
    timed("scaling", [made(double, RECORD_FRAMES, 0)], double)
    for what, counts in (("rows", FRAMES), ("records", RECORDS), ("links", LINKS)):
        taken = []
        for count in counts:
            mechanism = chain(count) if what == "links" else double
            rows, number = (
                (count, 1) if what == "rows" else (RECORD_FRAMES, count if what == "records" else 1)
            )
            records = [made(mechanism, rows, seed) for seed in range(number)]
            found = timed(what, records, mechanism)
            taken.append(found.processor)
            figures.append(Figure(what, f"{count}: processor time", found.processor, "s"))
        half = len(counts) // 2
        growth = np.polyfit(np.log(counts[half - 1 :]), np.log(taken[half - 1 :]), 1)[0]
        figures.append(Figure(what, "power of growth", growth, "", MOST_GROWTH[what]))
    return figures


def chain(links: int) -> Mechanism:
    """Return a pendulum of equal links, each hinged at the end of the one before.

    Args:
        links: Their number.
    """
    body = """<body name="link{0}" pos="{1} 0 0"><joint name="joint{0}" axis="0 -1 0"/>
        <geom type="box" size="0.05 0.01 0.005" pos="0.05 0 0" density="1000"/>"""
    bodies = "".join(body.format(k + 1, 0.1 if k else 0.0) for k in range(links)) + "</body>" * links
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "chain.xml"
        file.write_text(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
        return load(str(file))


def units(files: Sequence[Path]) -> list[Figure]:
    """Give windows in other units, which are to be named before anything is fitted.

    Args:
        files: Tables of the windows; the first two and the last of the double pendulum are taken.

    Returns:
        How many were named, and the longest time.
    """
    mechanism, named, longest = naive("double"), 0, 0.0
    chosen = [file for file in files if file.stem.startswith("double")]
    for file in (*chosen[:2], chosen[-1]):
        poses = read_poses(file, mechanism)
        for what, (angle, time_unit) in UNITS.items():
            given = replace(poses, position=angle * poses.position, time=time_unit * poses.time)
            with tempfile.TemporaryDirectory() as folder:
                table_file = Path(folder) / "record.csv"
                write_poses(given, table_file)
                began = time.perf_counter()
                try:
                    said = identify_tables([table_file], "double").fit.status
                except MonodynError as error:
                    said = str(error)
                longest = max(longest, time.perf_counter() - began)
            named += what in said
            say(f"{file.stem} in {what}: {said[:160]}")
    count = 3 * len(UNITS)
    return [
        Figure("units", "named", float(named), f"of {count}", float(count), least=True),
        Figure("units", "longest time", longest, "s", UNIT_SECONDS),
    ]


def naive(model: str) -> Mechanism:
    """Return a bundled model all of whose sizes are the same.

    Args:
        model: Its name.
    """
    mechanism = load(model)
    return mechanism.with_values(
        {p.name: SIZE for p in mechanism.parameters if p.kind in SIZES and not p.follows}
    )


def made(mechanism: Mechanism, rows: int, seed: int) -> Poses:
    """Return a simulated record of a damped mechanism, with noise.

    Args:
        mechanism: The mechanism.
        rows: Its rows.
        seed: Seed of its start and its noise.
    """
    drawn = np.random.default_rng(seed)
    names = tuple(joint.name for joint in mechanism.joints)
    damped = mechanism.with_values(
        {f"{name}.damping": 3e-4 if k == 0 else 2e-4 for k, name in enumerate(names)}
    )
    # a long chain is let go near the vertical, or it is wild
    stamps, start = PACE * np.arange(rows), drawn.uniform(-1.0, 1.0, len(names)) * min(1.0, 2.0 / len(names))
    start[0] -= 0.5 * np.pi
    q = simulate(damped, stamps, start, np.zeros(len(names))).position
    noisy = q + NOISE * drawn.standard_normal(q.shape)
    covariance = np.repeat(NOISE**2 * np.eye(len(names))[None], rows, axis=0)
    return Poses(names, np.arange(rows), stamps, noisy, covariance, np.ones(rows, dtype=bool))


def timed(name: str, records: Sequence[Poses], mechanism: Mechanism) -> Timed:
    """Return the fit of records with free bodies, and what it took.

    Args:
        name: What they are.
        records: The records.
        mechanism: The start.
    """
    wall, processor = time.perf_counter(), time.process_time()
    fit = identify(records, mechanism, IdentifySettings(bodies="free"))
    return Timed(name, fit, time.perf_counter() - wall, time.process_time() - processor)


def ratios(found: Timed, most: float | None = None) -> list[Figure]:
    """Return the errors of the known ratios as figures.

    Args:
        found: The fit.
        most: Their target, either way [%]; None for none.
    """
    return [
        Figure(found.name, f"{name} off", error if most is None else abs(error), "%", most)
        for name, error in found.off.items()
    ]


def times_and_use(found: Timed) -> list[Figure]:
    """Return whether a fit is to be used, and its times.

    Args:
        found: The fit.
    """
    return [Figure(found.name, "fit to be used", float(found.fit.ok), ""), *found.times()]


if __name__ == "__main__":
    raise SystemExit(main())
