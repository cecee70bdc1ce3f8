"""Print how long links come out when the file gives their bodies another shape than the clip shows.

Run: ``python benchmarks/shapes.py [--only NAME ...] [--json FILE] [--gate]``.
Clips of 3 s are made of a single and a double pendulum and of a cart-pole whose links are boxes, capsules or
cylinders, and each is run with the file of another shape and with its own. The length of a last link includes
a round end. A run that is trusted and further off than four of its standard deviations is wrong.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path

import monodyn
from clips import cached, wrong
from figures import Figure, command_line, finish, say, table
from spec import Case, Part, mjcf

LONGEST = 4.0
"""Standard deviations within which a length of a trusted run has to lie."""
SECONDS = 3.0
"""Length of a clip [s]."""
BLUE, RED, GREY = (45, 44, 60), (170, 40, 40), (70, 74, 72)
CART = Part(0.1, 0.06, 0.02, GREY, kind="slide", mass=0.3, damping=0.02)
MECHANISMS = {
    "single": ((Part(0.25, 0.024, colour=BLUE),), (-0.3,)),
    "double": ((Part(0.26, 0.024, colour=BLUE), Part(0.19, 0.0204, colour=RED, parent=0)), (-0.3, 0.8)),
    "thin": ((Part(0.26, 0.012, colour=BLUE), Part(0.19, 0.0102, colour=RED, parent=0)), (-0.3, 0.8)),
    "cartpole": ((CART, Part(0.24, 0.022, colour=RED, parent=0)), (0.05, 1.2)),
}
"""Bodies and start positions; a cart stays a box."""
SHAPES = ("box", "capsule")
CASES = {
    f"{name}_{shown}_{file}": (name, shown, file) for name, shown, file in product(MECHANISMS, SHAPES, SHAPES)
} | {f"single_{shown}_cylinder": ("single", shown, "cylinder") for shown in SHAPES}
"""Mechanism, shape in the clip and shape in the file, by name."""


def shaped(parts: tuple[Part, ...], shape: str) -> tuple[Part, ...]:
    """Return parts whose links have another shape.

    Args:
        parts: The mechanism.
        shape: Kind of geom.
    """
    return tuple(replace(part, shape=shape) if part.kind == "hinge" else part for part in parts)


def measured(case: str, name: str, shown: str, file: str, folder: Path) -> Iterator[Figure]:
    """Yield the errors of the lengths of a run whose file has another shape than its clip.

    Args:
        case: Name of the case.
        name: Of ``MECHANISMS``.
        shown: Shape of the links in the clip.
        file: Shape of the links in the file.
        folder: Where the file is written.
    """
    parts, start = MECHANISMS[name]
    clip = cached(Case(f"shapes_{name}_{shown}", shaped(parts, shown), start, seconds=SECONDS))
    model = folder / f"{case}.xml"
    model.write_text(mjcf(shaped(tuple(wrong(part) for part in parts), file)), encoding="utf-8")
    scene = monodyn.locate(monodyn.segment(monodyn.read(clip.video)), monodyn.load(model))
    fit = monodyn.identify(monodyn.track(scene.masks, scene), scene.mechanism)
    say(f"{case}: {fit.grade}, ends {dict(fit.mechanism.ends)}")
    links = [part for part in clip.case.parts if part.kind == "hinge"]
    limit = LONGEST if fit.grade == "trusted" else None
    for i, part in enumerate(links, 1):
        cap = 0.5 * part.width if shown == "capsule" and part is links[-1] else 0.0
        found, truth = fit.parameter(f"link{i}.length"), part.length + cap
        deviations = abs(found.value - truth) / found.std if found.std else math.inf
        yield Figure(case, f"link{i}.length", 100.0 * abs(found.value / truth - 1.0), "%")
        yield Figure(case, f"link{i}.length, interval", 100.0 * found.std / truth, "%")
        yield Figure(case, f"link{i}.length over its interval", deviations, "std", limit)
    yield Figure(case, "trusted", float(fit.grade == "trusted"), "")


def main() -> int:
    """Run the cases and print the table.

    Returns:
        The exit code.
    """
    options = command_line(__doc__, list(CASES)).parse_args()
    figures: list[Figure] = []
    with tempfile.TemporaryDirectory() as folder:
        for case in options.only or CASES:
            figures += measured(case, *CASES[case], Path(folder))
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


if __name__ == "__main__":
    raise SystemExit(main())
