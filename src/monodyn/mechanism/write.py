"""Write the identified mechanism as MJCF and URDF that simulate the same motion.

The frame is MuJoCo's usual one: the plane's x, y, z become x, z, -y, so hinges turn about 0 -1 0. Bodies
carry explicit inertials; of the inertia tensor only the part about the hinge axis is known, the others are
set equal to it. Geoms are for looks.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from monodyn.mechanism.axis import Form
from monodyn.mechanism.model import Mechanism
from monodyn.mechanism.parts import Joint
from monodyn.mechanism.plan import JOINT
from monodyn.mechanism.solids import Solid
from monodyn.mechanism.tree import (
    AIR,
    ANCHOR_X,
    ANCHOR_Y,
    ANGLE,
    ARMATURE,
    AXIS_X,
    AXIS_Y,
    COM_X,
    COM_Y,
    DAMPING,
    DRAG,
    FRICTION,
    HINGE,
    INERTIA,
    MASS,
    REST,
    STIFFNESS,
)  # fmt: skip

FAR = 1000.0
"""Limit [m] written for a slide without limits, because URDF requires one."""

NOT_IN_URDF = ("stiffness", "armature", "drag", "air")
"""Kinds of parameters of a joint that URDF has no place for."""

FIRM = {"solreffriction": "0.002 1", "solimpfriction": "0.999 0.9999 0.001"}
"""What makes MuJoCo's friction loss turn where the rate does: by default it does so 10 ms ahead, and lets a
joint that it holds creep at degrees a second. The first is twice its step [s], the least that it takes."""

MASSLESS = 1e-12
"""Mass [kg] and inertia [kg m^2] of a URDF link between two joints of one body; zero would be refused."""


@dataclass(frozen=True, eq=False)
class _Look:
    """A visible geom at the current values, in its link's frame; z counts from the plane of its body."""

    kind: str
    middle: np.ndarray
    direction: np.ndarray
    along: float
    across: float
    deep: float
    points: np.ndarray


def write_mjcf(mechanism: Mechanism, path: str | Path) -> None:
    """Write the mechanism as an MJCF file.

    The motion in MuJoCo is that of ``simulate`` except where friction loss holds a joint: there each creeps
    in its own way, neither visibly; and except for the drag of the air on links, which MJCF has no place for:
    it stands in custom numerics, that MuJoCo does not look at, and a comment says so. Torques over
    time are not in the file: each joint of a driven mechanism has a motor, whose control is the torque [N m
    or N].

    Args:
        mechanism: The mechanism.
        path: File to write.
    """
    root = ET.Element("mujoco", model=mechanism.name)
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    gravity = mechanism.tree.gravity
    ET.SubElement(
        root, "option", gravity=_numbers(gravity[0], 0, gravity[1]), integrator="RK4", timestep="0.001"
    )
    default = ET.SubElement(root, "default")
    ET.SubElement(default, "geom", contype="0", conaffinity="0")
    if np.any(mechanism.tree.links[:, FRICTION]):
        ET.SubElement(default, "joint", FIRM)
    asset = ET.Element("asset")
    world = ET.Element("worldbody")
    places = {-1: world}
    for group in _groups(mechanism):
        body = _mjcf_body(mechanism, group, places[int(mechanism.tree.parent[group[0]])])
        places[group[-1]] = body
        for look in _looks(mechanism, group[-1]):
            _mjcf_geom(look, body, asset)
        _mjcf_sites(mechanism, group[-1], body)
    _mjcf_air(mechanism, root)
    if len(asset):
        root.append(asset)
    root.append(world)
    if mechanism.torque != "friction":
        actuator = ET.SubElement(root, "actuator")
        for joint in mechanism.joints:
            ET.SubElement(actuator, "motor", name=f"{joint.name}_torque", joint=joint.name, gear="1")
    _save(root, path)


def _mjcf_air(mechanism: Mechanism, root: ET.Element) -> None:
    """Add the drag of the air on the links, as numbers."""
    stated = [
        (joint.name, c) for joint, c in zip(mechanism.joints, mechanism.tree.links[:, AIR], strict=True) if c
    ]
    if stated:
        root.append(ET.Comment(" not simulated by MuJoCo: the drag of the air on links, -c |z| z "))
        custom = ET.SubElement(root, "custom")
        for name, c in stated:
            ET.SubElement(custom, "numeric", name=f"{name}.air", data=_numbers(c))


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


def _depth(mechanism: Mechanism, link: int) -> float:
    """Return the z of a link's body [m]."""
    return float(mechanism.plan.depths[link] @ np.append(mechanism.plan_numbers, 1.0)) if link >= 0 else 0.0


def _mjcf_body(mechanism: Mechanism, group: list[int], parent: ET.Element) -> ET.Element:
    """Add a body with its joints and inertial."""
    tree = mechanism.tree
    links = tree.links
    first, last = group[0], group[-1]
    angle = float(links[first, ANGLE])
    # MuJoCo's body has one frame for all of its joints, ours has a link for each: the body stands where the
    # last joint is at zero, and the others are placed backwards from there.
    anchors = links[group][:, [ANCHOR_X, ANCHOR_Y]]
    rest = anchors[1:].sum(axis=0)
    x, y = anchors[0] + _turned(rest, angle)
    z = _depth(mechanism, last) - _depth(mechanism, int(tree.parent[first]))
    body = ET.SubElement(parent, "body", name=mechanism.joints[last].body, pos=_numbers(x, -z, y))
    if angle:
        body.set("quat", _quaternion(angle))
    for k, i in enumerate(group):
        joint, row = mechanism.joints[i], links[i]
        back = -anchors[k + 1 :].sum(axis=0)
        element = ET.SubElement(
            body, "joint", name=joint.name, type=joint.kind, axis=_axis(tree.kind[i], row)
        )
        if np.any(back):
            element.set("pos", _numbers(back[0], 0, back[1]))
        columns = {"damping": DAMPING, "frictionloss": FRICTION, "stiffness": STIFFNESS, "armature": ARMATURE}
        for name, column in columns.items():
            if name == "damping" and row[DRAG]:
                # MuJoCo's damping is -(b + b1 |v| + ...) v: its second number is the drag
                element.set(name, _numbers(row[DAMPING], row[DRAG]))
            elif row[column]:
                element.set(name, _numbers(row[column]))
        if row[REST]:
            element.set("springref", _numbers(row[REST]))
        if joint.lower > -math.inf or joint.upper < math.inf:
            element.set("range", _numbers(joint.lower, joint.upper))
    row = links[last]
    ET.SubElement(
        body, "inertial", pos=_numbers(row[COM_X], 0, row[COM_Y]), mass=_numbers(row[MASS]),
        diaginertia=_numbers(*[row[INERTIA]] * 3),
    )  # fmt: skip
    return body


def _mjcf_geom(look: _Look, body: ET.Element, asset: ET.Element) -> None:
    """Add a geom, and its mesh if it is one."""
    if look.kind == "mesh":
        name = f"shape{len(asset)}"
        ET.SubElement(asset, "mesh", name=name, vertex=_numbers(*_world(look.points).ravel()))
        ET.SubElement(body, "geom", type="mesh", mesh=name)
        return
    middle = _world(look.middle)
    if look.kind == "sphere":
        ET.SubElement(body, "geom", type="sphere", size=_numbers(look.across / 2), pos=_numbers(*middle))
    elif look.kind in ("capsule", "cylinder"):
        half = _world(np.array([*(look.along * look.direction), look.deep])) / 2
        ends = _numbers(*(middle - half), *(middle + half))
        ET.SubElement(body, "geom", type=look.kind, size=_numbers(look.across / 2), fromto=ends)
    else:
        geom = ET.SubElement(
            body, "geom", type=look.kind, size=_numbers(look.along / 2, look.deep / 2, look.across / 2),
            pos=_numbers(*middle),
        )  # fmt: skip
        angle = math.atan2(look.direction[1], look.direction[0])
        if angle:
            geom.set("quat", _quaternion(angle))


def _mjcf_sites(mechanism: Mechanism, link: int, body: ET.Element) -> None:
    """Add the sites of a link, which grow with its length."""
    part, table = mechanism.plan.links[link], mechanism.plan.table
    length = f"{part.joint.body}.length"
    grown = mechanism.values[length] / table.start[mechanism.row(length)] if length in table.names else 1.0
    for site in part.sites:
        place = _world(np.array([[*site.place, site.ahead]]) * grown)[0]
        ET.SubElement(body, "site", name=site.name, pos=_numbers(*place))


def _looks(mechanism: Mechanism, link: int) -> list[_Look]:
    """Return the visible geoms of a link at the current values."""
    plan, shapes = mechanism.plan, mechanism.shapes
    depth = np.array([0.0, 0.0, _depth(mechanism, link)])
    looks = []
    for g, solid in enumerate(plan.drawn):
        if plan.shape_link[g] == link:
            points = shapes.points[shapes.first[g] : shapes.first[g + 1]] - depth
            looks.append(_look(mechanism, solid, points, depth))
    return looks


def _look(mechanism: Mechanism, solid: Solid, points: np.ndarray, depth: np.ndarray) -> _Look:
    """Return a visible geom at the current values."""
    assert solid.look is not None
    middle = np.array([_value(mechanism, form) for form in solid.look.middle]) - depth
    along, across, deep = (_value(mechanism, form) for form in (solid.along, solid.across, solid.deep))
    direction = solid.look.direction
    if solid.turn:
        row = mechanism.plan.index[solid.turn]
        direction = _turned(direction, mechanism.plan_numbers[row] - mechanism.plan.table.start[row])
    return _Look(solid.look.kind, middle, direction, along, across, deep, points)


def _value(mechanism: Mechanism, form: Form) -> float:
    """Return a form at the current values."""
    index = mechanism.plan.index
    return sum(
        factor * (float(mechanism.plan_numbers[index[name]]) if name else 1.0)
        for name, factor in form.items()
    )


def write_urdf(mechanism: Mechanism, path: str | Path) -> None:
    """Write the mechanism as a URDF file.

    URDF has no place for the kinds ``NOT_IN_URDF``: where the mechanism has them, a comment in the file
    names what is missing, and the motion differs. Gravity is written in the ``<mujoco>`` element, which other
    readers ignore. Ellipsoids and meshes are shown as boxes of their extents. A slide without limits is
    given limits of 1000 m.

    Args:
        mechanism: The mechanism.
        path: File to write.
    """
    root = ET.Element("robot", name=mechanism.name)
    extra = ET.SubElement(root, "mujoco")
    gravity = mechanism.tree.gravity
    ET.SubElement(extra, "compiler", angle="radian", discardvisual="false", fusestatic="false")
    ET.SubElement(
        extra, "option", gravity=_numbers(gravity[0], 0, gravity[1]), integrator="RK4", timestep="0.001"
    )
    names = _link_names(mechanism)
    ET.SubElement(root, "link", name=names[-1])
    for i in range(len(mechanism.joints)):
        _urdf_link(mechanism, i, names[i], root)
    for i in range(len(mechanism.joints)):
        _urdf_joint(mechanism, i, names, root)
    _save(root, path)


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


def _urdf_link(mechanism: Mechanism, i: int, name: str, root: ET.Element) -> None:
    """Add a link with inertial and visuals."""
    element = ET.SubElement(root, "link", name=name)
    row = mechanism.tree.links[i]
    carries = mechanism.plan.links[i].carries
    inertial = ET.SubElement(element, "inertial")
    ET.SubElement(inertial, "origin", xyz=_numbers(row[COM_X], 0, row[COM_Y]))
    ET.SubElement(inertial, "mass", value=_numbers(row[MASS] if carries else MASSLESS))
    about = _numbers(row[INERTIA] if carries else MASSLESS)
    ET.SubElement(inertial, "inertia", ixx=about, iyy=about, izz=about, ixy="0", ixz="0", iyz="0")
    if carries:
        for look in _looks(mechanism, i):
            _urdf_visual(look, element)


def _urdf_visual(look: _Look, link: ET.Element) -> None:
    """Add the visuals of one geom."""
    middle = _world(look.middle)
    tilt = -math.atan2(look.direction[1], look.direction[0])
    if look.kind == "sphere":
        ET.SubElement(_visual(link, middle), "sphere", radius=_numbers(look.across / 2))
    elif look.kind in ("capsule", "cylinder"):
        axis = _world(np.array([*(look.along * look.direction), look.deep]))
        length = float(np.linalg.norm(axis))
        # the roll and pitch that turn URDF's cylinder axis, z, into the axis
        x, y, z = axis / length
        turn = (math.asin(max(-1.0, min(1.0, -y))), math.atan2(x, z), 0.0)
        ET.SubElement(
            _visual(link, middle, turn), "cylinder", radius=_numbers(look.across / 2), length=_numbers(length)
        )
        if look.kind == "capsule":
            for end in (middle - axis / 2, middle + axis / 2):
                ET.SubElement(_visual(link, end), "sphere", radius=_numbers(look.across / 2))
    else:
        if look.kind != "box":
            link.append(ET.Comment(f" {look.kind}, shown as the box of its extents "))
        ET.SubElement(
            _visual(link, middle, (0.0, tilt, 0.0)), "box", size=_numbers(look.along, look.deep, look.across)
        )


def _visual(
    link: ET.Element, place: np.ndarray, turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> ET.Element:
    """Add a visual and return its geometry element."""
    visual = ET.SubElement(link, "visual")
    ET.SubElement(visual, "origin", xyz=_numbers(*place), rpy=_numbers(*turn))
    return ET.SubElement(visual, "geometry")


def _urdf_joint(mechanism: Mechanism, i: int, names: dict[int, str], root: ET.Element) -> None:
    """Add a joint between a link and its parent."""
    tree, joint, row = mechanism.tree, mechanism.joints[i], mechanism.tree.links[i]
    parent = int(tree.parent[i])
    z = _depth(mechanism, i) - _depth(mechanism, parent)
    limited = joint.lower > -math.inf or joint.upper < math.inf
    kind = ("revolute" if limited else "continuous") if joint.kind == "hinge" else "prismatic"
    lost = [_lost(kind, joint, row) for kind in NOT_IN_URDF if row[JOINT[kind].column]]
    if lost:
        root.append(ET.Comment(f" not in URDF: {' and '.join(lost)} of the next joint "))
    element = ET.SubElement(root, "joint", name=joint.name, type=kind)
    ET.SubElement(
        element, "origin", xyz=_numbers(row[ANCHOR_X], -z, row[ANCHOR_Y]), rpy=_numbers(0, -row[ANGLE], 0)
    )
    ET.SubElement(element, "parent", link=names[parent])
    ET.SubElement(element, "child", link=names[i])
    ET.SubElement(element, "axis", xyz=_axis(tree.kind[i], row))
    if kind != "continuous":
        lower, upper = max(joint.lower, -FAR), min(joint.upper, FAR)
        ET.SubElement(
            element, "limit", lower=_numbers(lower), upper=_numbers(upper), effort="1000", velocity="1000"
        )
    ET.SubElement(element, "dynamics", damping=_numbers(row[DAMPING]), friction=_numbers(row[FRICTION]))


def _lost(kind: str, joint: Joint, row: np.ndarray) -> str:
    """Return what URDF cannot hold of a joint as text."""
    term, hinge = JOINT[kind], joint.kind == "hinge"
    about = f" about {row[REST]:g} {'rad' if hinge else 'm'}" if kind == "stiffness" and row[REST] else ""
    return f"{kind} {row[term.column]:g} {term.at_hinge if hinge else term.at_slide}{about}"


def _axis(kind: int, row: np.ndarray) -> str:
    """Return a joint's axis in the file's frame."""
    if kind == HINGE:
        return _numbers(0, -row[AXIS_X], 0)
    return _numbers(row[AXIS_X], 0, row[AXIS_Y])


def _world(points: np.ndarray) -> np.ndarray:
    """Return points of the plane frame in the file's frame (x, z toward up, y away from the camera)."""
    return np.stack([points[..., 0], -points[..., 2], points[..., 1]], axis=-1)


def _turned(vector: np.ndarray, angle: float) -> np.ndarray:
    """Return a vector turned counter-clockwise."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def _quaternion(angle: float) -> str:
    """Return the quaternion of a counter-clockwise turn in the plane, in the file's frame."""
    return _numbers(math.cos(angle / 2), 0, -math.sin(angle / 2), 0)


def _numbers(*values: float) -> str:
    """Return numbers with enough digits to read them back exactly."""
    return " ".join(repr(float(value) + 0.0) for value in values)


def _save(root: ET.Element, path: str | Path) -> None:
    """Write an XML file, indented."""
    ET.indent(root)
    Path(path).write_text(ET.tostring(root, encoding="unicode") + "\n", encoding="utf-8")
