"""A clip of a camera that moves, registered on its still scene, against the maps that it was made with."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.types import Frame
from monodyn.vision.clip.homography import Homography, at_rest
from monodyn.vision.clip.video import Video, read
from monodyn.vision.foreground.soft import soft_masks
from monodyn.vision.registration import register
from monodyn.vision.registration.keypicture import key_of, pyramid
from monodyn.vision.registration.register import camera_moves, levelled, onto_scene, steadied
from monodyn.vision.settings import SegmentSettings
from scenes import BEYOND, SIZE, disc, hand_held, moved, taken, wall
from support import refuses

SCENE = wall()


def clip(folder: Path, frames: Sequence[Frame]) -> Video:
    """Write frames as a folder of pictures."""
    folder.mkdir()
    for frame in frames:
        cv2.imwrite(str(folder / f"{frame.index:03d}.png"), frame.luma)
    return read(folder)


def swinging(maps: Sequence[Homography]) -> list[Frame]:
    """Film a disc that goes from left to right before the scene."""
    return [
        disc(taken(SCENE, at, k), *at.of(np.array([[60.0 + 120.0 * k / len(maps), 90.0]]))[0])
        for k, at in enumerate(maps)
    ]


def from_mean(maps: Sequence[Homography]) -> list[Homography]:
    """Return maps from the mean place of a camera."""
    mean = Homography(np.mean([at.entries for at in maps], axis=0), SIZE)
    return [at.after(mean.inverse) for at in maps]


def test_a_moving_camera_is_followed_and_its_pictures_stand_still(tmp_path: Path) -> None:
    maps = hand_held(20)
    video = clip(tmp_path / "clip", swinging(maps))
    masks = soft_masks(video, SegmentSettings(), None, None)
    path = masks.video.camera_path
    assert path is not None
    off = [Homography(path.maps[k], SIZE).apart(at) for k, at in enumerate(from_mean(maps))]
    assert max(off) < 0.2
    steady = [frame.luma.astype(float) for frame in masks.video.frames()]
    # away from the disc
    assert np.mean(np.abs(steady[3] - steady[15])[:60]) < 2.0
    # all that stands out is the disc, where it is
    coverage = masks.of(next(masks.video.frames(10, 11))).coverage > 80
    y, x = np.nonzero(coverage)
    place = from_mean(maps)[10].inverse.of(maps[10].of(np.array([[120.0, 90.0]])))[0]
    assert np.hypot(x.mean() - place[0], y.mean() - place[1]) < 1.0
    assert abs(coverage.sum() / (np.pi * 18.5**2) - 1.0) < 0.1
    far = float(np.hypot(*path.shift.T).max())
    turn = float(np.degrees(np.abs(path.turn).max()))
    assert masks.video.notes[-1] == (
        f"The camera moves: up to {far:.1f} px and {turn:.2f} deg from its mean place, with a zoom of "
        f"{path.zoom.min():.3f} to {path.zoom.max():.3f}; its pictures were registered on the still scene, "
        f"each within {float(np.median(path.std)):.2f} px (camera.csv)."
    )


def test_a_camera_that_stands_still_changes_nothing(tmp_path: Path) -> None:
    frames = swinging([moved()] * 12)
    video = clip(tmp_path / "clip", frames)
    assert steadied(video, frames) is video


def test_a_bare_wall_says_nothing_of_the_camera(tmp_path: Path) -> None:
    bare = [
        disc(Frame(k, k / 30, np.full(SIZE[::-1], 150, np.uint8)), 60.0 + 8.0 * k, 90.0) for k in range(12)
    ]
    video = clip(tmp_path / "clip", bare)
    steady = steadied(video, bare)
    assert steady.bare
    assert steady.camera_path is None
    assert steady.notes[-1] == (
        "The background shows too little to tell whether the camera moves; it is taken to stand still."
    )


def test_frames_without_a_common_scene_do_not_show_whether_the_camera_moves() -> None:
    # the middle one shows a scene, which most of the others do not
    frames = [taken(wall(k) if k % 3 else SCENE, moved(), k) for k in range(13)]
    key = key_of(pyramid(frames[6].luma), at_rest(SIZE))
    assert key.holds
    assert camera_moves(frames, key) is None
    assert camera_moves([taken(SCENE, moved(), k) for k in range(12)], key) is False
    assert camera_moves([taken(SCENE, at, k) for k, at in enumerate(hand_held(12))], key) is True


def test_a_pan_along_most_of_the_edges_is_a_motion() -> None:
    # boards with a joint here and there: most of the points show next to nothing of the displacement
    boards = np.where(np.arange(SIZE[1] + 2 * BEYOND) // 8 % 2, 150.0, 70.0)[:, np.newaxis]
    boards = np.repeat(boards, SIZE[0] + 2 * BEYOND, axis=1)
    for x in range(0, boards.shape[1], 49):
        boards[:, x : x + 2] = 200.0
    boards = cv2.GaussianBlur(boards, (0, 0), 0.8)
    pan = [taken(boards, moved((0.6 * k, -0.005 * k)), k + 6) for k in range(-6, 7)]
    assert camera_moves(pan, key_of(pyramid(pan[6].luma), at_rest(SIZE))) is True
    still = [taken(boards, moved(), k) for k in range(13)]
    assert camera_moves(still, key_of(pyramid(still[6].luma), at_rest(SIZE))) is False


def test_frames_that_show_something_else_are_not_registered(tmp_path: Path) -> None:
    maps = hand_held(20)
    frames = swinging(maps)
    other = taken(wall(8), moved(), 0)
    frames[:3] = [Frame(k, k / 30, np.zeros_like(other.luma)) for k in range(3)]
    frames[7] = Frame(7, 7 / 30, other.luma)
    video = clip(tmp_path / "clip", frames)
    path = steadied(video, frames).camera_path
    assert path is not None
    assert np.flatnonzero(~path.registered).tolist() == [0, 1, 2, 7]


def test_a_scene_that_no_frame_shows_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # as if the noise of frames before a bare wall had been taken for a scene
    monkeypatch.setattr(register, "camera_moves", lambda *given: True)
    frames = [taken(wall(k), moved(), k) for k in range(20)]
    steady = steadied(clip(tmp_path / "clip", frames), frames)
    assert steady.bare
    assert steady.camera_path is None


def test_motion_that_cannot_be_followed_is_refused(tmp_path: Path) -> None:
    # the samples show a scene, most of the other frames none
    frames = swinging(hand_held(20))
    shown = [
        frame if frame.index % 3 == 0 else taken(wall(frame.index), moved(), frame.index) for frame in frames
    ]
    video = clip(tmp_path / "clip", shown)
    said = (
        f"clip '{tmp_path / 'clip'}': expected a still scene by which the moving camera can be followed, "
        "found it in 7 of 20 frames; put the camera on a tripod, or film before a background with edges and "
        "patterns over much of the picture."
    )
    with refuses(VideoError, said):
        steadied(video, frames[::3])


def test_a_picture_of_the_background_is_put_in_its_place(tmp_path: Path) -> None:
    maps = hand_held(20)
    frames = swinging(maps)
    path = steadied(clip(tmp_path / "clip", frames), frames).camera_path
    assert path is not None
    at = moved((7.0, -3.0))
    found = onto_scene(taken(SCENE, at, 99), "wall.png", path)
    mean = Homography(np.mean([one.entries for one in maps], axis=0), SIZE)
    there = taken(SCENE, mean, 98)
    assert np.mean(np.abs(found.luma.astype(float) - there.luma)[20:-20, 20:-20]) < 2.5
    said = (
        "wall.png: expected a picture of the scene of the clip, whose camera moves, got one in which that "
        "scene does not show; take it from where the clip was filmed, or leave out --background."
    )
    with refuses(VideoError, said):
        onto_scene(taken(wall(8), at, 99), "wall.png", path)


def test_the_nearest_map_without_perspective() -> None:
    plain = moved((3.0, -2.0), 0.05, 1.1)
    assert levelled(plain).apart(plain) < 1e-9
    bent = levelled(moved((3.0, -2.0), 0.05, 1.1, 1e-5))
    assert bent.entries[2].tolist() == [0.0, 0.0, 1.0]
    assert bent.apart(plain) < 0.2
    assert levelled(plain).zoom == pytest.approx(1.1)
