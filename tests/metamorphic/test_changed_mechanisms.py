"""The same mechanism written in another way: pictures and motion of it must change as the writing says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from monodyn.mechanism import Mechanism, load, write_mjcf, write_urdf
from monodyn.mechanism.simulate import rollout
from monodyn.types import Camera
from monodyn.vision.drawing.outline import outline
from monodyn.vision.drawing.rig import root_slides
from pictures import CAMERA

HALF_TURN = float(np.pi)
BOX = '<geom type="box" size="0.1 0.003 0.015" pos="0.08 0 0" density="2700"/>'
HINGE = '<joint name="{}" type="hinge" axis="{}" damping="0.001"/>'


@dataclass(frozen=True)
class Effect:
    """What a change of the file has to do.

    Attributes:
        sign: Factors of the joint positions that show the same picture.
        offset: What is added to them [rad or m].
        size: Factor of all lengths.
        names: New names of bodies and joints by the old ones.
        values: False where the file states masses in place of densities, or sizes otherwise.
    """

    sign: tuple[float, ...] = (1.0, 1.0)
    offset: tuple[float, ...] = (0.0, 0.0)
    size: float = 1.0
    names: Mapping[str, str] = field(default_factory=dict)
    values: bool = True


@dataclass(frozen=True)
class Pair:
    """A change of a mechanism file, and its effect."""

    name: str
    before: str
    after: str
    effect: Effect = field(default_factory=Effect)


def world(bodies: str, gravity: str = "0 0 -9.81", more: str = "") -> str:
    """Return a file of some bodies."""
    return f'<mujoco><option gravity="{gravity}"/><worldbody>{bodies}</worldbody>{more}</mujoco>'


def double(
    base: str = "", axes: tuple[str, str] = ("0 -1 0", "0 -1 0"), before: str = "-0.008", geom: str = BOX
) -> str:
    """Return the bodies of a double pendulum; ``base`` is what the first body has in addition."""
    inner = f'<body name="b" pos="0.2 {before} 0">{HINGE.format("jb", axes[1])}{geom}</body>'
    return f'<body name="a" {base}>{HINGE.format("ja", axes[0])}{geom}{inner}</body>'


def cart(base: str = "", axis: str = "1 0 0", off: str = "0", pole: str = "") -> str:
    """Return the bodies of a cart with a pole; ``off`` is how far its body's frame is below the cart."""
    inner = f'<body name="pole" pos="0 -0.02 {off}" {pole}>{HINGE.format("turn", "0 -1 0")}{BOX}</body>'
    box = f'<geom type="box" size="0.06 0.01 0.03" pos="0 0 {off}" mass="0.3"/>'
    slide = f'<joint name="slide" type="slide" axis="{axis}" damping="0.01"/>'
    return f'<body name="cart" {base}>{slide}{box}{inner}</body>'


def two(first: str, second: str) -> str:
    """Return two pendulums on the world."""
    return "".join(
        f'<body name="{name}" pos="{pos}">{HINGE.format(f"j{name}", "0 -1 0")}{BOX}</body>'
        for name, pos in (("a", first), ("b", second))
    )


def rods(geom: str) -> str:
    """Return a double pendulum of other geoms."""
    return double(geom=geom)


TURN = float(np.radians(40.0))
ABOUT = f"quat='{np.cos(TURN / 2)} 0 {np.sin(TURN / 2)} 0'"
UP_IS_Y = 'quat="0.7071067811865476 -0.7071067811865476 0 0"'
DOUBLE, CART, TWO = world(double()), world(cart()), world(two("0 0 0", "0.3 -0.01 0.1"))
CENTRED = double().replace(BOX, '<geom type="box" size="0.1 0.003 0.015" density="2700"/>')
CENTRED = CENTRED.replace('axis="0 -1 0"', 'axis="0 -1 0" pos="-0.08 0 0"').replace(
    '<body name="a" ', '<body name="a" pos="0.08 0 0" '
)
SMALLER = (
    double()
    .replace("0.1 0.003 0.015", "0.01 0.0003 0.0015")
    .replace("0.08 0 0", "0.008 0 0")
    .replace("0.2 -0.008 0", "0.02 -0.0008 0")
)
LARGER = (
    double()
    .replace("0.1 0.003 0.015", "1 0.03 0.15")
    .replace("0.08 0 0", "0.8 0 0")
    .replace("0.2 -0.008 0", "2 -0.08 0")
)
FIRST = (
    double()
    .replace(BOX, "@")
    .replace(HINGE.format("ja", "0 -1 0") + "@", "@" + HINGE.format("ja", "0 -1 0"))
    .replace(HINGE.format("jb", "0 -1 0") + "@", "@" + HINGE.format("jb", "0 -1 0"))
    .replace("@", BOX)
)
FIXED = '<body pos="0.1 0 1"><body pos="0 0 1">{}</body></body>'
STAND = (
    '<geom type="plane" size="2 2 0.1" pos="0 0 -1"/><geom type="box" size="0.02 0.02 0.5" pos="0 0.1 -0.5"/>'
)
MOTORS = '<actuator><motor joint="ja"/></actuator><sensor><jointpos joint="ja"/></sensor>'
RENAMED = {"a": "upper", "b": "lower", "ja": "shoulder", "jb": "elbow"}


def renamed(text: str) -> str:
    """Give every body and joint another name."""
    for old, new in RENAMED.items():
        text = text.replace(f'name="{old}"', f'name="{new}"')
    return text


def same(name: str, before: str, after: str) -> Pair:
    """Return a pair of files that mean the same."""
    return Pair(name, before, after)


PAIRS = (
    same("moved in the plane", DOUBLE, world(double('pos="0.4 0 1"'))),
    same("moved by little", DOUBLE, world(double('pos="0.05 0 0"'))),
    same("moved far", DOUBLE, world(double('pos="-30 0 200"'))),
    same("moved along the hinge axis", DOUBLE, world(double('pos="0 0.7 0"'))),
    Pair("turned in the plane", DOUBLE, world(double(ABOUT)), Effect(offset=(TURN, 0.0))),
    Pair("turned and moved", DOUBLE, world(double(f'pos="1 2 3" {ABOUT}')), Effect(offset=(TURN, 0.0))),
    Pair(
        "seen from behind", DOUBLE, world(double(axes=("0 1 0", "0 1 0"), before="0.008")),
        Effect(offset=(HALF_TURN, 0.0)),
    ),
    Pair("second axis reversed", DOUBLE, world(double(axes=("0 -1 0", "0 1 0"))), Effect(sign=(1.0, -1.0))),
    Pair("sizes x 0.1", DOUBLE, world(SMALLER), Effect(size=0.1)),
    Pair("sizes x 10", DOUBLE, world(LARGER), Effect(size=10.0)),
    Pair("renamed", DOUBLE, world(renamed(double())), Effect(names=RENAMED)),
    same("in two fixed bodies", DOUBLE, world(FIXED.format(double()))),
    same("in a frame", DOUBLE, world(f'<frame pos="0.3 0 1">{double()}</frame>')),
    same("geoms before joints", DOUBLE, world(FIRST)),
    same("y is up", DOUBLE, world(f'<body {UP_IS_Y}>{double()}</body>', gravity="0 -9.81 0")),
    same("all turned", DOUBLE, world(
        f"<body {ABOUT}>{double()}</body>",
        gravity=f"{-9.81 * np.sin(TURN)} 0 {-9.81 * np.cos(TURN)}",
    )),
    same("with a stand, a floor, a motor and a sensor", DOUBLE, world(STAND + double(), more=MOTORS)),
    same("hinges away from the bodies' frames", DOUBLE, world(CENTRED)),
    same(
        "from end to end, or by the middle",
        world(rods('<geom type="capsule" size="0.01" fromto="0 0 0 0.2 0 0"/>')),
        world(rods('<geom type="capsule" size="0.01 0.1" pos="0.1 0 0" euler="0 90 0"/>')),
    ),
    same("cart moved by little", CART, world(cart('pos="0 0 0.05"'))),
    same("cart moved", CART, world(cart('pos="0.3 0.2 1"'))),
    same("cart in a fixed body", CART, world(f'<body pos="0 0 1">{cart()}</body>')),
    same("cart before its frame", CART, world(cart(off="1"))),
    same("cart where y is up", CART, world(f'<body {UP_IS_Y}>{cart()}</body>', gravity="0 -9.81 0")),
    Pair("slide reversed", CART, world(cart(axis="-1 0 0")), Effect(sign=(-1.0, 1.0))),
    Pair(
        "cart's frame turned", CART,
        world(cart('quat="0.7071067811865476 0 0.7071067811865476 0"', axis="0 0 1").replace(
            'size="0.06 0.01 0.03"', 'size="0.03 0.01 0.06"'
        )),
        Effect(offset=(0.0, HALF_TURN / 2)),
    ),
    same("two pendulums moved", TWO, world(two("0 0 1", "0.3 -0.01 1.1"))),
    same("two pendulums moved along their axes", TWO, world(two("0 2 0", "0.3 1.99 0.1"))),
)  # fmt: skip


@pytest.mark.parametrize("pair", PAIRS, ids=lambda pair: pair.name)
def test_the_same_in_another_file(pair: Pair, tmp_path: Path) -> None:
    before, after = (read(tmp_path, name, text) for name, text in (("a", pair.before), ("b", pair.after)))
    compare(before, after, pair.effect)


@pytest.mark.parametrize("kind", ["mjcf", "urdf"])
@pytest.mark.parametrize(
    "text", [world(double('pos="0.4 0 1"')), world(cart('pos="0.3 0 1"'))], ids=["double", "cart"]
)
def test_the_same_written_again(kind: str, text: str, tmp_path: Path) -> None:
    before, path = read(tmp_path, "a", text), tmp_path / f"b.{'xml' if kind == 'mjcf' else 'urdf'}"
    (write_mjcf if kind == "mjcf" else write_urdf)(before, path)
    compare(before, load(path), Effect(values=False))


def read(folder: Path, name: str, text: str) -> Mechanism:
    """Load a file of some text."""
    path = folder / f"{name}.xml"
    path.write_text(text)
    return load(path)


def compare(before: Mechanism, after: Mechanism, effect: Effect) -> None:
    """Compare sizes, pictures and motion of two mechanisms."""
    assert [effect.names.get(joint.name, joint.name) for joint in before.joints] == [
        j.name for j in after.joints
    ]
    assert [slide.column for slide in root_slides(before)] == [slide.column for slide in root_slides(after)]
    if effect.values:
        sizes = {
            p.name: p.value * effect.size for p in before.parameters if p.unit == "m" and p.kind[:3] != "com"
        }
        for name, value in sizes.items():
            owner, _, kind = name.partition(".")
            # files round at 1e-16 of a place, which may be a thousand times the size
            assert after.values[f"{effect.names.get(owner, owner)}.{kind}"] == pytest.approx(value, rel=1e-10)
    rng = np.random.default_rng(0)
    for q in rng.uniform(-0.1, 0.1, (3, len(before.joints))) + rng.uniform(-2.0, 2.0, (3, 1)) * [0.0, 1.0]:
        other = np.array(effect.sign) * q + effect.offset
        assert shown(after, other, effect.size) == pytest.approx(shown(before, q, 1.0), abs=1e-6)
        if effect.size == 1.0:
            assert moved(after, other) == pytest.approx(
                moved(before, q) * effect.sign + effect.offset, abs=1e-7
            )


def shown(mechanism: Mechanism, q: np.ndarray, size: float) -> np.ndarray:
    """Return how far each outline reaches in 16 directions [px], before a camera that grows along."""
    camera: Camera = replace(CAMERA, x=CAMERA.x * size, y=CAMERA.y * size, depth=CAMERA.depth * size)
    turns = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    directions = np.stack([np.cos(turns), np.sin(turns)])
    return np.array([(polygon @ directions).max(axis=0) for _, polygon in outline(mechanism, camera, q)])


def moved(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """Return the motion of half a second from rest, (time, dof)."""
    return rollout(mechanism.tree, np.linspace(0.0, 0.5, 6), q, np.zeros(len(q)), substeps=32)[0]
