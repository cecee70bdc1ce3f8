"""Clips with known truth, made by the benchmark's painter, through segmentation, location and tracking."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import monodyn
from cases import CASES
from clips import cached, exposures, simulate
from paint import Painter, fill_convex
from spec import Case, view


def small(name: str, seconds: float = 2.0) -> Case:
    """Return a case as a short clip of few pixels."""
    return replace(CASES[name], size=(360, 240), seconds=seconds)


def test_filled_polygons_have_their_exact_area() -> None:
    rng = np.random.default_rng(0)
    excess = []
    for _ in range(40):
        angle, centre = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(95.0, 105.0, 2)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        corners = np.array([[-60.0, -10.0], [60.0, -10.0], [60.0, 10.0], [-60.0, 10.0]]) @ turn.T + centre
        canvas = np.zeros((200, 200, 1), np.uint8)
        fill_convex(canvas, corners, np.array([1], np.uint8))
        excess.append((float(canvas.sum()) - 120.0 * 20.0) / (2.0 * (120.0 + 20.0)))
    # pixel centres in a polygon are an unbiased count of its area; half a pixel all around would give 0.5
    assert abs(np.mean(excess)) < 0.02


def test_the_same_case_gives_the_same_picture_and_the_edges_lie_where_the_camera_puts_them() -> None:
    case = replace(small("single_short_thick"), noise=0.0, wall="plain", pivot=(0.5, 0.5), start=(0.0,))
    q = next(exposures(case, simulate(case)))
    pictures = [Painter(case).picture(q) for _ in range(2)]
    assert np.array_equal(*pictures)
    part = case.parts[0]
    # the camera stands before the hinge: right of it, only the front face of the level link is seen
    column, row = round((case.size[0] - 1) / 2) + 20, round((case.size[1] - 1) / 2)
    wall, shown = (p[:, column:, 0].astype(float) for p in (Painter(case).picture(q + np.pi), pictures[0]))
    share = (wall - shown) / (wall - part.colour[0])
    focal, eye = view(case)
    scale = focal / (-eye[1] - part.thickness / 2)
    end = scale * (part.length - eye[0]) + (case.size[0] - 1) / 2
    # an edge along the rows falls between two of the four fine rows of a pixel: a quarter, and rounded levels
    assert np.sum(share[:, 25]) == pytest.approx(scale * part.width, abs=0.3)
    assert np.sum(share[row]) == pytest.approx(end - (column - 0.5), abs=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["single_capsule", "double_two_colours", "cart_off_centre"])
def test_poses_of_a_made_clip(name: str, tmp_path: Path) -> None:
    clip = cached(small(name), tmp_path)
    scene = monodyn.locate(monodyn.segment(monodyn.read(clip.video)), monodyn.load(clip.model))
    poses = monodyn.track(scene.masks, scene)
    assert np.mean(poses.seen) > 0.95
    hinges = [j.kind == "hinge" for j in scene.mechanism.joints]
    error = (poses.position - clip.position)[poses.seen][:, hinges]
    error = np.degrees((error + np.pi) % (2.0 * np.pi) - np.pi)
    # links of 60 to 90 px with an edge noise of 0.1 px are seen to 0.1 deg; three times that for model errors
    assert np.sqrt(np.mean(error**2, axis=0)).max() < 0.3
