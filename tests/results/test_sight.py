"""What a run saw of its clip: how far it came, and outlines judged against a film of known poses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from films import film
from monodyn.results.sight import Sight, outlines_of
from monodyn.types import FULL, Frame, Mask, Poses
from monodyn.vision.clip.steady import CameraPath
from monodyn.vision.clip.video import read
from monodyn.vision.drawing.shown import pose_row
from monodyn.vision.foreground.masks import View
from monodyn.vision.locating.scene import Scene
from monodyn.vision.points.drift import Drift
from monodyn.vision.points.scene import PointScene
from monodyn.vision.points.tracks import PointTracks
from scenes import SIZE, moved
from support import ClipMaker


def test_the_stage_is_the_last_that_was_reached(filmed: tuple[Scene, Poses]) -> None:
    scene, poses = filmed
    video = scene.masks.video
    lost = replace(poses, seen=np.zeros(len(poses), bool))
    stages = [Sight(video), Sight(video, scene.masks), Sight(video, scene.masks, scene, lost)]
    assert [sight.stage for sight in stages] == [
        "nothing moves",
        "nothing was located",
        "nothing was tracked",
    ]
    assert [sight.anything_tracked for sight in stages] == [False, False, False]
    assert Sight(video, scene.masks, scene, poses).anything_tracked


def test_true_poses_lie_on_their_masks_and_turned_ones_do_not(filmed: tuple[Scene, Poses]) -> None:
    scene, poses = filmed
    good = Sight(scene.masks.video, scene.masks, scene, poses).judged
    turned = replace(poses, position=poses.position + 0.6)
    bad = Sight(scene.masks.video, scene.masks, scene, turned).judged
    assert len(good) == len(bad) > 10
    for true, false in zip(good, bad, strict=True):
        assert true.tracked
        assert (true.matched > 0.9, true.inside > 0.9, true.mismatch < 0.25) == (True, True, True)
        assert true.score > false.score
        assert false.mismatch > 0.5


class Faint:
    """Masks in which noise covers a tenth of the picture's area, and which are trusted the less for it; the
    colour of the mechanism is also that of the left part of the background."""

    def __init__(self, masks: Any, hidden: int = 0) -> None:
        self._masks, self._hidden = masks, hidden

    def __getattr__(self, name: str) -> Any:
        return getattr(self._masks, name)

    def of(self, frame: Frame) -> Mask:
        mask, rng = self._masks.of(frame), np.random.default_rng(frame.index)
        noise = rng.integers(0, FULL // 5, mask.planes.shape, dtype=np.uint8)
        planes = np.maximum(mask.planes, noise)
        planes[:, :, : self._hidden] = 0
        return replace(mask, planes=planes)

    def view(self, geoms: int) -> View:
        view = self._masks.view(geoms)
        trust = 0.25 * view.trust
        trust[:, :, : self._hidden] = 0.0
        return view._replace(trust=trust)


def test_noise_and_what_cannot_show_are_no_mismatch(filmed: tuple[Scene, Poses]) -> None:
    scene, poses = filmed
    for hidden in (0, scene.masks.video.width // 2):
        masks: Any = Faint(scene.masks, hidden)
        faint = replace(scene, masks=masks)
        good = Sight(scene.masks.video, masks, faint, poses)
        assert good.mismatch < 0.3
        turned = replace(poses, position=poses.position + 0.6)
        assert Sight(scene.masks.video, masks, faint, turned).mismatch > 0.5


def test_an_outline_that_reaches_over_bare_background_is_measured(filmed: tuple[Scene, Poses]) -> None:
    scene, poses = filmed
    assert Sight(scene.masks.video, scene.masks, scene, poses).bare_px < 2.0
    last = list(dict.fromkeys(scene.mechanism.shapes.body))[-1]
    length = scene.mechanism.values[f"{last}.length"]
    for longer in (10.0, 20.0):
        by = longer * scene.camera.depth / scene.camera.focal
        mechanism = scene.mechanism.with_values({f"{last}.length": length + by})
        sight = Sight(scene.masks.video, scene.masks, replace(scene, mechanism=mechanism), poses)
        assert sight.bare_px == pytest.approx(longer, abs=3.0)


class Beside:
    """Masks in which something else moves in a corner of the picture."""

    def __init__(self, masks: Any, rows: slice, columns: slice) -> None:
        self._masks, self._part = masks, (slice(None), rows, columns)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._masks, name)

    def of(self, frame: Frame) -> Mask:
        mask = self._masks.of(frame)
        planes = mask.planes.copy()
        planes[self._part] = FULL
        return replace(mask, planes=planes)


def test_what_moves_beside_the_mechanism_does_not_count_against_it(filmed: tuple[Scene, Poses]) -> None:
    scene, poses = filmed
    video = scene.masks.video
    alone = Sight(video, scene.masks, scene, poses)
    drawn = np.concatenate(
        [corners for q in poses.position for corners in outlines_of(scene.mechanism, scene.camera, q)]
    )
    low = np.floor(drawn.min(axis=0)).astype(int)
    corner: Any = Beside(scene.masks, slice(0, max(low[1] - 2, 1)), slice(0, video.width))
    assert low[1] > 4
    beside = Sight(video, corner, replace(scene, masks=corner), poses)
    assert beside.mismatch == pytest.approx(alone.mismatch, abs=0.01)
    # over the mechanism it does
    whole: Any = Beside(scene.masks, slice(0, video.height), slice(0, video.width))
    assert Sight(video, whole, replace(scene, masks=whole), poses).mismatch > 0.5


class Shiny:
    """Masks in which what covers a pixel shows at less than half of its level."""

    def __init__(self, masks: Any, *, varied: bool) -> None:
        self._masks, self.varied = masks, varied

    def __getattr__(self, name: str) -> Any:
        return getattr(self._masks, name)

    def of(self, frame: Frame) -> Mask:
        mask = self._masks.of(frame)
        return replace(mask, planes=(0.4 * mask.planes).astype(np.uint8))


def test_where_colours_vary_the_level_is_not_the_coverage(filmed: tuple[Scene, Poses]) -> None:
    scene, poses = filmed
    turned = replace(poses, position=poses.position + 0.6)

    def mismatch(varied: bool, of: Poses) -> float:
        masks: Any = Shiny(scene.masks, varied=varied)
        return Sight(scene.masks.video, masks, replace(scene, masks=masks), of).mismatch

    assert mismatch(True, poses) < 0.3
    assert mismatch(True, turned) > 0.5
    # a mechanism of one colour that shows so faintly is not all there
    assert mismatch(False, poses) > 0.5


@pytest.mark.parametrize("x", [1e3, 1e12, -1e12])
def test_a_mechanism_far_outside_of_the_picture_misses_its_masks(
    filmed: tuple[Scene, Poses], x: float
) -> None:
    scene, poses = filmed
    away = replace(scene, camera=replace(scene.camera, x=x))
    judged = Sight(scene.masks.video, scene.masks, away, poses).judged
    # nothing is drawn, so all of the mask is missed
    assert [row.mismatch for row in judged] == pytest.approx([1.0] * len(judged))
    bodies = list(dict.fromkeys(scene.mechanism.shapes.body))
    assert Sight(scene.masks.video, scene.masks, away, poses).unshown == bodies


def test_a_body_that_nothing_shows_is_named(filmed: tuple[Scene, Poses]) -> None:
    """The last body stands out from the background nowhere: elsewhere the masks are as they are."""
    scene, poses = filmed
    *_, last = dict.fromkeys(scene.mechanism.shapes.body)
    assert Sight(scene.masks.video, scene.masks, scene, poses).unshown == []

    class Without:
        """The masks, empty within the outline of the last body."""

        def __getattr__(self, name: str) -> Any:
            return getattr(scene.masks, name)

        def of(self, frame: Frame) -> Mask:
            mask = scene.masks.of(frame)
            row = pose_row(poses, frame.index)
            planes = mask.planes.copy()
            if row is not None:
                own = outlines_of(scene.mechanism, scene.camera, poses.position[row], {last})
                hole = np.zeros(planes.shape[1:], np.uint8)
                cv2.fillPoly(hole, [np.round(polygon).astype(np.int32) for polygon in own], 1)
                planes[:, hole > 0] = 0
            return replace(mask, planes=planes)

    without: Any = replace(scene, masks=Without())
    assert Sight(scene.masks.video, without.masks, without, poses).unshown == [last]


def test_what_may_be_the_edge_of_another_body_shows_nothing(filmed: tuple[Scene, Poses]) -> None:
    """The last body, all but hidden behind the one before it, whose edges are what is seen."""
    scene, poses = filmed
    *_, first, last = dict.fromkeys(scene.mechanism.shapes.body)
    values, px = scene.mechanism.values, scene.camera.depth / scene.camera.focal
    speck = {f"{last}.length": 0.3 * values[f"{first}.length"]}
    speck[f"{last}.width"] = values[f"{first}.width"] + 2.0 * px

    class Wide:
        """The masks, of bodies whose edges lie a pixel farther out."""

        def __getattr__(self, name: str) -> Any:
            return getattr(scene.masks, name)

        def of(self, frame: Frame) -> Mask:
            mask = scene.masks.of(frame)
            planes = [cv2.dilate(plane, np.ones((3, 3), np.uint8)) for plane in mask.planes]
            return replace(mask, planes=np.array(planes))

    wide: Any = replace(scene, mechanism=scene.mechanism.with_values(speck), masks=Wide())
    folded = replace(poses, position=poses.position * [1.0, 0.0] + [0.0, np.pi])
    assert last in Sight(scene.masks.video, wide.masks, wide, folded).unshown
    # a bead on a rod is seen, by 2 px to either side
    bead = {f"{first}.width": 4.0 * px, f"{last}.width": 8.0 * px, f"{last}.length": 8.0 * px}
    beaded: Any = replace(wide, mechanism=scene.mechanism.with_values(bead))
    assert last not in Sight(scene.masks.video, beaded.masks, beaded, folded).unshown


def test_frames_that_were_not_tracked_are_judged_where_they_were_located(filmed: tuple[Scene, Poses]) -> None:
    scene, poses = filmed
    few = replace(scene, key_frames=(0, 30), key_positions=poses.position[[0, 30]])
    judged = Sight(scene.masks.video, scene.masks, few).judged
    assert {one.frame.index for one in judged} <= {0, 30}
    assert [one.tracked for one in judged] == [False] * len(judged)
    assert few.located(16)[0] == 30
    assert few.located(14)[1] == pytest.approx(poses.position[0])


def test_a_clip_without_masks_has_a_background_of_its_own(make_clip: ClipMaker) -> None:
    sight = Sight(read(make_clip()))
    assert sight.readable
    assert sight.background.luma.shape == (48, 64)
    assert sight.judged == ()


def test_the_reason_does_not_name_the_clip(make_clip: ClipMaker) -> None:
    sight = Sight(read(make_clip()), status="clip 'a.mp4': expected the mechanism, tracked it in none.")
    assert sight.reason == "expected the mechanism, tracked it in none."


def test_rows_are_found_by_frame_number(filmed: tuple[Scene, Poses]) -> None:
    _, poses = filmed
    part = poses[10:20]
    assert [pose_row(part, frame) for frame in (9, 10, 19, 20)] == [None, 0, 9, None]
    hidden = replace(part, seen=np.arange(10) > 0)
    assert [pose_row(hidden, frame) for frame in (10, 11)] == [None, 1]
    assert pose_row(None, 0) is None


def test_an_unknown_pose_has_no_outline(filmed: tuple[Scene, Poses]) -> None:
    scene, poses = filmed
    assert outlines_of(scene.mechanism, scene.camera, np.array([np.nan, 0.0])) == []
    assert len(outlines_of(scene.mechanism, scene.camera, poses.position[0])) == 2


def test_what_stands_before_the_mechanism_is_found(tmp_path: Path) -> None:
    """A board over a third of the picture: where the outline passes behind it no foreground shows."""

    def board(number: int, picture: np.ndarray) -> np.ndarray:
        picture = picture.copy()
        picture[:, 190:215] = 140.0
        return picture

    scene, poses = film(tmp_path, board)
    assert Sight(scene.masks.video, scene.masks, scene, poses).hidden is None
    lost = replace(poses, seen=np.arange(len(poses)) % 9 > 0)
    hidden = Sight(scene.masks.video, scene.masks, scene, lost).hidden
    assert hidden is not None
    assert hidden[:, 190:215].sum() > 0.7 * hidden.sum() > 100


def test_outlines_are_drawn_where_a_moving_camera_saw_them() -> None:
    box = np.array([[10.0, 20.0], [30.0, 40.0]])

    def filmed(path: CameraPath | None, frame: int) -> list[np.ndarray]:
        video: Any = SimpleNamespace(camera_path=path)
        masks: Any = SimpleNamespace(video=video, away=lambda frame: np.array([1.0, 0.5]))
        return Sight(video, masks).as_filmed(frame, [box])

    assert np.array_equal(filmed(None, 0)[0], box)
    maps = np.array([moved((5.0, -2.0)).entries, np.full((3, 3), np.nan)])
    path = CameraPath(maps, np.array([0.1, np.nan]), Frame(-1, 0.0, np.zeros(SIZE[::-1], np.uint8)))
    assert np.allclose(filmed(path, 0)[0], box + np.array([6.0, -1.5]))
    assert filmed(path, 1) == []


def test_outlines_are_drawn_where_tracked_points_say_that_the_camera_was() -> None:
    box = np.array([[10.0, 20.0], [30.0, 40.0]])
    drift = Drift(np.array([[1.0, 2.0], [3.0, 4.0]]), np.zeros(2), np.zeros(2))
    points: Any = object.__new__(PointScene)
    vars(points).update(
        drift=drift,
        tracks=PointTracks(
            Path("points.csv"),
            (),
            np.array([4, 7]),
            np.array([0.0, 0.1]),
            np.zeros((2, 0, 2)),
            np.zeros((2, 0)),
            64,
            48,
        ),
    )
    sight = Sight(SimpleNamespace(), points=points)  # type: ignore[arg-type]
    for frame, shift in ((4, [1.0, 2.0]), (7, [3.0, 4.0]), (9, [3.0, 4.0])):
        assert np.allclose(sight.as_filmed(frame, [box])[0], box + shift)
