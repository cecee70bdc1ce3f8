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

from spec import Case, Drawer, looking, mjcf, view

GEOM = mujoco.mjtGeom
FINE = 4
"""Fine pixels along the side of a pixel."""
LAMP = np.array([-0.35, -0.80, 0.5]) / np.linalg.norm([-0.35, -0.80, 0.5])
"""Direction toward the lamp: left, toward the camera, up."""
AMBIENT = 0.5
"""Light on a face that is turned away from the lamp; the lamp adds the rest of 1 on one that faces it."""
SPOT_PLACE, SPOT_WIDTH = (0.1, 0.15), 0.1
"""Where a highlight lies from the pivot and how wide it is, as shares of the picture's width and height."""
BULGE = 24
"""Rings of a round end."""
TURNS = 64
"""Faces around a solid of revolution."""
CHECKER, CHECKER_PLACE, CHECKER_DARK = 2.1, (0.2, 0.3), 0.08
"""Checks a picture height, where they begin, and how much darker every other one is."""
STRIPES, STRIPES_SLOPE, STRIPES_DARK = 9, 4, 0.15
"""Stripes a picture height along the rows and down the columns, and how much darker every other one is."""
MOTTLES = ((6, 0.05), (40, 0.03), (160, 0.02))
"""Spots across the picture and how strong they are, coarse to fine."""
CORNERS_DARK = 0.12
"""How much darker the wall is a picture height away from the middle."""
POST_WIDTH, POST_SHADE = 0.16, 0.55
"""Width of the post over the reach of the mechanism; its light over the wall's."""
OBJECTS = 9
"""Bars and discs of the clutter, all around the pivot."""
RINGS = {"elsewhere": (1.2, 1.9), "beside": (1.06, 1.3), "under": (0.5, 0.95)}
"""How far from the pivot they lie, least and most, as shares of the mechanism's reach."""


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
        self._axes = looking(case)
        reach_px = case.fill * min(width, height) / 2
        self._wall = backdrop(case, self._rng, self.project(np.zeros((1, 3)))[0], reach_px)
        column, row = np.meshgrid(np.arange(width) / width, np.arange(height) / height)
        right, down = column - case.pivot[0] - SPOT_PLACE[0], row - case.pivot[1] - SPOT_PLACE[1]
        spot = np.exp(-(right**2 + down**2) / (2 * SPOT_WIDTH**2))
        self._gain = (1.0 + case.shine * spot)[..., None].astype(np.float32)
        self._straight = unbent(case, self._focal) if case.bends else np.zeros(0)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return the pixels where world points appear, (point, 2).

        Args:
            points: x right, y away from the camera, z up [m], (point, 3).
        """
        width, height = self._case.size
        x, depth, up = ((points - self._eye) @ self._axes.T).T
        return np.column_stack(
            [(width - 1) / 2 + self._focal * x / depth, (height - 1) / 2 - self._focal * up / depth]
        )

    def picture(self, positions: np.ndarray) -> np.ndarray:
        """Return one frame, uint8 RGB (height, width, 3).

        Args:
            positions: Joint positions during the exposure, (exposure, dof).
        """
        layer = self._exposed(positions)
        share = layer[..., 3:] / 255.0
        picture = self._wall * (1.0 - share) + layer[..., :3] * self._gain
        if self._case.bends:
            edge = cv2.BORDER_REPLICATE
            picture = cv2.remap(picture, self._straight, None, cv2.INTER_CUBIC, borderMode=edge)
        return self.grainy(picture, self._rng)

    def covered(self, positions: np.ndarray) -> np.ndarray:
        """Return the share of each pixel that shows the mechanism, (height, width).

        Args:
            positions: Joint positions during the exposure, (exposure, dof).
        """
        return self._exposed(positions)[..., 3] / 255.0

    def _exposed(self, positions: np.ndarray) -> np.ndarray:
        """Return the mechanism alone during an exposure, float32 (height, width, 4)."""
        layer = np.zeros((*self._wall.shape[:2], 4), np.float32)
        for q in positions:
            self._add(layer, q, 1.0 / len(positions))
        return layer

    def ends(self, q: np.ndarray) -> np.ndarray:
        """Return where the bodies end in the picture [px], (body, 2).

        Args:
            q: Joint positions, (dof,).
        """
        self._data.qpos[:] = q
        mujoco.mj_kinematics(self._model, self._data)
        reach = [part.length if part.kind == "hinge" else 0.0 for part in self._case.parts]
        along = self._data.xmat[1:].reshape(-1, 3, 3)[:, :, 0]
        return self.project(self._data.xpos[1:] + np.array(reach)[:, None] * along)

    def _add(self, layer: np.ndarray, q: np.ndarray, share: float) -> None:
        """Add a share of the mechanism at positions ``q`` to a premultiplied layer."""
        faces = self._visible(q)
        # only what the faces cover is drawn on fine pixels, with room for the rounding
        every = np.concatenate([polygon for polygon, _ in faces])
        height, width = layer.shape[:2]
        low = np.clip(np.floor(every.min(0)) - 2, 0, [width, height]).astype(int)
        high = np.clip(np.ceil(every.max(0)) + 3, 0, [width, height]).astype(int)
        if np.any(high <= low):
            return
        size = high - low
        canvas = np.zeros((size[1] * FINE, size[0] * FINE, 4), np.uint8)
        for polygon, colour in faces:
            # pixel centres are whole numbers: pixel 0 spans the fine pixels 0 to FINE - 1
            fine = (polygon - low) * FINE + (FINE - 1) / 2
            fill_convex(canvas, fine, np.array(colour, dtype=np.uint8))
        # the mean over the fine pixels has the coverage in its fourth channel and is premultiplied by it
        small = cv2.resize(canvas.astype(np.float32), size.tolist(), interpolation=cv2.INTER_AREA)
        layer[low[1] : high[1], low[0] : high[0]] += share * small

    def _visible(self, q: np.ndarray) -> list[tuple[np.ndarray, list[float]]]:
        """Return the faces that look at the camera as pixels with colours, far geoms first."""
        data, model = self._data, self._model
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        found = []
        # the bodies are convex and lie in layers: far ones first and near ones over them is exact
        for g in np.argsort(-data.geom_xpos[:, 1], kind="stable"):
            turn, centre = data.geom_xmat[g].reshape(3, 3), data.geom_xpos[g]
            corners, normals = self._faces[g]
            world = corners @ turn.T + centre
            outward = normals @ turn.T
            toward = np.einsum("fk,fk->f", outward, self._eye - world.mean(1)) > 0
            direct = 1.0 - AMBIENT
            # normalized so that a face toward the camera has the colour that the case asks for
            shade = (AMBIENT + direct * np.maximum(outward @ LAMP, 0.0)) / (AMBIENT + direct * -LAMP[1])
            colour = 255.0 * model.geom_rgba[g, :3]
            for corner, light in zip(world[toward], shade[toward], strict=True):
                found.append((self.project(corner), [*np.clip(colour * light, 0, 255).tolist(), 255.0]))
        return found


def unbent(case: Case, focal: float) -> np.ndarray:
    """Return where a lens that bends nothing would show each pixel [px], float32 (height, width, 2).

    Args:
        case: With the size of the picture and the coefficients of the lens.
        focal: Focal length [px].
    """
    width, height = case.size
    matrix = np.array([[focal, 0.0, (width - 1) / 2], [0.0, focal, (height - 1) / 2], [0.0, 0.0, 1.0]])
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(np.float64)
    until = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-10)
    straight = cv2.undistortPoints(
        pixels.reshape(-1, 1, 2), matrix, np.array(case.bends), P=matrix, criteria=until
    )
    return straight.reshape(height, width, 2).astype(np.float32)


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
        low, high = np.inf, -np.inf
        for i in range(count):
            x0, y0 = polygon[i, 0], polygon[i, 1]
            x1, y1 = polygon[(i + 1) % count, 0], polygon[(i + 1) % count, 1]
            # a convex polygon meets a row in one interval, whose ends lie on the edges that cross the row
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
        bulge = [(np.cos(a), np.sin(a)) for a in np.linspace(-np.pi / 2, np.pi / 2, BULGE)]
        if kind == GEOM.mjGEOM_CAPSULE:
            rings = [(size[0] * c, size[0] * s + (size[1] if s > 0 else -size[1])) for c, s in bulge]
            faces = _turned(rings)
        else:
            radii = size if kind == GEOM.mjGEOM_ELLIPSOID else np.full(3, size[0])
            faces = _turned(bulge) * radii
    # at a pole the four corners of a face lie on a line, or in one point: such faces have no normal
    diagonals = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    faces = faces[np.linalg.norm(diagonals, axis=1) > 0]
    normals = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    # the origin lies inside of every geom
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


def _turned(rings: list[tuple[float, float]]) -> np.ndarray:
    """Return the faces of a solid of revolution about z from its (radius, height) rings, (face, 4, 3)."""
    angle = np.linspace(0, 2 * np.pi, TURNS + 1)
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
        pivot: Where the origin appears [px], (2,).
        reach_px: Reach of the mechanism [px].
    """
    width, height = case.size
    light = _pattern(case, rng)
    picture = (light[..., None] * np.array(case.base)).clip(0, 255).astype(np.uint8)
    # things are drawn at twice the size: halving it smooths their edges
    picture = cv2.resize(picture, (2 * width, 2 * height), interpolation=cv2.INTER_LINEAR)
    if case.wall == "room":
        _furnish(picture, rng)
    if case.stand:
        post = (np.array(case.base) * POST_SHADE).astype(int).tolist()
        foot = np.round(2 * pivot).astype(int)
        cv2.line(picture, foot.tolist(), [int(foot[0]), 0], post, max(2, int(POST_WIDTH * reach_px)))
    _clutter(picture, case, rng, 2 * pivot, 2 * reach_px)
    return cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA).astype(np.float32)


def _pattern(case: Case, rng: np.random.Generator) -> np.ndarray:
    """Return the light on the wall, about 1, (height, width)."""
    width, height = case.size
    column, row = np.meshgrid(np.arange(width) / height, np.arange(height) / height)
    light = np.ones((height, width))
    if case.wall == "checker":
        right, down = CHECKER_PLACE
        odd = (np.floor(column * CHECKER + right) + np.floor(row * CHECKER + down)) % 2
        light -= CHECKER_DARK * odd
    elif case.wall == "stripes":
        light -= STRIPES_DARK * (np.floor(column * STRIPES + STRIPES_SLOPE * row) % 2)
    elif case.wall in ("mottled", "room"):
        for cells, strength in MOTTLES:
            coarse = rng.normal(size=(cells, cells)).astype(np.float32)
            light += strength * cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    light *= 1.0 - CORNERS_DARK * ((column - width / height / 2) ** 2 + (row - 0.5) ** 2)
    return light


def _furnish(picture: np.ndarray, rng: np.random.Generator) -> None:
    """Draw a floor, a poster and a shelf with seven books."""
    _box_on(picture, (0.0, 0.86), (1.0, 1.0), [120, 98, 76])
    _box_on(picture, (0.08, 0.1), (0.27, 0.52), [70, 110, 150])
    shelf = 0.18
    _box_on(picture, (0.7, shelf), (1.0, 0.22), [90, 62, 40])
    height, width = picture.shape[:2]
    for k in range(7):
        left = int((0.72 + 0.035 * k) * width)
        tall = int((0.05 + 0.05 * rng.random()) * height)
        colour = rng.integers(30, 230, 3).tolist()
        top, foot = int(shelf * height) - tall, int(shelf * height)
        cv2.rectangle(picture, (left, top), (left + int(0.03 * width), foot), colour, -1)


def _box_on(
    picture: np.ndarray, first: tuple[float, float], last: tuple[float, float], colour: list[int]
) -> None:
    """Fill a rectangle between two corners, given as shares of width and height."""
    height, width = picture.shape[:2]
    corners = [(int(x * width), int(y * height)) for x, y in (first, last)]
    cv2.rectangle(picture, corners[0], corners[1], colour, -1)


def _clutter(
    picture: np.ndarray, case: Case, rng: np.random.Generator, pivot: np.ndarray, reach: float
) -> None:
    """Draw bars and discs outside of the reach, or in the mechanism's colours next to or under the motion."""
    if case.clutter == "none":
        return
    low, high = RINGS[case.clutter]
    for k in range(OBJECTS):
        angle = 2 * np.pi * (k + rng.random()) / OBJECTS
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
