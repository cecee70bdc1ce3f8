"""Write the identified mechanism as URDF that simulates the same motion, as far as URDF can hold it.

Inertials are explicit, as in MJCF. Visuals are for looks. Collision geometry is one box a body, because
PyBullet takes the inertia from there: a box in its axes with the identified inertia about the hinge.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from monodyn.mechanism import looks, tree
from monodyn.mechanism.model import Mechanism
from monodyn.mechanism.parts import Joint
from monodyn.mechanism.plan import JOINT

FAR = 1000.0
"""Limit [m] written for a slide without limits, because URDF requires one."""

NOT_IN_URDF = ("stiffness", "armature", "drag", "air", "lead")
"""Kinds of parameters of a joint that URDF has no place for."""

MASSLESS = 1e-14
"""Mass [kg] and inertia [kg m^2] of a URDF link between two joints of one body; zero would be refused."""

BULLET = (
    "PyBullet computes inertia from the collision geometry unless loadURDF is given "
    "flags=URDF_USE_INERTIA_FROM_FILE: each body has one box here that has the identified inertia about the "
    "hinge axis, for that purpose alone. PyBullet also damps every link, which changeDynamics(body, link, "
    "linearDamping=0, angularDamping=0) stops, and holds every joint by a motor, of which "
    "setJointMotorControl2(body, joint, VELOCITY_CONTROL, force=F) leaves the dry friction F of the joint."
)
PINOCCHIO = (
    "pinocchio reads damping into model.damping, but aba and rnea leave it out: subtract model.damping * v "
    "from the torques."
)


def write_urdf(mechanism: Mechanism, path: str | Path, *, remarks: Sequence[str] = ()) -> None:
    """Write the mechanism as a URDF file.

    URDF has no place for the kinds ``NOT_IN_URDF``: where the mechanism has them, a comment in the file
    names what is missing, and the motion differs. Gravity is written in the ``<mujoco>`` element, which other
    readers ignore. Ellipsoids and meshes are shown as boxes of their extents. A slide without limits is
    given limits of 1000 m.

    Args:
        mechanism: The mechanism.
        path: File to write.
        remarks: Sentences for comments at the top.
    """
    root = ET.Element("robot", name=mechanism.name)
    extra = ET.SubElement(root, "mujoco")
    gravity = mechanism.tree.gravity
    ET.SubElement(extra, "compiler", angle="radian", discardvisual="false", fusestatic="false")
    option = ET.SubElement(
        extra, "option", gravity=looks.numbers(gravity[0], 0, gravity[1]), integrator="RK4", timestep="0.001"
    )
    ET.SubElement(option, "flag", contact="disable")
    names = _link_names(mechanism)
    ET.SubElement(root, "link", name=names[-1])
    digits = looks.place_digits(mechanism)
    for i in range(len(mechanism.joints)):
        _link(mechanism, i, names[i], root, digits)
    for i in range(len(mechanism.joints)):
        _joint(mechanism, i, names, root, digits)
    _without_contact(names, root)
    looks.save(root, path, [*remarks, BULLET, PINOCCHIO])


def _without_contact(names: dict[int, str], root: ET.Element) -> None:
    """Tell Drake that the links do not touch one another; other readers leave this out."""
    root.set("xmlns:drake", "http://drake.mit.edu")
    group = ET.SubElement(root, "drake:collision_filter_group", name="links")
    for i in range(len(names) - 1):
        ET.SubElement(group, "drake:member", link=names[i])
    ET.SubElement(group, "drake:ignored_collision_filter_group", name="links")


def _link_names(mechanism: Mechanism) -> dict[int, str]:
    """Return a URDF link name for every link and for the world (-1)."""
    bodies = set(mechanism.bodies)
    names = {}
    for i, link in enumerate(mechanism.plan.links):
        names[i] = (
            link.joint.body if link.carries else _unused(f"{link.joint.body}_{link.joint.name}", bodies)
        )
        bodies.add(names[i])
    names[-1] = _unused("world", bodies)
    return names


def _unused(name: str, taken: set[str]) -> str:
    """Return a name that is not taken, with underscores added if need be."""
    while name in taken:
        name += "_"
    return name


def _link(mechanism: Mechanism, i: int, name: str, root: ET.Element, digits: int) -> None:
    """Add a link with inertial, visuals and collision geometry."""
    element = ET.SubElement(root, "link", name=name)
    row = mechanism.tree.links[i]
    carries = mechanism.plan.links[i].carries
    middle = looks.numbers(row[tree.COM_X], 0, row[tree.COM_Y], digits=digits)
    inertial = ET.SubElement(element, "inertial")
    ET.SubElement(inertial, "origin", xyz=middle)
    ET.SubElement(inertial, "mass", value=looks.numbers(row[tree.MASS] if carries else MASSLESS))
    about = looks.numbers(looks.significant(row[tree.INERTIA]) if carries else MASSLESS)
    ET.SubElement(inertial, "inertia", ixx=about, iyy=about, izz=about, ixy="0", ixz="0", iyz="0")
    if carries:
        shapes = looks.looks_of(mechanism, i)
        for look in shapes:
            _visual(look, element, digits)
        if row[tree.MASS] > 0.0 and row[tree.INERTIA] > 0.0:
            collision = ET.SubElement(element, "collision")
            # PyBullet's own inertia of a shape is exact only where the shape stands as the inertial does
            ET.SubElement(collision, "origin", xyz=middle)
            size = looks.numbers(*_heavy_box(row[tree.MASS], row[tree.INERTIA], shapes))
            ET.SubElement(ET.SubElement(collision, "geometry"), "box", size=size)


def _heavy_box(mass: float, inertia: float, shapes: list[looks.Look]) -> tuple[float, float, float]:
    """Return the sides x, y, z [m] of a solid box in the file's axes: m (x^2 + z^2) / 12 is the inertia.

    It has the proportions of the body's extents, so that it is the body where that is such a box itself; one
    without looks has a cube.
    """
    points = [look.points + sign * look.radius for look in shapes for sign in (-1.0, 1.0)]
    wide, high, deep = np.ptp(np.concatenate(points), axis=0).tolist() if points else (1.0, 1.0, 0.0)
    factor = math.sqrt(12.0 * inertia / mass) / math.hypot(wide, high)
    return factor * wide, deep or factor * wide, factor * high


def _visual(look: looks.Look, link: ET.Element, digits: int) -> None:
    """Add the visuals of one geom."""
    middle, radius = looks.world(look.middle), looks.numbers(look.across / 2, digits=digits)
    tilt = -math.atan2(look.direction[1], look.direction[0])
    if look.kind == "sphere":
        ET.SubElement(_placed(link, middle, digits), "sphere", radius=radius)
    elif look.kind in ("capsule", "cylinder"):
        axis = looks.world(np.array([*(look.along * look.direction), look.deep]))
        length = float(np.linalg.norm(axis))
        # the roll and pitch that turn URDF's cylinder axis, z, into the axis
        x, y, z = axis / length
        turn = (math.asin(max(-1.0, min(1.0, -y))), math.atan2(x, z), 0.0)
        shape = _placed(link, middle, digits, turn)
        ET.SubElement(shape, "cylinder", radius=radius, length=looks.numbers(length, digits=digits))
        if look.kind == "capsule":
            for end in (middle - axis / 2, middle + axis / 2):
                ET.SubElement(_placed(link, end, digits), "sphere", radius=radius)
    else:
        if look.kind != "box":
            link.append(looks.remark(f"{look.kind}, shown as the box of its extents"))
        size = looks.numbers(look.along, look.deep, look.across, digits=digits)
        ET.SubElement(_placed(link, middle, digits, (0.0, tilt, 0.0)), "box", size=size)


def _placed(
    link: ET.Element, place: np.ndarray, digits: int, turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> ET.Element:
    """Add a visual and return its geometry element."""
    visual = ET.SubElement(link, "visual")
    where = looks.numbers(*place, digits=digits)
    ET.SubElement(visual, "origin", xyz=where, rpy=looks.numbers(*turn, digits=looks.DIGITS))
    return ET.SubElement(visual, "geometry")


def _joint(mechanism: Mechanism, i: int, names: dict[int, str], root: ET.Element, digits: int) -> None:
    """Add a joint between a link and its parent."""
    joint, row = mechanism.joints[i], mechanism.tree.links[i]
    parent = int(mechanism.tree.parent[i])
    z = looks.depth_of(mechanism, i) - looks.depth_of(mechanism, parent)
    limited = joint.lower > -math.inf or joint.upper < math.inf
    kind = ("revolute" if limited else "continuous") if joint.kind == "hinge" else "prismatic"
    lost = [_lost(kind, joint, row) for kind in NOT_IN_URDF if row[JOINT[kind].column]]
    if lost:
        root.append(looks.remark(f"not in URDF: {' and '.join(lost)} of the next joint"))
    element = ET.SubElement(root, "joint", name=joint.name, type=kind)
    ET.SubElement(
        element, "origin", xyz=looks.numbers(row[tree.ANCHOR_X], -z, row[tree.ANCHOR_Y], digits=digits),
        rpy=looks.numbers(0, -row[tree.ANGLE], 0, digits=looks.DIGITS),
    )  # fmt: skip
    ET.SubElement(element, "parent", link=names[parent])
    ET.SubElement(element, "child", link=names[i])
    ET.SubElement(element, "axis", xyz=looks.axis_text(mechanism.tree.kind[i], row))
    if kind != "continuous":
        lower, upper = max(joint.lower, -FAR), min(joint.upper, FAR)
        ET.SubElement(
            element,
            "limit",
            lower=looks.numbers(lower),
            upper=looks.numbers(upper),
            effort="1000",
            velocity="1000",
        )
    ET.SubElement(
        element,
        "dynamics",
        damping=looks.numbers(row[tree.DAMPING]),
        friction=looks.numbers(row[tree.FRICTION]),
    )


def _lost(kind: str, joint: Joint, row: np.ndarray) -> str:
    """Return what URDF cannot hold of a joint as text."""
    term, hinge = JOINT[kind], joint.kind == "hinge"
    about = (
        f" about {row[tree.REST]:g} {'rad' if hinge else 'm'}"
        if kind == "stiffness" and row[tree.REST]
        else ""
    )
    return f"{kind} {row[term.column]:g} {term.at_hinge if hinge else term.at_slide}{about}"
