"""Figures of real records: two filmed pendulums and encoder logs, next to what is known of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import monodyn
from encoders import KNOWN_RATIOS, MOST_OFF, MOST_RESIDUAL, REQUIRED_WINDOW
from figures import Figure, say
from monodyn.vision.drawing.camera import pixels
from monodyn.vision.drawing.follow import EdgeSearch
from monodyn.vision.locating.bundle import KeyMasks, refine
from monodyn.vision.locating.scene import Scene
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.locating.variables import scene_variables

LOOKS = 30
"""Frames spread over a clip in which the first link is measured by itself."""
EDGES = EdgeSearch(np.array([5.0, 4.0, 4.0, 4.0, 4.0, 4.0]), 3.0)
"""Edge search of these measurements [px]."""
CLOCK = "time stamps"
"""Words of the advice that says what lengths depend on."""
LINKS_PIVOT, LINK_PX = (550.0, 494.0), 151.0
"""Where the double pendulum's first hinge is and how long its first link is [px]."""
BALL_PIVOT, CIRCLE_PX = (508.0, 584.0), 333.0
"""Where the rod pendulum's hinge is and the radius of its ball's circle [px]."""
NORMAL = 1.4826
"""Standard deviation of normal numbers over their median absolute deviation."""


@dataclass(frozen=True, eq=False)
class Seen:
    """A filmed mechanism.

    Attributes:
        scene: The mechanism before its camera.
        poses: Its joint positions, slides in the start scale.
        pivot: Where the first hinge is drawn [px], (2,).
        radius: How far from it the end of the first link is drawn, median over the frames [px].
    """

    scene: Scene
    poses: monodyn.Poses
    pivot: np.ndarray
    radius: float


def links(data: Path) -> list[Figure]:
    """Run the film of a passive double pendulum.

    Args:
        data: The data folder.

    Returns:
        Its figures; the pivot is near (550, 494), the first link 151 px long.
    """
    name = "double_pendulum"
    seen = _seen(data / "real" / f"{name}.webm", "double")
    lengths = _lengths(seen)
    return [
        Figure(name, "frames tracked", _share(seen.poses), "%", 98.0, least=True),
        Figure(name, "pivot off (550, 494)", _away(seen.pivot, LINKS_PIVOT), "px"),
        Figure(name, "first link drawn", seen.radius, "px"),
        Figure(name, "first link off 151 px", 100.0 * abs(seen.radius / LINK_PX - 1.0), "%"),
        Figure(name, f"first link in {len(lengths)} single frames, median", float(np.median(lengths)), "px"),
        Figure(name, "the same, spread over the frames", 100.0 * _scatter(lengths), "%"),
        *_dynamics(name, seen),
    ]


def ball(data: Path) -> list[Figure]:
    """Run the film of a rod pendulum with a ball.

    Args:
        data: The data folder.

    Returns:
        Its figures; the pivot is near (508, 584), the radius of the ball's circle 333 px.
    """
    name = "holonomic_pendulum"
    seen = _seen(data / "real" / f"{name}.webm", "bob")
    return [
        Figure(name, "frames tracked", _share(seen.poses), "%", 100.0, least=True),
        Figure(name, "pivot off (508, 584)", _away(seen.pivot, BALL_PIVOT), "px", 3.0),
        Figure(name, "radius", seen.radius, "px"),
        Figure(name, "radius off 333 px", 100.0 * abs(seen.radius / CIRCLE_PX - 1.0), "%", 0.5),
        *_dynamics(name, seen),
    ]


def encoders(data: Path) -> list[Figure]:
    """Identify encoder logs with free bodies; ``encoders.py`` runs all windows.

    Args:
        data: The data folder.

    Returns:
        Residuals and, of the double pendulum, the ratios that are known.
    """
    figures = []
    for file in [
        *sorted((data / "encoders").glob("single_*.csv")),
        data / "encoders" / f"{REQUIRED_WINDOW}.csv",
    ]:
        mechanism = monodyn.load(file.stem.split("_")[0])
        double = len(mechanism.joints) == 2
        settings = monodyn.IdentifySettings(bodies="free")
        fit = monodyn.identify(monodyn.read_poses(file, mechanism), mechanism, settings)
        if not fit.ok:
            say(f"{file.stem}: {fit.status}")
        for joint, value in fit.rms.items():
            figures.append(
                Figure(file.stem, f"{joint} residual", 1e3 * value, "mrad", MOST_RESIDUAL if double else None)
            )
        found = {combination.name: combination for combination in fit.combinations}
        for name, known in KNOWN_RATIOS.items() if double else ():
            error = 100.0 * abs(found[name].value / known - 1.0) if name in found else float("nan")
            spread = 100.0 * found[name].std / known if name in found else None
            figures.append(Figure(file.stem, name, error, "%", MOST_OFF, spread))
    return figures


def _seen(clip: Path, model: str) -> Seen:
    """Track a clip with a bundled model."""
    mechanism = monodyn.load(model)
    scene = monodyn.locate(monodyn.segment(monodyn.read(clip)), mechanism)
    poses = monodyn.track(scene.masks, scene)
    found, tree = scene.mechanism, scene.mechanism.tree
    shapes = found.shapes
    owner = np.repeat(shapes.link, np.diff(shapes.first))
    height = float(np.mean(shapes.points[owner == 0, 2]))
    length = found.values["link1.length"]
    # links of the bundled models lie along their x axis, and a hinge at 0 points to the right
    angle = tree.links[0, 2] + poses.position[poses.seen, 0]
    ends = np.stack([length * np.cos(angle), length * np.sin(angle), np.full(len(angle), height)], axis=1)
    pivot = pixels(scene.camera, np.array([[0.0, 0.0, height]]))[0]
    radius = float(np.median(np.linalg.norm(pixels(scene.camera, ends) - pivot, axis=1)))
    return Seen(scene, poses, pivot, radius)


def _lengths(seen: Seen) -> np.ndarray:
    """Measure the first link by itself in frames spread over the clip [px], (frame,).

    Drawn with one mechanism its length cannot vary; here it is refined in each frame alone, with camera and
    all other sizes held.
    """
    scene, poses = seen.scene, seen.poses
    rows = np.flatnonzero(poses.seen)
    rows = rows[np.linspace(0, len(rows) - 1, min(LOOKS, len(rows))).astype(int)]
    chosen = {int(poses.frame[row]): poses.position[row] for row in rows}
    size = "link1.length"
    variables = scene_variables(scene.mechanism, [size])
    view = scene.masks.view(len(scene.mechanism.shapes.radius))
    found = []
    for frame in scene.masks.video.frames():
        if frame.index in chosen:
            masks = KeyMasks([scene.masks.of(frame).planes], view)
            position = chosen[frame.index][None]
            guess = SceneGuess(scene.mechanism, scene.camera, position, np.zeros(1))
            bundle = refine(masks, guess, variables, EDGES)
            found.append(bundle.mechanism.values[size] / variables.start[size] * seen.radius)
    return np.array(found)


def _dynamics(name: str, seen: Seen) -> list[Figure]:
    """Fit the whole clip; say whether it can be used and whether it says that lengths hang on the clock."""
    fit = monodyn.identify(seen.poses, seen.scene.mechanism)
    said = any(CLOCK in sentence for sentence in fit.advice)
    figures = [Figure(name, "advice on the clock", float(said), "", 1.0, least=True)]
    return figures + [
        Figure(name, f"{joint} residual, whole clip", float(np.rad2deg(value)), "deg")
        for joint, value in fit.rms.items()
    ]


def _share(poses: monodyn.Poses) -> float:
    """Return the share of frames that were seen [%]."""
    return 100.0 * float(np.mean(poses.seen))


def _away(point: np.ndarray, place: tuple[float, float]) -> float:
    """Return the distance of a point from a place [px]."""
    return float(np.hypot(point[0] - place[0], point[1] - place[1]))


def _scatter(values: np.ndarray) -> float:
    """Return the standard deviation by the median absolute deviation, against the median."""
    middle = float(np.median(values))
    return NORMAL * float(np.median(np.abs(values - middle))) / middle
