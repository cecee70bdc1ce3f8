"""What the diagnosis shows of tracked points."""

from __future__ import annotations

import numpy as np

from monodyn.mechanism import load
from monodyn.results.diagnosis import diagnosis
from monodyn.results.pointed import points_panels
from monodyn.results.sheet import GREEN, RED, WIDTH, column_width
from monodyn.results.sight import Sight
from monodyn.stages import locate, track
from monodyn.vision.points.tracks import without_pictures
from tracked import seen, swing, tracks

NAMES = ("joint1", "joint2", "link2")


def counted(picture: np.ndarray, colour: tuple[int, int, int]) -> int:
    return int(np.all(picture == colour, axis=2).sum())


def test_points_on_and_off_their_marks() -> None:
    double = load("double")
    px = seen(double, swing(double, 40, (0.5, 0.4)), NAMES)
    px[7, 2] += 90.0
    points = tracks(NAMES, px)
    sight = Sight(without_pictures(points), tracks=points)
    assert (sight.name, sight.filmed, sight.readable, sight.stage) == (
        "points.csv", False, True, "nothing was located",
    )  # fmt: skip
    assert len(points_panels(sight)) == 3
    sight.points = locate(points, double)
    sight.poses = track(points, sight.points)
    assert sight.stage == "no joint is shown"
    paths, typical, worst = points_panels(sight)
    assert {panel.shape[1] for panel in (paths, typical, worst)} == {column_width(3)}
    # the point that is elsewhere is crossed out; the legend of both has one cross and a few dots
    assert counted(worst, RED) > counted(typical, RED)
    assert counted(typical, GREEN) > 0
    page = diagnosis(sight)
    assert page.shape[1] == WIDTH
