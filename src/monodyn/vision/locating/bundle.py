"""Joint refinement of camera, sizes and poses over key frames, on the sub-pixel edges of their masks.

Least squares of the edge displacements along the outline's normals over all key frames. The poses are
eliminated frame by frame (Schur complement), so a step costs little more than the frames' edge searches.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.mechanism import Mechanism
from monodyn.mechanism.assemble import drawn_of_many
from monodyn.types import Camera
from monodyn.vision.drawing.camera import PARAMETERS, camera_array, shrunk
from monodyn.vision.drawing.edges import MATCHED_PX, Agreement, Shifts, edge_terms
from monodyn.vision.drawing.follow import EdgeSearch
from monodyn.vision.drawing.rig import Rig, rig_of
from monodyn.vision.drawing.shutter import Shutter
from monodyn.vision.foreground.masks import View
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.locating.thin import LEAST_WIDTH_PX
from monodyn.vision.locating.variables import SceneVariables, springs

NOISE_PX = 0.3
"""Standard deviation of an edge sample, systematic part included, as it is assumed before it is known
[px]."""
SYSTEMATIC_PX = 0.2
"""Standard deviation of a size that more frames do not reduce, as it is assumed where it is not measured: of
points of another tool, and before the refinement has ended [px]."""
SETTLED_STEP = 1e-5
"""Change of a logarithm, or of metres in the start scale, below which the refinement has settled."""
MOST_STEP = 0.35
"""Largest change of a variable or a joint in one step."""
HIDDEN_STEP = 0.005
"""Largest change in one step of a variable that the edges do not show: less than a pixel for most bodies."""
SETTLE = 10
"""Further steps, at most, after those in which edges are looked for ever nearer."""
SEARCH_DAMPING, SETTLE_DAMPING = 1e-3, 1e-5
"""Damping of the steps of variables that the frames share, over what each alone is known by. Turns, focal
length and distance change the pictures almost alike: with the first they go a tenth of their way, or less."""


@dataclass(frozen=True, eq=False)
class KeyMasks:
    """Masks of key frames, whole or reduced.

    Attributes:
        planes: The mask of each by colour, uint8 (colour, height, width).
        view: How the planes are to be read.
        shrink: Pixels of the camera per pixel of the masks.
        shutter: How each is exposed while the mechanism moves; None for pictures of one instant.
    """

    planes: Sequence[np.ndarray]
    view: View
    shrink: float = 1.0
    shutter: Shutter | None = None

    def only(self, rows: Sequence[int]) -> KeyMasks:
        """Return the masks of some of the key frames.

        Args:
            rows: Their rows.
        """
        moving = None if self.shutter is None else self.shutter.only(rows)
        return replace(self, planes=[self.planes[i] for i in rows], shutter=moving)


@dataclass(frozen=True, eq=False)
class Bundle:
    """A mechanism before a camera with poses in key frames.

    Attributes:
        mechanism: Sizes in the start scale.
        camera: The camera.
        positions: Joint positions, (key frame, dof).
        variables: The parameters that were refined.
        information: Information matrix of these (sizes and depth as logarithms), poses eliminated, with what
            is assumed of the camera, without the weak start values, (param, param).
        rms_px: Root mean square of the edge displacements of each key frame [px], (key frame,).
        matched: Share of outline samples on an edge, (key frame,).
        inside: Mean coverage inside of the outline, (key frame,).
        samples: Outline samples at which an edge could be looked for, (key frame,).
        systematic_px: Standard deviation of a size that more key frames do not reduce [px].
        sway_px: Standard deviation of the place of the whole mechanism in a key frame, next to its pose [px].
        alternatives: Changes of the variables, by name, that the pictures allow as well: if a body ends
            otherwise, the camera looks squarely, or light was mixed before it was coded.
        unsettled: By how much the edges would still move each variable, (param,): what shows only where it
            stands too far out is drawn back until it no longer shows. Empty counts as nothing.
    """

    mechanism: Mechanism
    camera: Camera
    positions: np.ndarray
    variables: SceneVariables
    information: np.ndarray
    rms_px: np.ndarray
    matched: np.ndarray
    inside: np.ndarray
    samples: np.ndarray = field(default_factory=lambda: np.zeros(0))
    systematic_px: float = SYSTEMATIC_PX
    sway_px: float = 0.0
    alternatives: tuple[Mapping[str, float], ...] = ()
    unsettled: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def agreement(self) -> float:
        """Mean share of outline samples on an edge, each counting less the further off it is."""
        return float(np.mean(self.matched * (1.0 - (self.rms_px / MATCHED_PX) ** 2)))


def spread(bundle: Bundle, other: Bundle) -> dict[str, float]:
    """Return standard deviations of the variables, by name, where another refinement is as likely.

    Args:
        bundle: The one that is taken.
        other: The other one.
    """
    here, there = (
        dict(zip(one.variables.names, one.variables.read(one.mechanism, one.camera).tolist(), strict=True))
        for one in (bundle, other)
    )
    # of two values that are as likely either one is off by their distance half of the time
    return {name: (there[name] - value) * 0.5**0.5 for name, value in here.items() if name in there}


def refine(
    masks: KeyMasks, guess: SceneGuess, variables: SceneVariables, search: EdgeSearch, *, settle: int = 0
) -> Bundle:
    """Refine camera, sizes and poses together.

    Args:
        masks: Masks of the key frames.
        guess: Where to start; its poses are those of the key frames.
        variables: What is refined in addition to the poses.
        search: How the edges are looked for; one iteration for each search length.
        settle: Most further iterations with the last search length, less damped, until nothing changes.

    Returns:
        The refined bundle.
    """
    mechanism, camera = guess.mechanism, guess.camera
    x = variables.read(mechanism, camera)
    q = np.array(guess.positions, dtype=np.float64)
    wide = np.array([kind == "width" for kind in variables.kinds], dtype=bool)
    creeps, leapt = variables.creeps, np.zeros(len(x))
    last = float(search.reaches[-1])
    steps = [(float(reach), SEARCH_DAMPING) for reach in search.reaches] + [(last, SETTLE_DAMPING)] * settle
    for reach, damping in steps:
        mechanism, camera = variables.write(x, mechanism, camera)
        rig, shifts = shifted_rigs(variables, x, mechanism, camera, masks.shrink)
        terms = _normal_equations(masks, rig, shifts, q, (reach, search.spacing))
        step, q_step, hidden = _step(terms, x, creeps, damping, *springs(variables, x))
        # what leapt to its spring and is drawn back by the edges that it shows there leaps no more
        creeps = creeps | (~hidden & (step * leapt < 0.0))
        leapt = np.where(hidden, step, 0.0)
        x = x + step
        x[wide] = np.maximum(x[wide], np.log(LEAST_WIDTH_PX * camera.depth / camera.focal))
        q = q + q_step
        if (reach, damping) == steps[-1] and len(x) and np.abs(step).max() < SETTLED_STEP:
            break
    mechanism, camera = variables.write(x, mechanism, camera)
    rig, shifts = shifted_rigs(variables, x, mechanism, camera, masks.shrink)
    final = _normal_equations(masks, rig, shifts, q, (last, search.spacing))
    matched, rms, inside, samples = (
        np.array([getattr(found, name) for found in final.agreement])
        for name in ("matched", "rms_px", "inside", "samples")
    )
    information = _information(final) + np.diag(variables.assumed)
    unsettled, _, _ = _step(final, x, creeps, SETTLE_DAMPING, *springs(variables, x))
    return Bundle(
        mechanism, camera, q, variables, information, rms, matched, inside, samples, unsettled=unsettled
    )


@dataclass(frozen=True, eq=False)
class _Terms:
    """Normal equations of every key frame: blocks of poses (q) and shared parameters (x).

    ``qq`` (key frame, dof, dof), ``qx`` (key frame, dof, param), ``xx`` (key frame, param, param), right
    sides ``q`` (key frame, dof) and ``x`` (key frame, param), and how well the outlines lie on the masks.
    """

    qq: np.ndarray
    qx: np.ndarray
    xx: np.ndarray
    q: np.ndarray
    x: np.ndarray
    agreement: list[Agreement]


def shifted_rigs(
    variables: SceneVariables, x: np.ndarray, mechanism: Mechanism, camera: Camera, shrink: float
) -> tuple[Rig, Shifts]:
    """Return the rig of the mechanism before the camera, and with each variable shifted by its step.

    Args:
        variables: The variables.
        x: Their values, (param,).
        mechanism: The mechanism with these.
        camera: The camera with these.
        shrink: Pixels of the camera per pixel of the masks.

    Returns:
        The rig, and the shifted ones.
    """
    rig = rig_of(mechanism, camera, shrink=shrink)
    steps = np.where(variables.log, 1e-6, 1e-7)
    shifted = x + np.diag(steps)
    rows, values = variables.values_at(shifted, mechanism)
    numbers = np.tile(mechanism.numbers[: len(mechanism.plan.table.names)], (len(x), 1))
    numbers[:, rows] = values
    links, points, radius = drawn_of_many(mechanism.plan, numbers, mechanism.own)
    cameras = np.tile(rig.camera, (len(x), 1))
    for i, name in enumerate(variables.names):
        if name in PARAMETERS:
            cameras[i] = shrunk(camera_array(variables.camera_at(shifted[i], camera)), shrink)
    return rig, Shifts(links, points, radius, cameras, steps)


def _normal_equations(
    masks: KeyMasks, rig: Rig, shifts: Shifts, q: np.ndarray, search: tuple[float, float]
) -> _Terms:
    """Search the edges of every key frame and form its normal equations; ``search`` is reach and spacing."""
    rigs = [rig] * len(q) if masks.shutter is None else [masks.shutter.of(rig, k) for k in range(len(q))]
    blocks = on_all_cores(
        lambda frame: edge_terms(frame[0], masks.view, frame[2], shifts, frame[1], *search),
        zip(masks.planes, q, rigs, strict=True),
    )
    dofs = q.shape[1]
    normal = np.stack([block.normal for block in blocks])
    right = np.stack([block.right for block in blocks])
    poses, shared = slice(0, dofs), slice(dofs, None)
    return _Terms(
        qq=normal[:, poses, poses],
        qx=normal[:, poses, shared],
        xx=normal[:, shared, shared],
        q=right[:, poses],
        x=right[:, shared],
        agreement=[block.agreement for block in blocks],
    )


def _step(
    terms: _Terms, x: np.ndarray, creeps: np.ndarray, damping: float,
    anchor: np.ndarray, stiffness: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Solve the damped normal equations by eliminating the poses; last is True for what no edge shows."""
    weight = 1.0 / NOISE_PX**2
    # a key frame whose pose cannot be drawn, or that shows no edge, takes no part
    good = np.array([float(found.samples > 0) for found in terms.agreement])
    held = 1e-4 + 1e-3 * np.einsum("kii->ki", terms.qq)
    qq = terms.qq + np.einsum("ki,ij->kij", held, np.eye(terms.qq.shape[1]))
    # A pose appears in its own frame only, so the equations are an arrow: a block qq for each frame and one
    # common border. From the frame's own rows, q = qq^-1 (right_q - qx step). Inserted into the rows of the
    # shared parameters, and summed over the frames, this leaves
    # (xx - qx' qq^-1 qx) step = right_x - qx' qq^-1 right_q.
    inverse = np.linalg.inv(qq)
    gain = np.einsum("kij,kjx->kix", inverse, terms.qx)
    xx = np.einsum("k,kxy->xy", good, terms.xx - np.einsum("kix,kiy->kxy", terms.qx, gain))
    right = np.einsum("k,kx->x", good, terms.x - np.einsum("kix,ki->kx", gain, terms.q))
    # The springs act on this reduced system; the further damping is relative to its diagonal (Levenberg), so
    # that a direction which the frames do not show takes no large step.
    system = weight * xx + np.diag(stiffness)
    system += np.diag(damping * weight * np.maximum(np.diag(xx), 0.0) + 1e-9)
    step = np.linalg.solve(system, weight * right + stiffness * (anchor - x))
    # What no edge shows, such as an end inside of another geom, follows its spring a little at a time: else
    # it would leap out of there, be drawn back by the edges, and leap again.
    hidden = np.asarray(weight * np.diag(xx) < stiffness)
    slow = creeps & hidden
    step[slow] = np.clip(step[slow], -HIDDEN_STEP, HIDDEN_STEP)
    # the poses follow the step that is taken, so it is cut off before they are computed
    step = np.clip(step, -MOST_STEP, MOST_STEP)
    q_step = np.einsum("kij,kj->ki", inverse, terms.q - np.einsum("kix,x->ki", terms.qx, step))
    return step, np.clip(q_step, -MOST_STEP, MOST_STEP), hidden


def _information(terms: _Terms) -> np.ndarray:
    """Return the information of the shared parameters with the poses eliminated, without springs."""
    weight = 1.0 / NOISE_PX**2
    dofs = terms.qq.shape[1]
    inverse = np.linalg.inv(terms.qq + 1e-9 * np.eye(dofs))
    return weight * np.sum(terms.xx - np.einsum("kix,kij,kjy->kxy", terms.qx, inverse, terms.qx), axis=0)
