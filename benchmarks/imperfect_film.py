"""Make the clip of a draw: the true motion in three dimensions by MuJoCo, exposed row by row.

Joints that the user's file does not have (a pivot on springs, a turn out of the plane, a thread that
stretches) are added to the mechanism. Every body is drawn as convex polygons whose corners move while the
rows are read; the light is mixed on four times finer pixels, as in ``paint``.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import av
import cv2
import mujoco
import numpy as np
from numba import njit

from clips import wrong
from imperfections import GRAVITY, Draw
from paint import AMBIENT, FINE, LAMP, backdrop, unbent
from spec import CHROMA_NOISE, looking, mjcf, view

STEP = 5e-4
"""Longest step of the simulation [s]."""
KEPT = 1.0 / 500.0
"""Longest time between states that are kept; between them they are interpolated, to 0.01 mm at 2 g [s]."""
ROUND = 48
"""Corners of a disc."""
SHADES = 5
"""Discs in one another by which a ball is shaded."""
KNOTS = 5
"""Instants of a readout at which corners are computed; between them they move evenly."""
BLUR_PX = 0.7
"""Way of a corner between two of the pictures that an exposure averages [px]."""
BLURS = 8
"""Most pictures that an exposure averages."""
GRAINS, GRAIN_MARGIN = 12, 64
"""Pictures of noise that are used in turn, and by how many pixels each is moved at random."""
RINGING = 0.08
"""Share of the critical damping of a pivot, a bearing or a thread that gives way."""
PIVOT_TOLERANCE, PIVOT_TURNS = 0.05, 8
"""The spring of a pivot is right when the pivot moves as asked to this share; times that it is looked for."""
PIVOT_UP = 3.0
"""How much stiffer a pivot is upwards than sideways."""
MOUNT, MOUNT_MASS = "mount", 0.05
"""Body that gives way with the pivot, and its mass [kg]."""
HIDDEN = ("pivot0", "pivot1", "aside", "stretch")
"""Joints of the true mechanism that the user's file does not have."""


class Truth:
    """The true motion of a draw.

    Attributes:
        model: The mechanism with the joints that the user does not know of.
        time: Of the states since the clip began [s], (time,).
        qpos: States, (time, qpos).
    """

    def __init__(self, model: mujoco.MjModel, time: np.ndarray, qpos: np.ndarray) -> None:
        self.model = model
        self.time = time
        self.qpos = qpos
        self._data = mujoco.MjData(model)

    def at(self, time: float) -> mujoco.MjData:
        """Return the mechanism at a time; the next call changes it.

        Args:
            time: Since the clip began [s].
        """
        last = len(self.time) - 1
        place = min(max((time - self.time[0]) / KEPT, 0.0), last - 1e-9)
        before = int(place)
        share = place - before
        self._data.qpos[:] = (1.0 - share) * self.qpos[before] + share * self.qpos[before + 1]
        mujoco.mj_kinematics(self.model, self._data)
        return self._data


def true_xml(draw: Draw, spring: float = 0.0) -> str:
    """Return the true mechanism as MJCF.

    Args:
        draw: What is filmed.
        spring: Stiffness of the pivot [N/m]; 0 is a pivot that does not give way.
    """
    tree = ElementTree.fromstring(mjcf(draw.case.parts))
    if spring:
        _mount(tree, spring)
    hinged = next(body for body in tree.iter("body") if body.find("joint[@type='hinge']") is not None)
    if draw.ellipse or draw.wobble:
        joints = hinged.findall("joint")
        damping = joints[-1].get("damping", "0")
        aside = {"name": "aside", "type": "hinge", "axis": "0 0 1", "damping": damping}
        hinged.insert(list(hinged).index(joints[-1]) + 1, ElementTree.Element("joint", aside))
    if draw.stretch:
        weight = ElementTree.SubElement(hinged, "body", {"name": "weight"})
        along = {"name": "stretch", "type": "slide", "axis": "1 0 0"}
        weight.append(ElementTree.Element("joint", along))
        ball = hinged.find("geom[@type='sphere']")
        assert ball is not None
        hinged.remove(ball)
        weight.append(ball)
    return ElementTree.tostring(tree, encoding="unicode")


def _mount(tree: ElementTree.Element, spring: float) -> None:
    """Put the mechanism onto a body that gives way sideways and, less, upwards."""
    world = tree.find("worldbody")
    assert world is not None
    (root,) = world.findall("body")
    world.remove(root)
    mount = ElementTree.SubElement(world, "body", {"name": MOUNT})
    for number, (axis, factor) in enumerate((("1 0 0", 1.0), ("0 0 1", PIVOT_UP))):
        joint = {"type": "slide", "axis": axis, "stiffness": f"{spring * factor:.9g}"}
        mount.append(ElementTree.Element("joint", {"name": f"pivot{number}", **joint}))
    weight = {"pos": "0 0 0", "mass": f"{MOUNT_MASS:g}", "diaginertia": "1e-4 1e-4 1e-4"}
    mount.append(ElementTree.Element("inertial", weight))
    mount.append(root)


def moved(draw: Draw) -> Truth:
    """Return the true motion of a draw.

    A pivot's spring is such that the pivot moves sideways by what the draw asks for, a rail's such that it
    bends by that under the weight.

    Args:
        draw: What is filmed.
    """
    if not draw.pivot:
        return _simulated(draw, 0.0)
    mass = mujoco.MjModel.from_xml_string(true_xml(draw)).body_mass.sum()
    if draw.kind == "cart":
        # nothing but friction pulls a rail sideways: it gives way under the weight on it
        return _simulated(draw, mass * GRAVITY / draw.pivot / PIVOT_UP)
    spring = 0.5 * mass * GRAVITY / draw.pivot
    for _ in range(PIVOT_TURNS):
        truth = _simulated(draw, spring)
        gives = np.ptp(truth.qpos[truth.time >= 0.0, 0]) / 2
        if abs(gives / draw.pivot - 1.0) < PIVOT_TOLERANCE:
            break
        spring *= float(np.clip(gives / draw.pivot, 0.3, 3.0))
    return truth  # pyright: ignore[reportPossiblyUnboundVariable]


def _simulated(draw: Draw, spring: float) -> Truth:
    """Return the motion from the release to a little after the clip's end."""
    case = draw.case
    model = mujoco.MjModel.from_xml_string(true_xml(draw, spring))
    steps = int(np.ceil(KEPT / STEP))
    model.opt.timestep = KEPT / steps
    data = mujoco.MjData(model)
    joints = [model.joint(j).name for j in range(model.njnt)]
    data.qpos[[j for j, name in enumerate(joints) if name not in HIDDEN]] = case.start
    _soften(model, data, draw, joints)
    count = int(np.ceil((draw.lead + case.seconds + 0.1) / KEPT))
    qpos = np.empty((count, model.nq))
    for row in qpos:
        row[:] = data.qpos
        mujoco.mj_step(model, data, steps)
    return Truth(model, np.arange(count) * KEPT - draw.lead, qpos)


def _soften(model: mujoco.MjModel, data: mujoco.MjData, draw: Draw, joints: list[str]) -> None:
    """Set the springs of a mechanism at its start: how far they give way, how they ring."""
    mujoco.mj_forward(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    length = draw.case.parts[-1].length if draw.kind == "cart" else draw.case.parts[0].length
    swing = next(part for part in draw.case.parts if part.kind == "hinge")
    aside_angle = draw.case.start[draw.case.parts.index(swing)] + np.pi / 2
    for j, name in enumerate(joints):
        if name.startswith("pivot"):
            model.dof_damping[j] += 2.0 * RINGING * np.sqrt(model.jnt_stiffness[j] * inertia[j, j])
            if name == "pivot1":
                # the weight at rest holds it at the origin
                model.qpos_spring[j] = model.body_mass.sum() * GRAVITY / model.jnt_stiffness[j]
        if name == "aside" and draw.ellipse:
            data.qvel[j] = draw.ellipse * aside_angle * np.sqrt(GRAVITY / length)
        if name == "aside" and draw.wobble:
            model.jnt_stiffness[j] = inertia[j, j] * draw.wobble_ratio**2 * 1.5 * GRAVITY / length
            data.qpos[j] = draw.wobble
        if name == "stretch":
            pull = model.body_mass[-1] * GRAVITY
            model.jnt_stiffness[j] = pull / (draw.stretch * length)
            model.dof_damping[j] = 2.0 * RINGING * np.sqrt(model.jnt_stiffness[j] * model.body_mass[-1])
            data.qpos[j] = pull * np.cos(aside_angle) / model.jnt_stiffness[j]


class Film:
    """Draws the pictures of a draw, each row at its own time.

    Attributes:
        truth: The true motion.
        wall: The picture without the mechanism, RGB (height, width, 3).
    """

    def __init__(self, draw: Draw, truth: Truth) -> None:
        self._draw = draw
        self.truth = truth
        case = draw.case
        self._focal, self._eye = view(case)
        self._axes = looking(case)
        self._rng = np.random.default_rng(case.seed)
        reach_px = case.fill * min(case.size) / 2
        self.wall = backdrop(case, self._rng, self.straight(np.zeros((1, 3)))[0], reach_px)
        width, height = case.size
        room = (GRAINS, height + GRAIN_MARGIN, width + GRAIN_MARGIN)
        grey = self._rng.normal(scale=case.noise, size=(*room, 1)).astype(np.float32)
        colour = self._rng.standard_normal((*room, 3), dtype=np.float32) * np.float32(
            CHROMA_NOISE * case.noise
        )
        self._grains = grey + colour
        self._straight = unbent(case, self._focal) if case.bends else None

    def straight(self, points: np.ndarray) -> np.ndarray:
        """Return where world points appear through a lens that bends nothing [px], (point, 2).

        Args:
            points: x right, y away from the camera, z up [m], (point, 3).
        """
        width, height = self._draw.case.size
        x, depth, up = ((points - self._eye) @ self._axes.T).T
        return np.column_stack(
            [(width - 1) / 2 + self._focal * x / depth, (height - 1) / 2 - self._focal * up / depth]
        )

    def bent(self, places: np.ndarray) -> np.ndarray:
        """Return where the lens shows places of a straight picture [px], (point, 2).

        Args:
            places: In the straight picture [px], (point, 2).
        """
        if not self._draw.case.bends:
            return places
        centre = (np.array(self._draw.case.size) - 1) / 2
        rays = np.column_stack([(places - centre) / self._focal, np.ones(len(places))])
        matrix = np.array([[self._focal, 0.0, centre[0]], [0.0, self._focal, centre[1]], [0.0, 0.0, 1.0]])
        still = np.zeros(3)
        return cv2.projectPoints(rays, still, still, matrix, np.array(self._draw.case.bends))[0].reshape(
            -1, 2
        )

    def points(self, data: mujoco.MjData) -> np.ndarray:
        """Return the true places of ``material_points`` [m], (point, 3).

        Args:
            data: The mechanism at one instant.
        """
        return material_points(self.truth.model, data, self._draw, lengths(self._draw))

    def shown(self, time: float) -> np.ndarray:
        """Return where the frame of a time shows joints and far ends, each when its row is exposed [px].

        Args:
            time: Of the frame [s].

        Returns:
            The places, (point, 2).
        """
        places = self.straight(self.points(self.truth.at(time)))
        if self._draw.readout:
            # a row's time depends on the row: three rounds leave less than 0.01 px
            for _ in range(3):
                places = np.array(
                    [
                        self.straight(self.points(self.truth.at(time + self.delay(row))))[k]
                        for k, row in enumerate(places[:, 1])
                    ]
                )
        return self.bent(places)

    def delay(self, row: float) -> float:
        """Return when a row is exposed against the middle of its picture [s].

        Args:
            row: Its number, between 0 and the height.
        """
        last = self._draw.case.size[1] - 1
        return self._draw.readout * (float(np.clip(row / last, 0.0, 1.0)) - 0.5)

    def picture(self, time: float) -> tuple[np.ndarray, float]:
        """Return the frame of a time, uint8 RGB (height, width, 3), and the mechanism's area in it [px].

        Args:
            time: Middle of the exposure of the middle row [s].
        """
        layer = np.zeros((*self.wall.shape[:2], 4), np.float32)
        instants = self._exposed(time)
        boxes = np.array([self._add(layer, instant, 1.0 / len(instants)) for instant in instants])
        (left, top), (right, foot) = boxes[:, 0].min(0), boxes[:, 1].max(0)
        box = slice(top, foot), slice(left, right)
        ink, picture = layer[box], self.wall.copy()
        picture[box] = picture[box] * (1.0 - ink[..., 3:] / 255.0) + ink[..., :3]
        if self._straight is not None:
            picture = cv2.remap(
                picture, self._straight, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
            )
        down, right = self._rng.integers(GRAIN_MARGIN, size=2)
        height, width = picture.shape[:2]
        grain = self._grains[self._rng.integers(GRAINS), down : down + height, right : right + width]
        # rounded and kept within 0 to 255
        return cv2.add(picture, grain, dtype=cv2.CV_8U), float(ink[..., 3].sum()) / 255.0

    def _exposed(self, time: float) -> list[float]:
        """Return the instants whose light the middle row of a picture averages [s]."""
        half = self._draw.exposure / 2
        way = self.straight(self.points(self.truth.at(time + half)))
        way = np.abs(way - self.straight(self.points(self.truth.at(time - half)))).max()
        count = int(np.clip(np.ceil(way / BLUR_PX), 1, BLURS))
        return list(time + self._draw.exposure * ((np.arange(count) + 0.5) / count - 0.5))

    def _add(self, layer: np.ndarray, time: float, share: float) -> np.ndarray:
        """Add a share of the mechanism to a layer, each row at its own time; return the box around it."""
        readout = self._draw.readout
        shifts = np.linspace(-0.5, 0.5, KNOTS) * readout if readout else np.zeros(1)
        knots = [self._polygons(time + shift) for shift in shifts]
        # what is seen, and in which order, is that of the middle
        shown = knots[len(knots) // 2]
        corners = [np.array([knot[i][0] for knot in knots]) for i in range(len(shown))]
        every = np.concatenate([corner.reshape(-1, 2) for corner in corners])
        height, width = layer.shape[:2]
        low = np.clip(np.floor(every.min(0)) - 2, 0, [width, height]).astype(int)
        high = np.clip(np.ceil(every.max(0)) + 3, 0, [width, height]).astype(int)
        if np.any(high <= low):
            return np.array([low, low])
        size = high - low
        canvas = np.zeros((size[1] * FINE, size[0] * FINE, 4), np.uint8)
        for corner, (_, colour, faces) in zip(corners, shown, strict=True):
            if faces:
                # pixel centres are whole numbers: pixel 0 spans the fine pixels 0 to FINE - 1
                fine = (corner - low) * FINE + (FINE - 1) / 2
                fill_rows(canvas, fine, np.array(colour, dtype=np.uint8), low[1] * FINE, height * FINE)
        small = cv2.resize(canvas.astype(np.float32), size.tolist(), interpolation=cv2.INTER_AREA)
        layer[low[1] : high[1], low[0] : high[0]] += share * small
        return np.array([low, high])

    def _polygons(self, time: float) -> list[tuple[np.ndarray, list[float], bool]]:
        """Return convex polygons [px], their colours and whether they face the camera, far ones first."""
        data, model = self.truth.at(time), self.truth.model
        found: list[tuple[np.ndarray, list[float], bool]] = []
        # every part lies before its parent, a ball before its thread
        for g in range(model.ngeom):
            turn, centre, size = data.geom_xmat[g].reshape(3, 3), data.geom_xpos[g], model.geom_size[g]
            colour = 255.0 * model.geom_rgba[g, :3]
            if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX:
                found += self._box(centre, turn, size, colour)
            elif model.geom_type[g] == mujoco.mjtGeom.mjGEOM_SPHERE:
                found += self._ball(centre, size[0], colour)
            else:
                ends = centre + np.outer([-size[1], size[1]], turn[:, 2])
                found += self._rod(ends, size[0], colour)
        return found

    def _ball(
        self, centre: np.ndarray, radius: float, colour: np.ndarray
    ) -> list[tuple[np.ndarray, list[float], bool]]:
        """Return a ball's outline and, in it, ever smaller discs toward the light."""
        middle, circle, towards = self._contour(centre, radius)
        light = radius * (LAMP - (LAMP @ towards) * towards)
        discs = []
        for share in np.arange(SHADES) / SHADES:
            rim = middle + 0.45 * share * light + (1.0 - share) * circle
            discs.append((self.straight(rim), _opaque(colour * (0.78 + 0.4 * share)), True))
        return discs

    def _contour(self, centre: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the circle along which the eye's cone touches a ball: its middle, rays and normal."""
        towards = self._eye - centre
        distance = float(np.linalg.norm(towards))
        towards = towards / distance
        across = np.cross(towards, [0.0, 0.0, 1.0])
        across /= np.linalg.norm(across)
        up = np.cross(across, towards)
        angle = 2.0 * np.pi * np.arange(ROUND) / ROUND
        rays = np.outer(np.cos(angle), across) + np.outer(np.sin(angle), up)
        rays *= radius * np.sqrt(1.0 - (radius / distance) ** 2)
        return centre + towards * radius**2 / distance, rays, towards

    def _rod(
        self, ends: np.ndarray, radius: float, colour: np.ndarray
    ) -> list[tuple[np.ndarray, list[float], bool]]:
        """Return a rod with round ends: a disc at each and what lies between."""
        along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        across = np.cross(along, self._eye - ends.mean(0))
        across *= radius / np.linalg.norm(across)
        between = np.array([ends[0] + across, ends[1] + across, ends[1] - across, ends[0] - across])
        rims = [middle + rays for middle, rays, _ in (self._contour(end, radius) for end in ends)]
        return [(self.straight(corners), _opaque(colour), True) for corners in (*rims, between)]

    def _box(
        self, centre: np.ndarray, turn: np.ndarray, size: np.ndarray, colour: np.ndarray
    ) -> list[tuple[np.ndarray, list[float], bool]]:
        """Return the faces of a box; those that the camera does not see are marked."""
        faces = []
        for axis in range(3):
            u, w = [a for a in range(3) if a != axis]
            for side in (-1.0, 1.0):
                face = np.zeros((4, 3))
                face[:, axis] = side
                face[:, u], face[:, w] = [-1, 1, 1, -1], [-1, -1, 1, 1]
                world = (face * size) @ turn.T + centre
                outward = side * turn[:, axis]
                direct = 1.0 - AMBIENT
                shade = (AMBIENT + direct * max(float(outward @ LAMP), 0.0)) / (AMBIENT + direct * -LAMP[1])
                seen = bool(outward @ (self._eye - world.mean(0)) > 0)
                faces.append((self.straight(world), _opaque(colour * shade), seen))
        return faces


def _opaque(colour: np.ndarray) -> list[float]:
    return [*np.clip(colour, 0, 255).tolist(), 255.0]


@njit(cache=True)
def fill_rows(canvas: np.ndarray, knots: np.ndarray, colour: np.ndarray, first_row: int, rows: int) -> None:
    """Fill a convex polygon whose corners move while the rows are read, each row where it is then.

    Args:
        canvas: Changed in place, uint8 (height, width, channel).
        knots: Corners at equal steps of time from the first row's exposure to the last's, column and row on
            the canvas [px], (time, point, 2).
        colour: Of every channel, uint8.
        first_row: Of the canvas in the whole picture [px].
        rows: Of the whole picture.
    """
    height, width = canvas.shape[:2]
    count, last_knot = knots.shape[1], knots.shape[0] - 1
    low_row, high_row = knots[:, :, 1].min(), knots[:, :, 1].max()
    polygon = np.empty((count, 2))
    for row in range(max(0, int(np.ceil(low_row))), min(height - 1, int(np.floor(high_row))) + 1):
        place = (row + first_row) / (rows - 1.0) * last_knot
        before = min(int(place), max(last_knot - 1, 0))
        share, after = place - before, min(before + 1, last_knot)
        for i in range(count):
            for k in range(2):
                polygon[i, k] = (1.0 - share) * knots[before, i, k] + share * knots[after, i, k]
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


def material_points(
    model: mujoco.MjModel, data: mujoco.MjData, draw: Draw, lengths: dict[str, float]
) -> np.ndarray:
    """Return the places of joints and far ends that a picture shows [m], (point, 3).

    Of a ball on a thread that is its centre alone; of a cart its middle.

    Args:
        model: The true mechanism or one that was identified.
        data: The mechanism at one instant.
        draw: What is filmed.
        lengths: Of the links by name [m].
    """
    # where a ball sits is its place, not the length of a rod or thread, from which it may have parted
    balls = data.geom_xpos[model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE]
    if draw.kind == "ball":
        return balls.copy()
    bodies = [model.body(name).id for name in names(draw)]
    last = data.xmat[bodies[-1]].reshape(3, 3)[:, 0]
    end = balls[0] if draw.kind == "bob" else data.xpos[bodies[-1]] + lengths[names(draw)[-1]] * last
    return np.array([*data.xpos[bodies], end])


def names(draw: Draw) -> list[str]:
    """Return the names of the bodies, parents first.

    Args:
        draw: What is filmed.
    """
    links = sum(part.kind == "hinge" for part in draw.case.parts)
    return ["cart"] * (draw.kind == "cart") + [f"link{k + 1}" for k in range(links)]


def lengths(draw: Draw) -> dict[str, float]:
    """Return the true lengths of the links, without the stretch of a thread [m].

    Args:
        draw: What is filmed.
    """
    return {name: part.length for name, part in zip(names(draw), draw.case.parts, strict=True)}


def filmed(draw: Draw, folder: Path) -> tuple[Film, np.ndarray, float]:
    """Write clip and file of a draw.

    Args:
        draw: What is filmed.
        folder: Where ``clip.mp4`` and ``model.xml`` go.

    Returns:
        What drew it, the times of the frames [s], (frame,), and the mechanism's usual area [px].
    """
    case = draw.case
    film = Film(draw, moved(draw))
    time = np.arange(round(case.seconds * case.rate)) / case.rate
    areas = np.zeros(len(time))
    with av.open(str(folder / "clip.mp4"), "w") as file:
        options = {"preset": "fast", "crf": str(case.crf), "threads": "1"}
        stream = file.add_stream("libx264", rate=case.rate, options=options)
        stream.pix_fmt = "yuv420p"
        stream.width, stream.height = case.size
        for i, t in enumerate(time):
            picture, areas[i] = film.picture(float(t))
            file.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        file.mux(stream.encode())
    (folder / "model.xml").write_text(given(draw))
    return film, time, float(np.median(areas))


def given(draw: Draw) -> str:
    """Return the mechanism file of a user, MJCF: right topology, wrong sizes, no imperfection.

    Args:
        draw: What is filmed.
    """
    text = mjcf(tuple(wrong(part) for part in draw.case.parts))
    if draw.model != "ball":
        return text
    tree = ElementTree.fromstring(text)
    link = tree.find("worldbody/body")
    thread = tree.find("worldbody/body/geom[@type='capsule']")
    assert link is not None
    assert thread is not None
    link.remove(thread)
    return ElementTree.tostring(tree, encoding="unicode")
