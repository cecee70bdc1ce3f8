"""The film and the stills: sizes, stamps, colours where the mechanism is drawn."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest

from monodyn.errors import MonodynError
from monodyn.mechanism import load
from monodyn.results import overlay
from monodyn.results.overlay import (
    FILLED,
    FITTED,
    PREDICTED,
    TINT,
    TINTED,
    TRACKED,
    Drawing,
    DrawnMotion,
    draw,
    encoded_picture,
    still,
    write_overlay,
)
from monodyn.types import FULL, Camera, Frame, Poses
from monodyn.vision.clip.video import read
from monodyn.vision.drawing.outline import outline
from support import ClipMaker

BOX = np.array([[20.0, 20.0], [60.0, 20.0], [60.0, 50.0], [20.0, 50.0]])


def grey(height: int = 96, width: int = 128) -> Frame:
    return Frame(0, 0.0, np.full((height, width), 100, np.uint8), None)


def at(index: int, time: float = 0.0) -> Frame:
    return Frame(index, time, np.full((96, 128), 100, np.uint8), None)


def motion(count: int, size: tuple[int, int], stop: int, tracked: Poses | None = None) -> DrawnMotion:
    camera = Camera(width=size[0], height=size[1], focal=100.0, depth=0.6)
    position = np.linspace(-1.5, -1.0, count)[:, None]
    return DrawnMotion(load("single"), camera, position, (0, stop), tracked)


def test_outlines_are_drawn_and_the_frame_is_left_alone() -> None:
    frame = grey()
    frame.luma.flags.writeable = False
    planes = draw(frame, Drawing([(BOX, FITTED)]))
    assert planes.shape == (144, 128)
    assert abs(int(planes[20, 40]) - FITTED.luma) <= 20  # a line of one pixel is antialiased
    assert planes[35, 40] == 100
    blue = planes[96:].reshape(2, 48, 64)[0]
    assert blue[10, 20] == FITTED.blue
    assert blue[17, 20] == 128
    assert np.all(frame.luma == 100)


def test_a_body_behind_the_camera_in_one_of_two_poses_is_a_difference(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    q = np.array([[-1.5]])
    seen = Poses(("joint1",), np.arange(1), np.zeros(1), q + 1e-9, np.full((1, 1, 1), 1e-6), np.ones(1, bool))
    # the model shows one outline, the tracked pose another one too
    monkeypatch.setattr(
        overlay, "outlines_of", lambda _m, _c, q, _: [BOX] if q[0] == -1.5 else [BOX, BOX + 9.0]
    )
    drawing = motion(1, (128, 96), 1, seen).drawing(at(0))
    assert [ink for _, ink in drawing.outlines] == [TRACKED, TRACKED, FITTED]


def test_odd_sizes_are_made_even_by_repeating_the_edge() -> None:
    frame = Frame(0, 0.0, np.arange(95 * 127, dtype=np.int64).reshape(95, 127).astype(np.uint8), None)
    planes = draw(frame, Drawing([]))
    assert planes.shape == (144, 128)
    assert np.array_equal(planes[:95, :127], frame.luma)
    assert np.array_equal(planes[95, :127], frame.luma[94])
    assert np.array_equal(planes[:95, 127], frame.luma[:, 126])


def test_still_is_a_picture_of_the_frame_size() -> None:
    picture = cv2.imdecode(np.frombuffer(still(grey(95, 127), Drawing([(BOX, PREDICTED)])), np.uint8), 1)
    assert picture.shape == (95, 127, 3)


@pytest.mark.parametrize("size", [(64, 48), (62, 50), (61, 49), (64, 2), (854, 482)])
def test_an_encoder_takes_what_was_drawn_in_every_size(size: tuple[int, int]) -> None:
    """PyAV takes planes without a copy, but of chroma planes with an odd number of rows."""
    width, height = (side + side % 2 for side in size)
    planes = np.random.default_rng(0).integers(16, 236, (height * 3 // 2, width), dtype=np.uint8)
    picture = encoded_picture(planes)
    assert (picture.width, picture.height) == (width, height)
    np.testing.assert_array_equal(picture.to_ndarray(), planes)


def test_film_keeps_the_stamps_and_the_size(make_clip: ClipMaker, tmp_path: Path) -> None:
    stamps = [0, 3, 4, 9, 10, 11, 20, 21, 25, 26, 40, 41]
    video = read(make_clip("clip.mkv", stamps=stamps, base=Fraction(1, 600), size=(63, 47), pixel="yuv444p"))
    seen: list[int] = []
    film = tmp_path / "overlay.mp4"
    pictures = write_overlay(
        film, video, motion(12, (63, 47), 9).drawing, progress=lambda step, done, total: seen.append(done)
    )
    drawn = read(film)
    assert (drawn.width, drawn.height, drawn.count) == (64, 48, 12)
    # stamps in mkv are whole milliseconds
    assert np.allclose(drawn.times, np.array(stamps) / 600, atol=6e-4)
    assert seen == list(range(1, 13))
    assert [caption.split(",")[0] for _, caption in pictures] == ["Frame 0", "Frame 5", "Frame 11"]
    assert pictures[0][1].endswith("fitted")
    assert pictures[2][1].endswith("predicted")


@pytest.mark.parametrize(("begin", "first"), [(5.0, 5.0), (-1.0, 0.0), (1.7e9, 0.0)])
def test_a_film_begins_when_its_clip_does(
    make_clip: ClipMaker, tmp_path: Path, begin: float, first: float
) -> None:
    video = read(make_clip("clip.mp4", count=6))
    film = tmp_path / "overlay.mp4"
    write_overlay(film, video, motion(6, (64, 48), 4).drawing, begin=begin)
    np.testing.assert_allclose(read(film).times, video.times - video.times[0] + first, atol=1e-4)


def test_ink_changes_after_the_fitted_frames() -> None:
    scene = motion(4, (128, 96), 2)
    assert [scene.drawing(at(i)).outlines[0][1] for i in range(4)] == [FITTED, FITTED, PREDICTED, PREDICTED]


def test_tracked_outline_is_drawn_where_it_differs_or_alone() -> None:
    position = np.linspace(-1.5, -1.0, 4)[:, None] + np.array([[0.0], [0.0], [0.3], [0.0]])
    poses = Poses(
        ("joint1",), np.arange(4), np.arange(4.0), position, np.zeros((4, 1, 1)), np.array([1, 0, 1, 1], bool)
    )
    scene = motion(4, (128, 96), 4, poses)
    assert [len(scene.drawing(at(i)).outlines) for i in range(4)] == [1, 1, 2, 1]
    assert scene.drawing(at(2)).outlines[0][1] is TRACKED
    alone = DrawnMotion(scene.mechanism, scene.camera, np.full((4, 1), np.nan), (0, 4), poses)
    assert alone.drawing(at(0, 1.0)).caption == "1.00 s  tracked"
    assert alone.drawing(at(1, 1.0)).caption == "1.00 s  not seen"


def test_bodies_that_were_hidden_are_drawn_filled() -> None:
    """The second link where its joint alone was hidden, both where the first was; a prediction is on top."""
    mechanism, camera = load("double"), Camera(width=128, height=96, focal=100.0, depth=0.8)
    seen = np.array([[1, 1], [1, 0], [0, 1], [1, 0]], dtype=bool)
    position = np.tile([-1.0, 0.5], (4, 1))
    poses = Poses(
        ("joint1", "joint2"), np.arange(4), np.arange(4.0), np.where(seen, position, np.nan),
        np.zeros((4, 2, 2)), seen.all(axis=1), joint_seen=seen,
    )  # fmt: skip
    through = position + np.array([[0.0, 0.0], [0.0, 0.1], [0.1, 0.0], [0.0, 0.1]])
    scene = DrawnMotion(mechanism, camera, position, (0, 3), poses, filled=through)
    drawn = [scene.drawing(at(i, 1.0)) for i in range(4)]
    whole, two = [FITTED, FITTED], [FILLED, FILLED]
    assert [[ink for _, ink in one.outlines] for one in drawn] == [
        whole, [*whole, FILLED], [*whole, *two], [FILLED, PREDICTED, PREDICTED],
    ]  # fmt: skip
    second = dict(outline(mechanism, camera, through[1]))["link2"]
    np.testing.assert_array_equal(drawn[1].outlines[2][0], second)
    captions = [one.caption.split("  ")[1] for one in drawn]
    assert captions == ["fitted", "fitted, filled", "fitted, filled", "predicted, filled"]
    unknown = replace(scene, filled=np.full_like(through, np.nan))
    assert [ink for _, ink in unknown.drawing(at(1)).outlines] == whole


def test_outline_stands_where_the_camera_sees_the_link() -> None:
    camera = Camera(width=200, height=100, focal=100.0, depth=1.0)
    ((body, polygon),) = outline(load("single"), camera, np.array([0.0]))
    assert body == "link1"
    # a link of 0.2 m lies to the right of the centre, 20 px at 100 px/m, with half a width behind its hinge
    assert polygon[:, 0].max() == pytest.approx(99.5 + 20.0, abs=3.0)
    assert polygon[:, 1].mean() == pytest.approx(49.5, abs=0.5)


def test_a_film_that_cannot_be_written_is_an_oserror(make_clip: ClipMaker, tmp_path: Path) -> None:
    video = read(make_clip())
    with pytest.raises(OSError, match="No such file or directory"):
        write_overlay(tmp_path / "nowhere" / "overlay.mp4", video, motion(12, (64, 48), 9).drawing)
    assert not issubclass(MonodynError, OSError)


def test_a_tint_is_mixed_in_by_coverage() -> None:
    cover = np.zeros((96, 128), np.uint8)
    cover[:, 64:] = FULL
    planes = draw(grey(), Drawing([], tint=cover))
    assert (planes[:96, :64] == 100).all()
    assert (planes[:96, 64:] == 100 + int(TINTED * (TINT.luma - 100))).all()
    blue = planes[96:].reshape(2, 48, 64)[0]
    assert (blue[:, :32] == 128).all()
    assert (abs(blue[:, 32:].astype(int) - (128 + TINTED * (TINT.blue - 128))) <= 1).all()


def test_a_long_reason_takes_lines_above_the_caption() -> None:
    short = draw(grey(480, 640), Drawing([], "0.00 s  nothing moves"))
    both = draw(grey(480, 640), Drawing([], "0.00 s  nothing moves", "a long reason " * 30))
    written = [np.flatnonzero((planes[:480] != 100).any(axis=1)) for planes in (short, both)]
    assert written[0].min() > 440
    # 420 letters are seven lines of 64
    assert 290 < written[1].min() < 310
    assert np.array_equal(short[451:480], both[451:480])


@pytest.mark.parametrize(("height", "width"), [(480, 640), (480, 270), (1080, 608), (96, 128)])
def test_a_reason_is_written_to_its_end(height: int, width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """However long it is and however small the picture: what to do stands at its end."""
    lines: list[tuple[str, float]] = []
    monkeypatch.setattr(
        overlay, "_write_caption", lambda luma, text, scale, above: lines.append((text, above + 22 * scale))
    )
    reason = " ".join(f"word{k}" for k in range(120)) + "; give another clip."
    draw(grey(height, width), Drawing([], "0.00 s", reason))
    assert " ".join(text for text, _ in reversed(lines)) == f"{reason} 0.00 s"
    assert max(top for _, top in lines) <= height
