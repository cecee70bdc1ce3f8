"""The published vision method against silhouettes that are drawn here, corner by corner."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import monodyn
from monodyn.errors import SettingsError, VideoError
from monodyn.mechanism import Mechanism
from monodyn.paper.locate import locate_published, size_ratios
from monodyn.paper.placed import drawn
from monodyn.paper.sequential import sequential
from monodyn.paper.settings import PaperLocateSettings, PaperTrackSettings
from monodyn.paper.starts import BUDGET, evolved_starts, spread_pose, spread_starts
from monodyn.paper.subproblems import (
    History,
    area_gap,
    centroid_gap,
    fit_depth,
    fit_place,
    fit_pose,
    fit_ratios,
    mismatch,
    pose_directions,
)
from monodyn.paper.threshold import OPEN, holds, otsu_level, silhouette
from monodyn.paper.track import Motion, joint_ranges, move_limits, scatter, step
from monodyn.paper.view import Seen, View, seen, view_of
from monodyn.types import FULL, Camera, Frame, Poses
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.foreground.background import Background
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.settings import CameraSettings, LocateSettings, TrackSettings

CAMERA = Camera(360, 280, 400.0, x=0.03, y=-0.12, depth=1.1)
LENGTHS, WIDTHS, THICK = (0.2, 0.15), (0.03, 0.024), 0.006
POSE = np.array([-0.8, 0.7])
EXAMPLES = Path(__file__).parents[2] / "examples"
FINE = 8


def model(
    folder: Path, lengths: tuple[float, ...] = LENGTHS, widths: tuple[float, ...] = WIDTHS, limits: str = ""
) -> Mechanism:
    """Load a chain of boxes from hinge to hinge, all in one plane."""
    bodies, ends = "", ""
    for i, (length, width) in enumerate(zip(lengths, widths, strict=True)):
        place = lengths[i - 1] if i else 0
        bodies += (
            f'<body name="link{i + 1}" pos="{place} 0 0"><joint name="joint{i + 1}" type="hinge" '
            f'axis="0 -1 0" {limits}/><geom type="box" pos="{length / 2} 0 0" density="2700" '
            f'size="{length / 2} {THICK / 2} {width / 2}"/>'
        )
        ends += "</body>"
    path = folder / "chain.xml"
    path.write_text(
        '<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/>'
        f"<worldbody>{bodies}{ends}</worldbody></mujoco>"
    )
    return monodyn.load(path)


def picture(
    q: np.ndarray,
    camera: Camera = CAMERA,
    lengths: tuple[float, ...] = LENGTHS,
    widths: tuple[float, ...] = WIDTHS,
    fine: int = 1,
) -> np.ndarray:
    """Draw the chain: eight corners of each box through a pinhole, their hull filled."""
    out = np.zeros((camera.height * fine, camera.width * fine), np.uint8)
    at, angle = np.zeros(2), 0.0
    for turn, length, width in zip(q, lengths, widths, strict=True):
        angle += turn
        along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        corners = []
        for a in (0.0, length):
            for b in (-width / 2, width / 2):
                for z in (-THICK / 2, THICK / 2):
                    x, y = at + a * along + b * across
                    away = camera.depth - z
                    px = (camera.width - 1) / 2 + camera.focal * (x - camera.x) / away
                    py = (camera.height - 1) / 2 - camera.focal * (y - camera.y) / away
                    corners.append([(px + 0.5) * fine - 0.5, (py + 0.5) * fine - 0.5])
        fill(out, cv2.convexHull(np.array(corners, dtype=np.float32))[:, 0].astype(float))
        at = at + length * along
    return out


def fill(out: np.ndarray, hull: np.ndarray) -> None:
    """Set the pixels whose centres lie inside a convex polygon."""
    left, top = np.maximum(np.floor(hull.min(axis=0)).astype(int), 0)
    right, bottom = np.ceil(hull.max(axis=0)).astype(int) + 1
    window = out[top:bottom, left:right]
    y, x = np.mgrid[top : top + window.shape[0], left : left + window.shape[1]]
    following = np.roll(hull, -1, axis=0)
    sides = [
        (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) for a, b in zip(hull, following, strict=True)
    ]
    window[np.all(np.array(sides) >= 0, axis=0) | np.all(np.array(sides) <= 0, axis=0)] = 1


def image_of(q: np.ndarray = POSE, **kwargs: object) -> Seen:
    """Return a drawn silhouette; a pixel belongs to it when more than half of it does."""
    fine = picture(q, fine=FINE, **kwargs).astype(np.float32)  # pyright: ignore[reportArgumentType]
    size = (fine.shape[1] // FINE, fine.shape[0] // FINE)
    share = cv2.resize(fine, size, interpolation=cv2.INTER_AREA)
    return seen(np.where(share > 0.5, FULL, 0).astype(np.uint8))


def view(
    mechanism: Mechanism,
    camera: Camera = CAMERA,
    q: np.ndarray = POSE,
    moves: tuple[bool, bool, bool] = (True, True, True),
) -> View:
    return view_of(mechanism, camera, q, moves)


def falls(history: History) -> bool:
    return bool(np.all(np.diff(history.values) <= 0) and np.all(np.diff(history.evaluations) >= 0))


HELD = (False, False, False)


def test_area_centroid_and_mismatch_are_those_of_the_drawn_picture(tmp_path: Path) -> None:
    """Rows are taken along their middle lines: half a pixel's slope at the ends of an outline."""
    mechanism, other = model(tmp_path), np.array([-0.6, 0.3])
    image, rig = image_of(), rig_of(mechanism, CAMERA)
    fine = picture(other, fine=FINE)
    y, x = np.nonzero(fine)
    area, common, sum_x, sum_y = drawn(image.moments, rig, other)
    assert area == pytest.approx(len(x) / FINE**2, rel=0.005)
    assert common == pytest.approx(area)
    assert sum_x / common == pytest.approx((x.mean() + 0.5) / FINE - 0.5, abs=0.1)
    assert sum_y / common == pytest.approx((y.mean() + 0.5) / FINE - 0.5, abs=0.1)
    assert area_gap(image, rig, other) == pytest.approx((image.area - area) ** 2)
    apart = (image.x - sum_x / common) ** 2 + (image.y - sum_y / common) ** 2
    assert centroid_gap(image, rig, other) == pytest.approx(apart)
    difference = np.sum(picture(POSE, fine=FINE) != fine) / FINE**2
    assert mismatch(image, rig, other) == pytest.approx(difference, rel=0.02)


def test_what_lies_outside_of_the_picture_or_is_not_known_has_no_area(tmp_path: Path) -> None:
    mechanism = model(tmp_path)
    rig = rig_of(mechanism, replace(CAMERA, x=CAMERA.x + 0.5))
    shifted = picture(POSE, replace(CAMERA, x=CAMERA.x + 0.5), fine=FINE)
    blank = np.full((CAMERA.height, CAMERA.width), FULL, np.uint8)
    assert drawn(seen(blank).moments, rig, POSE)[1] == pytest.approx(shifted.sum() / FINE**2, rel=0.02)
    blank[:140] = OPEN
    lower = picture(POSE, fine=FINE)[140 * FINE :]
    assert drawn(seen(blank).moments, rig_of(mechanism, CAMERA), POSE)[1] == pytest.approx(
        lower.sum() / FINE**2, rel=0.02
    )


def test_the_drawn_arrays_are_affine_in_the_sizes(tmp_path: Path) -> None:
    mechanism = model(tmp_path)
    at = view(mechanism)
    assert at.reference == "link1.length"
    sizes = at.sizes * [1.3, 0.7, 2.0]
    expected = rig_of(mechanism.with_values(dict(zip(at.names, sizes, strict=True))), CAMERA)
    for a, b in zip(at.rig_with(sizes), expected, strict=True):
        np.testing.assert_allclose(
            a if a.shape != (2, 14) else a[:, :5], b if b.shape != (2, 14) else b[:, :5]
        )


def test_depth_from_the_area(tmp_path: Path) -> None:
    """Eq. (1): a pixel's share of the outline, 1 % of this area, is 0.5 % of the depth."""
    start = view(model(tmp_path), replace(CAMERA, depth=1.9))
    found, history = fit_depth(image_of(), start)
    assert found.base.camera[11] == pytest.approx(CAMERA.depth, rel=0.005)
    assert history.problem == "depth"
    assert falls(history)
    assert history.evaluations[-1] < 60


def test_place_from_the_centroid(tmp_path: Path) -> None:
    """Eq. (2): 0.1 px is 0.3 mm here."""
    start = view(model(tmp_path), replace(CAMERA, x=0.12, y=-0.02))
    found, history = fit_place(image_of(), start)
    np.testing.assert_allclose(found.base.camera[9:11], [CAMERA.x, CAMERA.y], atol=3e-4)
    assert falls(history)


@pytest.mark.parametrize("moves", [HELD, (True, True, True)])
def test_pose_from_the_mismatch(tmp_path: Path, moves: tuple[bool, bool, bool]) -> None:
    """Eq. (3), before a camera that stays and before one that follows."""
    start = view(model(tmp_path), q=np.array([-0.55, 0.4]), moves=moves)
    found, history = fit_pose(image_of(), start)
    np.testing.assert_allclose(found.position, POSE, atol=np.radians(0.3))
    assert falls(history)


def test_a_joint_limit_holds(tmp_path: Path) -> None:
    start = view(
        model(tmp_path, limits='range="-0.6 0.4" limited="true"'), q=np.array([-0.5, 0.2]), moves=HELD
    )
    found, _ = fit_pose(image_of(), start)
    assert np.all((found.position >= -0.6) & (found.position <= 0.4))
    image = image_of()
    grid = [np.array([a, b]) for a in np.linspace(-0.6, -0.5, 11) for b in np.linspace(-0.6, 0.4, 51)]
    best = min(mismatch(image, start.rig, q) for q in grid)
    assert mismatch(image, start.rig, found.position) <= 1.02 * best


def test_aspect_ratios_from_the_mismatch(tmp_path: Path) -> None:
    """Eq. (4): width over length of each body; before a camera that stays lengths are seen as well."""
    start = view(model(tmp_path, lengths=(0.21, 0.18), widths=(0.045, 0.016)), moves=HELD)
    found, history = fit_ratios(image_of(), start)
    sizes = dict(zip(found.names, found.sizes, strict=True))
    expected = {"link1.length": 0.2, "link1.width": 0.03, "link2.length": 0.15, "link2.width": 0.024}
    assert sizes == pytest.approx(expected, rel=0.03)
    assert falls(history)


def test_the_framework_finds_all_of_them(tmp_path: Path) -> None:
    """Fig. 2 from wrong sizes, camera and pose: the scale of the file stays, so the depth takes it."""
    mechanism = model(tmp_path, lengths=(0.1, 0.1), widths=(0.02, 0.02))
    image = image_of()
    start = view(mechanism, replace(CAMERA, depth=0.8, x=0.0, y=0.0), np.array([-0.7, 0.55]))
    found, histories = sequential(image, start)
    sizes = dict(zip(found.names, found.sizes, strict=True))
    np.testing.assert_allclose(found.position, POSE, atol=np.radians(0.3))
    assert sizes == pytest.approx(
        {"link1.width": 0.015, "link2.length": 0.075, "link2.width": 0.012}, rel=0.03
    )
    np.testing.assert_allclose(found.base.camera[9:12], [0.015, -0.06, 0.55], rtol=0.02)
    assert mismatch(image, found.rig, found.position) < 0.03 * image.area
    assert [h.problem for h in histories[:4]] == ["depth", "place", "pose", "ratios"]
    assert all(falls(h) for h in histories)


@pytest.mark.parametrize("search", [spread_starts, evolved_starts])
def test_starts_lead_to_the_pose(tmp_path: Path, search: object) -> None:
    """From no pose at all; a chain may be read from either end, so one of the starts comes out right."""
    mechanism = model(tmp_path, lengths=(0.1, 0.1), widths=(0.02, 0.02))
    image = image_of()
    starts, drawings = search(image, view(mechanism, q=np.zeros(2)), 4)  # pyright: ignore[reportCallIssue]
    assert drawings > 1000
    ends = [sequential(image, start)[0] for start in starts]
    errors = [np.abs((end.position - POSE + np.pi) % (2 * np.pi) - np.pi).max() for end in ends]
    assert min(errors) < np.radians(0.3)


@pytest.mark.parametrize("links", [2, 7, 9])
def test_the_spread_keeps_to_its_number_of_poses(tmp_path: Path, links: int) -> None:
    """A grid of four values a joint would have 262,000 poses for nine links; each is drawn three times."""
    mechanism = model(tmp_path, lengths=(0.04,) * links, widths=(0.02,) * links)
    starts, drawings = spread_starts(image_of(), view(mechanism, q=np.zeros(links)), 4)
    assert len(starts) == 4
    assert drawings <= 3 * BUDGET * links


def test_the_evolution_takes_its_seed(tmp_path: Path) -> None:
    """The same seed gives the same starts, another seed none of them."""
    image, at = image_of(), view(model(tmp_path), q=np.zeros(2))
    first, again, other = (evolved_starts(image, at, 2, seed=seed)[0] for seed in (0, 0, 1))
    np.testing.assert_array_equal([s.position for s in first], [s.position for s in again])
    for a in first:
        assert not any(np.array_equal(a.position, b.position) for b in other)


def test_a_pose_is_found_anywhere_before_a_known_camera(tmp_path: Path) -> None:
    far = np.array([2.0, -2.2])
    found, left, _ = spread_pose(image_of(far), view(model(tmp_path)))
    np.testing.assert_allclose(
        (found.position - far + np.pi) % (2 * np.pi) - np.pi, 0.0, atol=np.radians(0.5)
    )
    assert left < 100.0


def test_directions_move_the_picture_by_a_pixel_independently(tmp_path: Path) -> None:
    from monodyn.paper.subproblems import outline_points

    rig = rig_of(model(tmp_path), CAMERA)
    directions = pose_directions(rig, POSE, np.arange(2))
    h = 1e-3
    moves = [
        (outline_points(rig, POSE + h * d) - outline_points(rig, POSE - h * d)).ravel() / (2 * h)
        for d in directions.T
    ]
    gram = 2.0 * np.array([[a @ b for b in moves] for a in moves]) / len(moves[0])
    np.testing.assert_allclose(gram, np.eye(2), atol=1e-3)


def test_move_limits() -> None:
    """Eq. (5): a share of each joint's range about the last pose; adaptive about where its velocity leads."""
    mechanism = monodyn.load("double")
    at = view_of(mechanism, CAMERA, np.zeros(2), HELD)
    np.testing.assert_allclose(joint_ranges(at), 2 * np.pi)
    motion = Motion(1.0, np.array([0.5, 1.0]), np.array([6.0, -3.0]), 5, 0, 0.05)
    start, lower, upper = move_limits(at, motion, 1.05, PaperTrackSettings(move_share=0.1, adaptive=False))
    np.testing.assert_allclose(start, motion.position)
    np.testing.assert_allclose(upper - start, 0.2 * np.pi)
    np.testing.assert_allclose(start - lower, 0.2 * np.pi)
    start, lower, upper = move_limits(at, motion, 1.05, PaperTrackSettings(move_share=0.1))
    np.testing.assert_allclose(start, [0.8, 0.85])
    np.testing.assert_allclose(upper - start, 0.8 * 0.3)
    slow = replace(motion, velocity=np.zeros(2))
    start, lower, upper = move_limits(at, slow, 1.05, PaperTrackSettings(move_share=0.1))
    np.testing.assert_allclose(upper - start, 0.2 * 0.2 * np.pi)
    lost = replace(motion, lost=2)
    _, lower, upper = move_limits(at, lost, 1.1, PaperTrackSettings(move_share=0.1))
    np.testing.assert_allclose(upper - lower, 0.4 * np.pi * 1.6**2)


@pytest.mark.parametrize("adaptive", [True, False])
def test_a_motion_is_followed_through_a_gap(tmp_path: Path, adaptive: bool) -> None:
    """Eq. (5) on a swing of up to 0.3 rad a frame; for two frames something else hides the second link."""
    at = view(model(tmp_path), moves=HELD)
    settings = PaperTrackSettings(method="paper", adaptive=adaptive)
    motion, seen_frames = None, []
    for k in range(24):
        t = k / 30.0
        truth = np.array([-1.5 + 1.2 * np.sin(6.0 * t), 1.5 * np.sin(6.0 * t)])
        image = image_of(truth)
        if k in (12, 13):
            image = seen(cv2.circle(np.zeros((280, 360), np.uint8), (60, 60), 40, FULL, -1))
        motion, found, drawings = step(image, at, motion, t, settings, truth if k == 0 else None)
        seen_frames.append(found is not None)
        assert drawings > 0
        if found is not None:
            # the upright edges of links of 60 px cross their pixel centres all at once: a pixel is a degree
            np.testing.assert_allclose(found, truth, atol=np.radians(1.5))
    assert [k for k, lies in enumerate(seen_frames) if not lies] == [12, 13]


def test_scatter_is_the_noise_about_smooth_motion() -> None:
    """Of 400 samples a deviation is known within 10 %; a cubic motion and lost frames change nothing."""
    rng = np.random.default_rng(4)
    t = np.arange(400) / 30.0
    noise = np.array([2e-3, 5e-4])
    position = np.column_stack([1 + t - 0.02 * t**3, 0.3 * t**2]) + noise * rng.standard_normal((400, 2))
    position[50:60] = np.nan
    found = scatter(t, position, np.array([True, True]))
    np.testing.assert_allclose(np.sqrt(np.diag(found)), noise, rtol=0.15)
    assert found[0, 1] == 0.0


def background(grey: float = 170.0, known: np.ndarray | None = None) -> Background:
    luma = np.full((CAMERA.height, CAMERA.width), grey, np.float32)
    known = np.ones(luma.shape, dtype=bool) if known is None else known
    return Background(luma, None, 1.0, known, (0, CAMERA.height, 0, CAMERA.width))


def frame(noise: float = 2.0) -> tuple[Frame, np.ndarray]:
    mask = picture(POSE) > 0
    rng = np.random.default_rng(2)
    luma = np.where(mask, 60.0, 170.0) + noise * rng.standard_normal(mask.shape)
    luma[5:8, 5:8] = 60.0
    return Frame(0, 0.0, np.clip(np.round(luma), 0, 255).astype(np.uint8)), mask


def test_silhouette_by_background_subtraction_and_threshold() -> None:
    shot, mask = frame()
    level = otsu_level([shot], background())
    assert 20.0 < level < 100.0
    out = silhouette(shot, background(), level)
    np.testing.assert_array_equal(out, np.where(mask, FULL, 0))  # the patch of nine pixels is left out
    assert holds(out)
    assert not holds(silhouette(shot, background(), 200.0))


def test_otsu_level_maximizes_the_variance_between_the_classes() -> None:
    shot, _ = frame(noise=9.0)
    from monodyn.paper.threshold import difference

    values = difference(shot, background()).ravel().astype(float)
    spread = [
        np.mean(values <= t)
        * np.mean(values > t)
        * (values[values <= t].mean() - values[values > t].mean()) ** 2
        for t in range(1, 110)
    ]
    best = 1 + np.flatnonzero(np.array(spread) >= max(spread) * (1 - 1e-12))
    assert best.min() <= otsu_level([shot], background()) <= best.max()


def test_pixels_without_a_background() -> None:
    """A small patch that the mechanism touches is its own; a stand that it crosses is left open."""
    shot, mask = frame()
    known = np.ones(mask.shape, dtype=bool)
    y, x = (round(float(values.mean())) for values in np.nonzero(mask))
    known[y - 3 : y + 3, x - 3 : x + 3] = False
    known[:60, 300:340] = False
    out = silhouette(shot, background(known=known), 50.0)
    np.testing.assert_array_equal(out[:60, 300:340], OPEN)
    assert np.all(out[y - 3 : y + 3, x - 3 : x + 3] == FULL)
    assert np.all(silhouette(shot, background(known=known), 50.0, settle=False)[~known] == OPEN)


def test_bad_input_is_refused() -> None:
    with pytest.raises(SettingsError) as caught:
        silhouette(frame()[0], background(), 0.0)
    assert str(caught.value) == "silhouette: expected a level above 0 and below 255, got 0."
    with pytest.raises(VideoError, match="silhouette: expected some of the mechanism, got an empty picture"):
        seen(np.zeros((20, 20), np.uint8))
    with pytest.raises(SettingsError) as caught:
        PaperLocateSettings(method="fast", start="evolution")
    assert str(caught.value) == (
        "locate.start: expected 'spread' with the fast method, got 'evolution'; "
        "it belongs to locate.method paper."
    )
    with pytest.raises(SettingsError) as caught:
        LocateSettings(seed=-1)
    assert str(caught.value) == "locate.seed: expected 0 or more, got -1; give a whole number."
    with pytest.raises(SettingsError) as caught:
        CameraSettings(method="slow")  # pyright: ignore[reportArgumentType]
    assert str(caught.value) == "camera.method: expected one of 'fast', 'paper', got 'slow'."
    with pytest.raises(SettingsError) as caught:
        TrackSettings(method="slow")  # pyright: ignore[reportArgumentType]
    assert str(caught.value) == "track.method: expected one of 'fast', 'paper', got 'slow'."
    with pytest.raises(SettingsError) as caught:
        PaperTrackSettings(move_share=0.0)
    assert str(caught.value) == "track.move_share: expected 0.001 to 0.5, got 0.0."


def test_a_part_of_the_poses_keeps_its_evaluations() -> None:
    poses = Poses(
        ("a",), np.arange(4), np.arange(4.0), np.zeros((4, 1)), np.ones((4, 1, 1)), np.ones(4, dtype=bool),
        evaluations=np.array([5, 6, 7, 8]),
    )  # fmt: skip
    counts = poses.part(1, 3).evaluations
    assert counts is not None
    assert counts.tolist() == [6, 7]


@pytest.fixture(scope="module")
def masks() -> Masks:
    return monodyn.segment(monodyn.read(EXAMPLES / "double.mp4"))


def test_the_example_clip_by_the_published_method(masks: Masks) -> None:
    """Issue 3 asks for 1 degree over 40 frames; the errors found were 0.07 and 0.22."""
    mechanism = monodyn.load(EXAMPLES / "double.xml")
    both = LocateSettings(method="paper"), CameraSettings(method="paper")
    told: list[tuple[str, int, int | None]] = []
    scene = monodyn.locate(
        masks, mechanism, both[0], camera=both[1], progress=lambda *words: told.append(words)
    )
    poses = monodyn.track(scene.masks, scene, TrackSettings(method="paper"))
    truth = np.array(json.loads((EXAMPLES / "double.json").read_text())["q"])
    error = np.degrees((poses.position - truth + np.pi) % (2 * np.pi) - np.pi)
    assert poses.seen.all()
    assert np.sqrt((error[:40] ** 2).mean(axis=0)).max() < 0.5
    assert poses.evaluations is not None
    assert 20 < poses.evaluations.mean() < 300
    assert scene.frame == 0
    assert scene.mechanism.measured is not None
    assert {h.problem for h in scene.history} == {"depth", "place", "pose", "ratios"}
    assert all(falls(h) for h in scene.history)
    assert scene.evaluations > sum(int(h.evaluations[-1]) for h in scene.history)
    assert len(told) > 20
    assert {step for step, _, _ in told} == {"locate"}
    assert all(total is not None and 0 <= done <= total for _, done, total in told)
    assert np.all(np.diff([done for _, done, _ in told]) >= 0)
    assert told[-1][1] == told[-1][2]


def test_a_search_out_of_silhouettes_gives_the_best_so_far(masks: Masks) -> None:
    """The starts may draw half of what is left; a part that passes the limit ends: one finalist at least."""
    mechanism = monodyn.load(EXAMPLES / "double.xml")
    video = masks.video
    camera = Camera(video.width, video.height, float(video.width))
    settings = LocateSettings(method="paper")
    scene = locate_published(masks, mechanism, camera, (), settings, most=100_000)
    assert scene.evaluations < 200_000
    assert scene.advice[0] == (
        f"The search for the scene ended after {scene.evaluations:,} silhouettes, before all starts were "
        "tried: what was found is the best so far. Check the overlay; give sizes that are known with --fix, "
        "or use the default method, which is fast with many joints."
    )
    assert np.isfinite(scene.position).all()


@pytest.mark.parametrize("held", [False, True])
def test_sizes_from_one_silhouette_are_known_up_to_their_scale(tmp_path: Path, held: bool) -> None:
    """A ratio of sizes of many pixels is known to 4 % twice; a fixed size gives the others their scale."""
    mechanism = model(tmp_path)
    if held:
        mechanism = mechanism.with_choices(fix={"link1.length": LENGTHS[0]})
    at = view(mechanism, replace(CAMERA, focal=4e5))
    known = size_ratios(at, mechanism, scale_free=not held)
    assert ("link1.length" in known.names) is not held
    i, j = known.names.index("link2.width"), known.names.index("link1.width")
    if held:
        np.testing.assert_allclose(known.information, np.diag(np.full(3, 1 / 0.04**2)), rtol=1e-3)
        return
    np.testing.assert_allclose(known.information.sum(axis=1), 0.0, atol=1e-6)
    covariance = np.linalg.pinv(known.information)
    ratio = np.eye(4)[i] - np.eye(4)[j]
    assert ratio @ covariance @ ratio == pytest.approx(2 * 0.04**2, rel=1e-3)
    near = view(mechanism, CAMERA)
    width = 0.024 * CAMERA.focal / CAMERA.depth
    length = 0.2 * CAMERA.focal / CAMERA.depth
    coarse = np.linalg.pinv(size_ratios(near, mechanism, scale_free=True).information)
    i, j = known.names.index("link2.width"), known.names.index("link1.length")
    ratio = np.eye(4)[i] - np.eye(4)[j]
    expected = 2 * 0.04**2 + (0.5 / width) ** 2 + (0.5 / length) ** 2
    assert ratio @ coarse @ ratio == pytest.approx(expected, rel=1e-6)


def test_methods_can_be_mixed(masks: Masks) -> None:
    """The camera by area and centroid at the fast pose is the fast camera within 1 %."""
    mechanism = monodyn.load(EXAMPLES / "double.xml")
    fast = monodyn.locate(masks, mechanism)
    camera = monodyn.locate(masks, mechanism, camera=CameraSettings(method="paper"))
    assert camera.camera.depth == pytest.approx(fast.camera.depth, rel=0.01)
    np.testing.assert_array_equal(camera.position, fast.position)
    pose = monodyn.locate(masks, mechanism, LocateSettings(method="paper"))
    assert pose.camera == fast.camera
    for name in ("link1.length", "link2.length"):
        assert pose.mechanism.values[name] == pytest.approx(fast.mechanism.values[name], rel=0.02)
    with pytest.raises(
        SettingsError, match=r"'camera.focal': camera.method paper estimates camera.x, camera.y"
    ):
        monodyn.locate(masks, mechanism, camera=CameraSettings(method="paper"), free=("camera.focal",))
    with pytest.raises(SettingsError, match=r"locate.start: expected 'spread' with the fast method"):
        monodyn.locate(masks, mechanism, PaperLocateSettings(start="evolution"))
