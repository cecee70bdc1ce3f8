"""Equal dots of drawn masks, told apart by the motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dotted import BALLS, DrawnMasks
from monodyn.errors import MechanismError, VideoError
from monodyn.mechanism import Mechanism, load
from monodyn.stages import locate, track
from monodyn.types import Camera
from monodyn.vision.dots.find import find_dots
from monodyn.vision.points.sticks import sticks
from support import refuses
from tracked import CAMERA, apart, seen, swing

COUNT = 90


@pytest.fixture(scope="module")
def balls(tmp_path_factory) -> tuple[Mechanism, np.ndarray, np.ndarray]:
    """The mechanism of a file, a motion of one with other sizes, and where its dots are."""
    path = tmp_path_factory.mktemp("dots") / "balls.xml"
    path.write_text(BALLS, encoding="utf-8")
    file = load(path)
    truth = file.with_values({"link1.length": 0.22, "link2.length": 0.17}).with_bodies("free")
    rods = {f"link{i}.inertia": 1e-4 for i in (1, 2)}
    position = swing(truth.with_values(rods), COUNT, (-0.6, 0.8))
    camera = Camera(1280, 720, 1280.0, 0.02, -0.1, 1.3)
    return file, position, seen(truth, position, ("link1_dot", "tip"), camera=camera)


@pytest.mark.slow
def test_dots_have_their_names_in_every_frame(balls) -> None:
    file, position, px = balls
    # the order in which dots are drawn says nothing
    tracks = find_dots(DrawnMasks(px[:, ::-1]), file)  # type: ignore[arg-type]
    assert tracks.names == ("link1_dot", "tip")
    assert tracks.told_apart
    assert tracks.clip is not None
    assert tracks.found.mean() > 0.95
    np.testing.assert_allclose(tracks.px[tracks.found], px[tracks.found], atol=0.1)
    scene = locate(tracks, file)
    values = scene.mechanism.values
    assert values["link1.length"] / values["link2.length"] == pytest.approx(0.22 / 0.17, rel=0.01)
    poses = track(tracks, scene)
    off = apart(poses.position[poses.seen], position[poses.frame[poses.seen]])
    assert np.sqrt(np.mean(off**2)) < np.deg2rad(0.15)


@pytest.mark.slow
def test_dots_that_hide_and_things_that_are_none(balls) -> None:
    file, _, px = balls
    path = np.stack([200.0 + 6.0 * np.arange(COUNT), 500.0 + 40.0 * np.sin(np.arange(COUNT) / 5.0)], axis=1)
    drawn = np.concatenate([px, path[:, None]], axis=1)
    drawn[20:27, 0] = np.nan
    drawn[40:46, :2] = np.nan
    drawn[46:60, 1] = np.nan
    tracks = find_dots(DrawnMasks(drawn), file)  # type: ignore[arg-type]
    known = np.isfinite(drawn[:, :2, 0])
    # a spot that the other thing hides is missing, none has a wrong name
    assert not np.any(tracks.found & ~known)
    assert np.mean(tracks.found[known]) > 0.85
    assert np.linalg.norm(tracks.px - px, axis=2)[tracks.found].max() < 2.0
    (note,) = tracks.notes
    assert note.endswith("% of the spots that move are none of the dots.")


@pytest.mark.slow
def test_what_cannot_be_told_apart_is_refused(balls, tmp_path: Path) -> None:
    _, _, px = balls
    file = load("double")
    with refuses(
        MechanismError,
        "mechanism 'double': expected 1 to 6 dots (balls or sites) and nothing else that can be seen, got 0; "
        "locate it by its outline, or track its points.",
    ):
        find_dots(DrawnMasks(px), file)  # type: ignore[arg-type]
    with refuses(
        VideoError,
        "clip 'dots.mp4': expected 2 dots that move, all of them in the picture for 8 frames or more, got 1 "
        "at once; diagnosis.png shows what moves. Where they hardly stand out, a lower --segment.contrast "
        "may help.",
    ):
        find_dots(DrawnMasks(px[:, :1]), balls[0])  # type: ignore[arg-type]
    with pytest.raises(VideoError, match="got 0 at once"):
        find_dots(DrawnMasks(px * np.nan), balls[0])  # type: ignore[arg-type]


def test_sticks_lead_from_the_hinges_to_the_dots(balls) -> None:
    file, position, _ = balls
    lines = sticks(file, CAMERA, position[0])
    dots = seen(file, position[:1], ("link1_dot", "tip"))[0]
    np.testing.assert_allclose([line[1] for line in lines], dots, atol=1e-9)
    # the second hinge is where the first dot is, but for how far before it the second link stands
    assert np.linalg.norm(lines[1][0] - lines[0][1]) < 3.0
    assert sticks(load("double"), CAMERA, np.zeros(2)) == []
