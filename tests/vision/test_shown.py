"""Scenes for looking at: pictures with outlines, one line, HTML; and what a pickle of a scene has."""

from __future__ import annotations

import pickle
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import monodyn
from chains import chain
from films import film
from monodyn.errors import SettingsError, VideoError
from monodyn.types import Frame, Poses
from monodyn.vision.clip.colour import rgb, stacked
from monodyn.vision.clip.lens import Lens, straightened
from monodyn.vision.clip.video import Video, read
from monodyn.vision.drawing.shown import frame_of
from monodyn.vision.foreground.given import read_masks
from monodyn.vision.locating.scene import Scene
from support import refuses
from tracked import seen, stretched, tracks


@pytest.fixture(scope="module")
def filmed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Scene, Poses]:
    scene, poses = film(tmp_path_factory.mktemp("chain"))
    # as ``track`` returns them
    return replace(scene, key_frames=(0, 30), key_positions=poses.position[[0, 30]]), poses


@pytest.fixture(scope="module")
def pyplot() -> Any:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    yield pyplot
    pyplot.close("all")


def corners(axes: Any) -> np.ndarray:
    """Return the corners of the outlines that were drawn."""
    return np.concatenate([line.get_xydata() for line in axes.lines])


def test_an_outline_is_drawn_as_located_or_as_tracked(filmed: tuple[Scene, Poses], pyplot: Any) -> None:
    scene, poses = filmed
    first = scene.show()
    assert first.get_title() == "frame 0, 0.00 s: as located"
    assert first.images[0].get_array().shape == (scene.video.height, scene.video.width, 3)
    assert {line.get_linestyle() for line in first.lines} == {"-"}
    near = scene.show(20)
    assert near.get_title() == "frame 20, 0.67 s: outline as in frame 30"
    assert {line.get_linestyle() for line in near.lines} == {"--"}
    np.testing.assert_array_equal(corners(near), corners(scene.show(30)))
    tracked = scene.show(20, poses)
    assert tracked.get_title() == "frame 20, 0.67 s: as tracked"
    assert np.abs(corners(tracked) - corners(near)).max() > 10.0
    # the mechanism is dark before the wall: what the outline encloses is
    x, y = corners(tracked).mean(axis=0)
    assert scene.video.width > x > 0.0
    assert scene.video.height > y > 0.0
    lost = scene.show(20, replace(poses, seen=np.zeros(len(poses), bool)))
    assert lost.get_title() == "frame 20, 0.67 s: not seen"
    assert not lost.lines
    _, axes = pyplot.subplots()
    assert scene.show(3, axes=axes) is axes


def test_what_cannot_be_shown_is_refused(
    filmed: tuple[Scene, Poses], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, poses = filmed
    video = scene.video
    with refuses(VideoError, "show: expected a frame from 0 to 39, got 40."):
        scene.show(40)
    with refuses(
        VideoError,
        "show: expected poses as track returns them for this scene, got others; leave them out, or pass "
        "those.",
    ):
        scene.show(20, replace(poses, roll=None))
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with refuses(
        SettingsError,
        "show: expected the package 'matplotlib', which is not installed; install it with pip install "
        "'monodyn[plots]'.",
    ):
        scene.show(0)
    gone = replace(video, decode=lambda start, stop: iter(()))
    with refuses(VideoError, f"show: frame 5 of '{video.path}' cannot be decoded; name another one."):
        frame_of(gone, 5)


@pytest.mark.slow
def test_a_scene_of_points_is_shown_over_its_clip(tmp_path: Path, pyplot: Any) -> None:
    file, truth, motion = stretched()
    names = ("joint1", "joint2", "link2")
    given = tracks(names, seen(truth, motion, names))
    scene = monodyn.locate(given, file)
    times = given.time
    dark = np.zeros((given.height, given.width), np.uint8)

    def decode(start: int, stop: int) -> Any:
        return (Frame(k, float(times[k]), dark) for k in range(start, stop))

    clip = Video(tmp_path, given.width, given.height, times, decode)
    scene = replace(scene, tracks=replace(given, clip=clip))
    axes = scene.show(4)
    assert axes.get_title().endswith(": as located")
    assert len(axes.lines) >= 4
    poses = monodyn.track(given, scene)
    assert scene.show(4, poses).get_title().endswith(": as tracked")
    hidden = replace(poses, joint_seen=None, seen=np.zeros(len(poses), bool))
    assert not scene.show(4, hidden).lines
    assert repr(scene) == (
        f"<PointScene of 'double' in {given.path.name}: 3 points within {scene.rms_px:.2f} px in "
        f"{len(given)} frames>"
    )
    assert repr(given).startswith("<PointTracks of joint1, joint2, link2: ")
    assert "camera.depth" in scene._repr_html_()


def test_a_scene_says_in_one_line_what_it_is(filmed: tuple[Scene, Poses]) -> None:
    scene, _ = filmed
    assert repr(scene) == (
        "<Scene of 'chain' in film: outline within 0.00 px in 2 key frames, first pose in frame 0>"
    )
    assert repr(scene.masks) == f"<SoftMasks of film: 1 colour, noise {scene.masks.background.noise:.1f}>"
    found = replace(scene, camera_std={"camera.x": 0.00123}, advice=("Look <squarely>.",))._repr_html_()
    assert ">0.00123</td>" in found
    assert found.count(">held</td>") == 6
    assert "Look &lt;squarely&gt;." in found
    assert "link1.length" in found


def test_a_pickle_of_a_scene_has_no_picture_of_the_clip(filmed: tuple[Scene, Poses]) -> None:
    scene, _ = filmed
    scene.masks.samples.medians  # noqa: B018  what was worked out is not kept either
    written = pickle.dumps(scene)
    # in memory the sample frames alone are that large
    frames = sum(frame.luma.nbytes for frame in scene.masks.samples.frames)
    background = sum(
        value.nbytes for value in vars(scene.masks.background).values() if hasattr(value, "nbytes")
    )
    palette = sum(value.nbytes for value in vars(scene.masks.palette).values() if hasattr(value, "nbytes"))
    assert len(written) < background + palette + 0.05 * frames
    again = pickle.loads(written)
    # a pickle of that, still unread, is as small
    assert abs(len(pickle.dumps(again)) - len(written)) < 0.01 * len(written)
    poses, same = monodyn.track(scene.masks, scene), monodyn.track(again.masks, again)
    np.testing.assert_array_equal(same.position, poses.position)
    np.testing.assert_array_equal(same.covariance, poses.covariance)
    kept, read_again = scene.masks.samples, again.masks.samples
    assert [frame.index for frame in read_again.frames] == [frame.index for frame in kept.frames]
    for one, other in zip(kept.frames, read_again.frames, strict=True):
        np.testing.assert_array_equal(one.luma, other.luma)
    np.testing.assert_array_equal(read_again.thumbnails.planes, kept.thumbnails.planes)
    assert read_again.window == kept.window
    with pytest.raises(AttributeError, match=r"^'SoftMasks' has no attribute 'nothing'\.$"):
        again.masks.nothing  # noqa: B018


def test_masks_of_other_tools_stay_in_their_file(filmed: tuple[Scene, Poses], tmp_path: Path) -> None:
    scene, _ = filmed
    planes = np.stack([mask.coverage for mask in scene.masks])
    np.savez_compressed(tmp_path / "masks.npz", masks=(planes > 80).astype(np.uint8))
    masks = read_masks(tmp_path / "masks.npz", chain(tmp_path), clip=read(scene.video.path, rate=30.0))
    written = pickle.dumps(masks)
    assert len(written) < 0.5 * planes.nbytes
    again = pickle.loads(written)
    for one, other in zip(masks, again, strict=True):
        np.testing.assert_array_equal(one.planes, other.planes)
    assert len(again.samples.frames) == len(masks.samples.frames)
    assert repr(again) == "<GivenMasks of masks.npz: 1 object>"


def test_a_clip_put_straight_is_pickled_too(filmed: tuple[Scene, Poses]) -> None:
    video = filmed[0].video
    lens = Lens((-0.05, 0.0, 0.0, 0.0), 400.0, video.width, video.height)
    again = pickle.loads(pickle.dumps(straightened(video, lens)))
    one, other = next(straightened(video, lens).frames(3, 4)), next(again.frames(3, 4))
    np.testing.assert_array_equal(one.luma, other.luma)


def test_planes_are_stacked_and_coloured() -> None:
    grey = Frame(0, 0.0, np.full((3, 5), 235, np.uint8))
    assert stacked(grey).shape == (6, 6)
    assert rgb(grey).shape == (3, 5, 3)
    assert rgb(grey).min() == 255
    chroma = np.full((2, 3), 90, np.uint8), np.full((2, 3), 240, np.uint8)
    red = rgb(replace(grey, luma=np.full((3, 5), 81, np.uint8), chroma=chroma))
    assert red[1, 2, 0] > 240
    assert red[1, 2, 1:].max() < 20
