"""What a made clip shows: a mechanism, a camera, colours and a wall; its MJCF and its framing.

``clips`` films a case and the painters draw it; both start from here.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from typing import Literal

import numpy as np

if sys.platform == "linux":
    # mujoco reads this when it is imported, which every user of this module does later: draw without a screen
    os.environ.setdefault("MUJOCO_GL", "egl")

Colour = tuple[int, int, int]
"""Red, green and blue, 0 to 255."""
BOLT_RADIUS = 0.32
"""Radius of a bolt head over the width of its link."""
BOLT_HALF = 0.001
"""Half the height of a bolt head [m]."""
CHROMA_NOISE = 0.4
"""Noise of each colour channel over the noise that the three share: sensors count more light than colour."""


@dataclass(frozen=True)
class Part:
    """One moving body.

    Attributes:
        length: From its hinge to the next one or to its end; of a cart, along the slide [m].
        width: In the picture, across [m].
        thickness: Along the line of sight [m].
        colour: Red, green, blue.
        kind: Its joint.
        shape: Its geom.
        parent: Number of the part that it hangs on; -1 is the world.
        at: Where it hangs, as a share of the parent's length; 1 is a link's end and a cart's middle.
        layer: How far it stands before its parent [m].
        tail: Overhang behind the hinge [m].
        tip: Overhang beyond the next hinge [m].
        ball: Radius of a ball at its end [m]; 0 for none.
        damping: Of its joint [N m s/rad or N s/m].
        density: In kg/m^3.
        mass: Of a cart [kg]; 0 takes the density.
        slope: Of a slide against the horizontal [rad].
    """

    length: float
    width: float
    thickness: float = 0.006
    colour: Colour = (45, 44, 60)
    kind: Literal["hinge", "slide"] = "hinge"
    shape: Literal["box", "capsule", "cylinder", "ellipsoid"] = "box"
    parent: int = -1
    at: float = 1.0
    layer: float = 0.008
    tail: float = 0.0
    tip: float = 0.0
    ball: float = 0.0
    damping: float = 8e-4
    density: float = 2700.0
    mass: float = 0.0
    slope: float = 0.0


@dataclass(frozen=True)
class Case:
    """One clip.

    Attributes:
        name: Its name.
        parts: The mechanism, parents first.
        start: Joint positions at time zero [rad or m].
        rates: Joint rates at time zero [rad/s or m/s]; empty is rest.
        size: Picture width and height [px].
        rate: Frames a second [Hz].
        seconds: Length of the clip [s].
        fovy: Vertical angle of view [deg].
        fill: Diameter of the reach of the mechanism, as a share of the picture's shorter side.
        pivot: Where the world's origin appears, as shares of width and height.
        engine: ``plain`` draws faces of one shade; ``mujoco`` draws with lamps and highlights.
        wall: Pattern of the background.
        base: Its colour, RGB.
        stand: Whether a post stands behind the origin.
        bolts: Colour of bolt heads before the hinges, or None.
        clutter: Things on the wall: outside of the reach; or in the mechanism's colours, next to the motion
            or under it.
        noise: Standard deviation of the pixel noise [grey levels].
        shutter: Exposure as a share of the frame interval; 0 draws no motion blur.
        shine: Strength of a highlight, as a share of the mechanism's colour.
        crf: Quality of the encoder; higher is worse.
        seed: Of noise, patterns and clutter.
        turned: Roll, pitch and yaw of the camera about the world's origin [deg]: the picture clockwise, up,
            to the right.
        bends: Coefficients by which the lens bends the picture, as OpenCV has them; empty for none.
    """

    name: str
    parts: tuple[Part, ...]
    start: tuple[float, ...]
    rates: tuple[float, ...] = ()
    size: tuple[int, int] = (720, 480)
    rate: int = 30
    seconds: float = 6.0
    fovy: float = 40.0
    fill: float = 0.75
    pivot: tuple[float, float] = (0.5, 0.42)
    engine: Literal["plain", "mujoco"] = "plain"
    wall: Literal["plain", "mottled", "checker", "stripes", "room"] = "checker"
    base: Colour = (190, 184, 170)
    stand: bool = False
    bolts: Colour | None = None
    clutter: Literal["none", "elsewhere", "beside", "under"] = "none"
    noise: float = 2.0
    shutter: float = 0.0
    shine: float = 0.0
    crf: int = 20
    seed: int = 1
    turned: tuple[float, float, float] = (0.0, 0.0, 0.0)
    bends: tuple[float, ...] = ()


class NoRenderer(Exception):
    """This machine cannot draw the case."""


class Drawer:
    """Draws the pictures of a case one after the other; the noise goes on from picture to picture."""

    _case: Case

    def picture(self, positions: np.ndarray) -> np.ndarray:
        """Return one frame, uint8 RGB (height, width, 3).

        Args:
            positions: Joint positions during the exposure, (exposure, dof).
        """
        raise NotImplementedError

    def grainy(self, picture: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return a picture with the noise of a sensor, uint8 RGB (height, width, 3).

        Args:
            picture: Without noise, float (height, width, 3).
            rng: Where the noise comes from.
        """
        noise = self._case.noise
        grey = rng.normal(scale=noise, size=(*picture.shape[:2], 1)).astype(np.float32)
        colour = rng.normal(scale=CHROMA_NOISE * noise, size=picture.shape).astype(np.float32)
        return np.clip(np.round(picture + grey + colour), 0, 255).astype(np.uint8)


def mjcf(parts: tuple[Part, ...], bolts: Colour | None = None) -> str:
    """Return the mechanism as MJCF; hinge axes point at the camera, gravity points down.

    Args:
        parts: Its bodies, parents first.
        bolts: Colour of weightless bolt heads before the hinges, or None.
    """
    inner = "".join(_body(parts, i, bolts) for i, part in enumerate(parts) if part.parent < 0)
    head = '<mujoco><option gravity="0 0 -9.81" integrator="RK4"/><worldbody>'
    return head + inner + "</worldbody></mujoco>\n"


def _body(parts: tuple[Part, ...], i: int, bolts: Colour | None) -> str:
    """Return a body with everything that hangs on it."""
    part = parts[i]
    place = "0 0 0"
    if part.parent >= 0:
        parent = parts[part.parent]
        # a link's origin is its hinge at one end, a cart's origin is its middle
        share = part.at if parent.kind == "hinge" else part.at - 1.0
        place = f"{parent.length * share:.9g} {-part.layer:.9g} 0"
    if part.kind == "slide":
        name, axis = "slide", f"{np.cos(part.slope):.9g} 0 {np.sin(part.slope):.9g}"
        # a tilted cart lies along its slide: the body is turned and the slide is its own x axis
        turn = f' euler="0 {-np.degrees(part.slope):.9g} 0"' if part.slope else ""
        body, axis = f"cart{i}" if i else "cart", "1 0 0" if part.slope else axis
    else:
        number = 1 + sum(other.kind == "hinge" for other in parts[:i])
        name, axis, turn, body = f"joint{number}", "0 -1 0", "", f"link{number}"
    text = f'<body name="{body}" pos="{place}"{turn}>'
    text += f'<joint name="{name}" type="{part.kind}" axis="{axis}" damping="{part.damping:.9g}"/>'
    text += _geoms(part)
    if bolts and part.kind == "hinge":
        radius, middle = BOLT_RADIUS * part.width, -part.thickness / 2 - BOLT_HALF
        text += (
            f'<geom type="cylinder" size="{radius:.9g} {BOLT_HALF:g}" pos="0 {middle:.9g} 0" '
            f'euler="90 0 0" density="0" mass="0" rgba="{_rgba(bolts)}" contype="0" conaffinity="0"/>'
        )
    inner = "".join(_body(parts, k, bolts) for k, other in enumerate(parts) if other.parent == i)
    return text + inner + "</body>"


def _geoms(part: Part) -> str:
    """Return the geoms of a body."""
    weight = f'mass="{part.mass:.9g}"' if part.mass else f'density="{part.density:.9g}"'
    tail = f' {weight} rgba="{_rgba(part.colour)}" contype="0" conaffinity="0"/>'
    first, last = -part.tail, part.length + part.tip
    if part.kind == "slide":
        first, last = -part.length / 2, part.length / 2
    middle, half = (first + last) / 2, (last - first) / 2
    if part.shape in ("box", "ellipsoid"):
        sizes = f"{half:.9g} {part.thickness / 2:.9g} {part.width / 2:.9g}"
        text = f'<geom type="{part.shape}" size="{sizes}" pos="{middle:.9g} 0 0"' + tail
    else:
        ends = f"{first:.9g} 0 0 {last:.9g} 0 0"
        text = f'<geom type="{part.shape}" size="{part.width / 2:.9g}" fromto="{ends}"' + tail
    if part.ball:
        text += f'<geom type="sphere" size="{part.ball:.9g}" pos="{part.length:.9g} 0 0"' + tail
    return text


def _rgba(colour: Colour) -> str:
    return " ".join(f"{c / 255:.4f}" for c in colour) + " 1"


def span(case: Case) -> float:
    """Return the greatest distance from the origin that the mechanism reaches by turning [m].

    Args:
        case: With its parts.
    """
    far: list[float] = []
    for part in case.parts:
        base = far[part.parent] if part.parent >= 0 else 0.0
        if part.kind == "slide":
            # how far it travels depends on the motion and is left out
            far.append(base + part.length / 2)
            continue
        behind = case.parts[part.parent].length * (1.0 - part.at) if part.parent >= 0 else 0.0
        far.append(base - behind + part.length + max(part.tip, part.ball))
    return max(far)


def view(case: Case) -> tuple[float, np.ndarray]:
    """Return the focal length [px] and the camera's place [m], (3,): x right, y away from the camera, z up.

    Args:
        case: With its framing.
    """
    width, height = case.size
    focal = height / 2 / np.tan(np.radians(case.fovy) / 2)
    depth = focal * 2 * span(case) / (case.fill * min(width, height))
    # depth is such that the circle of radius span fills its share of the shorter side; the camera then moves
    # sideways until the world's origin appears at the pivot
    left, down = case.pivot[0] * width - (width - 1) / 2, case.pivot[1] * height - (height - 1) / 2
    return focal, -looking(case).T @ np.array([left * depth / focal, depth, -down * depth / focal])


def looking(case: Case) -> np.ndarray:
    """Return the directions to the right, away from the camera and up in the picture, (3, 3), one a row.

    Args:
        case: With the turns of its camera.
    """
    roll, pitch, yaw = np.radians(case.turned)
    right, away, up = np.eye(3)
    right, away = np.cos(yaw) * right - np.sin(yaw) * away, np.cos(yaw) * away + np.sin(yaw) * right
    away, up = np.cos(pitch) * away + np.sin(pitch) * up, np.cos(pitch) * up - np.sin(pitch) * away
    right, up = np.cos(roll) * right + np.sin(roll) * up, np.cos(roll) * up - np.sin(roll) * right
    return np.array([right, away, up])
