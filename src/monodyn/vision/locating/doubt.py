"""What is not known of a scene, and what that does to the poses that are tracked in it.

Sizes and camera are held while the mechanism is followed. What they are wrong by moves the poses of all
frames together, which no number of frames averages out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.mechanism import Mechanism
from monodyn.types import Poses
from monodyn.vision.drawing.camera import PARAMETERS
from monodyn.vision.drawing.edges import Shifts
from monodyn.vision.drawing.gains import pose_gains
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.locating.bundle import Bundle, shifted_rigs
from monodyn.vision.locating.knowledge import covariance_of, shifted_turn
from monodyn.vision.locating.variables import springs

HARMONICS = (0, 1, 2)
"""How often an error of edges comes back while a link turns once: with the link's own shape, with the light
or the side from which it is seen, and with the pixels' rows and columns."""
SLIDING = ("camera.x", "camera.y")
"""Places that every frame has in common with all edges of the outline."""
AT_ONCE = 64
"""Poses whose derivatives are computed at a time, at most."""


@dataclass(frozen=True, eq=False)
class Doubt:
    """What is not known of a scene.

    Attributes:
        bundle: The refinement that the scene was taken from, in its own unit of length.
        root: One standard deviation of each independent direction in which its variables are not known,
            (param, direction).
        metre: The unit in the scene's own.
    """

    bundle: Bundle
    root: np.ndarray
    metre: float

    def with_shifts(self, poses: Poses, slides: np.ndarray) -> Poses:
        """Return poses that state what moves all of them together.

        Args:
            poses: Poses tracked in the scene.
            slides: True for slides, (dof,).
        """
        # what hides a joint does not make the others any surer: it is taken to be where it went meanwhile
        moved = self.shifts_at(_filled(poses), slides)
        return replace(poses, shifts=np.where(np.isfinite(poses.position), moved, 0.0))

    def shifts_at(self, position: np.ndarray, slides: np.ndarray) -> np.ndarray:
        """Return by how much poses are wrong if sizes and camera are, by one deviation of each direction.

        Args:
            position: Joint positions [rad; m in the start scale], (frame, dof).
            slides: True for slides, (dof,).

        Returns:
            What is added to the positions, (direction, frame, dof).
        """
        unit = np.where(slides, self.metre, 1.0)
        rig, shifts = self._turned
        parts = np.array_split(position * unit, -(-len(position) // AT_ONCE) or 1)
        gains = np.concatenate(on_all_cores(lambda part: pose_gains(rig, shifts, part), parts))
        moved = np.einsum("fdp,pk->kfd", gains, self.root) / unit
        return np.concatenate((moved, self._edges.at(position)))

    @cached_property
    def _edges(self) -> EdgeTurns:
        """What edges that are off everywhere do to the poses."""
        px = self.bundle.camera.focal / self.bundle.camera.depth
        return edge_turns(self.bundle.mechanism, self.bundle.systematic_px / px)

    @cached_property
    def _turned(self) -> tuple[Rig, Shifts]:
        """The mechanism before its camera, and the same with each variable shifted."""
        variables, mechanism, camera = self.bundle.variables, self.bundle.mechanism, self.bundle.camera
        return shifted_rigs(variables, variables.read(mechanism, camera), mechanism, camera, 1.0)


class EdgeTurns(NamedTuple):
    """How edges that are off turn links, wave by wave: each a harmonic of where a link points.

    Attributes:
        pointing: By how much each joint turns each link, (dof, dof).
        link: The link of each wave, int (direction,).
        harmonic: Its harmonic, (direction,).
        phase: 0 for its cosine, a quarter of a turn before that for its sine [rad], (direction,).
        turn: By how much it turns each joint, (direction, dof).
    """

    pointing: np.ndarray
    link: np.ndarray
    harmonic: np.ndarray
    phase: np.ndarray
    turn: np.ndarray

    def at(self, position: np.ndarray) -> np.ndarray:
        """Return by how much each wave turns the joints of some poses.

        Args:
            position: Joint positions [rad or m], finite, (frame, dof).

        Returns:
            The turns [rad], (direction, frame, dof); none at slides.
        """
        angle = position @ self.pointing.T
        wave = np.cos(self.harmonic * angle[:, self.link] - self.phase)
        return wave.T[:, :, np.newaxis] * self.turn[:, np.newaxis]


def edge_turns(mechanism: Mechanism, off: float) -> EdgeTurns:
    """Return what edges that are off do to poses, whatever the scene is.

    They are off in the same way whenever a link points in the same direction: its ends are, so that it seems
    to be turned, and the links on it the other way.

    Args:
        mechanism: The mechanism.
        off: Standard deviation of the place of an edge [m].

    Returns:
        Its waves, by one standard deviation each.
    """
    values, parents, joints = mechanism.values, mechanism.tree.parent.tolist(), mechanism.joints
    count = len(joints)
    pointing, inward = np.zeros((count, count)), []
    for i, joint in enumerate(joints):
        at = parents[i]
        if at >= 0:
            pointing[i] = pointing[at]
        pointing[i, i] = joint.sign * (joint.kind == "hinge")
        # the hinge that a link's angle counts from: slides between do not turn
        while at >= 0 and joints[at].kind != "hinge":
            at = parents[at]
        inward.append(at)
    waves: list[tuple[int, int, float]] = []
    turns: list[np.ndarray] = []
    for i, joint in enumerate(joints):
        length = values.get(f"{joint.body}.length", 0.0)
        if joint.kind != "hinge" or length <= 0.0:
            continue
        turn = np.zeros(count)
        turn[i] = joint.sign
        for k, child in enumerate(joints):
            if inward[k] == i and child.kind == "hinge":
                turn[k] = -child.sign
        turn *= np.sqrt(2.0 / len(HARMONICS)) * off / length
        for harmonic in HARMONICS:
            # what does not come back while a link turns is the same wherever it points
            for phase in (0.0, 0.5 * np.pi)[: 2 if harmonic else 1]:
                waves.append((i, harmonic, phase))
                turns.append(turn)
    link, harmonic, phase = np.array(waves).reshape(-1, 3).T
    return EdgeTurns(pointing, link.astype(np.int64), harmonic, phase, np.array(turns).reshape(-1, count))


def _filled(poses: Poses) -> np.ndarray:
    """Return joint positions (frame, dof), of those that were not seen between the frames in which they were,
    beyond these as in the nearest, and zero where a joint was never seen."""
    filled = np.zeros(poses.position.shape)
    for joint, path in enumerate(poses.position.T):
        known = np.isfinite(path)
        if known.any():
            filled[:, joint] = np.interp(poses.time, poses.time[known], path[known])
    return filled


def doubt_of(bundle: Bundle, known: Bundle, off: np.ndarray, metre: float, *, scale_free: bool) -> Doubt:
    """Return what is not known of a refined scene.

    Args:
        bundle: The refinement.
        known: The same with all that is not known among its variables.
        off: How far that one was from what is held, (param,).
        metre: The unit of the refinement in the scene's own.
        scale_free: True where nothing pins the common scale, which the motion will.

    Returns:
        Its directions.
    """
    variables, mechanism, camera = known.variables, bundle.mechanism, bundle.camera
    x = variables.read(mechanism, camera)
    held = np.where([name in PARAMETERS for name in variables.names], 0.0, springs(variables, x)[1])
    information = known.information + np.diag(held)
    covariance = covariance_of(information, variables.is_size, scale_free=scale_free)
    # what more key frames do not reduce: an edge that is shifted everywhere
    px = camera.focal / camera.depth
    values = mechanism.values
    for i, name in enumerate(variables.names):
        if variables.is_size[i] or variables.is_place[i]:
            size = values[variables.against[i] or name]
            covariance[i, i] += (bundle.systematic_px / max(size * px, 1e-9)) ** 2
        elif name in SLIDING:
            covariance[i, i] += (bundle.systematic_px / px) ** 2
        else:
            covariance[i, i] += shifted_turn(bundle, name) ** 2
    values, vectors = np.linalg.eigh(covariance + np.outer(off, off))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return Doubt(replace(bundle, variables=variables, unsettled=known.unsettled), root, metre)
