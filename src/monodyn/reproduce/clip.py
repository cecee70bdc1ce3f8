"""A clip of an aluminium double pendulum with known truth: simulated by MuJoCo, painted, encoded.

No part of the estimation is used here, on purpose: projection, faces and coverage are written a second time
and independently of ``vision.drawing``, so that a mistake there cannot cancel. This module is the oracle that
both methods are judged by. Each rod is a box before a pinhole camera. The share of every pixel that a face
covers is computed, not sampled over the width, and the faces of a box that look at the camera do not overlap,
so a silhouette has the area of its exact outline.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from monodyn.reproduce.truth import Truth, true_values
from monodyn.types import Camera, Progress

LINES = 8
"""Scan lines in the height of a pixel."""
LAMP = np.array([-0.35, 0.56, 0.75]) / np.linalg.norm([-0.35, 0.56, 0.75])
"""Direction to the lamp in the plane frame."""
AMBIENT = 0.35
"""Light on a face that looks away from the lamp, as a share of the most."""

MODEL = (Path(__file__).parent / "rods.xml").read_text(encoding="utf-8")


@dataclass(frozen=True)
class Pendulum:
    """Two uniform aluminium rods of rectangular section, hinged at their ends, the second before the first.

    Attributes:
        length: Length of each rod [m].
        width: Width of each rod in the plane of motion [m].
        thickness: Thickness of each rod across it [m].
        layer: Distance between the middle planes of the rods [m].
        density: Density [kg/m^3].
        damping: Viscous friction of each hinge [N m s/rad].
        start: Joint positions at rest at the first frame [rad].
    """

    length: tuple[float, float] = (0.24, 0.19)
    width: tuple[float, float] = (0.030, 0.026)
    thickness: tuple[float, float] = (0.006, 0.005)
    layer: float = 0.0075
    density: float = 2700.0
    damping: tuple[float, float] = (6e-4, 3e-4)
    start: tuple[float, float] = (-0.30, -0.30)

    @property
    def mass(self) -> np.ndarray:
        """Mass of each rod [kg], (body,)."""
        return self.density * np.prod([self.length, self.width, self.thickness], axis=0)


@dataclass(frozen=True)
class ClipSettings:
    """What the clip shows and how.

    Attributes:
        pendulum: What moves.
        camera: Perpendicular to the plane of motion, as in the paper's experiment.
        rate: Frames a second [Hz].
        frames: Length of the clip.
        colour: Colour of each rod in full light, RGB from 0 to 1.
        wall: Mean colour of the background, RGB from 0 to 255.
        noise: Standard deviation of the noise of a pixel, of 255.
        quality: Constant rate factor of H.264; less is better.
        seed: Seed of background and noise.
    """

    pendulum: Pendulum = field(default_factory=Pendulum)
    camera: Camera = field(default_factory=lambda: Camera(720, 480, 700.0, 0.03, -0.17, 1.15))
    rate: int = 30
    frames: int = 140
    colour: tuple[tuple[float, float, float], ...] = ((0.80, 0.82, 0.84), (0.91, 0.92, 0.92))
    wall: tuple[float, float, float] = (66.0, 78.0, 92.0)
    noise: float = 2.0
    quality: int = 18
    seed: int = 0


def make_clip(path: Path, settings: ClipSettings | None = None, *, progress: Progress | None = None) -> Truth:
    """Simulate, paint and encode a double pendulum.

    Args:
        path: The film to write (mp4).
        settings: What it shows.
        progress: Called with the number of frames painted.

    Returns:
        The true motion.

    Raises:
        OSError: the film cannot be written.
    """
    settings = settings or ClipSettings()
    truth = simulated(settings)
    film(path, truth, settings, progress=progress)
    return truth


def film(path: Path, truth: Truth, settings: ClipSettings, *, progress: Progress | None = None) -> None:
    """Paint and encode a motion.

    Args:
        path: The film to write (mp4).
        truth: The motion.
        settings: What the clip shows.
        progress: Called with the number of frames painted.

    Raises:
        OSError: the film cannot be written.
    """
    rng = np.random.default_rng(settings.seed)
    background = wall(settings, rng)
    camera = settings.camera
    with _Film(path, settings) as made:
        for done, position in enumerate(truth.position, start=1):
            picture = painted(settings, position, background)
            noise = rng.standard_normal((camera.height, camera.width, 1), dtype=np.float32)
            picture += np.float32(settings.noise) * noise
            made.add(np.clip(np.round(picture), 0, 255).astype(np.uint8))
            if progress is not None:
                progress("clip", done, settings.frames)


def truth_document(truth: Truth, settings: ClipSettings) -> dict[str, Any]:
    """Return sizes, camera and motion as a JSON document.

    Args:
        truth: The true motion.
        settings: What the clip shows.
    """
    return {
        "pendulum": asdict(settings.pendulum),
        "camera": asdict(settings.camera),
        "rate": settings.rate,
        "seed": settings.seed,
        "times": [round(t, 9) for t in truth.time.tolist()],
        "q": np.round(truth.position, 8).tolist(),
        "v": np.round(truth.velocity, 7).tolist(),
    }


def simulated(settings: ClipSettings) -> Truth:
    """Return the pendulum's motion from rest, simulated with MuJoCo.

    Args:
        settings: Pendulum, rate and number of frames.
    """
    import importlib

    mujoco: Any = importlib.import_module("mujoco")

    rods, substeps = settings.pendulum, 100
    text = MODEL.format(
        step=1.0 / (settings.rate * substeps),
        damping=rods.damping,
        density=rods.density,
        layer=rods.layer,
        length=rods.length,
        half=[length / 2 for length in rods.length],
        thick=[thickness / 2 for thickness in rods.thickness],
        wide=[width / 2 for width in rods.width],
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = rods.start
    position, velocity = [], []
    for _ in range(settings.frames):
        # the state at the start of each frame, so that frame 0 is at rest
        position.append(data.qpos.copy())
        velocity.append(data.qvel.copy())
        mujoco.mj_step(model, data, substeps)
    values = true_values(rods.length, rods.mass, rods.damping)
    return Truth(np.arange(settings.frames) / settings.rate, np.array(position), np.array(velocity), values)


def painted(settings: ClipSettings, position: np.ndarray, background: np.ndarray) -> np.ndarray:
    """Return one painted frame without noise, RGB from 0 to 255, (height, width, 3).

    Args:
        settings: Pendulum, camera and colours.
        position: Joint positions [rad], (dof,).
        background: What is seen without the pendulum, (height, width, 3).
    """
    picture = background.astype(np.float32)
    for rod, colour in zip(faces(settings, position), settings.colour, strict=True):
        bright = np.float32(255.0) * np.array(colour, dtype=np.float32)
        # the faces of a rod do not overlap: each dims what was there before the rod by its own share
        behind = picture.copy()
        for polygon, shade in rod:
            rows, columns, share = coverage(polygon, background.shape[:2])
            picture[rows, columns] += share[..., np.newaxis] * (bright * shade - behind[rows, columns])
    return picture


def faces(settings: ClipSettings, position: np.ndarray) -> list[list[tuple[np.ndarray, float]]]:
    """Return the faces of each rod that look at the camera, the rod behind first.

    Args:
        settings: Pendulum and camera.
        position: Joint positions [rad], (dof,).

    Returns:
        For each rod its faces: corners [px] (4, 2) and light from 0 to 1.
    """
    rods, camera = settings.pendulum, settings.camera
    # the camera looks along -z without roll: its place alone decides which faces it sees
    eye = np.array([camera.x, camera.y, camera.depth])
    hinge, angle, found = np.zeros(3), 0.0, []
    for i, turn in enumerate(position):
        angle += turn
        along = np.array([np.cos(angle), np.sin(angle), 0.0])
        axes = np.column_stack([along, [-along[1], along[0], 0.0], [0.0, 0.0, 1.0]])
        low = np.array([0.0, -rods.width[i] / 2, -rods.thickness[i] / 2])
        high = np.array([rods.length[i], rods.width[i] / 2, rods.thickness[i] / 2])
        visible = []
        for corners, outward in _box_faces(low, high):
            world, normal = corners @ axes.T + hinge, axes @ outward
            # a face is seen from its outer side alone; those of a convex body never hide each other
            if normal @ (eye - world[0]) > 0:
                shade = AMBIENT + (1.0 - AMBIENT) * max(0.0, float(normal @ LAMP))
                visible.append((project(camera, world), shade))
        found.append(visible)
        # each rod lies one layer nearer to the camera, so that painting them in order hides what is behind
        hinge = hinge + rods.length[i] * along + np.array([0.0, 0.0, rods.layer])
    return found


def _box_faces(low: np.ndarray, high: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return corners (4, 3) and outward normal (3,) of the six faces of a box."""
    found = []
    for axis in range(3):
        u, w = [a for a in range(3) if a != axis]
        for side, level in ((-1.0, low[axis]), (1.0, high[axis])):
            corners, outward = np.zeros((4, 3)), np.zeros(3)
            corners[:, axis] = level
            corners[:, u] = [low[u], high[u], high[u], low[u]]
            corners[:, w] = [low[w], low[w], high[w], high[w]]
            outward[axis] = side
            found.append((corners, outward))
    return found


def project(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Return points of the plane frame in the picture [px], (point, 2); pixel centres are whole numbers.

    Args:
        camera: A camera without roll, pitch and yaw.
        points: x to the right, y up, z toward the camera [m], (point, 3).
    """
    scale = camera.focal / (camera.depth - points[:, 2])
    column = (camera.width - 1) / 2 + scale * (points[:, 0] - camera.x)
    row = (camera.height - 1) / 2 - scale * (points[:, 1] - camera.y)
    return np.column_stack([column, row])


def coverage(polygon: np.ndarray, shape: tuple[int, int]) -> tuple[slice, slice, np.ndarray]:
    """Return the share of each pixel that lies in a convex polygon.

    Every pixel is cut into ``LINES`` scan lines; along each the covered length is exact.

    Args:
        polygon: Corners [px], (point, 2), column and row; pixel centres are whole numbers.
        shape: Height and width of the picture [px].

    Returns:
        Rows and columns of the part of the picture that the polygon can touch, and the shares there,
        float32 (row, column).
    """
    # a pixel reaches half a pixel to either side of its whole-numbered centre
    first = np.maximum(np.floor(polygon.min(axis=0) + 0.5).astype(int), 0)
    stop = np.minimum(np.ceil(polygon.max(axis=0) + 0.5).astype(int), shape[::-1])
    (left, top), (right, bottom) = first, np.maximum(stop, first)
    # scan lines run through the middles of equal strips, so that no pixel's share is biased up or down
    line = top - 0.5 + (np.arange((bottom - top) * LINES) + 0.5) / LINES
    enter, leave = np.full(len(line), np.inf), np.full(len(line), -np.inf)
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if a[1] == b[1]:  # a scan line lies within no horizontal edge
            continue
        along = (line - a[1]) / (b[1] - a[1])
        crossed = (along >= 0.0) & (along <= 1.0)
        # a convex polygon is entered and left once by each line: the least and the greatest crossing
        column = a[0] + along * (b[0] - a[0])
        enter = np.where(crossed, np.minimum(enter, column), enter)
        leave = np.where(crossed, np.maximum(leave, column), leave)
    # a line that misses the polygon has an empty stretch, so that no difference of infinities is formed below
    leave = np.maximum(leave, np.where(np.isfinite(enter), enter, 0.0))
    enter = np.where(np.isfinite(enter), enter, leave)
    edge = np.arange(left, right) - 0.5
    # covered length of each pixel: what lies right of its left edge, up to its width, at either end
    share = np.clip(leave[:, None] - edge, 0.0, 1.0) - np.clip(enter[:, None] - edge, 0.0, 1.0)
    share = share.reshape(bottom - top, LINES, right - left).mean(axis=1)
    return slice(top, bottom), slice(left, right), share.astype(np.float32)


def wall(settings: ClipSettings, rng: np.random.Generator) -> np.ndarray:
    """Return the background: a mottled wall, darker to its corners, with a stand behind the first hinge.

    Args:
        settings: Camera and mean colour.
        rng: Where the mottling comes from.

    Returns:
        RGB from 0 to 255, (height, width, 3).
    """
    import cv2

    height, width = settings.camera.height, settings.camera.width
    # three scales of mottling: the mask must not depend on a background that is all of one grey
    grain = np.zeros((height, width))
    for cells, strength in ((6, 7.0), (40, 4.0), (180, 2.5)):
        coarse = rng.normal(size=(cells * height // width + 2, cells + 2))
        grain += strength * cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    row, column = np.linspace(-1, 1, height)[:, None], np.linspace(-1, 1, width)
    shade = 1.0 - 0.14 * column**2 - 0.10 * (row - 0.2) ** 2
    picture = (np.array(settings.wall) + grain[..., None]) * shade[..., None]
    post = np.array(
        [[-0.011, -0.012, -0.02], [0.011, -0.012, -0.02], [0.011, 1.0, -0.02], [-0.011, 1.0, -0.02]]
    )
    rows, columns, share = coverage(project(settings.camera, post), (height, width))
    dark = np.array([38.0, 40.0, 44.0])
    picture[rows, columns] += share[..., None] * (dark - picture[rows, columns])
    return np.clip(picture, 0.0, 255.0)


class _Film:
    """An H.264 film that takes RGB pictures; libav's errors become OSError."""

    def __init__(self, path: Path, settings: ClipSettings) -> None:
        import av

        # with the tree of macroblocks x264 does not write the same file twice
        options = {"preset": "medium", "crf": str(settings.quality), "x264-params": "mbtree=0"}
        self.container = av.open(str(path.absolute()), "w", format="mp4", options={"movflags": "faststart"})
        self.stream: Any = self.container.add_stream("libx264", rate=settings.rate, options=options)
        self.stream.width, self.stream.height = settings.camera.width, settings.camera.height
        self.stream.pix_fmt = "yuv420p"

    def __enter__(self) -> _Film:
        return self

    def add(self, picture: np.ndarray) -> None:
        """Encode one picture, uint8 (height, width, 3)."""
        import av
        import cv2

        planes: Any = cv2.cvtColor(picture, cv2.COLOR_RGB2YUV_I420)
        self.container.mux(self.stream.encode(av.VideoFrame.from_ndarray(planes, format="yuv420p")))

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if error is None:  # a film that failed is not finished, and its file is dropped with the folder
            # the encoder holds frames back to order them: a call without one writes these
            self.container.mux(self.stream.encode())
        self.container.close()
