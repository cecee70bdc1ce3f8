"""The demo clip, whose truth its script wrote: camera, sizes and poses from the topology alone."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import monodyn
from monodyn.errors import SettingsError, VideoError
from monodyn.types import Frame, Mask
from monodyn.vision.drawing.outline import outline
from monodyn.vision.foreground.masks import EVERY_PLANE, Wanted
from monodyn.vision.foreground.soft import SoftMasks
from monodyn.vision.locating.scene import Scene
from monodyn.vision.settings import LocateSettings, SegmentSettings, TrackSettings
from monodyn.vision.track import Follower, _have_own_planes
from support import DEMO, ClipMaker, refuses

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def truth() -> dict:
    return json.loads((DEMO / "double.json").read_text())


@pytest.fixture(scope="module")
def scene() -> Scene:
    masks = monodyn.segment(monodyn.read(DEMO / "double.mp4"))
    return monodyn.locate(masks, monodyn.load(DEMO / "double.xml"))


def off(position: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return angle errors [deg], whole turns aside."""
    return np.degrees((position - q + np.pi) % (2 * np.pi) - np.pi)


def test_sizes_up_to_one_scale(scene: Scene, truth: dict) -> None:
    values = scene.mechanism.values
    scale = truth["length"][0] / values["link1.length"]
    # 0.1 px on links of 110 px and widths of 16 px
    far = truth["length"][1] + truth["overhang"][1]
    assert values["link2.length"] * scale == pytest.approx(far, rel=5e-3)
    assert values["link1.width"] * scale == pytest.approx(truth["width"][0], rel=0.03)
    assert values["link2.width"] * scale == pytest.approx(truth["width"][1], rel=0.03)
    assert scene.rms_px < 0.3
    assert scene.advice == ()


def test_every_frame_is_tracked(scene: Scene, truth: dict) -> None:
    poses = monodyn.track(scene.masks, scene)
    assert poses.seen.all()
    error = off(poses.position, np.array(truth["q"]))
    # issue 2 asks for 0.15 deg on clips like this one
    assert np.sqrt((error**2).mean(axis=0)).max() < 0.15
    spread = np.sqrt(np.array([np.diag(c) for c in poses.covariance]))
    share = np.abs(error) < 3.0 * np.degrees(spread) + 0.03
    assert share.mean() > 0.95
    # angles are continuous through full turns: no step comes near half a turn
    assert np.abs(np.diff(poses.position, axis=0)).max() < 2.0


def test_what_the_camera_fixes_stays(scene: Scene) -> None:
    masks = scene.masks
    mechanism = monodyn.load(DEMO / "double.xml")
    found = monodyn.locate(
        masks, mechanism, LocateSettings(search_frames=4, refine_frames=8), fix={"camera.depth": 1.1}
    )
    assert found.camera.depth == 1.1
    # with the depth given, the focal length (a guess) alone scales the sizes
    guess, true_focal = found.camera.focal, 240 / np.tan(np.radians(19.0))
    assert found.mechanism.values["link1.length"] == pytest.approx(0.24 * true_focal / guess, rel=0.02)


def test_names_that_are_not_the_cameras(scene: Scene) -> None:
    with refuses(
        SettingsError,
        "parameter 'camera.zoom': expected one of the camera's; parameters: 'camera.x', 'camera.y', "
        "'camera.depth', 'camera.roll', 'camera.pitch', 'camera.yaw', 'camera.focal'.",
    ):
        monodyn.locate(scene.masks, scene.mechanism, free=("camera.zoom",))


def test_a_mechanism_that_vanishes_is_not_seen_and_found_again(scene: Scene, truth: dict) -> None:
    follower = Follower(scene, TrackSettings())
    seen = []
    for frame in scene.masks.video.frames(0, 60):
        mask = scene.masks.of(frame)
        if 20 <= frame.index < 30:
            mask = replace(mask, planes=np.zeros_like(mask.planes))
        found = follower.step(mask)
        ok = bool(found.joints.all())
        seen.append(ok)
        assert np.isfinite(found.position).all() == ok
        assert np.isfinite(found.covariance).all() == ok
        if ok:
            assert np.abs(off(found.position, np.array(truth["q"][frame.index]))).max() < 1.0
    assert all(seen[:20])
    assert not any(seen[20:30])
    assert all(seen[33:])


@pytest.mark.parametrize("view", ["by geom", "one plane"])
@pytest.mark.parametrize(("margin", "most"), [(None, 6), (9, 60)])
def test_a_part_of_a_mask_gives_the_pose_that_the_whole_gives(
    scene: Scene, monkeypatch: pytest.MonkeyPatch, view: str, margin: int | None, most: int
) -> None:
    """What is not wanted of a mask is noise; where it would be needed the whole is taken."""
    assert isinstance(scene.masks, SoftMasks)
    if view == "one plane":
        palette = replace(scene.masks.palette, part=None, shaded=None)
        scene = replace(scene, masks=replace(scene.masks, palette=palette))
    near, whole, wholes = Follower(scene, TrackSettings()), Follower(scene, TrackSettings()), []
    step, of, rng = near.step, SoftMasks.of, np.random.default_rng(7)

    def some(masks: SoftMasks, frame: Frame, wanted: Wanted | None = None) -> Mask:
        """Return a mask with noise wherever it is not wanted."""
        mask = of(masks, frame, wanted)
        if wanted is None:
            return mask
        known = np.zeros(mask.planes.shape, dtype=bool)
        for plane, y, left, right in wanted.rows:
            planes = slice(None) if plane == EVERY_PLANE else [plane, -1]
            known[planes, y, left:right] = True
        noise = rng.integers(0, 256, mask.planes.shape, dtype=np.uint8)
        return replace(mask, planes=np.where(known, mask.planes, noise))

    monkeypatch.setattr(SoftMasks, "of", some)
    monkeypatch.setattr(near, "step", lambda mask, at=None: wholes.append(mask.index) or step(mask, at))
    if margin is not None:
        monkeypatch.setattr(near, "_near_px", margin)
    for frame in scene.masks.video.frames(0, 60):
        found, expected = near.find(frame), whole.step(scene.masks.of(frame))
        np.testing.assert_array_equal(found.position, expected.position)
        np.testing.assert_array_equal(found.covariance, expected.covariance)
    # where the mechanism is at first is looked for in the whole picture
    assert 0 in wholes
    assert len(wholes) <= most
    assert margin is None or len(wholes) > 6


def test_a_mask_of_noise_is_not_a_mechanism(scene: Scene) -> None:
    shape = scene.masks.view(2).trust.shape
    noise = np.random.default_rng(0).integers(0, 256, shape, dtype=np.uint8)
    assert not Follower(scene, TrackSettings()).step(Mask(0, 0.0, noise)).fits


def without_link(scene: Scene, mask: Mask, q: np.ndarray, body: str) -> Mask:
    """Take the foreground of one body out of a mask, as something before it would."""
    planes = mask.planes.copy()
    for name, polygon in outline(scene.mechanism, scene.camera, q):
        if name == body:
            gone = np.zeros(planes.shape[1:], np.uint8)
            cv2.fillPoly(gone, [np.round(polygon).astype(np.int32)], 1)
            planes[:, cv2.dilate(gone, np.ones((7, 7), np.uint8)) > 0] = 0
    return replace(mask, planes=planes)


def test_a_link_folded_onto_another_is_not_seen(scene: Scene, truth: dict) -> None:
    """Link 2 is hidden; folded back onto link 1, which shows, it seems to lie on the mask."""
    folded = 0
    for index, known in zip(scene.key_frames[:8], scene.key_positions[:8], strict=True):
        frame = next(iter(scene.masks.video.frames(index, index + 1)))
        mask = without_link(scene, scene.masks.of(frame), np.array(truth["q"][index]), "link2")
        start = replace(scene, key_frames=(index,), key_positions=np.array([[known[0], np.pi]]))
        found = Follower(start, TrackSettings()).step(mask)
        folded += bool(found.joints[0])
        assert not found.joints[1]
    assert folded > 4


def test_a_hidden_link_leaves_the_other_joint_seen(scene: Scene, truth: dict) -> None:
    follower, q = Follower(scene, TrackSettings()), np.array(truth["q"])
    spread = []
    for frame in scene.masks.video.frames(0, 40):
        mask = scene.masks.of(frame)
        if 20 <= frame.index < 24:
            mask = without_link(scene, mask, q[frame.index], "link2")
        found = follower.step(mask)
        # the whole picture is searched in every third frame
        if not 24 <= frame.index < 27:
            assert found.joints.tolist() == [True, not 20 <= frame.index < 24]
        assert np.abs(off(found.position, q[frame.index]))[0] < 1.0
        spread.append(float(found.covariance[1, 1]))
    # out of sight it is known worse from frame to frame
    assert np.all(np.diff(spread[19:24]) > 0)


def test_what_hides_the_mechanism_is_left_out_of_the_picture(scene: Scene, truth: dict) -> None:
    """A post over the second link: most of its frames are seen, and none of them is pulled by the post."""
    q = np.array(truth["q"])
    follower = Follower(scene, TrackSettings())
    left = round(float(np.mean(outline(scene.mechanism, scene.camera, q[0])[-1][1][:, 0])))
    post = np.zeros(scene.masks.view(2).trust.shape[1:], dtype=bool)
    post[:, left : left + 14] = True

    def masks() -> Iterator[Mask]:
        for frame in scene.masks.video.frames():
            mask = scene.masks.of(frame)
            yield replace(mask, planes=np.where(post, np.uint8(0), mask.planes))

    for mask in masks():
        follower.step(mask)
    hidden = follower.occluders.hidden()
    near = np.zeros_like(post)
    near[:, left - 5 : left + 19] = True
    assert hidden[post].any()
    assert not hidden[~near].any()
    again = Follower(scene, TrackSettings(), hidden)
    found = [again.step(mask) for mask in masks()]
    assert np.mean([sighting.joints.all() for sighting in found]) > 0.9
    error = np.array(
        [off(sighting.position, q[i])[sighting.joints].max() for i, sighting in enumerate(found)]
    )
    assert np.abs(error).max() < 1.0


def test_any_masks_of_the_clip_are_followed_alike(scene: Scene) -> None:
    """The program of the README hands over the first masks; background and colours are the scene's."""
    video = monodyn.read(DEMO / "double.mp4")
    first = monodyn.segment(video)
    poses, same = monodyn.track(first, scene), monodyn.track(scene.masks, scene)
    np.testing.assert_array_equal(poses.position, same.position)


def test_without_measured_colours_the_largest_coverage_counts(scene: Scene, truth: dict) -> None:
    """The masks have two planes, of which the first shows nothing; the view has one."""
    assert isinstance(scene.masks, SoftMasks)
    plain = replace(scene.masks, palette=replace(scene.masks.palette, part=None, shaded=None))
    follower, index = Follower(replace(scene, masks=plain), TrackSettings()), scene.key_frames[0]
    mask = scene.masks.of(next(iter(scene.masks.video.frames(index, index + 1))))
    planes = np.stack([np.zeros_like(mask.coverage), mask.coverage])
    found = follower.step(replace(mask, planes=planes))
    assert found.joints.all()
    assert np.abs(off(found.position, np.array(truth["q"][index]))).max() < 1.0


def test_a_background_that_was_given_stays(scene: Scene, tmp_path: Path) -> None:
    picture = np.clip(scene.masks.background.luma.round() + 1, 0, 255).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "wall.png"), picture)
    masks = monodyn.segment(scene.masks.video, background=tmp_path / "wall.png")
    found = monodyn.locate(masks, monodyn.load(DEMO / "double.xml"))
    np.testing.assert_array_equal(found.masks.background.luma, masks.background.luma)


def test_a_clip_of_another_size_is_refused(scene: Scene, make_clip: ClipMaker) -> None:
    other = monodyn.read(make_clip())
    assert isinstance(scene.masks, SoftMasks)
    masks = SoftMasks(
        other, scene.masks.background, scene.masks.palette, scene.masks.samples, SegmentSettings()
    )
    with refuses(
        VideoError,
        f"{other.path}: expected pictures of 720x480 like the scene, got 64x48; locate the mechanism in this "
        "clip.",
    ):
        monodyn.track(masks, scene)


def test_a_link_has_a_plane_of_its_own_where_no_other_link_shows_in_it() -> None:
    part, link = np.array([0, 1, 1, 2, 3]), np.array([0, 1, 1, 2, 2])
    assert _have_own_planes(part, link, 3).tolist() == [True, True, True]
    assert _have_own_planes(np.array([0, 1, 0, 2, 3]), link, 3).tolist() == [False, False, True]
    # a geom that is left out, and a link without any
    assert _have_own_planes(np.array([0, -1, 1, 2, 3]), link, 4).tolist() == [True, False, True, False]
