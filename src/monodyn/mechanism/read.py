"""Read a mechanism: MJCF or URDF through MuJoCo, laid out in the plane of its motion."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from monodyn.choices import BUNDLED
from monodyn.errors import MechanismError
from monodyn.mechanism.assemble import links_of
from monodyn.mechanism.bundled import bundled
from monodyn.mechanism.files import read_mechanism
from monodyn.mechanism.hull import hull
from monodyn.mechanism.model import Mechanism
from monodyn.mechanism.parts import Geom, Given, Joint, Link, Site
from monodyn.mechanism.plan import OWNED_COLUMNS, OWNED_KINDS, make_plan
from monodyn.mechanism.plane import Plane, find_plane
from monodyn.mechanism.supported import refuse_one_axis, refuse_unsupported, stated
from monodyn.mechanism.torques import make_torques
from monodyn.mechanism.tree import INERTIA, MASS
from monodyn.mechanism.unlogged import unlogged
from monodyn.names import known, meant, near, near_files

GEOM_KINDS = {2: "sphere", 3: "capsule", 4: "ellipsoid", 5: "cylinder", 6: "box", 7: "mesh"}
"""Kinds of geoms by MuJoCo's number."""


def load(source: str | Path) -> Mechanism:
    """Read a mechanism from an MJCF or URDF file, or take a bundled one.

    Sizes, masses and frictions of the file are start values; a joint without damping starts at 1e-3 (N m
    s/rad or N s/m). Contacts, actuators and joint limits do not act in the dynamics.

    Args:
        source: Path of the file, or ``single``, ``double``, ``triple``, ``bob``, ``ball``, ``cartpole`` or
            ``chain:N``.

    Returns:
        The mechanism with the file's values as start.

    Raises:
        MechanismError: The file cannot be read, or holds something other than planar trees of hinges and
            slides.

    Example:
        >>> import monodyn.mechanism
        >>> [joint.name for joint in monodyn.mechanism.load("double").joints]
        ['joint1', 'joint2']
    """
    found = bundled(source) if isinstance(source, str) else None
    if isinstance(found, str):
        return replace(_mechanism(found, False, {}, str(source)), source=source)
    path = found or Path(source)
    if found is None and not path.exists():
        raise MechanismError(
            f"mechanism '{source}': expected an MJCF or URDF file or a bundled name, got no such file; "
            f"{meant(_near(path)) or known('bundled names', BUNDLED, str(source))}"
        )
    made = _mechanism(*read_mechanism(path), path.name)
    return replace(made, source=str(source if found else path.resolve()))


def _near(path: Path) -> list[str]:
    """Return the bundled names and the files that may have been meant by one that does not exist."""
    # of a chain the number is kept
    number = re.sub(r"\D", "", path.name)
    names = [name.replace("N", number or "N") for name in BUNDLED]
    return near(names, str(path)) or near_files(path, (".xml", ".urdf", ".mjcf"))


def _mechanism(text: str, urdf: bool, meshes: dict[str, bytes], where: str) -> Mechanism:
    """Compile the text with MuJoCo and lay the model out in its plane."""
    import importlib

    mujoco: Any = importlib.import_module("mujoco")
    try:
        with warnings.catch_warnings(), unlogged(mujoco):
            # MuJoCo's advice on its file format; whatever changes the motion is checked below.
            warnings.simplefilter("ignore")
            spec = mujoco.MjSpec.from_string(text, assets=meshes)
            spec.compiler.discardvisual = False
            spec.compiler.fusestatic = False
            model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())
        raise MechanismError(f"{where}: MuJoCo cannot read it ({reason}); correct the file.") from None
    file = _File(mujoco, spec, model, where, urdf)
    # "MuJoCo Model" is what MuJoCo calls a model without a name.
    name = Path(where).stem if spec.modelname in ("", "MuJoCo Model") else spec.modelname
    return assembled(name.encode("utf-8", "replace").decode("utf-8"), *file.links())


def assembled(name: str, links: list[Link], gravity: float) -> Mechanism:
    """Return a mechanism made of its parts.

    Args:
        name: Its name.
        links: Its links, parents first.
        gravity: Gravity in the plane, downward [m/s^2].
    """
    plan = make_plan(links, gravity)
    table = plan.table
    numbers, own = np.array(table.start), np.zeros(len(table.names), dtype=bool)
    lower, upper = np.array(table.lower), np.array(table.upper)
    columns = links_of(plan, numbers, own)
    for i, rows in enumerate(plan.owned):
        for row, column, what in zip(rows or (), OWNED_COLUMNS, OWNED_KINDS, strict=False):
            if table.follows[row]:
                numbers[row] = columns[i, column]
                if what in ("mass", "inertia"):
                    lower[row], upper[row] = 1e-6 * numbers[row], 1e6 * numbers[row]
    bodies = tuple(dict.fromkeys(link.joint.body for link in links))
    joints = tuple(link.joint for link in links)
    free = np.array(table.free, dtype=bool)
    return Mechanism(
        name=name, joints=joints, bodies=bodies, plan=plan, torques=make_torques(plan, "friction"),
        numbers=numbers, lower=lower, upper=upper, free=free, own=own,
    )  # fmt: skip


class _Frame(NamedTuple):
    """The frame of a link in the plane frame: origin [m] (2,), turn [rad], height of its body [m]."""

    origin: np.ndarray
    angle: float
    height: float


class _File:
    """A compiled model while it is read, with its joints at zero."""

    def __init__(self, mujoco: Any, spec: Any, model: Any, where: str, urdf: bool) -> None:
        self.mujoco, self.model, self.where, self.urdf = mujoco, model, where, urdf
        self.data = mujoco.MjData(model)
        self.bodies = {body.id: body for body in spec.bodies}
        self.geoms = {geom.id: geom for body in spec.bodies for geom in body.geoms}
        self.from_geoms = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
        names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, b) for b in range(model.nbody)]
        self.body_names = [name or f"body{b}" for b, name in enumerate(names)]
        names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, j) for j in range(model.njnt)]
        self.joint_names = [name or f"joint{j + 1}" for j, name in enumerate(names)]
        refuse_unsupported(model, where, self.joint_names, self.body_names)
        self.data.qpos[:] = 0.0
        mujoco.mj_kinematics(model, self.data)
        mujoco.mj_comPos(model, self.data)
        off = bool(model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY))
        gravity = np.zeros(3) if off else np.array(model.opt.gravity)
        hinges = np.array(model.jnt_type) == int(mujoco.mjtJoint.mjJNT_HINGE)
        self.plane: Plane = find_plane(where, self.joint_names, hinges, np.array(self.data.xaxis), gravity)
        self.switches = (
            not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_DAMPER),
            not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS),
            not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_SPRING),
        )

    def links(self) -> tuple[list[Link], float]:
        """Return the links in dof order and gravity in the plane [m/s^2]."""
        links: list[Link] = []
        last: dict[int, int] = {}
        frames = {-1: _Frame(np.zeros(2), 0.0, 0.0)}
        for j in range(self.model.njnt):
            body = int(self.model.jnt_bodyid[j])
            above = int(self.model.body_weldid[self.model.body_parentid[body]])
            # Joints of one body follow one another; the first of them hangs on the body above.
            parent = last.get(body, last.get(above, -1))
            frames[j] = self._frame(j, frames[parent])
            links.append(self._link(j, parent, frames[parent], frames[j]))
            last[body] = j
        refuse_one_axis(links, self.where)
        self._compare(links)
        return links, self.plane.gravity

    def _frame(self, j: int, parent: _Frame) -> _Frame:
        """Return the frame of one joint's link: at the joint, turned as its body is."""
        body, plane = int(self.model.jnt_bodyid[j]), self.plane
        angle = plane.angle(self.data.xmat[body].reshape(3, 3))
        # A body that is also tilted out of the plane has no angle in the plane; any constant one may be
        # chosen.
        angle = parent.angle if angle is None else angle
        place = self.data.xanchor[j] if plane.hinges[j] else self.data.xpos[body]
        return _Frame(plane.place(place)[:2], angle, float(plane.place(self.data.xpos[body])[2]))

    def _link(self, j: int, parent: int, start: _Frame, frame: _Frame) -> Link:
        """Return one joint's link, between the frame of its parent and its own."""
        model, plane = self.model, self.plane
        hinge, body = bool(plane.hinges[j]), int(model.jnt_bodyid[j])
        # Bodies without a joint move with their parent: heights count from the body that has the joint.
        above = int(model.body_weldid[model.body_parentid[body]])
        # Several joints of one body become a chain of links, of which the last alone has geoms and mass.
        carries = j + 1 == model.njnt or int(model.jnt_bodyid[j + 1]) != body
        # The kernels read one column pair by kind: the sign of a hinge's turn, or a slide's direction in
        # its link.
        axis = (
            np.array([plane.signs[j], 0.0])
            if hinge
            else _turned(plane.axes @ self.data.xaxis[j], -frame.angle)
        )
        below = float(plane.place(self.data.xpos[above])[2]) if above > 0 else 0.0
        limited = bool(model.jnt_limited[j])
        damper, friction, spring = self.switches
        return Link(
            joint=Joint(
                self.joint_names[j],
                self.body_names[body],
                "hinge" if hinge else "slide",
                float(model.jnt_range[j, 0]) if limited else -np.inf,
                float(model.jnt_range[j, 1]) if limited else np.inf,
                int(plane.signs[j]),
            ),
            parent=parent,
            carries=carries,
            anchor=_turned(frame.origin - start.origin, -start.angle),
            # a difference of two angles may exceed half a turn: it is brought back within one
            angle=float(np.arctan2(np.sin(frame.angle - start.angle), np.cos(frame.angle - start.angle))),
            axis=axis[:2],
            offset=frame.height - below,
            geoms=self._geoms(body, frame) if carries else (),
            givens=self._givens(body, frame) if carries else (),
            terms={
                # MuJoCo compiles what an option flag switches off too; switched off it does not act
                "damping": float(model.dof_damping[j]) if damper else 0.0,
                "friction": float(model.dof_frictionloss[j]) if friction else 0.0,
                "stiffness": float(model.jnt_stiffness[j]) if spring else 0.0,
                "rest": float(model.qpos_spring[j]),
                "armature": float(model.dof_armature[j]),
                "drag": float(model.dof_dampingpoly[j, 0]) if damper else 0.0,
                "air": float(stated(model, self.joint_names[j], "air")[0]),
                "lead": float(stated(model, self.joint_names[j], "lead")[0]),
            },
            sites=self._sites(body, frame) if carries else (),
        )

    def _welded(self, body: int) -> list[int]:
        """Return the bodies that move as one with a body, itself first."""
        return [b for b in range(1, self.model.nbody) if self.model.body_weldid[b] == body]

    def _explicit(self, body: int) -> bool:
        """True if the file states the inertia of a body."""
        return bool(self.bodies[body].explicitinertial) and not self.from_geoms

    def _geoms(self, body: int, frame: _Frame) -> tuple[Geom, ...]:
        """Return the geoms that move with a body, in the frame of its link."""
        found = []
        for b in self._welded(body):
            first, count = int(self.model.body_geomadr[b]), int(self.model.body_geomnum[b])
            rows = list(range(first, first + count))
            # MuJoCo keeps a URDF's visual geometry in group 1 without contacts; where there is any, the
            # collision geometry, which nobody sees, is left out.
            looks = [g for g in rows if self.urdf and self.geoms[g].group == 1 and self.geoms[g].contype == 0]
            found += [self._geom(g, b, frame, bool(looks)) for g in (looks or rows)]
        return tuple(found)

    def _geom(self, g: int, body: int, frame: _Frame, look: bool) -> Geom:
        """Return one geom in the frame of its link; ``look`` if it is URDF geometry for looks."""
        model, given = self.model, self.geoms[g]
        kind = GEOM_KINDS.get(int(model.geom_type[g]))
        name = given.name
        if kind is None:
            raise MechanismError(
                f"{self.where}: body '{self.body_names[body]}': expected geoms that are box, capsule, "
                f"cylinder, sphere, ellipsoid or mesh, got type "
                f"'{str(given.type).split('GEOM_')[-1].lower()}'; replace it."
            )
        centre = self.plane.place(self.data.geom_xpos[g])
        axes = self.plane.axes @ self.data.geom_xmat[g].reshape(3, 3)
        # From the plane's frame into the link's: the transpose of the link's turn, about the plane's normal.
        c, s = np.cos(frame.angle), np.sin(frame.angle)
        turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
        vertices = np.zeros((0, 3))
        if kind == "mesh":
            mesh = int(model.geom_dataid[g])
            start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            points = np.array(model.mesh_vert[start : start + count], dtype=float)
            vertices = points[np.unique(hull(points))]
        weighs = not self._explicit(body)
        # geometry for looks has no density of its own: MuJoCo's default stands in for it
        density = 1000.0 if look else float(given.density)
        return Geom(
            body=self.body_names[body],
            name=name,
            kind=kind,
            centre=turn @ (centre - np.array([*frame.origin, frame.height])),
            axes=turn @ axes,
            size=np.array(model.geom_size[g]),
            vertices=vertices,
            # MuJoCo shows no geom without opacity either
            drawn=float(model.geom_rgba[g, 3]) > 0.0,
            density=density if weighs and np.isnan(given.mass) else None,
            mass=float(given.mass) if weighs and not np.isnan(given.mass) else None,
        )

    def _sites(self, body: int, frame: _Frame) -> tuple[Site, ...]:
        """Return the named sites that move with a body, in the frame of its link."""
        model, found = self.model, []
        for s in np.flatnonzero(np.isin(model.site_bodyid, self._welded(body))):
            name = self.mujoco.mj_id2name(model, self.mujoco.mjtObj.mjOBJ_SITE, int(s))
            place = self.plane.place(self.data.site_xpos[s])
            if name:
                in_link = _turned(place[:2] - frame.origin, -frame.angle)
                found.append(Site(name, in_link, float(place[2]) - frame.height))
        return tuple(found)

    def _givens(self, body: int, frame: _Frame) -> tuple[Given, ...]:
        """Return the inertials stated for a body and what is welded to it."""
        found = []
        for b in self._welded(body):
            if self._explicit(b) and self.model.body_mass[b] > 0:
                com, inertia = self._planar_inertial(b)
                found.append(
                    Given(
                        self.body_names[b],
                        float(self.model.body_mass[b]),
                        _turned(com - frame.origin, -frame.angle),
                        inertia,
                    )
                )
        return tuple(found)

    def _planar_inertial(self, body: int) -> tuple[np.ndarray, float]:
        """Return a body's centre of mass in the plane (2,) and its inertia about z [kg m^2] by MuJoCo."""
        axes = self.plane.axes[2] @ self.data.ximat[body].reshape(3, 3)
        return self.plane.place(self.data.xipos[body])[:2], float(axes**2 @ self.model.body_inertia[body])

    def _whole(self, body: int) -> tuple[float, float]:
        """Return mass [kg] and inertia [kg m^2] by MuJoCo of a body and what is welded to it."""
        parts = [(float(self.model.body_mass[b]), *self._planar_inertial(b)) for b in self._welded(body)]
        mass = sum(m for m, _, _ in parts)
        com = sum(m * place for m, place, _ in parts) / mass
        return mass, sum(own + m * float((place - com) @ (place - com)) for m, place, own in parts)

    def _compare(self, links: list[Link]) -> None:
        """Raise if MuJoCo makes another mass or inertia of a body than its geoms have.

        Options such as ``settotalmass`` and ``shellinertia`` change what the geoms weigh, and a mesh that is
        not convex weighs less than its hull; the formulas of this room do not take them into account.
        """
        tree = assembled("", links, self.plane.gravity).tree
        for j, link in enumerate(links):
            body = int(self.model.jnt_bodyid[j])
            if not link.carries or self.urdf:
                continue
            mass, inertia = self._whole(body)
            ours = tree.links[j, [MASS, INERTIA]]
            if not np.allclose(ours, (mass, inertia), rtol=1e-6, atol=0):
                raise MechanismError(
                    f"{self.where}: body '{link.joint.body}': expected the mass and inertia of solid convex "
                    f"geoms ({ours[0]:.6g} kg, {ours[1]:.6g} kg m^2), got {mass:.6g} kg, {inertia:.6g} "
                    "kg m^2 by the file's settings; state them with <inertial>."
                )


def _turned(vector: np.ndarray, angle: float) -> np.ndarray:
    """Return the first two components of a vector, turned."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])
