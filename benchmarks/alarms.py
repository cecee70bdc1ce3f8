"""Print how often what a model lacks is named: tables moved by MuJoCo with something more, and without.

Run: ``python benchmarks/alarms.py [--only NAME ...] [--records N] [--json FILE] [--gate]``.
Every wrong record is to be refused or called approximate with its cause in status or advice, and no other
cause (a drag is found and named, and the fit then right); of the right ones at most one in twenty may have
any.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import monodyn
from damaged import DAMAGES, Record, drawn
from figures import Figure, command_line, finish, say, table
from monodyn.pipeline import identify_tables

DRAG = "quadratic drag"
"""The one damage that the default finds by itself, and then rightly trusts."""
CAUSES = {
    "triple as double": ("With a link more at the end of link2",),
    "a base that swings": ("On a base that swings",),
    "quadratic drag": ("With quadratic drag at its joints", f"The evidence is for friction with {DRAG}"),
    "gravity tilted by 10 deg": ("deg from straight down where the angles are measured the motion comes",),
    "a clock slow by 20 %": ("contradict the time stamps",),
}
"""What names each damage: a drag may be named as what the model lacks, or found as what acts."""
RIGHT = "right"
"""Records of the model's own mechanism."""
FIRST = 100
"""Seed of the first record, apart from those of the other benchmarks."""
NAMED, UNNAMED = 100.0, 95.0
"""Share of wrong records whose cause is to be named, and of right ones that are to have none [%]."""


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``.
    """
    parser = command_line(__doc__, (*CAUSES, RIGHT))
    parser.add_argument("--records", type=int, default=10, metavar="N", help="records of each")
    options = parser.parse_args()
    figures: list[Figure] = []
    for name in options.only or (*CAUSES, RIGHT):
        # a right record takes a moment, and a share of one in twenty needs twenty
        count = options.records * (4 if name == RIGHT else 1)
        figures += counted(name, count, (lambda rng: drawn(rng)) if name == RIGHT else DAMAGES[name])
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def counted(name: str, count: int, damage: Callable[[np.random.Generator], Record]) -> list[Figure]:
    """Identify records of one kind, and count what is said about them.

    Args:
        name: What was done to them.
        count: How many.
        damage: Draws one.

    Returns:
        Shares of the records, and the longest time.
    """
    right, other, trusted, longest = 0, 0, 0, 0.0
    for seed in range(FIRST, FIRST + count):
        began = time.perf_counter()
        grade, said = identified(damage(np.random.default_rng(seed)))
        longest = max(longest, time.perf_counter() - began)
        found = [cause for cause, words in CAUSES.items() if any(word in said for word in words)]
        right += found == ([] if name == RIGHT else [name])
        other += any(cause != name for cause in found)
        trusted += grade == "trusted"
        say(f"{name} {seed}: {grade}, {time.perf_counter() - began:.0f} s: {', '.join(found) or 'no cause'}")
    share = 100.0 / count
    if name == RIGHT:
        figures = [Figure(name, "without a cause", share * right, "%", UNNAMED, least=True)]
    else:
        figures = [
            Figure(name, "its cause alone named", share * right, "%", NAMED, least=True),
            Figure(name, "another one named", share * other, "%", 0.0),
        ]
    wanted = {"least": True, "target": UNNAMED} if name in (RIGHT, DRAG) else {"target": 0.0}
    return [
        *figures,
        Figure(name, "trusted", share * trusted, "%", **wanted),
        Figure(name, "longest", longest, "s"),
    ]


def identified(record: Record) -> tuple[str, str]:
    """Identify a record.

    Args:
        record: The record.

    Returns:
        Grade, and status and advice in one.
    """
    settings = monodyn.RunSettings(fix=dict(record.fix), free=list(record.free))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "record.csv"
        path.write_text(record.text(), encoding="utf-8")
        try:
            document = identify_tables([path], record.model, settings=settings).document
        except monodyn.MonodynError as error:
            return "stopped", str(error)
    return document["grade"], " ".join([document["status"], *document["advice"]])


if __name__ == "__main__":
    raise SystemExit(main())
