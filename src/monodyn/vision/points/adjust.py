"""Joint refinement of camera, sizes, places of marks and poses on tracked points: a robust bundle adjustment.

Least squares of the distances between marks and tracked points over all frames, the poses eliminated frame by
frame (Schur complement). A distance of several standard deviations counts for little (Geman and McClure); the
standard deviation of each mark is found from what remains.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.types import Camera
from monodyn.vision.drawing.camera import CAMERA_STD
from monodyn.vision.locating.bundle import Bundle
from monodyn.vision.locating.variables import LOG_CAMERA, LOG_STD, OFFSET_STD, PLACE_STD, SceneVariables
from monodyn.vision.points.shown import SHIFT_PX, STEP, Places, Shown, pose_slopes, project, shown_by

REDESCENDS = 3.0
"""Distance from which a point counts for less and less, in standard deviations."""
OUTSIDE = 4.0
"""Distance from which a point is none of the mechanism's, in standard deviations."""
LEAST_NOISE_PX = 0.02
"""Least standard deviation of a tracked point [px]."""
MOST_ROUNDS = 40
"""Most steps of a refinement."""
SETTLED = 3e-5
"""Change of every unknown below which a refinement has settled."""
MOST = 0.9
"""Share of the poses that have to settle."""
CALM = 0.02
"""Relative change of every standard deviation below which a refinement has settled."""
MOST_STEP = 0.5
"""Largest change of an unknown in a step."""
HINGE_STD = 0.03
"""Standard deviation of a site from the hinge that it marks, as a share of the length of its body."""
LEAST_SHOWN = 1e-8
"""Share of all information on the shared unknowns below which the common scale is not shown."""
LOOSE = 1e-4
"""Share of the largest information with which a pose is held where nothing shows it."""


@dataclass(frozen=True, eq=False)
class Seen:
    """Tracked points of the marks.

    Attributes:
        px: Columns and rows [px], (frame, point, 2); NaN where not found.
        weight: How much each counts, 0 to 1, (frame, point).
    """

    px: np.ndarray
    weight: np.ndarray


@dataclass(frozen=True, eq=False)
class Fitted:
    """A mechanism with marks before a camera, and its poses in all frames.

    Attributes:
        mechanism: With its sizes.
        camera: The camera.
        own: Places of the free marks as ratios to their bodies' lengths, (point, 2).
        position: Joint positions [rad or m], and shifts of the picture where the camera moves, (frame, dof).
        noise: Standard deviation of each mark's points [px], (point,).
        information: Information matrix of the variables of the scene, all else eliminated, with what is
            assumed of the camera, (param, param).
    """

    mechanism: Mechanism
    camera: Camera
    own: np.ndarray
    position: np.ndarray
    noise: np.ndarray
    information: np.ndarray


@dataclass(frozen=True, eq=False)
class Adjustment:
    """What is refined.

    Attributes:
        places: The marks.
        variables: Sizes and camera parameters that are refined.
        jitter: Standard deviation of the shift of the picture from frame to frame [px]; 0 where the camera
            stands still. The shifts are two further columns of the poses.
    """

    places: Places
    variables: SceneVariables
    jitter: float = 0.0

    @property
    def hold(self) -> np.ndarray:
        """Information on each column of the poses before any point is seen, (dof,)."""
        dofs = len(self.places.start.joints)
        shift = [(SHIFT_PX / self.jitter) ** 2] * 2 if self.jitter > 0.0 else []
        return np.array([*np.zeros(dofs), *shift])

    def shown(self, fitted: Fitted) -> Shown:
        """Return the arrays of a mechanism before a camera.

        Args:
            fitted: Both.
        """
        return shown_by(self.places, fitted.mechanism, fitted.camera, fitted.own)

    def read(self, fitted: Fitted) -> np.ndarray:
        """Return the shared unknowns as one vector, (param,).

        Args:
            fitted: Where they stand.
        """
        return np.concatenate([self.variables.read(fitted.mechanism, fitted.camera), fitted.own.ravel()])

    def write(self, x: np.ndarray, fitted: Fitted) -> Fitted:
        """Return a mechanism before a camera with other shared unknowns.

        Args:
            x: The unknowns, (param,).
            fitted: What stays.
        """
        count = len(self.variables.names)
        mechanism, camera = self.variables.write(x[:count], fitted.mechanism, fitted.camera)
        return replace(fitted, mechanism=mechanism, camera=camera, own=x[count:].reshape(-1, 2))

    def scaling(self, fitted: Fitted) -> np.ndarray:
        """Return how the shared unknowns change as the mechanism, its distance and its place grow alike,
        (param,).

        Args:
            fitted: Where the unknowns stand.
        """
        x, variables = self.read(fitted), self.variables
        lengths = np.isin(variables.kinds, ("offset", "camera.x", "camera.y"))
        own = np.zeros(len(x) - len(variables.names))
        logs = variables.is_size | np.isin(variables.kinds, ("camera.depth",))
        return np.concatenate([np.where(logs, 1.0, np.where(lengths, x[: len(lengths)], 0.0)), own])

    def bundle(self, fitted: Fitted) -> Bundle:
        """Return a refined mechanism with what is known of it, in the form of a refinement on edges.

        Args:
            fitted: Where the refinement ended.
        """
        whole = np.ones(len(fitted.position))
        return Bundle(
            fitted.mechanism, fitted.camera, fitted.position, self.variables, fitted.information,
            whole, whole, whole,
        )  # fmt: skip

    def springs(self, fitted: Fitted) -> tuple[np.ndarray, np.ndarray]:
        """Return where weak springs hold the shared unknowns, and their stiffness, each (param,).

        Args:
            fitted: Where the unknowns stand.
        """
        variables, start = self.variables, self.variables.start
        anchor, stiffness = np.zeros(len(variables.names)), np.zeros(len(variables.names))
        for i, (name, kind) in enumerate(zip(variables.names, variables.kinds, strict=True)):
            if variables.is_size[i]:
                anchor[i], stiffness[i] = np.log(start[name]), 1.0 / LOG_STD**2
            elif variables.is_place[i]:
                size = variables.against[i]
                anchor[i], stiffness[i] = start[name] / (start[size] if size else 1.0), 1.0 / PLACE_STD**2
            elif kind == "offset":
                reach = abs(start[name]) + OFFSET_STD * variables.length + 1e-12
                anchor[i], stiffness[i] = start[name], 1.0 / reach**2
            elif name in CAMERA_STD:
                anchor[i] = np.log(variables.focal) if name in LOG_CAMERA else 0.0
                stiffness[i] = 1.0 / CAMERA_STD[name] ** 2
        # places of marks have no other anchor than where they stand: only the data move them; but what marks
        # a hinge is about there
        places, own, std = self.places, fitted.own.copy(), np.full(fitted.own.shape, PLACE_STD)
        for k in np.flatnonzero(places.hinged):
            own[k], std[k] = places.by_file(int(places.free[k])), HINGE_STD
        return np.concatenate([anchor, own.ravel()]), np.concatenate([stiffness, 1.0 / std.ravel() ** 2])


def refine(
    adjustment: Adjustment, fitted: Fitted, seen: Seen, *, rounds: int = MOST_ROUNDS, robust: bool = True
) -> Fitted:
    """Refine camera, sizes, places and poses together.

    Args:
        adjustment: What is refined.
        fitted: Where to start.
        seen: The tracked points.
        rounds: Most steps.
        robust: False where what lies outside has been left out already.

    Returns:
        The refined mechanism with its noise, and what is known of the scene.
    """
    terms = None
    noise, steps = fitted.noise, 0
    while steps < rounds:
        steps += 1
        shown = adjustment.shown(fitted)
        base = project(shown, fitted.position)
        weight = weights(seen, base, noise, robust=robust)
        terms = _terms(adjustment, fitted, seen, (base, weight / noise**2))
        step, q_step = _step(adjustment, fitted, terms)
        fitted = replace(
            adjustment.write(adjustment.read(fitted) + step, fitted), position=fitted.position + q_step
        )
        found = noise_of(adjustment, fitted, seen, noise, robust=robust)
        # a frame that its points hardly show may go on for ever, and decides nothing
        settled = max(np.abs(step).max(initial=0.0), float(np.quantile(np.abs(q_step), MOST))) < SETTLED
        calm = bool(np.all(np.abs(np.log(found / noise)) < CALM))
        noise = found
        if settled and calm:
            break
    information = np.zeros((0, 0)) if terms is None else _information(adjustment, fitted, terms)
    return replace(fitted, noise=noise, information=information)


def weights(seen: Seen, base: np.ndarray, noise: np.ndarray, *, robust: bool = True) -> np.ndarray:
    """Return how much each tracked point counts, (frame, point).

    Args:
        seen: The tracked points.
        base: Where the marks are [px], (frame, point, 2).
        noise: Standard deviation of each mark's points [px], (point,).
        robust: True lets distances of several standard deviations count for little.
    """
    off = np.sum((seen.px - base) ** 2, axis=2) / (2.0 * noise**2)
    known = np.where(np.isfinite(off), seen.weight, 0.0)
    return known / (1.0 + np.nan_to_num(off) / REDESCENDS**2) ** 2 if robust else known


def cost(seen: Seen, base: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Return the robust cost of each frame, (frame,): half the squared distances in standard deviations, each
    at most ``REDESCENDS`` squared.

    Args:
        seen: The tracked points.
        base: Where the marks are [px], (frame, point, 2).
        noise: Standard deviation of each mark's points [px], (point,).
    """
    off = np.sum((seen.px - base) ** 2, axis=2) / (2.0 * noise**2)
    known = np.where(np.isfinite(off), seen.weight, 0.0)
    off = np.where(np.isfinite(off), off, 1e12)
    return np.sum(known * off / (1.0 + off / REDESCENDS**2), axis=1)


@dataclass(frozen=True, eq=False)
class _Terms:
    """Normal equations: blocks of poses (q) and shared unknowns (x).

    ``qq`` (frame, dof, dof), ``qx`` (frame, dof, param), ``xx`` (param, param), right sides ``q`` (frame,
    dof) and ``x`` (param,).
    """

    qq: np.ndarray
    qx: np.ndarray
    xx: np.ndarray
    q: np.ndarray
    x: np.ndarray


def _terms(adjustment: Adjustment, fitted: Fitted, seen: Seen, at: tuple[np.ndarray, np.ndarray]) -> _Terms:
    """Form the normal equations; ``at`` is where the marks are (frame, point, 2), and the weights."""
    base, weight = at
    shown, x = adjustment.shown(fitted), adjustment.read(fitted)
    by_pose = pose_slopes(shown, fitted.position, base)
    by_shared = np.empty((*base.shape, len(x)))
    for i in range(len(x)):
        moved = x.copy()
        moved[i] += STEP
        other = adjustment.shown(adjustment.write(moved, fitted))
        by_shared[..., i] = (project(other, fitted.position) - base) / STEP
    off = np.nan_to_num(seen.px - base)
    known = weight > 0.0
    by_pose, by_shared = (np.where(known[..., None, None], table, 0.0) for table in (by_pose, by_shared))
    weighted = weight[..., None, None] * by_pose
    shared = weight[..., None, None] * by_shared
    hold = adjustment.hold
    return _Terms(
        qq=np.einsum("npci,npcj->nij", weighted, by_pose) + np.diag(hold),
        qx=np.einsum("npci,npcx->nix", weighted, by_shared),
        xx=np.einsum("npcx,npcy->xy", shared, by_shared),
        q=np.einsum("npci,npc->ni", weighted, off) - hold * fitted.position,
        x=np.einsum("npcx,npc->x", shared, off),
    )


def held(block: np.ndarray) -> np.ndarray:
    """Return the blocks of the poses with what nothing shows held where it is.

    Args:
        block: Information on the pose of each frame, (frame, dof, dof).

    Returns:
        Blocks that have an inverse, (frame, dof, dof).
    """
    usual = np.median(np.einsum("nii->ni", block), axis=0) + 1e-12
    return block + LOOSE * np.eye(len(usual)) * usual


def common_shifts(adjustment: Adjustment, fitted: Fitted, seen: Seen, off: np.ndarray) -> np.ndarray:
    """Return what the errors of camera, sizes and places of marks do to the poses of all frames together.

    Args:
        adjustment: What was refined, and what was held but is not known.
        fitted: Where it ended.
        seen: The points that lie on their marks; the others have no weight.
        off: How far the unknowns would go if none were held, (param,).

    Returns:
        One standard deviation along each independent direction, (direction, frame, dof).
    """
    base = project(adjustment.shown(fitted), fitted.position)
    terms = _terms(
        adjustment, fitted, seen, (base, weights(seen, base, fitted.noise, robust=False) / fitted.noise**2)
    )
    inverse = np.linalg.inv(held(terms.qq))
    known = terms.xx - np.einsum("nix,nij,njy->xy", terms.qx, inverse, terms.qx)
    known = known + np.diag(adjustment.springs(fitted)[1] + 1e-9)
    # the motion finds the common scale, to which the poses do not react
    scaling = adjustment.scaling(fitted)
    known = known + np.trace(known) / max(float(scaling @ scaling), 1e-12) * np.outer(scaling, scaling)
    values, vectors = np.linalg.eigh(np.linalg.inv(known) + np.outer(off, off))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return -np.einsum("nij,njx,xk->kni", inverse, terms.qx, root)


def _step(adjustment: Adjustment, fitted: Fitted, terms: _Terms) -> tuple[np.ndarray, np.ndarray]:
    """Solve the normal equations by eliminating the poses."""
    inverse = np.linalg.inv(held(terms.qq))
    anchor, stiffness = adjustment.springs(fitted)
    x = adjustment.read(fitted)
    cross = np.einsum("nix,nij->nxj", terms.qx, inverse)
    schur = terms.xx - np.einsum("nxj,njy->xy", cross, terms.qx) + np.diag(stiffness + 1e-9)
    right = terms.x - np.einsum("nxj,nj->x", cross, terms.q) + stiffness * (anchor - x)
    scaling = adjustment.scaling(fitted)
    if scaling @ (schur @ scaling) - scaling @ (stiffness * scaling) < LEAST_SHOWN * np.trace(schur):
        # Where no point shows the common scale, springs alone would move it, far and out of proportion: what
        # they hold in metres gains by a smaller mechanism. It stays.
        schur = schur + np.trace(schur) / max(float(scaling @ scaling), 1e-12) * np.outer(scaling, scaling)
    step = np.clip(np.linalg.solve(schur, right), -MOST_STEP, MOST_STEP)
    q_step = np.einsum("nij,nj->ni", inverse, terms.q - np.einsum("nix,x->ni", terms.qx, step))
    return step, np.clip(q_step, -MOST_STEP, MOST_STEP)


def _information(adjustment: Adjustment, fitted: Fitted, terms: _Terms) -> np.ndarray:
    """Return the information of the scene's variables, poses and places of marks eliminated."""
    inverse = np.linalg.inv(held(terms.qq))
    known = terms.xx - np.einsum("nix,nij,njy->xy", terms.qx, inverse, terms.qx)
    count = len(adjustment.variables.names)
    rest = known[count:, count:] + np.diag(adjustment.springs(fitted)[1][count:])
    cross = known[:count, count:]
    known = known[:count, :count] - (cross @ np.linalg.solve(rest, cross.T) if len(rest) else 0.0)
    return known + np.diag(adjustment.variables.assumed)


def noise_of(
    adjustment: Adjustment, fitted: Fitted, seen: Seen, noise: np.ndarray, *, robust: bool = True
) -> np.ndarray:
    """Find the standard deviation of each mark's points from what remains, by its share of the freedom.

    Args:
        adjustment: What was refined.
        fitted: The mechanism and its poses.
        seen: The tracked points.
        noise: The standard deviations so far [px], (point,).
        robust: True counts what lies outside for little.

    Returns:
        The standard deviations [px], (point,).
    """
    shown = adjustment.shown(fitted)
    base = project(shown, fitted.position)
    slopes = np.nan_to_num(pose_slopes(shown, fitted.position, base))
    weight = weights(seen, base, noise, robust=robust)
    block = np.einsum("npci,np,npcj->nij", slopes, weight / noise**2, slopes) + np.diag(adjustment.hold)
    inverse = np.linalg.inv(held(block))
    # of the two coordinates of a point this much is taken up by the pose itself
    taken = np.einsum("npci,nij,npcj->np", slopes, inverse, slopes) / noise**2
    off = np.nan_to_num(np.sum((seen.px - base) ** 2, axis=2))
    free = np.sum(weight * np.clip(2.0 - weight * taken, 0.0, 2.0), axis=0)
    squares = np.sum(weight * off, axis=0)
    total = np.sqrt(squares.sum() / max(free.sum(), 1e-9))
    # a mark that the poses follow wherever it is shows no noise of its own
    own = np.sqrt(squares / np.maximum(free, 1e-9))
    share = np.clip(free / np.maximum(0.2 * np.sum(2.0 * weight, axis=0), 1e-9), 0.0, 1.0)
    return np.maximum(share * own + (1.0 - share) * total, LEAST_NOISE_PX)
