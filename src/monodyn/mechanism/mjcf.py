"""Write the identified mechanism as MJCF that simulates the same motion.

Bodies carry explicit inertials; of the inertia tensor only the part about the hinge axis is known, the others
are set equal to it. Geoms are for looks. What ``load`` reads of a file is the mechanism alone: where a motion
began, the camera, motors and what drives them are for MuJoCo, and a mechanism that was read has none of them.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monodyn.mechanism import looks, tree
from monodyn.mechanism.drive import FOURIER, KNOTS
from monodyn.mechanism.model import Mechanism

FIRM = {"solreffriction": "0.002 1", "solimpfriction": "0.999 0.9999 0.001"}
"""What makes MuJoCo's friction loss turn where the rate does: by default it does so 10 ms ahead, and lets a
joint that it holds creep at degrees a second. The first is twice its step [s], the least that it takes."""
MOST_FIRM, LEAST_SOFT = 0.9999, 0.002
"""The second number of ``solimpfriction``, and that first one."""

SERIES = (
    "Not applied by MuJoCo itself: the control [N m or N] of the motor of each joint at data.time t [s] is "
    "a0 + a1 cos(2 pi t / T) + b1 sin(2 pi t / T) + a2 cos(4 pi t / T) + ..., with T in the numeric "
    "torque.period and a0 a1 b1 a2 b2 ... in <joint>.torque."
)
HATS = (
    "Not applied by MuJoCo itself: the controls [N m or N] of the motors at the times in the numeric "
    "torque.times [s of data.time] are those in <joint>.torque, linear in between and zero outside."
)
LED = (
    "Dry friction turns ahead of the rate, as a soft constraint of MuJoCo does and no bearing: by "
    "<joint>.lead [s], half of solreffriction."
)
AIRED = "Not simulated by MuJoCo: the drag of the air on links, -c |z| z."
INTEGRATOR = (
    "mjd_transitionFD (linearization by finite differences) does not take this integrator: set "
    "model.opt.integrator to mujoco.mjtIntegrator.mjINT_IMPLICITFAST before it."
)


class Keyframe(NamedTuple):
    """A state to begin a simulation in.

    Attributes:
        name: What it is called.
        time: When, in true time [s].
        position: Joint positions [rad or m], (dof,).
        velocity: Joint rates [rad/s or m/s], (dof,).
    """

    name: str
    time: float
    position: np.ndarray
    velocity: np.ndarray


class Eye(NamedTuple):
    """A pinhole camera in the plane frame.

    Attributes:
        name: What it is called.
        place: Where it stands [m], (3,).
        right: Direction of the picture's rows, (3,).
        up: Direction against its columns, (3,).
        focal: Focal length [px].
        size: Width and height of the picture [px].
    """

    name: str
    place: np.ndarray
    right: np.ndarray
    up: np.ndarray
    focal: float
    size: tuple[int, int]


def write_mjcf(
    mechanism: Mechanism,
    path: str | Path,
    *,
    keyframes: Sequence[Keyframe] = (),
    camera: Eye | None = None,
    motors: Sequence[str] = (),
    remarks: Sequence[str] = (),
) -> None:
    """Write the mechanism as an MJCF file.

    The motion in MuJoCo is that of ``simulate`` except where friction loss holds a joint: there each creeps
    in its own way, neither visibly, and a lead of less than a millisecond is one of that; and except for the
    drag of the air on links, which MJCF has no place for: it stands in custom numerics, that MuJoCo does not
    look at, and a comment says so. Each joint of a driven
    mechanism has a motor, whose control is the torque [N m or N]; a drive stands in custom numerics, and a
    comment gives its formula.

    Args:
        mechanism: The mechanism.
        path: File to write.
        keyframes: States to begin in.
        camera: The camera that saw it.
        motors: Joints that have a motor though the mechanism is not driven.
        remarks: Sentences for comments at the top.
    """
    root = ET.Element("mujoco", model=mechanism.name)
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    gravity = mechanism.tree.gravity
    ET.SubElement(
        root, "option", gravity=looks.numbers(gravity[0], 0, gravity[1]), integrator="RK4", timestep="0.001"
    )
    default = ET.SubElement(root, "default")
    ET.SubElement(default, "geom", contype="0", conaffinity="0")
    if np.any(mechanism.tree.links[:, tree.FRICTION]):
        ET.SubElement(default, "joint", FIRM)
    root.extend(_customs(mechanism))
    asset = ET.SubElement(root, "asset")
    scene = ET.SubElement(root, "worldbody")
    places, digits = {-1: scene}, looks.place_digits(mechanism)
    for group in _groups(mechanism):
        body = _body(mechanism, group, places[int(mechanism.tree.parent[group[0]])], digits)
        places[group[-1]] = body
        for look in looks.looks_of(mechanism, group[-1]):
            _geom(look, body, asset, digits)
        _sites(mechanism, group[-1], body, digits)
    if not len(asset):
        root.remove(asset)
    if camera is not None:
        scene.append(_camera(camera))
    if mechanism.torque != "friction":
        motors = [joint.name for joint in mechanism.joints]
    if motors:
        actuator = ET.SubElement(root, "actuator")
        for name in motors:
            ET.SubElement(actuator, "motor", name=motor_at(name), joint=name, gear="1")
    if keyframes:
        listed = ET.SubElement(root, "keyframe")
        for key in keyframes:
            qpos, qvel = looks.numbers(*key.position), looks.numbers(*key.velocity)
            ET.SubElement(listed, "key", name=key.name, time=looks.numbers(key.time), qpos=qpos, qvel=qvel)
    looks.save(root, path, [*remarks, INTEGRATOR])


def motor_at(joint: str) -> str:
    """Return the name of the motor at a joint.

    Args:
        joint: Name of the joint.
    """
    return f"{joint}_torque"


def _customs(mechanism: Mechanism) -> list[ET.Element]:
    """Return what MJCF has no place for, as numbers: the drag of the air on the links, leads of dry friction,
    which follow from none of its attributes to the last digit, and the drive."""
    custom, said = ET.Element("custom"), []
    for kind, column, about in (("air", tree.AIR, AIRED), ("lead", tree.LEAD, LED)):
        rows = mechanism.tree.links[:, column]
        for joint, value in zip(mechanism.joints, rows, strict=True):
            if value:
                ET.SubElement(custom, "numeric", name=f"{joint.name}.{kind}", data=looks.numbers(value))
        said += [about] if np.any(rows) else []
    drive = mechanism.drive
    if drive.mode in (FOURIER, KNOTS):
        series = drive.mode == FOURIER
        said.append(SERIES if series else HATS)
        clock = "torque.period" if series else "torque.times"
        ET.SubElement(custom, "numeric", name=clock, data=looks.numbers(*drive.times))
        for joint, row in zip(mechanism.joints, drive.table, strict=True):
            ET.SubElement(custom, "numeric", name=f"{joint.name}.torque", data=looks.numbers(*row))
    return [*(looks.remark(text) for text in said), custom] if said else []


def _groups(mechanism: Mechanism) -> list[list[int]]:
    """Return the links of each body, in order; the last of them carries it."""
    groups: list[list[int]] = []
    links = mechanism.plan.links
    for i in range(len(links)):
        if i > 0 and not links[i - 1].carries:
            groups[-1].append(i)
        else:
            groups.append([i])
    return groups


def _body(mechanism: Mechanism, group: list[int], parent: ET.Element, digits: int) -> ET.Element:
    """Add a body with its joints and inertial."""
    links = mechanism.tree.links
    first, last = group[0], group[-1]
    angle = round(float(links[first, tree.ANGLE]), looks.DIGITS)
    # MuJoCo's body has one frame for all of its joints, ours has a link for each: the body stands where the
    # last joint is at zero, and the others are placed backwards from there.
    anchors = links[group][:, [tree.ANCHOR_X, tree.ANCHOR_Y]]
    rest = anchors[1:].sum(axis=0)
    x, y = anchors[0] + looks.turned(rest, angle)
    z = looks.depth_of(mechanism, last) - looks.depth_of(mechanism, int(mechanism.tree.parent[first]))
    name, place = mechanism.joints[last].body, looks.numbers(x, -z, y, digits=digits)
    body = ET.SubElement(parent, "body", name=name, pos=place)
    if angle:
        body.set("euler", looks.numbers(0, -angle, 0))
    for k, i in enumerate(group):
        joint, row = mechanism.joints[i], links[i]
        back = np.round(-anchors[k + 1 :].sum(axis=0), digits)
        element = ET.SubElement(
            body, "joint", name=joint.name, type=joint.kind, axis=looks.axis_text(mechanism.tree.kind[i], row)
        )
        # where a slide is written does not matter
        if np.any(back) and joint.kind == "hinge":
            element.set("pos", looks.numbers(back[0], 0, back[1]))
        columns = {
            "damping": tree.DAMPING,
            "frictionloss": tree.FRICTION,
            "stiffness": tree.STIFFNESS,
            "armature": tree.ARMATURE,
        }
        for name, column in columns.items():
            if name == "damping" and row[tree.DRAG]:
                # MuJoCo's damping is -(b + b1 |v| + ...) v: its second number is the drag
                element.set(name, looks.numbers(row[tree.DAMPING], row[tree.DRAG]))
            elif row[column]:
                element.set(name, looks.numbers(row[column]))
        if row[tree.FRICTION] and row[tree.LEAD]:
            element.set("solreffriction", looks.numbers(max(2.0 * row[tree.LEAD] / MOST_FIRM, LEAST_SOFT), 1))
        if row[tree.REST]:
            element.set("springref", looks.numbers(row[tree.REST]))
        if joint.lower > -math.inf or joint.upper < math.inf:
            element.set("range", looks.numbers(joint.lower, joint.upper))
    row = links[last]
    middle = looks.numbers(row[tree.COM_X], 0, row[tree.COM_Y], digits=digits)
    mass, inertia = looks.numbers(row[tree.MASS]), looks.significant(row[tree.INERTIA])
    around = looks.numbers(*[inertia] * 3)
    ET.SubElement(body, "inertial", pos=middle, mass=mass, diaginertia=around)
    return body


def _geom(look: looks.Look, body: ET.Element, asset: ET.Element, digits: int) -> None:
    """Add a geom, and its mesh if it is one."""
    if look.kind == "mesh":
        name = f"shape{len(asset)}"
        corners = looks.numbers(
            *looks.world(look.points).ravel(), digits=digits - looks.DIGITS + looks.MESH_DIGITS
        )
        ET.SubElement(asset, "mesh", name=name, vertex=corners)
        ET.SubElement(body, "geom", type="mesh", mesh=name)
        return
    middle = looks.world(look.middle)
    if look.kind in ("capsule", "cylinder"):
        half = looks.world(np.array([*(look.along * look.direction), look.deep])) / 2
        ends = looks.numbers(*(middle - half), *(middle + half), digits=digits)
        radius = looks.numbers(look.across / 2, digits=digits)
        ET.SubElement(body, "geom", type=look.kind, size=radius, fromto=ends)
        return
    along, across, angle = look.along, look.across, math.atan2(look.direction[1], look.direction[0])
    # a box that is turned by a quarter is one with its sides exchanged: which of them is read as its length
    # depends on which is longer
    quarters = round(angle / (math.pi / 2))
    angle = round(angle - quarters * (math.pi / 2), looks.DIGITS)
    if quarters % 2:
        along, across = across, along
    half = (across,) if look.kind == "sphere" else (along, look.deep, across)
    size = looks.numbers(*(width / 2 for width in half), digits=digits)
    geom = ET.SubElement(body, "geom", type=look.kind, size=size, pos=looks.numbers(*middle, digits=digits))
    if angle and look.kind != "sphere":
        geom.set("euler", looks.numbers(0, -angle, 0))


def _sites(mechanism: Mechanism, link: int, body: ET.Element, digits: int) -> None:
    """Add the sites of a link, which grow with its length."""
    part, table = mechanism.plan.links[link], mechanism.plan.table
    length = f"{part.joint.body}.length"
    grown = mechanism.values[length] / table.start[mechanism.row(length)] if length in table.names else 1.0
    for site in part.sites:
        place = looks.world(np.array([[*site.place, site.ahead]]) * grown)[0]
        ET.SubElement(body, "site", name=site.name, pos=looks.numbers(*place, digits=digits))


def _camera(eye: Eye) -> ET.Element:
    """Return a camera; MuJoCo's looks along its -z and has its x to the right, its y up."""
    width, height = eye.size
    # MuJoCo takes degrees here whatever the file's angles are in
    view = math.degrees(2.0 * math.atan2(height / 2.0, eye.focal))
    axes = looks.numbers(*looks.world(eye.right), *looks.world(eye.up))
    place = looks.numbers(*looks.world(eye.place))
    resolution = f"{width} {height}"
    return ET.Element(
        "camera", name=eye.name, pos=place, xyaxes=axes, fovy=looks.numbers(view), resolution=resolution
    )
