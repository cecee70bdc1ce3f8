"""A clip of a camera that moves as one that stands still shows it."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.types import Frame
from monodyn.vision.clip.homography import Homography
from monodyn.vision.clip.steady import (
    CameraPath,
    Parallax,
    displaced,
    light_grid,
    plane_matrix,
    shown_in_place,
)
from monodyn.vision.clip.video import read
from scenes import SIZE, moved, taken, wall
from support import ClipMaker, left_edges, refuses

REST = moved()


def path_of(*maps: np.ndarray | None, scene: Frame) -> CameraPath:
    """Return the path of given maps; None stands for a frame that is not registered."""
    entries = [np.full((3, 3), np.nan) if at is None else at for at in maps]
    return CameraPath(np.array(entries), np.array([np.nan if at is None else 0.1 for at in maps]), scene)


@pytest.mark.parametrize("bend", [0.0, 1e-4])
def test_a_frame_comes_back_to_its_place(bend: float) -> None:
    scene, at = wall(), moved((5.3, -3.6), 0.02, 1.03, bend)
    still = taken(scene, REST, noise=0.0)
    path = path_of(at.entries, scene=still)
    steady = path.steady(taken(scene, at, noise=0.0))
    assert steady is not None
    assert not steady.luma.flags.writeable
    off = np.abs(steady.luma.astype(float) - still.luma)
    # linear interpolation flattens edges
    assert np.mean(off) < 1.0
    assert np.percentile(off, 99) < 8.0


def test_what_a_frame_does_not_show_comes_from_the_scene() -> None:
    luma = np.full(SIZE[::-1], 90, np.uint8)
    chroma = (np.full((80, 120), 100, np.uint8), np.full((80, 120), 110, np.uint8))
    path = path_of(moved((40.0, 0.0)).entries, None, scene=Frame(-1, 0.0, luma, chroma))
    filmed = Frame(0, 0.0, np.full(SIZE[::-1], 200, np.uint8), (chroma[1], chroma[0]))
    steady = path.steady(filmed)
    assert steady is not None
    assert steady.chroma is not None
    # the camera moved to the left: what is at the right end of the scene is out of its picture
    assert np.all(steady.luma[:-1, :199] == 200)
    assert np.all(steady.luma[:, 201:] == 90)
    assert np.all(steady.chroma[0][:-1, :99] == 110)
    assert np.all(steady.chroma[0][:, 101:] == 100)
    assert path.steady(replace(filmed, index=1)) is None
    assert path.steady(replace(filmed, index=7)) is None


@pytest.mark.parametrize("bend", [0.0, 1e-4])
def test_a_window_is_taken_to_its_place_as_the_whole_picture_is(bend: float) -> None:
    at = moved((5.3, -3.6), 0.02, 1.03, bend)
    scene, filmed = taken(wall(), REST, noise=0.0), taken(wall(), at, noise=2.0)
    tint = tuple(np.ascontiguousarray(scene.luma[i::2, i::2]) for i in range(2))
    scene, filmed = replace(scene, chroma=tint), replace(filmed, chroma=(tint[1], tint[0]))
    path = path_of(at.entries, scene=scene)
    whole, part = path.steady(filmed), path.within(31, 100, 43, 160).steady(filmed)
    assert whole is not None
    assert part is not None
    assert whole.chroma is not None
    assert part.chroma is not None
    assert scene.chroma is not None
    for one, other, cut in (
        (whole.luma, part.luma, (slice(31, 100), slice(43, 160))),
        *((a, b, (slice(15, 50), slice(21, 80))) for a, b in zip(whole.chroma, part.chroma, strict=True)),
    ):
        assert np.abs(one[cut].astype(int) - other[cut]).max() <= 1
    # the light is compared over the whole picture
    places = light_grid(*SIZE[::-1])
    assert np.abs(whole.luma[places].astype(int) - part.luma[places]).max() <= 8
    beyond = np.ones(SIZE[::-1], dtype=bool)
    beyond[27:104, 39:164], beyond[places] = False, False
    assert np.array_equal(part.luma[beyond], scene.luma[beyond])


def test_reduced_planes_keep_their_place() -> None:
    at = moved((4.0, -2.0), 0.1, 1.1)
    # the middle of pixel (30, 20) of a plane of half the size lies at (60.5, 40.5)
    whole = at.of(np.array([[60.5, 40.5]]))[0]
    small = plane_matrix(at, (80, 120)) @ [30.0, 20.0, 1.0]
    assert np.allclose((whole - 0.5) / 2.0, small[:2] / small[2])


def test_the_way_in_numbers() -> None:
    path = path_of(moved((3.0, -2.0), 0.1, 1.2).entries, None, scene=taken(wall(), REST))
    assert path.registered.tolist() == [True, False]
    assert path.shift[0].tolist() == [3.0, -2.0]
    assert path.turn[0] == pytest.approx(-0.1)
    assert path.zoom[0] == pytest.approx(1.2)
    assert path.at(1) is None
    assert path.size == SIZE


def test_what_is_nearer_sways_along() -> None:
    # the picture of what is near moves by half as much again, and that of a turned camera not at all
    path = path_of(moved((8.0, -4.0), zoom=2.0, bend=1e-4).entries, scene=taken(wall(), REST))
    assert path.sway(0, Parallax()).tolist() == [0.0, 0.0]
    assert np.allclose(path.sway(0, Parallax(0.5)), [2.0, -1.0])
    assert np.allclose(path.sway(0, Parallax(0.5, -2e4)), [1.0, -1.0])
    assert path.sway(5, Parallax(0.5)).tolist() == [0.0, 0.0]


def test_planes_are_displaced() -> None:
    plane = np.zeros((1, 20, 30), np.uint8)
    plane[0, 5, 7] = 100
    assert displaced(plane, np.zeros(2)) is plane
    assert displaced(plane, np.array([2.0, 1.0]))[0, 6, 9] == 100
    assert displaced(plane, np.array([0.5, 0.0]))[0, 5, 7:9].tolist() == [50, 50]


@pytest.mark.parametrize(
    "at",
    [
        REST,
        moved((3.3, -2.2), 0.001, 1.0001),
        moved((3.3, -2.2), -0.03, 0.99),
        moved((-7.1, 0.4), 0.4, 1.2),
        moved((0.3, 5.0), 0.01, 1.0, 5e-5),
        moved((0.3, 5.0), -0.01, 1.0, -5e-5),
    ],
)
def test_pictures_are_put_in_place_as_by_opencv(at: Homography) -> None:
    plane = cv2.GaussianBlur(np.random.default_rng(3).integers(0, 256, (160, 240), np.uint8), (0, 0), 1.0)
    ours = np.zeros(plane.shape, np.uint8)
    shown_in_place(plane + np.uint8(1), at, ours)
    # as floats, which OpenCV interpolates without rounding; before its version 5 to 1/32 of a pixel
    grey = plane.astype(np.float32) + 1.0
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    theirs = cv2.warpPerspective(grey, at.matrix, SIZE, flags=flags, borderMode=cv2.BORDER_CONSTANT)
    whole = cv2.warpPerspective(np.ones_like(grey), at.matrix, SIZE, flags=flags) > 0.999
    assert np.sum(whole) > 0.5 * plane.size
    assert np.mean(ours[whole] > 0) > 0.98
    both = whole & (ours > 0)
    off = np.abs(ours[both] - theirs[both])
    # the second is of rounding to whole levels
    most, usual = (1.0, 0.32) if int(cv2.__version__.partition(".")[0]) >= 5 else (2.0, 0.36)
    assert off.max() < most
    assert np.sqrt(np.mean(off**2)) < usual


def test_what_is_not_shown_stays() -> None:
    plane, out = np.full(SIZE[::-1], 50, np.uint8), np.zeros(SIZE[::-1], np.uint8)
    shown_in_place(plane, moved((-20.0, 0.0)), out)
    assert np.all(out[:, :19] == 0)
    assert np.all(out[:-1, 21:-1] == 50)
    again = np.zeros(SIZE[::-1], np.uint8)
    shown_in_place(plane, moved((0.0, 400.0)), again)
    assert not again.any()


def test_wrong_arrays_are_refused() -> None:
    said = "CameraPath.maps: expected an array of shape (2, 3, 3), got (1, 3, 3)."
    with refuses(VideoError, said):
        CameraPath(np.eye(3)[np.newaxis], np.zeros(2), taken(wall(), REST))


def test_a_video_steadied_and_as_filmed(make_clip: ClipMaker) -> None:
    # the square moves by one pixel a frame: for a camera that moves along it stands still
    video = read(make_clip(count=4))
    first = next(iter(video.frames()))
    maps = np.repeat(np.eye(3)[np.newaxis], 4, axis=0)
    maps[:, 0, 2] = np.arange(4.0)
    std = np.array([0.1, 0.1, np.nan, 0.1])
    steady = replace(video, camera_path=CameraPath(maps, std, first))
    assert [frame.index for frame in steady.frames()] == [0, 1, 3]
    assert left_edges(steady) == [2, 2, 2]
    assert left_edges(steady.as_filmed) == [2, 3, 4, 5]
    assert left_edges(steady.within(0, 48, 0, 64)) == [2, 2, 2]
    assert "The camera moves; frames are as one at rest shows them." in steady._repr_html_()
    assert video.within(0, 48, 0, 64) is video
