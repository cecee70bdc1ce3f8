"""The made clip: painted rods against exact geometry, the motion's energy, the file against its truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from monodyn.reproduce.clip import (
    ClipSettings,
    Pendulum,
    coverage,
    faces,
    make_clip,
    painted,
    project,
    simulated,
    truth_document,
    wall,
)

TILTED = np.array([[20.3, 11.7], [61.9, 24.2], [55.1, 46.6], [13.5, 34.1]])


def area(polygon: np.ndarray) -> float:
    """Return the area of a polygon by the shoelace formula."""
    x, y = polygon.T
    return 0.5 * abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))))


def whole(polygon: np.ndarray, shape: tuple[int, int] = (64, 80)) -> np.ndarray:
    """Return the coverage of every pixel of a picture."""
    picture = np.zeros(shape)
    rows, columns, share = coverage(polygon, shape)
    picture[rows, columns] = share
    return picture


def corners(settings: ClipSettings, position: np.ndarray, rod: int) -> np.ndarray:
    """Project the eight corners of a rod, worked out here from the joint angles."""
    rods, angle = settings.pendulum, np.cumsum(position)
    hinge = sum(
        (rods.length[i] * np.array([np.cos(angle[i]), np.sin(angle[i])]) for i in range(rod)), np.zeros(2)
    )
    u = np.array([np.cos(angle[rod]), np.sin(angle[rod])])
    n = np.array([-u[1], u[0]])
    points = [
        [*(hinge + along * rods.length[rod] * u + across * rods.width[rod] / 2 * n), depth]
        for along in (0.0, 1.0)
        for across in (-1.0, 1.0)
        for depth in rod * rods.layer + np.array([-0.5, 0.5]) * rods.thickness[rod]
    ]
    return project(settings.camera, np.array(points))


def test_coverage_of_an_upright_rectangle_is_exact() -> None:
    share = whole(np.array([[9.75, 4.5], [12.0, 4.5], [12.0, 7.5], [9.75, 7.5]]))
    assert share[5:8, 10:13] == pytest.approx(np.tile([0.75, 1.0, 0.5], (3, 1)), abs=1e-6)
    assert share.sum() == pytest.approx(2.25 * 3.0, rel=1e-6)


def test_coverage_of_a_tilted_polygon_has_its_area_and_centroid() -> None:
    share = whole(TILTED)
    assert share.sum() == pytest.approx(area(TILTED), rel=2e-4)
    row, column = np.mgrid[:64, :80]
    # a parallelogram: its centroid is the mean of its corners
    middle = np.array([(share * column).sum(), (share * row).sum()]) / share.sum()
    assert middle == pytest.approx(TILTED.mean(axis=0), abs=0.005)


def test_coverage_agrees_with_points_in_the_polygon() -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.5, 0.5, (4000, 2))
    share = whole(TILTED)
    for row, column in ((12, 20), (25, 61), (30, 16), (40, 33), (28, 40), (5, 5)):
        spots = points + np.array([column, row])
        inside = np.ones(len(spots), dtype=bool)
        for a, b in zip(TILTED, np.roll(TILTED, -1, axis=0), strict=True):
            inside &= (b[0] - a[0]) * (spots[:, 1] - a[1]) - (b[1] - a[1]) * (spots[:, 0] - a[0]) >= 0
        # four standard deviations of a share from 4000 points
        assert share[row, column] == pytest.approx(inside.mean(), abs=0.035)


@pytest.mark.parametrize("shift", [(-40.0, 0.0), (50.0, 30.0), (0.0, -60.0), (500.0, 0.0)])
def test_coverage_is_cut_at_the_picture(shift: tuple[float, float]) -> None:
    polygon = TILTED + shift
    share = whole(polygon)
    wide = whole(polygon + np.array([100.0, 100.0]), (264, 800))
    assert share == pytest.approx(wide[100:164, 100:180], abs=1e-4)


def test_a_painted_rod_has_the_area_of_its_exact_outline() -> None:
    rods = Pendulum(layer=0.05)
    settings = ClipSettings(pendulum=rods, colour=((1.0, 1.0, 1.0), (0.0, 0.0, 0.0)))
    position = np.array([-0.9, 0.6])
    for rod in range(2):
        hull = cv2.convexHull(corners(settings, position, rod).astype(np.float32))[:, 0]
        total = sum(area(polygon) for polygon, _ in faces(settings, position)[rod])
        assert total == pytest.approx(area(hull), rel=1e-5)
    picture = painted(settings, position, np.full((480, 720, 3), 100.0))
    dark = (100.0 - picture[..., 0]).clip(min=0).sum() / 100.0
    hull = cv2.convexHull(corners(settings, position, 1).astype(np.float32))[:, 0]
    assert dark == pytest.approx(area(hull), rel=1e-3)


def test_the_motion_keeps_its_energy_without_friction() -> None:
    rods = Pendulum(damping=(0.0, 0.0))
    truth = simulated(ClipSettings(pendulum=rods, frames=60))
    mass = rods.density * np.prod([rods.length, rods.width, rods.thickness], axis=0)
    angle, rate = np.cumsum(truth.position, axis=1), np.cumsum(truth.velocity, axis=1)
    place = np.zeros((2, 60))
    speed = np.zeros((2, 60))
    energy = np.zeros(60)
    for i in range(2):
        u = np.array([np.cos(angle[:, i]), np.sin(angle[:, i])])
        n = np.array([-u[1], u[0]])
        half = rods.length[i] / 2
        middle, pace = place + half * u, speed + half * rate[:, i] * n
        inertia = mass[i] / 12 * (rods.length[i] ** 2 + rods.width[i] ** 2)
        energy += mass[i] * (9.81 * middle[1] + 0.5 * (pace**2).sum(axis=0))
        energy += 0.5 * inertia * rate[:, i] ** 2
        place, speed = place + rods.length[i] * u, speed + rods.length[i] * rate[:, i] * n
    assert np.ptp(energy) < 1e-6 * np.ptp(0.5 * mass[0] * rate[:, 0] ** 2)


def test_the_clip_is_that_of_its_truth_and_its_seed(tmp_path: Path) -> None:
    settings = ClipSettings(frames=3)
    truth = make_clip(tmp_path / "a.mp4", settings)
    make_clip(tmp_path / "b.mp4", settings)
    make_clip(tmp_path / "c.mp4", replace(settings, seed=1))
    first, second, other = ((tmp_path / f"{name}.mp4").read_bytes() for name in "abc")
    assert first == second
    assert first != other
    film = cv2.VideoCapture(str(tmp_path / "a.mp4"))
    assert film.get(cv2.CAP_PROP_FPS) == 30.0
    background = wall(settings, np.random.default_rng(settings.seed))
    for position in truth.position:
        found, picture = film.read()
        assert found
        exact = painted(settings, position, background)
        # noise of 2 grey levels and the codec's rounding
        assert np.sqrt(np.mean((picture[..., ::-1] - exact) ** 2)) < 4.0
    document = truth_document(truth, settings)
    assert document["pendulum"]["length"] == settings.pendulum.length
    assert document["q"][0] == [-0.3, -0.3]
    assert document["times"][1] == pytest.approx(1 / 30, abs=1e-9)
