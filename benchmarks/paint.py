"""Draw convex bodies in perspective before a wall: every face that looks at the camera, far bodies first.

Faces are filled on four times finer pixels into a premultiplied layer with coverage, so that edges, motion
blur and the wall behind stay exact to a fraction of a grey level.
"""

from __future__ import annotations

from itertools import pairwise

import cv2
import mujoco
import numpy as np
from numba import njit

from clips import Case, Drawer, mjcf, view

FINE = 4
LAMP = np.array([-0.35, -0.80, 0.5]) / np.linalg.norm([-0.35, -0.80, 0.5])
GEOM = mujoco.mjtGeom


class Painter(Drawer):
    """Draws the pictures of one case in their order."""

    def __init__(self, case: Case) -> None:
        self._case = case
        self._rng = np.random.default_rng(case.seed)
        self._model = mujoco.MjModel.from_xml_string(mjcf(case.parts, case.bolts))
        self._data = mujoco.MjData(self._model)
        self._faces = [_faces(self._model, g) for g in range(self._model.ngeom)]
        width, height = case.size
        self._focal, self._eye = view(case)
        reach_px = case.fill * min(width, height) / 2
        self._wall = backdrop(case, self._rng, self.project(np.zeros((1, 3)))[0], reach_px)
        column, row = np.meshgrid(np.arange(width) / width, np.arange(height) / height)
        spot = np.exp(
            -((column - case.pivot[0] - 0.1) ** 2 + (row - case.pivot[1] - 0.15) ** 2) / (2 * 0.1**2)
        )
        self._gain = (1.0 + case.shine * spot)[..., None].astype(np.float32)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return pixels, (point, 2), of world points [m], (point, 3).

        Args:
            points: x right, y away from the camera, z up.
        """
        width, height = self._case.size
        x, depth, up = (points - self._eye).T
        return np.column_stack(
            [(width - 1) / 2 + self._focal * x / depth, (height - 1) / 2 - self._focal * up / depth]
        )

    def picture(self, positions: np.ndarray) -> np.ndarray:
        """Return one frame, uint8 RGB (height, width, 3).

        Args:
            positions: Joint positions during the exposure, (exposure, dof).
        """
        layer = np.zeros((*self._wall.shape[:2], 4), np.float32)
        for q in positions:
            self._add(layer, q, 1.0 / len(positions))
        share = layer[..., 3:] / 255.0
        picture = self._wall * (1.0 - share) + layer[..., :3] * self._gain
        return self.grainy(picture, self._rng)

    def _add(self, layer: np.ndarray, q: np.ndarray, share: float) -> None:
        """Add a share of the mechanism at positions ``q`` to a premultiplied layer."""
        faces = self._visible(q)
        every = np.concatenate([polygon for polygon, _ in faces])
        height, width = layer.shape[:2]
        low = np.clip(np.floor(every.min(0)) - 2, 0, [width, height]).astype(int)
        high = np.clip(np.ceil(every.max(0)) + 3, 0, [width, height]).astype(int)
        if np.any(high <= low):
            return
        size = high - low
        canvas = np.zeros((size[1] * FINE, size[0] * FINE, 4), np.uint8)
        for polygon, colour in faces:
            fine = (polygon - low) * FINE + (FINE - 1) / 2
            fill_convex(canvas, fine, np.array(colour, dtype=np.uint8))
        small = cv2.resize(canvas.astype(np.float32), size.tolist(), interpolation=cv2.INTER_AREA)
        layer[low[1] : high[1], low[0] : high[0]] += share * small

    def _visible(self, q: np.ndarray) -> list[tuple[np.ndarray, list[float]]]:
        """Return the faces that look at the camera as pixels with colours, far geoms first."""
        data, model = self._data, self._model
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        found = []
        for g in np.argsort(-data.geom_xpos[:, 1], kind="stable"):
            turn, centre = data.geom_xmat[g].reshape(3, 3), data.geom_xpos[g]
            corners, normals = self._faces[g]
            world = corners @ turn.T + centre
            outward = normals @ turn.T
            toward = np.einsum("fk,fk->f", outward, self._eye - world.mean(1)) > 0
            shade = (0.5 + 0.5 * np.maximum(outward @ LAMP, 0.0)) / (0.5 + 0.5 * -LAMP[1])
            colour = 255.0 * model.geom_rgba[g, :3]
            for corner, light in zip(world[toward], shade[toward], strict=True):
                found.append((self.project(corner), [*np.clip(colour * light, 0, 255).tolist(), 255.0]))
        return found


@njit(cache=True)
def fill_convex(canvas: np.ndarray, polygon: np.ndarray, colour: np.ndarray) -> None:
    """Fill the pixels whose centres lie in a convex polygon; OpenCV's fill would add half a pixel all around.

    Args:
        canvas: Changed in place, uint8 (height, width, channel).
        polygon: Its corners, column and row [px], (point, 2).
        colour: Of every channel, uint8.
    """
    height, width = canvas.shape[:2]
    count = len(polygon)
    first = max(0, int(np.ceil(polygon[:, 1].min())))
    last = min(height - 1, int(np.floor(polygon[:, 1].max())))
    for row in range(first, last + 1):
        low, high = 1e18, -1e18
        for i in range(count):
            x0, y0 = polygon[i, 0], polygon[i, 1]
            x1, y1 = polygon[(i + 1) % count, 0], polygon[(i + 1) % count, 1]
            if y0 != y1 and min(y0, y1) <= row <= max(y0, y1):
                x = x0 + (x1 - x0) * (row - y0) / (y1 - y0)
                low, high = min(low, x), max(high, x)
        for column in range(max(0, int(np.ceil(low))), min(width - 1, int(np.floor(high))) + 1):
            for k in range(canvas.shape[2]):
                canvas[row, column, k] = colour[k]


def _faces(model: mujoco.MjModel, g: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the faces of a geom in its own frame, (face, 4, 3), and their normals, (face, 3)."""
    size, kind = model.geom_size[g], model.geom_type[g]
    if kind == GEOM.mjGEOM_BOX:
        faces = _box(size)
    elif kind == GEOM.mjGEOM_CYLINDER:
        rings = [(0.0, -size[1]), (size[0], -size[1]), (size[0], size[1]), (0.0, size[1])]
        faces = _turned(rings)
    else:
        bulge = [(np.cos(a), np.sin(a)) for a in np.linspace(-np.pi / 2, np.pi / 2, 24)]
        if kind == GEOM.mjGEOM_CAPSULE:
            rings = [(size[0] * c, size[0] * s + (size[1] if s > 0 else -size[1])) for c, s in bulge]
            faces = _turned(rings)
        else:
            radii = size if kind == GEOM.mjGEOM_ELLIPSOID else np.full(3, size[0])
            faces = _turned(bulge) * radii
    diagonals = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    faces = faces[np.linalg.norm(diagonals, axis=1) > 0]
    normals = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    inward = np.einsum("fk,fk->f", normals, faces.mean(1)) < 0
    normals[inward] *= -1.0
    return faces, normals


def _box(size: np.ndarray) -> np.ndarray:
    """Return the six faces of a box of half sizes ``size``, (6, 4, 3)."""
    faces = []
    for axis in range(3):
        u, w = [a for a in range(3) if a != axis]
        for side in (-1.0, 1.0):
            face = np.zeros((4, 3))
            face[:, axis] = side
            face[:, u], face[:, w] = [-1, 1, 1, -1], [-1, -1, 1, 1]
            faces.append(face * size)
    return np.array(faces)


def _turned(rings: list[tuple[float, float]], count: int = 64) -> np.ndarray:
    """Return the faces of a solid of revolution about z from its (radius, height) rings, (face, 4, 3)."""
    angle = np.linspace(0, 2 * np.pi, count + 1)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    faces = []
    for (r0, z0), (r1, z1) in pairwise(rings):
        for a, b in pairwise(circle):
            faces.append([[*r0 * a, z0], [*r0 * b, z0], [*r1 * b, z1], [*r1 * a, z1]])
    return np.array(faces)


def backdrop(case: Case, rng: np.random.Generator, pivot: np.ndarray, reach_px: float) -> np.ndarray:
    """Return the picture without the mechanism, float32 RGB (height, width, 3).

    Args:
        case: Pattern, colours and clutter.
        rng: Of patterns and clutter.
        pivot: Where the origin appears [px].
        reach_px: Reach of the mechanism [px].
    """
    width, height = case.size
    column, row = np.meshgrid(np.arange(width) / height, np.arange(height) / height)
    light = np.ones((height, width))
    if case.wall == "checker":
        light -= 0.08 * ((np.floor(column * 2.1 + 0.2) + np.floor(row * 2.1 + 0.3)) % 2)
    elif case.wall == "stripes":
        light -= 0.15 * (np.floor(column * 9 + 4 * row) % 2)
    elif case.wall in ("mottled", "room"):
        for cells, strength in ((6, 0.05), (40, 0.03), (160, 0.02)):
            coarse = rng.normal(size=(cells, cells)).astype(np.float32)
            light += strength * cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    light *= 1.0 - 0.12 * ((column - width / height / 2) ** 2 + (row - 0.5) ** 2)
    picture = (light[..., None] * np.array(case.base)).clip(0, 255).astype(np.uint8)
    picture = cv2.resize(picture, (2 * width, 2 * height), interpolation=cv2.INTER_LINEAR)
    if case.wall == "room":
        _furnish(picture, rng)
    if case.stand:
        post = (np.array(case.base) * 0.55).astype(int).tolist()
        foot = np.round(2 * pivot).astype(int)
        cv2.line(picture, foot.tolist(), [int(foot[0]), 0], post, max(2, int(0.16 * reach_px)))
    _clutter(picture, case, rng, 2 * pivot, 2 * reach_px)
    return cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA).astype(np.float32)


def _furnish(picture: np.ndarray, rng: np.random.Generator) -> None:
    """Draw a shelf, a poster and a floor line."""
    height, width = picture.shape[:2]
    cv2.rectangle(picture, (0, int(0.86 * height)), (width, height), (120, 98, 76), -1)
    cv2.rectangle(
        picture,
        (int(0.08 * width), int(0.1 * height)),
        (int(0.27 * width), int(0.52 * height)),
        (70, 110, 150),
        -1,
    )
    cv2.rectangle(
        picture, (int(0.7 * width), int(0.18 * height)), (width, int(0.22 * height)), (90, 62, 40), -1
    )
    for k in range(7):
        left = int((0.72 + 0.035 * k) * width)
        tall = int((0.05 + 0.05 * rng.random()) * height)
        colour = rng.integers(30, 230, 3).tolist()
        cv2.rectangle(
            picture,
            (left, int(0.18 * height) - tall),
            (left + int(0.03 * width), int(0.18 * height)),
            colour,
            -1,
        )


def _clutter(
    picture: np.ndarray, case: Case, rng: np.random.Generator, pivot: np.ndarray, reach: float
) -> None:
    """Draw bars and discs outside of the reach, or in the mechanism's colours beside or under the motion."""
    if case.clutter == "none":
        return
    low, high = {"elsewhere": (1.2, 1.9), "beside": (1.06, 1.3), "under": (0.5, 0.95)}[case.clutter]
    for k in range(9):
        angle = 2 * np.pi * (k + rng.random()) / 9
        place = pivot + reach * rng.uniform(low, high) * np.array([np.cos(angle), np.sin(angle)])
        own = case.parts[k % len(case.parts)].colour
        colour = list(own) if case.clutter != "elsewhere" else rng.integers(20, 235, 3).tolist()
        size = reach * rng.uniform(0.05, 0.11)
        centre = np.round(place).astype(int).tolist()
        if k % 2:
            cv2.circle(picture, centre, max(1, int(size)), colour, -1, cv2.LINE_AA)
        else:
            along = size * 2 * np.array([np.cos(3 * angle), np.sin(3 * angle)])
            ends = np.round([place - along, place + along]).astype(int).tolist()
            cv2.line(picture, ends[0], ends[1], colour, max(1, int(0.5 * size)), cv2.LINE_AA)
