"""A picture of a body in its own frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.types import Camera
from monodyn.vision.locating.body import CELLS, BodyView, beside, best_bar, best_disc
from monodyn.vision.locating.search import SceneGuess
from pictures import drawn_frames

CAMERA = Camera(200, 160, 150.0, x=0.02, y=-0.05, depth=0.75)
SIDE = np.arange(-CELLS, CELLS + 1)


def test_the_bar_that_gains_most_is_the_one_that_is_there() -> None:
    x, y = np.meshgrid(SIDE, SIDE)
    c, s = np.cos(np.pi / 3), np.sin(np.pi / 3)
    u, v = c * (x - 12) + s * (y + 20), -s * (x - 12) + c * (y + 20)
    picture = np.where((np.abs(u) < 25) & (np.abs(v) < 5), 1.0, -1.0).astype(np.float32)
    bar = best_bar(picture)
    assert (bar.x, bar.y) == pytest.approx((12.0, -20.0), abs=3.0)
    assert bar.angle == pytest.approx(np.pi / 3, abs=1e-6)
    # sizes of a grid
    assert bar.length == pytest.approx(50.0, rel=0.15)
    assert bar.width == pytest.approx(10.0, rel=0.2)
    assert bar.gain > 0.7 * picture[picture > 0].sum()


def test_the_disc_that_gains_most_is_the_one_that_is_there() -> None:
    x, y = np.meshgrid(SIDE, SIDE)
    disc = best_disc(np.where(np.hypot(x + 30, y - 9) < 14, 1.0, -1.0).astype(np.float32))
    assert (disc.x, disc.y) == pytest.approx((-30.0, 9.0), abs=1.0)
    assert disc.width == pytest.approx(28.0, rel=0.15)


def test_where_nothing_gains_nothing_is_found() -> None:
    nothing = np.full((len(SIDE), len(SIDE)), -1.0, np.float32)
    assert best_bar(nothing).gain == best_disc(nothing).gain == 0.0


def test_a_body_gains_where_it_is_and_loses_where_it_never_is() -> None:
    mechanism = load("double")
    poses = np.column_stack([np.linspace(-2.2, -0.8, 6), [1.0, -1.3, 0.7, 2.0, -0.4, 1.6]])
    guess = SceneGuess(mechanism, CAMERA, poses, np.zeros(6))
    for link in (0, 1):
        view = BodyView(drawn_frames(mechanism, CAMERA, poses), guess, link)
        (own,) = view.geoms
        covered = view.covered([own])
        # a pixel at the border is half covered, and at its hinge the other link covers it
        assert view.gain[covered].mean() > 0.4
        assert view.gain[~covered].max() < 0.9
        assert view.gain[covered].sum() * view.cell**2 == pytest.approx(
            mechanism.values[f"link{link + 1}.length"] * mechanism.values[f"link{link + 1}.width"], rel=0.4
        )


def test_what_moves_along_with_a_body_is_measured(tmp_path: Path) -> None:
    bar = '<geom type="box" size=".12 .003 .012" pos=".12 0 0"/>'
    disc = '<geom type="cylinder" size=".03 .003" pos=".12 0 .06" euler="90 0 0"/>'
    made = []
    for geoms in (bar, bar + disc):
        (tmp_path / "body.xml").write_text(
            '<mujoco><worldbody><body name="a"><joint name="j" axis="0 -1 0"/>'
            + geoms
            + "</body></worldbody></mujoco>"
        )
        made.append(load(tmp_path / "body.xml"))
    poses = np.array([[-2.4], [-1.9], [-1.3], [-0.7], [-0.2], [0.6]])
    without, whole = made
    frames = drawn_frames(whole, CAMERA, poses)
    # the disc's share of bar and disc, less its border
    share = np.pi * 0.03**2 / (np.pi * 0.03**2 + 0.24 * 0.024 - 0.0)
    assert beside(frames, SceneGuess(without, CAMERA, poses, np.zeros(6)))["a"] == pytest.approx(
        share, rel=0.35
    )
    assert beside(frames, SceneGuess(whole, CAMERA, poses, np.zeros(6))) == {"a": 0.0}
    # in a wrong pose of each frame nothing is at one place of the body
    passing = beside(frames, SceneGuess(without, CAMERA, poses + np.linspace(-2, 2, 6)[:, None], np.zeros(6)))
    assert passing["a"] < 0.02
