"""Print which bundled mechanism is chosen for each rendered clip, against the one that was rendered.

Run: ``MONODYN_DATA=<folder> python benchmarks/auto.py [--only CLIP ...] [--json FILE] [--gate]``. Every clip
whose file has the joints and geoms of a bundled mechanism is run without a model, and again with the one that
was chosen, for the time. ``--runs`` keeps the folders.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import monodyn
from figures import Figure, command_line, finish, say, table
from monodyn.choose import FIRST
from monodyn.mechanism import Mechanism, load
from monodyn.mechanism.dots import shows_dots

MOST_TIMES = 6.0
"""Time of a run without a model over that of the same with it, at most."""


def kind(mechanism: Mechanism) -> tuple[Any, ...]:
    """Return what makes a mechanism another one: kinds of its joints, what they hang on, its geoms.

    Args:
        mechanism: The mechanism.
    """
    tree, shapes = mechanism.tree, mechanism.shapes
    joints = tuple(joint.kind for joint in mechanism.joints)
    # a ball has one point, a rod two, a box eight
    geoms = zip(shapes.link.tolist(), np.diff(shapes.first).tolist(), strict=True)
    return joints, tuple(tree.parent.tolist()), tuple(geoms), shows_dots(mechanism)


def truths(folder: Path) -> dict[str, str]:
    """Return the bundled name of each clip's mechanism, of those that have one.

    Args:
        folder: The rendered clips with their files.
    """
    names = {kind(load(name)): name for group in FIRST for name in group}
    found = {path.stem: names.get(kind(load(path))) for path in sorted(folder.glob("*.xml"))}
    return {clip: name for clip, name in found.items() if name is not None}


def main() -> int:
    """Run the clips and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``, 2 when the data are missing.
    """
    folder = Path(os.environ.get("MONODYN_DATA") or "missing") / "rendered"
    if not folder.is_dir():
        print("MONODYN_DATA: expected the folder that holds rendered/; set the variable.", file=sys.stderr)
        return 2
    known = truths(folder)
    parser = command_line(__doc__, tuple(known))
    parser.add_argument("--runs", type=Path, metavar="FOLDER", help="keep the run folders there")
    options = parser.parse_args()
    figures: list[Figure] = []
    with tempfile.TemporaryDirectory() as temporary:
        runs = options.runs or Path(temporary)
        for clip in options.only or known:
            figures += compared(folder / f"{clip}.mp4", known[clip], runs)
    print(table([*figures, *counted(figures)]))
    return finish(figures, to=options.json, gate=options.gate)


def compared(clip: Path, truth: str, runs: Path) -> list[Figure]:
    """Return the figures of a clip that is run without a model, and with the one that was chosen.

    Args:
        clip: The clip.
        truth: Bundled name of what was rendered.
        runs: Where the run folders go.
    """
    alone, alone_time = timed(clip, "auto", runs / clip.stem)
    rows = alone.get("comparison") or [{"model": "none", "said": alone["status"]}]
    for row in rows:
        say(f"{clip.stem}: {row['model']}: {row['said']}")
    chosen = rows[0]["model"]
    named, named_time = timed(clip, rows[0]["model"], runs / f"{clip.stem}_named")
    say(f"{clip.stem}: {truth} taken for {chosen}, {alone['grade']}; named {named['grade']}")
    return [
        Figure(clip.stem, f"{truth} taken for {chosen}", float(chosen != truth), "", 0.0),
        Figure(clip.stem, f"{alone['grade']}, with the model named {named['grade']}", 0.0, ""),
        Figure(clip.stem, "time, over that with the model named", alone_time / named_time, "", MOST_TIMES),
    ]


def timed(clip: Path, model: str, out: Path) -> tuple[dict[str, Any], float]:
    """Return of a run the content of fit.json, or what takes its place, and the time [s].

    Args:
        clip: The clip.
        model: Name of the model.
        out: The run folder.
    """
    began = time.perf_counter()
    try:
        outcome = monodyn.run(clip, model, out, force=True)
    except monodyn.MonodynError as error:
        return {"grade": "stopped", "status": str(error)}, time.perf_counter() - began
    return outcome.document, time.perf_counter() - began


def counted(figures: Sequence[Figure]) -> list[Figure]:
    """Return how many choices were wrong, and the usual time.

    Args:
        figures: Those of the clips.
    """
    wrong = [figure.value for figure in figures if " taken for " in figure.name]
    times = sorted(figure.value for figure in figures if figure.name.startswith("time"))
    return [
        Figure("all", "clips", float(len(wrong)), ""),
        Figure("all", "wrong choices", sum(wrong), "", 0.0),
        Figure("all", "time, median", times[len(times) // 2] if times else float("nan"), ""),
    ]


if __name__ == "__main__":
    raise SystemExit(main())
