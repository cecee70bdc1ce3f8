"""Run the program with default settings on made clips of everything that happens while people film.

``python benchmarks/filmed.py [--only NAME ...] [--random N [--first SEED]] [--runs FOLDER] [--gate]``. A clip
of ``cases.py``'s kind is drawn, and something is done to it: a hand holds and lets go, a post stands before
it, the pivot is above the picture; or mechanism, picture, file and what happens are drawn at random. A run
is right, refused, or wrong and called ok, which none may be. The truth only judges.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import av
import numpy as np

import monodyn
from accuracy import differences, rms
from cases import BLUE, DARK, RED, chain
from clips import exposures, simulate, wrong
from effects import EFFECTS, Effect, Moment, held
from figures import Figure, command_line, finish, say, table
from paint import Painter
from spec import Case, Colour, Part, mjcf

ANGLE_DEG, LENGTH = 0.5, 1.5
"""Errors up to which a run is right: of the seen angles, rms [deg], and of the lengths [%]."""
SIGMAS = 4.0
"""A length off by more than ``LENGTH`` is no wrong answer within so many of its standard deviations."""


@dataclass(frozen=True)
class Take:
    """One clip.

    Attributes:
        case: The mechanism and its picture.
        effects: What is done to it.
        held: How long it is held before it is let go [s].
        repeated: Every picture of this number is replaced by the one before; 0 for none.
    """

    case: Case
    effects: tuple[Effect, ...] = ()
    held: float = 0.0
    repeated: int = 0


def _thread(length: float, ball: float, colour: Colour) -> tuple[Part, ...]:
    return (Part(length, 0.0006, shape="capsule", ball=ball, colour=colour, damping=4e-4),)


_WALL = (128, 128, 126)
_DOUBLE = Case("double", chain((0.22, 0.18), (0.03, 0.026), (RED, BLUE)), (-0.5, 0.4))
_DARK = Case("dark", chain((0.2, 0.22), 0.028, (DARK,)), (-0.2, 0.5), wall="mottled")
_TRIPLE = Case(
    "triple", chain((0.14, 0.14, 0.11), (0.026, 0.024, 0.022), (RED, BLUE, DARK)), (-0.7, 0.3, 0.6)
)
_SINGLE = Case("single", chain((0.27,), 0.03, (BLUE,)), (-0.5,), wall="room")
_BOB = Case(
    "bob", (Part(0.25, 0.012, shape="capsule", ball=0.03, colour=RED, damping=1e-3),), (-0.7,), wall="room"
)
_CART = Case(
    "cart",
    (
        Part(0.12, 0.06, 0.02, BLUE, kind="slide", mass=0.4, damping=0.06),
        Part(0.25, 0.022, 0.008, RED, parent=0, layer=0.02),
    ),
    (-0.08, -2.4),
    fill=0.8,
)
_BALL = Case("ball", _thread(0.3, 0.025, RED), (-1.0,), pivot=(0.5, -0.2), fill=2.1, wall="room")
_GREY = chain((0.22, 0.18), 0.009, ((112, 112, 112), (104, 104, 103)))
_FAINT = Case("faint", _GREY, (-0.5, 0.4), base=_WALL, wall="plain", noise=2.5)
MECHANISMS = {c.name: c for c in (_SINGLE, _DOUBLE, _TRIPLE, _BOB, _CART)}
"""One mechanism of each kind, by name."""
WIDE = {"size": (840, 600), "fovy": 48.9, "fill": 0.6}
"""The picture of a camera that is held by hand, which loses its margins."""
_HELD = [replace(c, **WIDE) for c in (_DOUBLE, _DARK, _SINGLE, _BOB, replace(_CART, name="cart"), _TRIPLE)]
_BARE = replace(_DOUBLE, name="bare", wall="plain", **WIDE)
TAKES = {
    **{f"hand_{c.name}": Take(c, (EFFECTS["hand"],), held=1.2) for c in (_DOUBLE, _DARK, _TRIPLE, _SINGLE)},
    **{f"post_{c.name}": Take(c, (EFFECTS["post"],)) for c in (_DOUBLE, _TRIPLE, _BOB, _CART)},
    **{f"passer_by_{c.name}": Take(c, (EFFECTS["passer_by"],)) for c in (_DOUBLE, _BOB)},
    **{f"clock_{c.name}": Take(c, (EFFECTS["clock"],)) for c in (_DARK, _SINGLE)},
    **{f"fade_{c.name}": Take(c, (EFFECTS["fade"],)) for c in (_DOUBLE, _CART)},
    **{f"lamp_{c.name}": Take(c, (EFFECTS["lamp"],)) for c in (_DOUBLE, _BOB)},
    **{f"shadow_{c.name}": Take(c, (EFFECTS["shadow"],)) for c in (_DOUBLE, _DARK, _BOB, _CART)},
    **{f"pane_{c.name}": Take(c, (EFFECTS["pane"],)) for c in (_DARK, _SINGLE, _TRIPLE)},
    **{f"repeats_{c.name}": Take(c, repeated=n) for c, n in ((_DARK, 5), (_SINGLE, 2), (_CART, 6))},
    **{f"shake_{n}_{c.name}": Take(c, (held(float(n)),)) for c in _HELD for n in (1, 3, 6)},
    **{f"drift_{c.name}": Take(c, (held(1.0, 25.0, 0.5),)) for c in _HELD},
    **{f"turn_{c.name}": Take(c, (held(0.5, 5.0, 3.0),)) for c in _HELD},
    **{f"zoom_{c.name}": Take(c, (held(0.5, 5.0, 0.5, 0.15),)) for c in _HELD},
    "drift_bare": Take(_BARE, (held(1.0, 25.0, 0.5),)),
    "shake_bare": Take(_BARE, (held(3.0),)),
    "above_ball": Take(_BALL),
    "above_ball_dark": Take(replace(_BALL, parts=_thread(0.35, 0.02, DARK), wall="plain")),
    "above_bob": Take(replace(_BOB, pivot=(0.45, -0.15), fill=2.0)),
    "above_double": Take(replace(_DOUBLE, pivot=(0.5, -0.08), fill=1.5)),
    "faint_double": Take(_FAINT),
    "faint_noisy": Take(replace(_FAINT, noise=5.0)),
    "faint_single": Take(replace(_FAINT, parts=_GREY[:1], start=(-0.5,))),
    "several": Take(
        _DOUBLE,
        (EFFECTS["shadow"], EFFECTS["passer_by"], EFFECTS["hand"], EFFECTS["clock"], EFFECTS["fade"]),
        held=1.5,
    ),
}
"""The clips by name."""


SHADES: tuple[Colour, ...] = (
    RED, BLUE, DARK, (240, 238, 230), (176, 126, 78), (52, 120, 70), (226, 190, 60), (128, 130, 134)
)  # fmt: skip
"""Colours of random mechanisms, RGB."""
WALLS: tuple[Colour, ...] = ((190, 184, 170), (228, 226, 220), (128, 128, 126), (96, 104, 116))
"""Colours of the walls behind them."""
START_FACTOR = 4.0
"""How far the sizes of a random clip's file are off, at most, either way."""


def at_random(seed: int) -> tuple[Take, tuple[Part, ...]]:
    """Draw a clip and a mechanism file to start from.

    Args:
        seed: Which one.

    Returns:
        The clip, and the parts with sizes that are off, each by a factor of its own.
    """
    rng = np.random.default_rng(seed)
    shades = [SHADES[i] for i in rng.choice(len(SHADES), 3, replace=False)]
    lengths = 0.2 * rng.uniform(0.6, 1.5, 3)
    widths = lengths.mean() * rng.uniform(0.06, 0.14, 3)
    hinged = chain(tuple(lengths), tuple(widths), tuple(shades))
    angles = rng.uniform(-1.8, 1.8, 3)
    kind = str(rng.choice(["single", "double", "double", "triple", "bob", "ball", "cart"]))
    parts = hinged[: {"single": 1, "double": 2, "triple": 3}.get(kind, 1)]
    start = tuple(angles[: len(parts)] + np.where(np.arange(len(parts)) == 0, -np.pi / 2, 0.0))
    pivot, fill = (float(rng.uniform(0.35, 0.65)), float(rng.uniform(0.35, 0.55))), rng.uniform(0.55, 0.85)
    if kind == "bob":
        parts = (replace(parts[0], width=0.4 * widths[0], shape="capsule", ball=widths[0]),)
    elif kind == "ball":
        parts = _thread(float(lengths[0]), float(widths[0]), shades[0])
        pivot, fill, start = (0.5, -0.1), 1.8, (-np.pi / 2 + 0.5 * angles[0],)
    elif kind == "cart":
        cart = Part(0.12, 0.06, 0.02, shades[1], kind="slide", mass=0.4, damping=0.06)
        parts, start = (
            (cart, replace(parts[0], parent=0, layer=0.02)),
            (float(rng.uniform(-0.1, 0.1)), *start),
        )
    case = Case(
        f"random_{seed}_{kind}", parts, start,
        size=((640, 360), (720, 480), (480, 640), (854, 480), (1280, 720))[rng.integers(5)],
        rate=int(rng.choice([24, 25, 30, 50, 60])), seconds=5.0, fovy=float(rng.uniform(28, 60)),
        fill=float(fill), pivot=pivot, base=WALLS[rng.integers(len(WALLS))],
        wall=("plain", "mottled", "checker", "stripes", "room")[rng.integers(5)],
        noise=float(rng.uniform(1.0, 4.0)), crf=int(rng.integers(18, 30)), seed=seed,
    )  # fmt: skip
    effects = tuple(
        list(EFFECTS.values())[i] for i in rng.choice(len(EFFECTS), rng.integers(3), replace=False)
    )
    factors = START_FACTOR ** rng.uniform(-1.0, 1.0, (len(parts), 2))
    off = tuple(
        replace(part, length=part.length * a, width=part.width * b, ball=part.ball * b)
        for part, (a, b) in zip(parts, factors, strict=True)
    )
    return Take(case, effects, held=1.2 if EFFECTS["hand"] in effects else 0.0), off


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when a run was called ok over a wrong answer, under ``--gate``.
    """
    parser = command_line(__doc__, tuple(TAKES))
    parser.add_argument("--runs", type=Path, metavar="FOLDER", help="keep clips and run folders there")
    parser.add_argument("--random", type=int, metavar="N", help="N random clips in place of the named ones")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="the first of them")
    options = parser.parse_args()
    if options.random:
        drawn = [at_random(seed) for seed in range(options.first, options.first + options.random)]
    else:
        named = [
            replace(take, case=replace(take.case, name=name, seed=number))
            for number, (name, take) in enumerate(TAKES.items(), start=1)
            if not options.only or name in options.only
        ]
        drawn = [(take, tuple(wrong(part) for part in take.case.parts)) for take in named]
    figures: list[Figure] = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.runs or Path(temporary)
        for take, start in drawn:
            figures += judged(take, start, folder / take.case.name)
    print(table(figures))
    right = sum(f.value for f in figures if f.name == "right")
    print(f"{right:.0f} of {len(drawn)} are right, each other one is refused or missed above")
    return finish(figures, to=options.json, gate=options.gate)


def judged(take: Take, start: tuple[Part, ...], folder: Path) -> list[Figure]:
    """Make a clip, run it with default settings and compare with the truth.

    Args:
        take: What the clip shows.
        start: The mechanism of the file that is given.
        folder: Where clip and run folder go.

    Returns:
        Whether it is right, whether it is wrong and called ok, and the errors.
    """
    name = take.case.name
    folder.mkdir(parents=True, exist_ok=True)
    clip, truth = folder / "clip.mp4", filmed(take, folder / "clip.mp4")
    (folder / "model.xml").write_text(mjcf(start))
    began = time.perf_counter()
    try:
        outcome = monodyn.run(clip, folder / "model.xml", folder / "run", force=True)
    except monodyn.MonodynError as error:
        say(f"{name}: {time.perf_counter() - began:.1f} s, refused: {error}")
        return [Figure(name, "right", 0.0, ""), Figure(name, "wrong and called ok", 0.0, "", 0.0)]
    ok = bool(outcome.document["ok"])
    angle, share = angle_error(take, outcome.poses, truth)
    length, sigmas = length_error(take, outcome.document)
    right = ok and angle <= ANGLE_DEG and length <= LENGTH
    off = angle > ANGLE_DEG or (length > LENGTH and sigmas > SIGMAS)
    say(f"{name}: {time.perf_counter() - began:.1f} s, {outcome.document['status']}")
    return [
        Figure(name, "right", float(right), ""),
        Figure(name, "wrong and called ok", float(ok and off), "", 0.0),
        Figure(name, "free frames seen", share, "%"),
        Figure(name, "worst seen angle, rms", angle, "deg"),
        Figure(name, "worst length", length, "%"),
    ]


def filmed(take: Take, path: Path) -> np.ndarray:
    """Write the clip of a take.

    Args:
        take: What it shows.
        path: The file.

    Returns:
        The true joint positions of every frame, (frame, dof).
    """
    case = take.case
    states = simulate(case)
    still = np.broadcast_to(states[0, 0], (round(take.held * case.rate), *states.shape[1:]))
    states = np.concatenate([still, states])
    painter, rng = Painter(case), np.random.default_rng(case.seed)
    quiet = Painter(replace(case, noise=0.0))
    with av.open(str(path), "w") as file:
        stream = file.add_stream(
            "libx264", rate=case.rate, options={"preset": "medium", "crf": str(case.crf)}
        )
        stream.pix_fmt = "yuv420p"
        for i, positions in enumerate(exposures(case, states)):
            if not (take.repeated and i % take.repeated == take.repeated - 1):
                picture = quiet.picture(positions).astype(np.float32)
                if take.effects:
                    covered = quiet.covered(positions)
                    moment = Moment(i, i / case.rate, take.held, quiet.ends(positions[0]), covered)
                    for effect in take.effects:
                        picture = effect(picture, moment)
                picture = painter.grainy(picture, rng)
            if i == 0:
                stream.height, stream.width = picture.shape[:2]
            file.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        file.mux(stream.encode())
    return states[:, 0]


def angle_error(take: Take, poses: monodyn.Poses, truth: np.ndarray) -> tuple[float, float]:
    """Return the largest rms error of a hinge over the seen free frames [deg], and the share of these [%].

    Args:
        take: What the clip shows.
        poses: What was tracked.
        truth: True joint positions, (frame, dof).
    """
    free = poses.frame >= round(take.held * take.case.rate)
    fresh = np.ones(len(poses), dtype=bool)
    if take.repeated:
        fresh = poses.frame % take.repeated != take.repeated - 1
    seen = poses.seen & free & fresh
    errors = [
        rms(np.degrees(differences(poses.position[seen, dof], truth[poses.frame[seen], dof], turns=True)))
        for dof, part in enumerate(take.case.parts)
        if part.kind == "hinge"
    ]
    return max(errors), 100.0 * float(np.mean(poses.seen[free & fresh]))


def length_error(take: Take, document: dict) -> tuple[float, float]:
    """Return the largest error of a length [%] and how many of its standard deviations that is.

    Args:
        take: What the clip shows.
        document: The content of ``fit.json``.
    """
    rows = {row["name"]: row for row in document["parameters"]}
    hinged = [part for part in take.case.parts if part.kind == "hinge"]
    errors = []
    for i, part in enumerate(hinged, start=1):
        found = rows[f"link{i}.length"]
        off = abs(found["value"] - part.length)
        errors.append((100.0 * off / part.length, off / max(found.get("std") or 0.0, 1e-12)))
    return max(errors)


if __name__ == "__main__":
    sys.exit(main())
