"""Read a mechanism: MJCF or URDF through MuJoCo, laid out in the plane of its motion."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from monodyn.errors import MechanismError
from monodyn.mechanism.bundled import BUNDLED, bundled
from monodyn.mechanism.files import read_mechanism
from monodyn.mechanism.model import Mechanism, assemble
from monodyn.mechanism.parts import Geom, Given, Joint, Link
from monodyn.mechanism.plane import Plane, find_plane
from monodyn.mechanism.tree import INERTIA, MASS

WILD = 1e9
"""Largest number [SI] that a mechanism file may hold."""

RESERVED = ("time", "frame", "seen")
"""Columns of the tables of positions that no joint may be named after."""

KINDS = {2: "sphere", 3: "capsule", 4: "ellipsoid", 5: "cylinder", 6: "box", 7: "mesh"}


def load(source: str | Path) -> Mechanism:
    """Read a mechanism from an MJCF or URDF file, or take a bundled one.

    Sizes, masses and frictions of the file are start values; a joint without damping starts at 1e-3 (N m
    s/rad or N s/m). Contacts, actuators and joint limits do not act in the dynamics.

    Args:
        source: Path of the file, or ``single``, ``double``, ``triple``, ``bob``, ``cartpole``, ``chain:N``.

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
        return _mechanism(found, False, {}, str(source))
    path = found or Path(source)
    if found is None and not path.exists():
        names = ", ".join(f"'{name}'" for name in BUNDLED)
        raise MechanismError(
            f"mechanism '{source}': expected an MJCF or URDF file or a bundled name, got no such file; "
            f"bundled names: {names}."
        )
    return _mechanism(*read_mechanism(path), path.name)


def _mechanism(text: str, urdf: bool, meshes: dict[str, bytes], where: str) -> Mechanism:
    """Compile the text with MuJoCo and lay the model out in its plane."""
    import importlib

    mujoco: Any = importlib.import_module("mujoco")
    try:
        with warnings.catch_warnings():
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
    return assemble(name.encode("utf-8", "replace").decode("utf-8"), *file.links())


class _File:
    """A compiled model while it is read."""

    def __init__(self, mujoco: Any, spec: Any, model: Any, where: str, urdf: bool) -> None:
        self.model, self.where, self.urdf = model, where, urdf
        self.data = mujoco.MjData(model)
        self.bodies = {body.id: body for body in spec.bodies}
        self.geoms = {geom.id: geom for body in spec.bodies for geom in body.geoms}
        self.from_geoms = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
        names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, b) for b in range(model.nbody)]
        self.body_names = [name or f"body{b}" for b, name in enumerate(names)]
        names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, j) for j in range(model.njnt)]
        self.joint_names = [name or f"joint{j + 1}" for j, name in enumerate(names)]
        self._refuse(mujoco)
        self._refuse_wild_numbers()
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
        frames: dict[int, tuple[np.ndarray, float]] = {-1: (np.zeros(2), 0.0)}
        for j in range(self.model.njnt):
            body = int(self.model.jnt_bodyid[j])
            above = int(self.model.body_weldid[self.model.body_parentid[body]])
            parent = last.get(body, last.get(above, -1))
            links.append(self._link(j, body, above, parent, frames))
            last[body] = j
        self._compare(links)
        return links, self.plane.gravity

    def _link(self, j: int, body: int, above: int, parent: int, frames: dict[int, Any]) -> Link:
        """Return one joint's link and enter its frame."""
        model, plane = self.model, self.plane
        hinge = bool(plane.hinges[j])
        start, turn = frames[parent]
        angle = plane.angle(self.data.xmat[body].reshape(3, 3))
        angle = turn if angle is None else angle
        origin = plane.place(self.data.xanchor[j] if hinge else self.data.xpos[body])[:2]
        frames[j] = (origin, angle)
        carries = j + 1 == model.njnt or int(model.jnt_bodyid[j + 1]) != body
        axis = np.array([plane.signs[j], 0.0]) if hinge else _turned(plane.axes @ self.data.xaxis[j], -angle)
        height = float(plane.place(self.data.xpos[body])[2])
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
            anchor=_turned(origin - start, -turn),
            angle=float(np.arctan2(np.sin(angle - turn), np.cos(angle - turn))),
            axis=axis[:2],
            offset=height - below,
            geoms=self._geoms(body, origin, angle, height) if carries else (),
            givens=self._givens(body, origin, angle) if carries else (),
            damping=float(model.dof_damping[j]) if damper else 0.0,
            friction=float(model.dof_frictionloss[j]) if friction else 0.0,
            stiffness=float(model.jnt_stiffness[j]) if spring else 0.0,
            rest=float(model.qpos_spring[j]),
            armature=float(model.dof_armature[j]),
        )

    def _welded(self, body: int) -> list[int]:
        """Return the bodies that move as one with a body, itself first."""
        return [b for b in range(1, self.model.nbody) if self.model.body_weldid[b] == body]

    def _explicit(self, body: int) -> bool:
        """True if the file states the inertia of a body."""
        return bool(self.bodies[body].explicitinertial) and not self.from_geoms

    def _geoms(self, body: int, origin: np.ndarray, angle: float, height: float) -> tuple[Geom, ...]:
        """Return the geoms that move with a body, in the frame of its link."""
        found = []
        for b in self._welded(body):
            first, count = int(self.model.body_geomadr[b]), int(self.model.body_geomnum[b])
            rows = list(range(first, first + count))
            looks = [g for g in rows if self.urdf and self.geoms[g].group == 1 and self.geoms[g].contype == 0]
            found += [self._geom(g, b, origin, angle, height, bool(looks)) for g in (looks or rows)]
        return tuple(found)

    def _geom(self, g: int, body: int, origin: np.ndarray, angle: float, height: float, look: bool) -> Geom:
        """Return one geom in the frame of its link; ``look`` if it is URDF geometry for looks."""
        model, given = self.model, self.geoms[g]
        kind = KINDS.get(int(model.geom_type[g]))
        name = given.name
        if kind is None:
            raise MechanismError(
                f"{self.where}: body '{self.body_names[body]}': expected geoms that are box, capsule, "
                f"cylinder, "
                f"sphere, ellipsoid or mesh, got type '{str(given.type).split('GEOM_')[-1].lower()}'; "
                f"replace it."
            )
        centre = self.plane.place(self.data.geom_xpos[g])
        axes = self.plane.axes @ self.data.geom_xmat[g].reshape(3, 3)
        turn = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
        vertices = np.zeros((0, 3))
        if kind == "mesh":
            mesh = int(model.geom_dataid[g])
            start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            vertices = _hull(np.array(model.mesh_vert[start : start + count], dtype=float))
        weighs = not self._explicit(body)
        density = 1000.0 if look else float(given.density)
        return Geom(
            body=self.body_names[body],
            name=name,
            kind=kind,
            centre=turn @ (centre - np.array([*origin, height])),
            axes=turn @ axes,
            size=np.array(model.geom_size[g]),
            vertices=vertices,
            drawn=True,
            density=density if weighs and np.isnan(given.mass) else None,
            mass=float(given.mass) if weighs and not np.isnan(given.mass) else None,
        )

    def _givens(self, body: int, origin: np.ndarray, angle: float) -> tuple[Given, ...]:
        """Return the inertials stated for a body and what is welded to it."""
        found = []
        for b in self._welded(body):
            if self._explicit(b) and self.model.body_mass[b] > 0:
                com, inertia = self._planar_inertial(b)
                found.append(
                    Given(
                        self.body_names[b],
                        float(self.model.body_mass[b]),
                        _turned(com - origin, -angle),
                        inertia,
                    )
                )
        return tuple(found)

    def _planar_inertial(self, body: int) -> tuple[np.ndarray, float]:
        """Return a body's centre of mass in the plane (2,) and its inertia about z [kg m^2] by MuJoCo."""
        axes = self.plane.axes[2] @ self.data.ximat[body].reshape(3, 3)
        return self.plane.place(self.data.xipos[body])[:2], float(axes**2 @ self.model.body_inertia[body])

    def _compare(self, links: list[Link]) -> None:
        """Raise if MuJoCo makes another mass or inertia of a body than its geoms say."""
        tree = assemble("", links, self.plane.gravity).tree
        for j, link in enumerate(links):
            body = int(self.model.jnt_bodyid[j])
            if not link.carries or self.urdf:
                continue
            mass = inertia = 0.0
            for b in self._welded(body):
                mass += float(self.model.body_mass[b])
            moment = sum(
                float(self.model.body_mass[b]) * self._planar_inertial(b)[0] for b in self._welded(body)
            )
            com = moment / mass
            for b in self._welded(body):
                place, own = self._planar_inertial(b)
                inertia += own + float(self.model.body_mass[b]) * float((place - com) @ (place - com))
            ours = tree.links[j, [MASS, INERTIA]]
            if not np.allclose(ours, (mass, inertia), rtol=1e-6, atol=0):
                raise MechanismError(
                    f"{self.where}: body '{link.joint.body}': expected the mass and inertia of solid convex "
                    f"geoms "
                    f"({ours[0]:.6g} kg, {ours[1]:.6g} kg m^2), got {mass:.6g} kg, {inertia:.6g} kg m^2 by "
                    f"the "
                    f"file's settings; state them with <inertial>."
                )

    def _refuse(self, mujoco: Any) -> None:
        """Raise for whatever the planar dynamics do not know."""
        model = self.model
        if model.njnt == 0:
            raise MechanismError(
                f"{self.where}: expected at least one joint, got none; add a hinge or a slide."
            )
        for name in self.joint_names:
            if name in RESERVED:
                raise MechanismError(
                    f"{self.where}: joint '{name}': expected a name other than {', '.join(RESERVED)}, which "
                    "are columns of the tables of positions; rename it."
                )
        for j, kind in enumerate(model.jnt_type):
            if kind not in (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)):
                free = "floating" if self.urdf else "free"
                got = free if kind == int(mujoco.mjtJoint.mjJNT_FREE) else "ball"
                raise MechanismError(
                    f"{self.where}: joint '{self.joint_names[j]}': expected a hinge or a slide, got a {got} "
                    f"joint; "
                    f"replace it."
                )
            bent = np.any(model.dof_dampingpoly[j]) or np.any(model.jnt_stiffnesspoly[j])
            if bent or np.any(model.jnt_springyield[j]):
                raise MechanismError(
                    f"{self.where}: joint '{self.joint_names[j]}': expected linear damping and stiffness, "
                    f"got "
                    f"higher terms; give one number each."
                )
        for b in range(model.nbody):
            if model.body_gravcomp[b]:
                raise MechanismError(
                    f"{self.where}: body '{self.body_names[b]}': gravity compensation is not supported; "
                    f"remove gravcomp."
                )
        if model.opt.density or model.opt.viscosity:
            raise MechanismError(
                f"{self.where}: option: forces of a surrounding fluid are not supported; remove density and "
                f"viscosity."
            )
        if model.neq or model.ntendon:
            raise MechanismError(
                f"{self.where}: closed loops and coupled joints are not supported; remove equality and "
                f"tendon."
            )

    def _refuse_wild_numbers(self) -> None:
        """Raise for numbers that no mechanism has and no arithmetic survives."""
        model = self.model
        groups = {
            "gravity": model.opt.gravity,
            "body positions": model.body_pos,
            "masses and inertias": np.concatenate([model.body_mass, model.body_inertia.ravel()]),
            "geom positions": model.geom_pos,
            "geom sizes": model.geom_size,
            "joint positions": model.jnt_pos,
            "joint references": np.concatenate([model.qpos0, model.qpos_spring]),
            "joint axes": model.jnt_axis,
            "damping, friction, stiffness or armature": np.concatenate(
                [model.dof_damping, model.dof_frictionloss, model.jnt_stiffness, model.dof_armature]
            ),
        }
        for what, numbers in groups.items():
            wild = ~(np.abs(np.asarray(numbers)) <= WILD)
            if wild.any():
                raise MechanismError(
                    f"{self.where}: {what}: expected numbers up to {WILD:g}, got "
                    f"{np.asarray(numbers)[wild][0]:g}; "
                    f"correct it."
                )
        for name, axis in zip(self.joint_names, model.jnt_axis, strict=True):
            if abs(float(axis @ axis) - 1) > 1e-6:
                raise MechanismError(
                    f"{self.where}: joint '{name}': expected an axis with a direction, got one without; "
                    f"correct it."
                )
        if np.any(model.dof_damping < 0) or np.any(model.jnt_stiffness < 0):
            raise MechanismError(
                f"{self.where}: joints: expected damping and stiffness not below 0, got a negative one; "
                f"correct it."
            )


def _turned(vector: np.ndarray, angle: float) -> np.ndarray:
    """Return the first two components of a vector, turned."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def _hull(points: np.ndarray) -> np.ndarray:
    """Return the corners of the convex hull of points."""
    from scipy.spatial import ConvexHull

    return points[ConvexHull(points).vertices]
