"""Draw clips that are filmed as people film them: what a careful person leaves imperfect, one to three times.

A draw is a mechanism with its picture, one imperfection (sometimes two), and the file that a user would
give. Everything follows from a seed and the number of the draw. The ranges were fixed before the program was
run on any of the draws, and are not tuned.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from cases import BLUE, DARK, RED, chain
from filmed import SHADES, WALLS
from spec import Case, Colour, Part

KINDS = {"ball": 0.30, "bob": 0.15, "single": 0.20, "double": 0.20, "cart": 0.15}
"""Shares of the kinds: a ball on a thread, a ball on a rod, one link, two links, a pole on a cart."""
FACTORS = (1.0, 3.0)
"""How many times what a careful person leaves is drawn, evenly between these."""
BOTH = 0.25
"""Share of the draws with two imperfections, each by a factor of its own."""


class Careful(NamedTuple):
    """What a careful person leaves of an imperfection.

    Attributes:
        value: Its size.
        unit: Unit of the size.
        kinds: The kinds of mechanism that have it.
        reason: Why this value.
    """

    value: float
    unit: str
    kinds: tuple[str, ...]
    reason: str


_RODS = ("single", "double", "cart")
CAREFUL = {
    "ellipse": Careful(
        0.05,
        "of the swing",
        ("ball", "bob"),
        "a ball let go by hand gets a sideways push: an ellipse of 1:20, at worst of 1:7, across the swing",
    ),
    "wobble": Careful(
        1.0, "deg", _RODS, "play of a bearing as long as wide, a tenth of a millimetre in 6 mm"
    ),
    "pivot": Careful(
        3.5e-3,
        "m",
        ("ball", "bob", *_RODS),
        "a hook, a shelf or a tripod gives way by millimetres, at worst 1 cm",
    ),
    "roll": Careful(1.0, "deg", ("ball", "bob", *_RODS), "a tripod without a level, put upright by the eye"),
    "lean": Careful(
        2.0, "deg", ("ball", "bob", *_RODS), "pitch and yaw: a camera pointed by the eye; at worst 6"
    ),
    "shutter": Careful(
        8e-3, "s", ("ball", "bob", *_RODS), "readout of a good phone; 24 ms are those of a plain one"
    ),
    "lens": Careful(
        0.01,
        "of the distance",
        ("ball", "bob", *_RODS),
        "what a lens bends in the picture's corner; makers correct to a per cent",
    ),
    "stretch": Careful(
        0.005, "of the length", ("ball",), "a cotton thread under the weight of its ball; nylon has 1.5 %"
    ),
}
"""The imperfections by name, each with what a careful person leaves: the only table of their ranges."""

BUNDLED = 0.5
"""Share of the balls and bobs that are run with the bundled ``bob``; else with a file of their own."""
ABOVE = {"inside": 0.35, "above": 0.3, "far": 0.35}
"""Shares of the places of a ball's or bob's pivot: in the picture, above it, far above it."""
FARTHEST = 3.0
"""Largest radius of a ball's path [picture heights]."""
RATES = {24: 0.12, 25: 0.12, 30: 0.32, 50: 0.08, 60: 0.24, 120: 0.08, 240: 0.04}
"""Shares of the frame rates [Hz]."""
SIZES = ((640, 360), (640, 360), (640, 480), (720, 480), (480, 640))
"""Picture sizes [px], equally likely."""
LEAST_CONTRAST = 70.0
"""Least distance of a mechanism's colour from the wall's, in RGB: a careful person films no grey on grey."""
LEAD = (0.1, 1.5)
"""How long after the release a clip begins [s]."""
GRAVITY = 9.81
"""Of the true motion [m/s^2]."""


@dataclass(frozen=True)
class Draw:
    """One clip that is not ideal.

    Attributes:
        case: The mechanism and its picture; its ``turned`` and ``bends`` are those of the camera.
        kind: Of ``KINDS``.
        model: Name of a bundled mechanism, or ``file`` or ``ball`` (a file with a ball alone).
        place: Where the pivot is, of ``ABOVE``.
        factors: How many times what a careful person leaves, by imperfection.
        ellipse: Width over length of the ellipse.
        wobble: Amplitude of the root's turn out of the plane [rad].
        wobble_ratio: Frequency of the wobble over that of the mechanism's own swing.
        pivot: By how much the pivot gives way, amplitude [m].
        readout: From the exposure of the first row to that of the last [s]; negative from below.
        stretch: Elongation of the thread by the weight at rest, as a share of its length.
        exposure: How long a row is exposed [s].
        lead: How long after the release the clip begins [s].
    """

    case: Case
    kind: str
    model: str
    place: str = "inside"
    factors: tuple[tuple[str, float], ...] = ()
    ellipse: float = 0.0
    wobble: float = 0.0
    wobble_ratio: float = 2.5
    pivot: float = 0.0
    readout: float = 0.0
    stretch: float = 0.0
    exposure: float = 0.0
    lead: float = 0.5

    @property
    def imperfection(self) -> str:
        """Names of the imperfections."""
        return "+".join(name for name, _ in self.factors) or "none"


def generator(seed: str, number: int) -> np.random.Generator:
    """Return the random numbers of one draw.

    Args:
        seed: An integer or the hash of a commit, as text.
        number: Of the draw.
    """
    digest = hashlib.sha256(f"{seed} {number}".encode()).digest()
    return np.random.default_rng(int.from_bytes(digest[:8], "big"))


def drawn(seed: str, number: int) -> Draw:
    """Return the draw of a seed and a number.

    Args:
        seed: An integer or the hash of a commit, as text.
        number: Of the draw.
    """
    rng = generator(seed, number)
    kind = _one_of(rng, KINDS)
    names = [name for name, careful in CAREFUL.items() if kind in careful.kinds]
    names = [str(name) for name in rng.permutation(names)[: 2 if rng.random() < BOTH else 1]]
    factors = tuple((name, float(rng.uniform(*FACTORS))) for name in sorted(names))
    sizes = {name: factor * CAREFUL[name].value for name, factor in factors}
    readout = sizes.get("shutter", 0.0) * (1.0 if rng.random() < 0.75 else -1.0)
    case = _pictured(rng, f"{number}_{kind}", abs(readout))
    draw = (_hung if kind in ("ball", "bob") else _linked)(rng, kind, case)
    return replace(
        draw,
        case=_seen(rng, draw.case, sizes),
        factors=factors,
        ellipse=sizes.get("ellipse", 0.0) * float(rng.choice([-1.0, 1.0])),
        wobble=np.radians(sizes.get("wobble", 0.0)),
        wobble_ratio=float(rng.uniform(1.5, 4.0)),
        pivot=sizes.get("pivot", 0.0),
        readout=readout,
        stretch=sizes.get("stretch", 0.0),
        # in good light, by which a careful person avoids blur
        exposure=float(np.exp(rng.uniform(np.log(5e-4), np.log(4e-3)))),
        lead=float(rng.uniform(*LEAD)),
    )


def _one_of(rng: np.random.Generator, shares: dict[Any, float]) -> Any:
    return list(shares)[int(rng.choice(len(shares), p=list(shares.values())))]


def _pictured(rng: np.random.Generator, name: str, readout: float) -> Case:
    """Return a case with its picture alone; the rows of a picture are read before the next one begins."""
    rates = {rate: share for rate, share in RATES.items() if readout < 0.95 / rate}
    rate = _one_of(rng, {r: share / sum(rates.values()) for r, share in rates.items()})
    return Case(
        name,
        (),
        (),
        size=SIZES[rng.integers(len(SIZES))],
        rate=rate,
        seconds=5.0 if rate > 60 else float(rng.uniform(5.0, 8.0)),
        fovy=float(rng.uniform(25.0, 58.0)),
        base=WALLS[rng.integers(len(WALLS))],
        wall=("plain", "mottled", "checker", "stripes", "room")[rng.integers(5)],
        noise=float(rng.uniform(1.0, 4.0)),
        crf=int(rng.integers(18, 28)),
        seed=int(rng.integers(2**31)),
    )


def _seen(rng: np.random.Generator, case: Case, sizes: dict[str, float]) -> Case:
    """Return a case before the camera's turns and through the lens of a draw."""
    roll = sizes.get("roll", 0.0) * float(rng.choice([-1.0, 1.0]))
    # the lean points anywhere
    towards, lean = rng.uniform(0.0, 2.0 * np.pi), sizes.get("lean", 0.0)
    turned = (roll, float(lean * np.sin(towards)), float(lean * np.cos(towards)))
    width, height = case.size
    corner = np.hypot(width, height) / height * np.tan(np.radians(case.fovy) / 2)
    barrel = -1.0 if rng.random() < 0.75 else 1.0
    bends = (barrel * sizes["lens"] / corner**2, 0.0, 0.0, 0.0) if "lens" in sizes else ()
    return replace(case, turned=turned, bends=bends)


def _hung(rng: np.random.Generator, kind: str, case: Case) -> Draw:
    """Return a ball on a thread or on a rod whose swing lies in the picture."""
    width, height = case.size
    place = _one_of(rng, ABOVE)
    radius_px, lowest = {
        "inside": (rng.uniform(0.45, 0.7) * height, rng.uniform(0.75, 0.88)),
        "above": (rng.uniform(0.8, 1.4) * height, rng.uniform(0.6, 0.75)),
        "far": (rng.uniform(1.4, FARTHEST) * height, rng.uniform(0.5, 0.75)),
    }[place]
    ball_px = rng.uniform(0.07, 0.16) * min(width, height)
    # a long thread whose pivot is in the picture would need a huge ball
    length = float(np.exp(rng.uniform(np.log(0.3), np.log(1.0 if place == "inside" else 2.0))))
    length = length * 0.5 if kind == "bob" else length
    ball = float(ball_px / 2 * length / radius_px)
    pivot = (float(rng.uniform(0.42, 0.58)), float(lowest - radius_px / height))
    room = 0.9 * min(pivot[0], 1.0 - pivot[0]) * width - ball_px / 2
    most = np.arcsin(min(room / radius_px, np.sin(np.radians(60.0))))
    aside = float(rng.uniform(0.5, 1.0) * most * rng.choice([-1.0, 1.0]))
    colour, thin = _colour(rng, case), 0.0006 if kind == "ball" else float(rng.uniform(0.2, 0.4)) * 2 * ball
    density = float(rng.uniform(900.0, 4000.0))
    part = Part(length, thin, shape="capsule", ball=ball, colour=colour, density=density)
    mass = density * 4.0 / 3.0 * np.pi * ball**3
    part = replace(part, damping=_friction(rng, mass * length**2))
    case = replace(case, parts=(part,), start=(aside - np.pi / 2,), pivot=pivot)
    fill = 2.0 * radius_px * (length + ball) / length / min(width, height)
    own = "ball" if kind == "ball" else "file"
    return Draw(replace(case, fill=float(fill)), kind, "bob" if rng.random() < BUNDLED else own, place)


def _linked(rng: np.random.Generator, kind: str, case: Case) -> Draw:
    """Return one link, two links or a pole on a cart, all of it in the picture."""
    lengths = 0.22 * rng.uniform(0.6, 1.5, 2)
    widths = lengths.mean() * rng.uniform(0.08, 0.14, 2)
    tails = widths * rng.uniform(0.3, 0.9, 2) * (rng.random(2) < 0.5)
    shades = _colour(rng, case), _colour(rng, case)
    angles = rng.uniform(0.35, 1.3, 2) * rng.choice([-1.0, 1.0], 2)
    parts = tuple(
        replace(
            part,
            tail=float(tail),
            thickness=float(rng.uniform(0.004, 0.009)),
            damping=_friction(rng, part.density * part.length**3 * part.width * part.thickness / 3),
        )
        for part, tail in zip(
            chain(tuple(map(float, lengths)), tuple(map(float, widths)), shades), tails, strict=True
        )
    )
    start: tuple[float, ...] = (float(angles[0]) - np.pi / 2, float(angles[1]))
    pivot, fill = (float(rng.uniform(0.4, 0.6)), float(rng.uniform(0.38, 0.5))), rng.uniform(0.6, 0.85)
    if kind == "single":
        parts, start = parts[:1], start[:1]
    elif kind == "cart":
        mass = float(rng.uniform(0.2, 0.6))
        cart = Part(0.12, 0.06, 0.02, shades[1], kind="slide", mass=mass, damping=0.1 * mass)
        parts = (cart, replace(parts[0], parent=0, layer=0.02, tail=0.0))
        start = (float(rng.uniform(-0.06, 0.06)), start[0])
    return Draw(replace(case, parts=parts, start=start, pivot=pivot, fill=float(fill)), kind, "file")


def _friction(rng: np.random.Generator, inertia: float) -> float:
    """Return a damping by which a swing decays to 1/e within 20 to 100 s or so [N m s/rad]."""
    return float(2.0 * inertia / np.exp(rng.uniform(np.log(20.0), np.log(100.0))))


def _colour(rng: np.random.Generator, case: Case) -> Colour:
    """Return a colour that stands out from the wall."""
    away = [c for c in SHADES if np.linalg.norm(np.subtract(c, case.base)) > LEAST_CONTRAST]
    return away[int(rng.integers(len(away)))]


_THREAD = Part(1.7, 0.0006, shape="capsule", ball=0.06, colour=RED, damping=2e-3, density=900.0)
_ABOVE = Case(
    "above",
    (_THREAD,),
    (-np.pi / 2 + np.radians(25.9),),
    size=(640, 360),
    seconds=8.0,
    fovy=40.0,
    pivot=(0.5, -0.7),
    fill=2.0 * 1.4 * (1.76 / 1.7),
    turned=(0.0, 6.0, 0.0),
    wall="mottled",
    noise=2.0,
)
_LEVEL = replace(_ABOVE, turned=(0.0, 0.0, 0.0))
_SINGLE = Case("single", chain((0.27,), 0.03, (BLUE,)), (-0.5,), size=(640, 360), wall="room")
_DOUBLE = Case("double", chain((0.22, 0.18), (0.03, 0.026), (RED, BLUE)), (-0.5, 0.4), size=(640, 360))
_CART = Case(
    "cart",
    (
        Part(0.12, 0.06, 0.02, BLUE, kind="slide", mass=0.4, damping=0.04),
        Part(0.25, 0.022, 0.008, DARK, parent=0, layer=0.02),
    ),
    (-0.05, -2.2),
    size=(640, 360),
    fill=0.8,
)


def _named(draws: Sequence[Draw]) -> dict[str, Draw]:
    return {draw.case.name: replace(draw, case=replace(draw.case, seed=k)) for k, draw in enumerate(draws, 1)}


def _as(case: Case, name: str, **more: object) -> Case:
    return replace(case, name=name, **more)  # pyright: ignore


_ELLIPSE = (("ellipse", 1 / 7 / CAREFUL["ellipse"].value), ("lean", 3.0))
NAMED = _named(
    [
        Draw(_as(_ABOVE, "ellipse_above_bob"), "ball", "bob", "above", _ELLIPSE, ellipse=1 / 7),
        Draw(_as(_ABOVE, "ellipse_above_ball"), "ball", "ball", "above", _ELLIPSE, ellipse=1 / 7),
        Draw(_as(_ABOVE, "plane_above_bob"), "ball", "bob", "above", _ELLIPSE[1:]),
        Draw(_as(_ABOVE, "plane_above_ball"), "ball", "ball", "above", _ELLIPSE[1:]),
        Draw(_as(_LEVEL, "ellipse_level_bob"), "ball", "bob", "above", _ELLIPSE[:1], ellipse=1 / 7),
        *(
            Draw(_as(case, f"ideal_{case.name}"), case.name, "file")
            for case in (_SINGLE, _DOUBLE, _CART)
        ),
    ]
)  # fmt: skip
"""Clips by name: that of a ball whose record once shrank to nothing, the same in a plane, and ideal ones."""
