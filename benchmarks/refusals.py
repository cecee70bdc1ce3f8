"""Print how long it takes until what no mechanism in the file explains is refused.

Run: ``MONODYN_DATA=<folder> python benchmarks/refusals.py [--only tables|clips] [--rows N] [--json FILE]
[--gate]``. Tables are motions of one mechanism read as those of another; clips are run with a bundled
mechanism that they do not show. Times are those of two idle cores, everything compiled.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

import monodyn
from figures import Figure, command_line, finish, say, table
from monodyn.mechanism import load
from monodyn.mechanism.simulate import rollout
from monodyn.types import Poses

TABLES = {
    "triple as double": ("triple", (0, 1), "double"),
    "end of a triple as double": ("triple", (1, 2), "double"),
    "cart-pole as double": ("cartpole", (0, 1), "double"),
    "double as cart-pole": ("double", (0, 1), "cartpole"),
    "four links as triple": ("chain:4", (0, 1, 2), "triple"),
    "second link as single": ("double", (1,), "single"),
}
"""What moved, which of its joints were read, and what they are taken for."""
CLIPS = {
    "bob as cart-pole": ("rendered/bob.mp4", "cartpole"),
    "single as cart-pole": ("rendered/single.mp4", "cartpole"),
    "pendubot without its torque": ("real/pendubot.m4v", "real/pendubot.xml"),
}
"""Clips and the mechanisms that they are run with."""
TABLE_SECONDS, CLIP_SECONDS = 30.0, 60.0
"""Until a table of 1,000 rows, and a clip of 10 s, are refused [s]."""
RATE, NOISE = 100.0, 1e-3
"""Rows a second [Hz], and the noise of the positions [rad or m]."""


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``, 2 when data are missing.
    """
    groups = {"tables": tables, "clips": clips}
    parser = command_line(__doc__, tuple(groups))
    parser.add_argument("--rows", type=int, default=1000, help="rows of each table (1000)")
    parser.add_argument("--seed", type=int, default=1, help="where starts and noise come from (1)")
    options = parser.parse_args()
    if "clips" in (options.only or groups) and "MONODYN_DATA" not in os.environ:
        print("MONODYN_DATA: expected the folder of recordings, got nothing; see benchmarks/README.md.")
        return 2
    figures: list[Figure] = []
    for group in options.only or groups:
        figures += groups[group](options)
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def tables(options: Any) -> list[Figure]:
    """Return how long each table takes.

    Args:
        options: The command line.
    """
    found = []
    for name, (moved, joints, taken_for) in TABLES.items():
        say(name)
        mechanism = load(taken_for)
        record = _record(moved, joints, [joint.name for joint in mechanism.joints], options)
        began = time.perf_counter()
        fit = monodyn.identify(record, mechanism)
        found += _figures(name, fit, time.perf_counter() - began, TABLE_SECONDS)
    return found


def clips(_: Any) -> list[Figure]:
    """Return how long each clip takes, a whole run of it."""
    found, data = [], Path(os.environ["MONODYN_DATA"])
    for name, (clip, model) in CLIPS.items():
        say(name)
        path = data / model
        began = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            outcome = monodyn.run(data / clip, path if path.is_file() else model, Path(folder) / "run")
        found += _figures(name, outcome.fit, time.perf_counter() - began, CLIP_SECONDS)
    return found


def _figures(name: str, fit: Any, seconds: float, most: float) -> list[Figure]:
    """Return the figures of one refusal."""
    print(f"{name}: {fit.grade}. {fit.status}", file=sys.stderr)
    return [
        Figure(name, "until it is refused", seconds, "s", most),
        Figure(name, "refused", float(fit.grade == "refused"), "", 1.0, least=True),
    ]


def _record(moved: str, joints: tuple[int, ...], names: list[str], options: Any) -> Poses:
    """Return some joints of a motion, under other names."""
    mechanism, rng = load(moved), np.random.default_rng(options.seed)
    stamps, dofs = np.arange(options.rows) / RATE, len(mechanism.joints)
    start = rng.uniform(-1.0, 1.0, dofs), rng.uniform(-1.0, 1.0, dofs)
    position, _ = rollout(mechanism.tree, stamps, *start, substeps=8)
    read = position[:, joints] + NOISE * rng.standard_normal((len(stamps), len(joints)))
    noise = np.broadcast_to(NOISE**2 * np.eye(len(joints)), (len(stamps), len(joints), len(joints)))
    seen = np.ones(len(stamps), dtype=bool)
    return Poses(tuple(names), np.arange(len(stamps)), stamps, read, noise.copy(), seen)


if __name__ == "__main__":
    sys.exit(main())
