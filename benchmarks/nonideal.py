"""Run the program with default settings on clips that are not ideal: what is right, refused or wrong.

``python benchmarks/nonideal.py [--seed SEED] [--count N] [--first I] [--only NAME ...] [--only-case I]
[--json FILE] [--runs FOLDER] [--jobs N] [--gate]``. The draws are those of ``imperfections.py``: balls on
threads and rods, singles, doubles and cart-poles that swing out of their plane, whose pivot gives way, before
a camera that leans, a shutter that rolls, a lens, or with a thread that stretches. SEED is an integer or the
hash of a commit; draw I of a seed is the same alone. Every run is a process of its own. Each row is appended
to FILE as a line of JSON as soon as it is done, and rows that are there are not run again. None may be wrong,
and of the right runs at most 2 % may lose their grade by the picture check alone.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

import numpy as np

from figures import say
from imperfect_film import filmed
from imperfections import CAREFUL, KINDS, NAMED, Draw, drawn
from judge import OUTCOMES, judged, lost_to_check

COUNT = 300
"""Draws of a seed."""
TIMEOUT = 900.0
"""Longest time of a run before it counts as failed, far above what any takes on an idle core [s]."""
REFUSED_CODE = 2
"""Exit code of a run that the program refused."""
MOST_LOST = 0.02
"""Largest share of the right runs that may lose their grade by the picture check alone."""
CONFIDENCE = 1.96
"""Standard deviations of a Wilson interval of 95 %."""
RUN = """
import sys, monodyn
try:
    monodyn.run(sys.argv[1], sys.argv[2], sys.argv[3], force=True)
except monodyn.MonodynError as error:
    print(error)
    sys.exit(2)
"""
"""What a run does, as a user's program."""


def case(seed: str, name: str, draw: Draw, folder: Path) -> dict:
    """Make a clip, run it and judge the run.

    Args:
        seed: Of the draw.
        name: Of the draw: its number, or that of a named clip.
        draw: What is filmed.
        folder: Where clip and run folder go.

    Returns:
        The row, of plain values.
    """
    folder.mkdir(parents=True, exist_ok=True)
    began = time.perf_counter()
    film, stamps, area = filmed(draw, folder)
    made = time.perf_counter()
    model = "bob" if draw.model == "bob" else str(folder / "model.xml")
    words = [sys.executable, "-c", RUN, str(folder / "clip.mp4"), model, str(folder / "run")]
    with (folder / "run.log").open("w", encoding="utf-8") as log:
        try:
            code = subprocess.run(words, stdout=log, stderr=subprocess.STDOUT, timeout=TIMEOUT).returncode
        except subprocess.TimeoutExpired:
            code = -1
    said = (folder / "run.log").read_text(encoding="utf-8").strip().splitlines()
    row = {
        "seed": seed,
        "name": name,
        "kind": draw.kind,
        "model": draw.model,
        "place": draw.place,
        "imperfection": draw.imperfection,
        "factors": dict(draw.factors),
        "rate": draw.case.rate,
        "size": draw.case.size,
        "drawing_s": round(made - began, 1),
        "run_s": round(time.perf_counter() - made, 1),
        "code": code,
        "said": said[-1] if said else "",
    }
    return {**row, **judged(draw, film, stamps, area, folder / "run", failed=code not in (0, REFUSED_CODE))}


def wilson(hits: int, count: int) -> tuple[float, float]:
    """Return the interval of a share that holds with 95 %, after Wilson.

    Args:
        hits: Cases that are so.
        count: All cases.
    """
    if not count:
        return 0.0, 1.0
    share, z2 = hits / count, CONFIDENCE**2
    middle = (share + z2 / (2 * count)) / (1 + z2 / count)
    half = CONFIDENCE / (1 + z2 / count) * np.sqrt(share * (1 - share) / count + z2 / (4 * count**2))
    return float(max(0.0, middle - half)), float(min(1.0, middle + half))


def table(rows: Sequence[dict]) -> str:
    """Return how many rows have each outcome, by kind, by imperfection and in all, with intervals.

    Args:
        rows: From ``case``.
    """
    lines = [
        f"{'':18}{'n':>5}"
        + "".join(f"{outcome:>9}" for outcome in OUTCOMES)
        + "   right [%]        wrong [%]"
    ]
    groups: list[tuple[str, Callable[[dict], bool]]] = [
        *((kind, lambda row, kind=kind: row["kind"] == kind) for kind in KINDS),
        *((name, lambda row, name=name: name in row["factors"]) for name in CAREFUL),
        ("two together", lambda row: len(row["factors"]) > 1),
        ("all", lambda row: True),
    ]
    for name, belongs in groups:
        chosen = [row["outcome"] for row in rows if belongs(row)]
        if chosen:
            counts = [chosen.count(outcome) for outcome in OUTCOMES]
            shares = [
                f"{100 * chosen.count(o) / len(chosen):5.1f} ({100 * low:.1f} to {100 * high:.1f})"
                for o in ("right", "wrong")
                for low, high in [wilson(chosen.count(o), len(chosen))]
            ]
            lines.append(
                f"{name:18}{len(chosen):5}" + "".join(f"{n:9}" for n in counts) + "   " + "  ".join(shares)
            )
    lost = [row for row in rows if lost_to_check(row)]
    right = [row for row in rows if row["within"]]
    low, high = wilson(len(lost), len(right))
    interval = f"({100 * low:.1f} to {100 * high:.1f} %)"
    lines.append(
        f"\n{len(lost)} of {len(right)} right runs lose their grade by the picture check alone {interval}"
    )
    for row in rows:
        if row["outcome"] in ("wrong", "failed"):
            why = row.get("why") or row["said"]
            lines.append(f"{row['outcome']}: {row['name']} ({row['kind']}, {row['imperfection']}): {why}")
    return "\n".join(lines)


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when a run is wrong or failed, or too many lost their grade, under ``--gate``.
    """
    options = _parser().parse_args()
    chosen = _chosen(options)
    known = _known(options.json)
    waiting = {name: draw for name, draw in chosen.items() if (options.seed, name) not in known}
    with tempfile.TemporaryDirectory() as temporary:
        folder = (options.runs or Path(temporary)) / f"seed_{options.seed}"
        spawn = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(max_workers=options.jobs, mp_context=spawn) as pool:
            work = [
                pool.submit(case, options.seed, name, draw, folder / name) for name, draw in waiting.items()
            ]
            for done in as_completed(work):
                row = done.result()
                known[options.seed, row["name"]] = row
                why = row.get("why") or row["said"]
                say(f"{row['name']}: {row['kind']}, {row['imperfection']}: {row['outcome']}; {why}")
                if options.json:
                    with options.json.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(row) + "\n")
    rows = [known[options.seed, name] for name in chosen]
    print(table(rows))
    bad = any(row["outcome"] in ("wrong", "failed") for row in rows)
    lost = sum(map(lost_to_check, rows)) > MOST_LOST * sum(row["within"] for row in rows)
    return int(options.gate and (bad or lost))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seed", default="1", help="an integer or the hash of a commit")
    parser.add_argument("--first", type=int, default=0, metavar="I", help="number of the first draw")
    parser.add_argument("--count", type=int, default=COUNT, metavar="N", help="number of draws")
    parser.add_argument("--only-case", type=int, metavar="I", help="one draw alone")
    parser.add_argument("--only", nargs="+", choices=NAMED, metavar="NAME", help=f"of {', '.join(NAMED)}")
    parser.add_argument("--json", type=Path, metavar="FILE", help="append the rows there, one a line")
    parser.add_argument("--runs", type=Path, metavar="FOLDER", help="keep clips and run folders there")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="clips at a time")
    parser.add_argument("--gate", action="store_true", help="exit code 1 when a target is missed")
    return parser


def _chosen(options: argparse.Namespace) -> dict[str, Draw]:
    """Return the draws that were asked for, by name."""
    if options.only:
        return {name: NAMED[name] for name in options.only}
    numbers = range(options.first, options.first + options.count)
    if options.only_case is not None:
        numbers = range(options.only_case, options.only_case + 1)
    return {str(number): drawn(options.seed, number) for number in numbers}


def _known(path: Path | None) -> dict[tuple[str, str], dict]:
    """Return the rows that a file has, by seed and name."""
    if path is None or not path.exists():
        return {}
    rows = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return {(row["seed"], row["name"]): row for row in rows}


if __name__ == "__main__":
    sys.exit(main())
