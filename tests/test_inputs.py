"""Points and masks in place of a clip: a run from end to end, and what is refused before it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

import monodyn
from monodyn.blur import check_exposure
from monodyn.checks import unshown
from monodyn.doubtful import doubtful_sight
from monodyn.errors import SettingsError, VideoError
from monodyn.inputs import (
    check_torques,
    clip_torques,
    frames_with_torques,
    masks_and_mechanism,
    opened,
    points_and_mechanism,
)
from monodyn.settings import RunSettings
from monodyn.types import FULL
from monodyn.vision.clip.lens import lens_of
from monodyn.vision.clip.repeats import Repeats
from monodyn.vision.foreground.mask_files import OpenedMasks
from monodyn.vision.points.tracks import PointTracks
from monodyn.vision.settings import CameraSettings, LocateSettings
from pictures import drawn_mask
from support import ClipMaker, command, refuses
from tracked import plain_csv, seen, spoiled, swing

NAMES = ("joint1", "joint2", "link2")


def written(folder: Path, count: int = 120) -> tuple[Path, np.ndarray]:
    double = monodyn.load("double")
    q = swing(double, count, (0.6, 0.5))
    return plain_csv(folder / "points.csv", NAMES, spoiled(seen(double, q, NAMES))), q


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("points")
    path, q = written(folder)
    words = ("--points", path, "--rate", "30", "--points.size", "1280,720", "--model", "double", "--json")
    return command("run", *words, "--out", folder / "run", folder=folder / "run"), q


def test_a_run_on_points(done: Any) -> None:
    run, q = done
    assert run.code == 0, run.err
    files = {path.name for path in run.folder.iterdir()}
    assert files == {
        "poses.csv", "states.csv", "prediction.csv", "fit.json", "model.xml", "model.urdf", "diagnosis.png",
        "report.html", "run.toml", "run.json",
    }  # fmt: skip
    fit = json.loads(run.out)
    lengths = {row["name"]: row for row in fit["parameters"] if row["name"].endswith("length")}
    truth = monodyn.load("double").values
    for name, row in lengths.items():
        assert abs(row["value"] - truth[name]) < 4.0 * row["std"] + 1e-3
    table = np.genfromtxt(run.folder / "prediction.csv", delimiter=",", names=True)
    off = (table["joint1"] - q[table["frame"].astype(int), 0] + np.pi) % (2 * np.pi) - np.pi
    assert np.degrees(np.sqrt(np.mean(off**2))) < 1.5
    log = json.loads((run.folder / "run.json").read_text(encoding="utf-8"))
    assert set(log["inputs"]) == {"points", "model"}
    assert log["settings"]["points_size"] == [1280, 720]


@pytest.mark.slow
def test_tracking_points_alone_leaves_poses_and_pictures(tmp_path: Path) -> None:
    path, _ = written(tmp_path, 60)
    done = command(
        "track", "--points", path, "--rate", "30", "--model", "double", "--out", tmp_path / "run",
        "--points.map", "link2=link2", "--quiet", folder=tmp_path / "run",
    )  # fmt: skip
    assert done.code == 0, done.err
    assert {path.name for path in done.folder.iterdir()} == {
        "poses.csv",
        "diagnosis.png",
        "run.toml",
        "run.json",
    }


def test_points_that_are_refused_leave_nothing(tmp_path: Path) -> None:
    path = plain_csv(tmp_path / "points.csv", ("nose",), np.zeros((9, 1, 2)))
    done = command("run", "--points", path, "--rate", "30", "--model", "double", "--out", tmp_path / "run")
    assert done.code == 2
    assert "points 'nose'" in done.err
    assert not (tmp_path / "run").exists()


def test_a_run_needs_something_to_look_at(tmp_path: Path) -> None:
    with refuses(VideoError, "clip: expected a video file or a folder of pictures, got none; name one."):
        opened(None, "double", RunSettings())
    with refuses(SettingsError, "points: expected a file of tracked points, got none; name one."):
        points_and_mechanism(None, "double", RunSettings())
    with refuses(SettingsError, "masks: expected a folder, a film or an NPZ file, got none; name one."):
        masks_and_mechanism(None, "double", RunSettings())
    path, _ = written(tmp_path, 10)
    with refuses(
        SettingsError, "roi: expected nothing next to --points, which take the place of the pictures."
    ):
        opened(None, "double", RunSettings(points=path, rate=30.0, roi=(0, 0, 99, 99)))
    with refuses(
        SettingsError, "background: expected nothing next to --masks, which have none; leave it out."
    ):
        opened(None, "double", RunSettings(masks=path, background=path))
    with refuses(SettingsError, "masks: expected masks or points, got both; leave one out."):
        RunSettings(masks=path, points=path)
    with refuses(
        SettingsError,
        "points.size: expected W,H of 16 to 65535 px, got 640,2; give width and height of the picture.",
    ):
        RunSettings(points=path, points_size=(640, 2))
    with refuses(
        SettingsError,
        "points.map, points.size, points.axis: expected --points FILE with them, got none; name the file, or "
        "leave them out.",
    ):
        RunSettings(points_map={"a": "joint1"})
    said = command("run", "--model", "double", "--out", tmp_path / "run")
    assert said.err == (
        "monodyn: clip: expected CLIP, or --points FILE or --masks MASKS in its place, got none; name one.\n"
    )
    said = command("run", "a.mp4", "--clip", "b.mp4", "--model", "double", "--out", tmp_path / "run")
    assert said.err == "monodyn: run: expected one CLIP, got 'a.mp4' and 'b.mp4'; leave one out.\n"


BARREL = (-0.3, 0.1, 0.002, 0.0)
"""How a lens bends a picture 1280 px wide, seen with a focal length of as many."""


def bent(px: np.ndarray) -> np.ndarray:
    """Return where such a lens shows places of a straight picture, (..., 2)."""
    matrix = np.array([[1280.0, 0.0, 639.5], [0.0, 1280.0, 359.5], [0.0, 0.0, 1.0]])
    ahead = np.concatenate([(px - matrix[:2, 2]) / 1280.0, np.ones((*px.shape[:-1], 1))], axis=-1)
    shown, _ = cv2.projectPoints(ahead.reshape(-1, 3), np.zeros(3), np.zeros(3), matrix, np.array(BARREL))
    return shown.reshape(px.shape)


def test_points_are_put_straight(tmp_path: Path) -> None:
    double = monodyn.load("double")
    straight = seen(double, swing(double, 60, (0.6, 0.5)), NAMES)
    path = plain_csv(tmp_path / "points.csv", NAMES, bent(straight))
    given = RunSettings(
        points=path, points_size=(1280, 720), rate=30.0, distortion=BARREL, fix={"camera.focal": 1280.0}
    )
    _, tracks, _ = opened(None, "double", given)
    assert isinstance(tracks, PointTracks)
    # the table has three decimals
    assert tracks.px == pytest.approx(straight, abs=2e-3)


def test_points_that_a_lens_cannot_show_are_said(tmp_path: Path) -> None:
    px = np.full((20, 2, 2), [900.0, 500.0]) + np.arange(20)[:, None, None]
    # two in a corner that the coefficients fold, and one that was not found
    px[3:5, 0], px[7, 1] = [2.0, 2.0], np.nan
    path = plain_csv(tmp_path / "points.csv", ("joint1", "joint2"), px)
    given = RunSettings(
        points=path, points_size=(1920, 1080), rate=30.0, distortion=(-0.25, 0.08, 0.0, 0.0, -0.012),
        locate=LocateSettings(focal=870.0),
    )  # fmt: skip
    _, tracks, _ = opened(None, "double", given)
    assert isinstance(tracks, PointTracks)
    assert np.flatnonzero(~tracks.found.all(axis=1)).tolist() == [3, 4, 7]
    assert tracks.notes[-1] == (
        "2 of 39 points lie where no place of a straight picture appears by --camera.distortion and "
        "--locate.focal: they count as not found. Check both where the points are right."
    )
    _, whole, _ = opened(None, "double", replace(given, distortion=BARREL))
    assert isinstance(whole, PointTracks)
    assert not any("--camera.distortion" in note for note in whole.notes)


def test_an_exposure_is_shorter_than_the_time_between_two_pictures(make_clip: ClipMaker) -> None:
    clip = make_clip()
    said = (
        "camera.exposure: expected at most 0.03333 s, the time between two pictures of the clip, got 5 s; "
        "give it in seconds (5 ms are 0.005), and --rate if the clip has another rate."
    )
    with refuses(SettingsError, said):
        opened(clip, "double", RunSettings(camera=CameraSettings(exposure=5.0)))
    # that fits a scene of a lower rate in this clip: refused as soon as the pictures have been looked at
    given = RunSettings(camera=CameraSettings(exposure=0.04))
    video, _, _ = opened(clip, "double", given)
    with refuses(SettingsError, said.replace("5 s;", "0.04 s;")):
        check_exposure(video, given.camera)
    every_other = video.without(Repeats(tuple(range(1, 12, 2))))
    check_exposure(every_other, given.camera)
    check_exposure(video.without(Repeats((5, 11), 25.0, np.arange(12) / 25.0)), given.camera)
    with refuses(SettingsError, said.replace("exposure", "readout").replace("5 s;", "-0.04 s;")):
        check_exposure(video, CameraSettings(readout=-0.04))
    # what both were rounded by does not count
    check_exposure(video, CameraSettings(exposure=0.034, readout=-1 / 30))


def test_torques_reach_over_the_frames_that_the_user_names(tmp_path: Path) -> None:
    """Where nobody does, the clip has to be seen first."""
    log = tmp_path / "torques.csv"
    log.write_text("time,joint1\n" + "".join(f"{0.1 * k},0.5\n" for k in range(10, 31)), encoding="utf-8")
    times, settings = np.arange(90) / 30.0, RunSettings(torques=(log,))
    known = clip_torques(settings, monodyn.load("single"), times, (0, 67))
    assert known is not None
    said = (
        "torques: expected a log of all of the frames to fit (0:67), 0 to 2.2 s, got one from 1 to 3 s; both "
        "are on one clock: shift the times of the log, or fit what it covers (--fit-frames A:B)."
    )
    with refuses(VideoError, said):
        clip_torques(replace(settings, fit_frames=(0, 67)), monodyn.load("single"), times, (0, 67))
    with refuses(VideoError, said):
        check_torques(known, times, (0, 67))
    check_torques(known, times, (30, 67))
    note = ["The log of torques covers frames 30:67 alone, which the fit is of."]
    assert frames_with_torques(known, times, (0, 67)) == ((30, 67), note)
    assert frames_with_torques(known, times, (31, 67)) == ((31, 67), [])
    assert frames_with_torques(None, times, (0, 67)) == ((0, 67), [])
    coarse = replace(known, time=np.array([0.5, 1.5]), torque=np.ones((2, 1)))
    assert frames_with_torques(coarse, times, (0, 12)) == ((0, 12), [])
    with refuses(VideoError, said.replace("(0:67), 0 to 2.2 s", "(0:20), 0 to 0.6333 s")):
        frames_with_torques(known, times, (0, 20))
    check_torques(None, times, (0, 67))


def test_a_lens_bends_no_lengths_of_a_scene(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("mass_A\nt,x,y\n" + "".join(f"{0.1 * k},{0.1 * k},{0.02 * k * k}\n" for k in range(9)))
    given = RunSettings(
        points=path, distortion=BARREL, locate=LocateSettings(focal=900.0), points_map={"mass_A": "link1"}
    )
    with refuses(
        SettingsError,
        "camera.distortion: expected points in pixels, got lengths of a scene; leave one of them out.",
    ):
        opened(None, "single", given)


def test_masks_are_put_straight(tmp_path: Path) -> None:
    folder = tmp_path / "masks"
    folder.mkdir()
    for k in range(3):
        picture = np.zeros((120, 160), np.uint8)
        picture[5:25, 5 + k : 25 + k] = 255
        cv2.imwrite(str(folder / f"{k:03d}.png"), picture)
    settings = RunSettings(masks=folder, rate=30.0)
    lens = {"distortion": BARREL, "locate": LocateSettings(focal=160.0)}
    video, plain, _ = opened(None, "single", settings)
    straight_video, straight, _ = opened(None, "single", replace(settings, **lens))
    assert isinstance(plain, OpenedMasks)
    assert isinstance(straight, OpenedMasks)
    assert (video is plain.objects, straight_video is straight.objects) == (True, True)
    before, after = (next(clip.frames()).luma for clip in (plain.objects, straight.objects))
    # a barrel draws corners inward: put straight they are farther out
    assert after[:12, :12].mean() > before[:12, :12].mean() + 20.0


@pytest.mark.slow
def test_a_bent_clip_is_a_straight_one_with_the_lens(tmp_path: Path) -> None:
    """A made clip that a wide lens bends: the lengths are wrong without its coefficients, and right with."""
    mechanism, size, focal = monodyn.load("double"), (480, 360), 320.0
    q = swing(mechanism, 60, (0.9, 0.6))
    camera = monodyn.Camera(*size, focal, y=-0.15, depth=0.75)
    lens = lens_of((-0.3, 0.1, 0.0, 0.0), focal, *size)
    pixels = np.stack(np.meshgrid(np.arange(size[0]), np.arange(size[1])), axis=-1).astype(np.float64)
    source = lens.points(pixels).astype(np.float32)
    folder = tmp_path / "clip"
    folder.mkdir()
    for k, position in enumerate(q):
        cover = drawn_mask(mechanism, camera, position)[0].astype(np.float32) / FULL
        picture = cv2.remap(200.0 - 150.0 * cover, source, np.zeros(0), cv2.INTER_CUBIC)
        cv2.imwrite(str(folder / f"{k:03d}.png"), np.clip(np.round(picture), 0, 255).astype(np.uint8))
    settings = RunSettings(rate=30.0, fit_frames=(0, 50), locate=LocateSettings(focal=focal))
    off = []
    for given in (settings, replace(settings, distortion=lens.coefficients)):
        run = monodyn.run(folder, "double", tmp_path / "run", given, force=True)
        found = {row["name"]: row["value"] for row in run.document["parameters"]}
        ratios = [found[name] / mechanism.values[name] for name in ("link1.length", "link2.length")]
        off.append(np.abs(np.array(ratios) - 1.0).max())
    assert off[0] > 0.01
    assert off[1] < 0.005


def part(share: float, count: int = 100) -> monodyn.Poses:
    shown = np.zeros((count, 1), bool)
    shown[: round(share * count)] = True
    nothing = np.zeros((count, 1, 1))
    return monodyn.Poses(
        ("joint1",), np.arange(count), np.arange(count) / 30.0, np.zeros((count, 1)), nothing, shown[:, 0],
        joint_seen=shown,
    )  # fmt: skip


def test_points_that_are_hardly_the_mechanism_are_doubted() -> None:
    def sight(**changed: float) -> Any:
        usual = {"outside": 0.05, "rms_px": 0.5, "extent_px": 300.0}
        return SimpleNamespace(points=SimpleNamespace(**{**usual, **changed}))

    assert doubtful_sight(sight(), part(0.9)) is None
    assert doubtful_sight(sight(), part(0.2)) == (
        "Only 20 of the 100 frames to fit show a joint: too few points to trust the fit; diagnosis.png "
        "shows which were found."
    )
    assert doubtful_sight(sight(outside=0.6), part(0.9)) == (
        "60% of the tracked points do not lie where the mechanism can have them: names may belong to other "
        "points (--points.map), or the mechanism file is another one; diagnosis.png shows it."
    )
    assert doubtful_sight(sight(rms_px=15.0), part(0.9)) == (
        "The tracked points lie 15.0 px from where the mechanism can have them, 5% of its size in the "
        "picture: names may belong to other points (--points.map), the camera may move without a point of "
        "the scene that shows it, or the mechanism file is another one; diagnosis.png shows it."
    )
    assert unshown(part(0.95)) == []
    assert unshown(part(0.5)) == [
        "The points do not show every joint in every frame (shown: joint1 50%): points are missing or lie "
        "on no mark there; diagnosis.png shows which."
    ]


def test_pictures_of_masks_show_all_bodies_in_one(tmp_path: Path) -> None:
    masks = np.zeros((3, 2, 24, 32), np.uint8)
    masks[:, 0, 4:8, 6:10], masks[:, 1, 12:16, 20:24] = 255, 255
    np.savez(tmp_path / "masks.npz", masks=masks)
    settings = replace(RunSettings(), masks=tmp_path / "masks.npz", rate=30.0)
    given, video, _ = masks_and_mechanism(None, "double", settings)
    assert given.planes == 2
    shown = [frame.luma > 100 for frame in video.frames()]
    assert np.array_equal(shown, masks.max(axis=1) > 0)
