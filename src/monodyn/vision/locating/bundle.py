"""Joint refinement of camera, sizes and poses over key frames, on the sub-pixel edges of their masks.

Least squares of the edge displacements along the outline's normals over all key frames. The poses are
eliminated frame by frame (Schur complement), so a step costs little more than the frames' edge searches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monodyn.mechanism import Measured, Mechanism
from monodyn.types import Camera
from monodyn.vision.drawing.camera import PARAMETERS, value_of, with_values
from monodyn.vision.drawing.edges import edge_terms
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.foreground.palette import View

SIZES = (".length", ".width", ".tail", ".tip")
"""Sizes that a picture shows; they are refined as logarithms."""
NOISE_PX = 0.3
"""Standard deviation of an edge sample, systematic part included [px]."""
OFFSET_SPREAD = 0.02
"""Standard deviation of how far a body may stand before its parent, in mean lengths of the mechanism."""
LEAST_WIDTH_PX = 1.5
"""No width gets below this while it is refined: an outline without an inside has no edges to come back by
[px]."""
SETTLED = 1e-5
"""Change of a logarithm, or of metres in the start scale, below which the refinement has settled."""
SYSTEMATIC_PX = 0.2
"""Standard deviation of a size that more key frames do not better: blur, light and the codec shift edges
[px]."""
LOG_SPREAD = 1.0
"""Standard deviation of the logarithm of a start size: the file's sizes are only a start."""


@dataclass(frozen=True, eq=False)
class Bundle:
    """A mechanism before a camera with poses in key frames.

    Attributes:
        mechanism: Sizes in the start scale.
        camera: The camera.
        positions: Joint positions, (key frame, dof).
        names: Parameters that were refined.
        information: Information matrix of the refined parameters (sizes and depth as logarithms), poses
            eliminated, without the weak start values, (param, param).
        rms_px: Root mean square of the edge displacements of each key frame [px].
        matched: Share of outline samples within 1.5 px of an edge, by key frame.
        inside: Mean coverage inside of the outline, by key frame.
    """

    mechanism: Mechanism
    camera: Camera
    positions: np.ndarray
    names: tuple[str, ...]
    information: np.ndarray
    rms_px: np.ndarray
    matched: np.ndarray
    inside: np.ndarray


@dataclass(frozen=True, eq=False)
class _Variables:
    """The refined parameters as one vector: sizes and depths as logarithms, the rest as they are."""

    names: tuple[str, ...]
    log: np.ndarray

    def read(self, mechanism: Mechanism, camera: Camera) -> np.ndarray:
        values = mechanism.values
        x = np.array([value_of(camera, n) if n in PARAMETERS else values[n] for n in self.names])
        return np.where(self.log, np.log(np.where(self.log, np.maximum(x, 1e-12), 1.0)), x)

    def write(self, x: np.ndarray, mechanism: Mechanism, camera: Camera) -> tuple[Mechanism, Camera]:
        values = np.where(self.log, np.exp(np.where(self.log, x, 0.0)), x)
        pairs = dict(zip(self.names, values.tolist(), strict=True))
        seen = {n: v for n, v in pairs.items() if n in PARAMETERS}
        return mechanism.with_values({n: v for n, v in pairs.items() if n not in PARAMETERS}), with_values(
            camera, seen
        )


def refine(
    masks: Sequence[np.ndarray],
    view: View,
    mechanism: Mechanism,
    camera: Camera,
    positions: np.ndarray,
    names: Sequence[str],
    start: dict[str, float],
    *,
    reaches: Sequence[float],
    settle: int = 0,
    shrink: float = 1.0,
    spacing: float = 3.0,
) -> Bundle:
    """Refine camera, sizes and poses together.

    Args:
        masks: Masks of the key frames by colour, each uint8 (colour, height, width).
        view: How the planes of the masks are to be read.
        mechanism: Start sizes.
        camera: Start camera.
        positions: Start poses, (key frame, dof).
        names: Parameters to refine: sizes and ``camera.*``.
        start: Values of the mechanism file, to which a weak spring holds what the masks do not show.
        reaches: Search length along the normals of each iteration [px].
        settle: Most further iterations with the last search length, until nothing changes.
        shrink: Pixels of the camera per pixel of the masks.
        spacing: Distance between outline samples [px].

    Returns:
        The refined bundle.
    """
    variables = _Variables(
        tuple(names), np.array([n.endswith(SIZES) or n in LOG_CAMERA for n in names], dtype=bool)
    )
    x = variables.read(mechanism, camera)
    q = np.array(positions, dtype=np.float64)
    wide = np.array([name.endswith(".width") for name in names], dtype=bool)
    for reach in (*map(float, reaches), *[float(reaches[-1])] * settle):
        mechanism, camera = variables.write(x, mechanism, camera)
        terms = _terms(masks, view, variables, x, mechanism, camera, q, reach, shrink, spacing)
        step, q_step = _step(terms, x, *_springs(variables, x, start))
        x = x + step
        x[wide] = np.maximum(x[wide], np.log(LEAST_WIDTH_PX * camera.depth / camera.focal))
        q = q + q_step
        if reach == reaches[-1] and np.abs(step).max() < SETTLED:
            break
    mechanism, camera = variables.write(x, mechanism, camera)
    final = _terms(masks, view, variables, x, mechanism, camera, q, float(reaches[-1]), shrink, spacing)
    matched, rms, inside = final.facts[:, 1], final.facts[:, 2], final.facts[:, 3]
    return Bundle(mechanism, camera, q, tuple(names), _information(final), rms, matched, inside)


def size_information(bundle: Bundle, *, scale_free: bool) -> Measured:
    """Return what the key frames know of the sizes, camera and offsets eliminated.

    Args:
        bundle: A refined bundle.
        scale_free: True where nothing pins the common scale; then the information along it, which stems
            only from thicknesses and offsets held at their start, is taken out.

    Returns:
        Information matrix on the logarithms of the sizes.
    """
    sizes = [i for i, name in enumerate(bundle.names) if name.endswith(SIZES)]
    others = [i for i in range(len(bundle.names)) if i not in sizes]
    rest = bundle.information[np.ix_(others, others)] + 1e-9 * np.eye(len(others))
    cross = bundle.information[np.ix_(sizes, others)]
    known = bundle.information[np.ix_(sizes, sizes)] - cross @ np.linalg.solve(rest, cross.T)
    along = known.sum(axis=1)
    if scale_free and along.sum() > 1e-9 * np.trace(known):
        known = known - np.outer(along, along) / along.sum()
    names = tuple(bundle.names[i] for i in sizes)
    values = bundle.mechanism.values
    px = np.array([values[name] for name in names]) * bundle.camera.focal / bundle.camera.depth
    # (K^-1 + D)^-1 for a K that may be singular, D the variance that no number of frames takes away
    floor = np.diag((px / SYSTEMATIC_PX) ** 2)
    known = known - known @ np.linalg.solve(known + floor, known)
    return Measured(names, 0.5 * (known + known.T))


def camera_spread(bundle: Bundle, *, scale_free: bool) -> dict[str, float]:
    """Return the standard deviations of the refined camera parameters [m, rad, px].

    Args:
        bundle: A refined bundle.
        scale_free: True where nothing pins the common scale; then it is held, as for the mean size.
    """
    information = bundle.information + 1e-6 * np.eye(len(bundle.names))
    sizes = np.array([name.endswith(SIZES) for name in bundle.names], dtype=np.float64)
    if scale_free:
        information = information + 1e6 * np.trace(information) * np.outer(sizes, sizes) / max(
            sizes.sum(), 1.0
        )
    covariance = np.linalg.pinv(information, hermitian=True)
    spread = {}
    for i, name in enumerate(bundle.names):
        if name in PARAMETERS:
            unit = value_of(bundle.camera, name) if name in LOG_CAMERA else 1.0
            spread[name] = unit * float(np.sqrt(max(covariance[i, i], 0.0)))
    return spread


LOG_CAMERA = ("camera.depth", "camera.focal")


@dataclass(frozen=True, eq=False)
class _Terms:
    """Normal equations of every key frame: blocks of poses (q) and shared parameters (x)."""

    qq: np.ndarray
    qx: np.ndarray
    xx: np.ndarray
    q: np.ndarray
    x: np.ndarray
    facts: np.ndarray


def _springs(variables: _Variables, x: np.ndarray, start: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return where the weak springs pull the variables ``x`` and their stiffness (1 / variance).

    A length is held to its start; another size to its start proportion to the lengths.
    """
    names = variables.names
    anchor, stiffness = np.zeros(len(names)), np.zeros(len(names))
    grown = [x[i] - np.log(start[name]) for i, name in enumerate(names) if name.endswith(".length")]
    common = float(np.mean(grown)) if grown else 0.0
    reach = OFFSET_SPREAD * float(np.mean([v for n, v in start.items() if n.endswith(".length")] or [0.0]))
    for i, name in enumerate(names):
        if name.endswith(".length"):
            anchor[i], stiffness[i] = np.log(start[name]), 1.0 / LOG_SPREAD**2
        elif name.endswith(SIZES):
            spread = LOG_SPREAD if name.endswith(".width") else 0.5 * LOG_SPREAD
            anchor[i], stiffness[i] = np.log(start[name]) + common, 1.0 / spread**2
        elif name.endswith(".offset"):
            anchor[i], stiffness[i] = start[name], 1.0 / (abs(start[name]) + reach + 1e-12) ** 2
        elif name in ("camera.roll", "camera.pitch", "camera.yaw"):
            stiffness[i] = 1.0
    return anchor, stiffness


def _terms(
    masks: Sequence[np.ndarray],
    view: View,
    variables: _Variables,
    x: np.ndarray,
    mechanism: Mechanism,
    camera: Camera,
    q: np.ndarray,
    reach: float,
    shrink: float,
    spacing: float,
) -> _Terms:
    """Search the edges of every key frame and form its normal equations."""
    base = rig_of(mechanism, camera, shrink=shrink)
    rigs = [base]
    steps = np.where(variables.log, 1e-6, 1e-7)
    for i in range(len(x)):
        shifted = x.copy()
        shifted[i] += steps[i]
        rigs.append(rig_of(*variables.write(shifted, mechanism, camera), shrink=shrink))
    links, points, radius, cameras = (
        np.stack([getattr(rig, field) for rig in rigs]) for field in ("links", "points", "radius", "camera")
    )
    blocks = [
        edge_terms(
            planes, *view, base.parent, base.kind, base.link, base.first, links, points, radius,
            cameras, steps, pose, reach, spacing,
        )
        for planes, pose in zip(masks, q, strict=True)
    ]  # fmt: skip
    dofs = q.shape[1]
    normal = np.stack([block[0] for block in blocks])
    right = np.stack([block[1] for block in blocks])
    facts = np.stack([block[2] for block in blocks])
    return _Terms(
        normal[:, :dofs, :dofs], normal[:, :dofs, dofs:], normal[:, dofs:, dofs:], right[:, :dofs], right[:,
        dofs:], facts,
    )  # fmt: skip


def _step(
    terms: _Terms, x: np.ndarray, anchor: np.ndarray, stiffness: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Solve the damped normal equations by eliminating the poses."""
    weight = 1.0 / NOISE_PX**2
    good = (terms.facts[:, 0] > 0).astype(np.float64)
    damping = 1e-4 + 1e-3 * np.einsum("kii->ki", terms.qq)
    qq = terms.qq + np.einsum("ki,ij->kij", damping, np.eye(terms.qq.shape[1]))
    inverse = np.linalg.inv(qq)
    gain = np.einsum("kij,kjx->kix", inverse, terms.qx)
    xx = np.einsum("k,kxy->xy", good, terms.xx - np.einsum("kix,kiy->kxy", terms.qx, gain))
    right = np.einsum("k,kx->x", good, terms.x - np.einsum("kix,ki->kx", gain, terms.q))
    system = weight * xx + np.diag(stiffness)
    system += np.diag(1e-3 * weight * np.maximum(np.diag(xx), 0.0) + 1e-9)
    step = np.linalg.solve(system, weight * right + stiffness * (anchor - x))
    step = np.clip(step, -0.35, 0.35)
    q_step = np.einsum("kij,kj->ki", inverse, terms.q - np.einsum("kix,x->ki", terms.qx, step))
    return step, np.clip(q_step, -0.35, 0.35)


def _information(terms: _Terms) -> np.ndarray:
    """Return the information of the shared parameters with the poses eliminated, without springs."""
    weight = 1.0 / NOISE_PX**2
    dofs = terms.qq.shape[1]
    inverse = np.linalg.inv(terms.qq + 1e-9 * np.eye(dofs))
    return weight * np.sum(terms.xx - np.einsum("kix,kij,kjy->kxy", terms.qx, inverse, terms.qx), axis=0)
