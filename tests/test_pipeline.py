"""The composition from the inside: what is recorded, and one way from a fit to its files."""

from __future__ import annotations

import errno
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import monodyn
import tracked
from fits import identified, made_fit
from monodyn import job, pipeline
from monodyn.checks import FILMING, UNCOMPARED
from monodyn.doubtful import doubtful_sight
from monodyn.errors import FitError, SettingsError, VideoError
from monodyn.estimation.fit import Doubt, Fit
from monodyn.estimation.record.tables import read_poses, write_poses
from monodyn.live.run import follow
from monodyn.mechanism import load
from monodyn.pipeline import Job, identify_tables, run, track_clip
from monodyn.results.log import RunLog
from monodyn.settings import RunSettings, settings_classes
from monodyn.stages import segment
from monodyn.types import Camera, Poses
from monodyn.vision.clip.video import read
from monodyn.vision.locating.scene import Scene
from monodyn.vision.release import FreeSpan
from monodyn.vision.settings import CameraSettings
from support import ClipMaker, command, refuses
from swings import TIMES, motion, record


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a table of the motion of the bundled single pendulum."""
    mechanism = load("single")
    path = tmp_path_factory.mktemp("table") / "swing.csv"
    write_poses(record(mechanism, TIMES, motion(mechanism, TIMES, [0.5], [0.0])), path)
    return path


WHOLE = FreeSpan(0, 12, ())


def seen(
    monkeypatch: pytest.MonkeyPatch, make_clip: ClipMaker, *, last: int = 12, fit: Any = None,
    span: FreeSpan = WHOLE,
) -> Path:  # fmt: skip
    """Stand in for the stages: a clip of 12 frames that is tracked up to ``last``, and its fit."""
    clip = make_clip()
    masks = segment(read(clip))
    video = masks.video
    position = np.where(np.arange(12)[:, None] < last, -1.0, np.nan)
    poses = Poses(
        ("joint1",), np.arange(12), video.times, position, np.zeros((12, 1, 1)), np.arange(12) < last
    )
    pose = np.array([[-1.0]])
    scene = Scene(
        load("single"), Camera(64, 48, 100.0), masks, 0, pose[0], (0,), pose,
        {"camera.depth": 0.1, "camera.roll": 0.2}, 0.0, ("The camera is a guess.",),
    )  # fmt: skip
    tracked = poses, span
    for stage, found in (
        ("segment", masks), ("locate", scene), ("track_freely", tracked), ("identify", fit)
    ):  # fmt: skip
        monkeypatch.setattr(pipeline, stage, lambda *args, found=found, **kwargs: found)
    # the poses are made up, and no outline of them lies on the clip's square
    # the poses are not those of the fit
    monkeypatch.setattr(pipeline, "redrawn", lambda fit, *_: fit)
    monkeypatch.setattr(pipeline, "doubtful_sight", lambda *args, **kwargs: None)
    monkeypatch.setattr(pipeline, "heldout_doubts", lambda *args: [])
    return clip


def test_a_fit_in_a_wrong_place_is_refused(
    monkeypatch: pytest.MonkeyPatch, make_clip: ClipMaker, tmp_path: Path
) -> None:
    fit = identified()
    clip = seen(
        monkeypatch, make_clip, fit=made_fit(time=(fit.time[0][:9],), residual=(fit.residual[0][:9],))
    )
    assert run(clip, "single", tmp_path / "run").document["ok"]
    monkeypatch.setattr(pipeline, "doubtful_sight", doubtful_sight)
    document = run(clip, "single", tmp_path / "run", force=True).document
    assert not document["ok"]
    assert document["status"].startswith("The mechanism as it was located differs from what stands out")
    # the advice of the fit is about a model in the right place
    assert document["advice"] == ["The camera is a guess.", UNCOMPARED, FILMING]
    page = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert "What was seen of the clip" in page


def test_a_run_records_every_setting_of_every_stage(table: Path, tmp_path: Path) -> None:
    identify_tables([table], "single", tmp_path / "fit")
    settings = json.loads((tmp_path / "fit" / "run.json").read_text())["settings"]
    for stage, kind in settings_classes().items():
        assert set(settings[stage]) == set(kind.__dataclass_fields__)


@pytest.mark.slow
def test_a_report_in_python_is_the_report_of_a_run(table: Path, tmp_path: Path) -> None:
    outcome = identify_tables([table], "single", tmp_path / "run")
    assert outcome.fit is not None
    monodyn.report(outcome.fit, to=tmp_path / "report", poses=outcome.poses)
    for name in ("fit.json", "states.csv", "prediction.csv", "model.xml", "model.urdf"):
        assert (tmp_path / "report" / name).read_bytes() == (tmp_path / "run" / name).read_bytes()


@pytest.mark.slow
def test_without_a_folder_nothing_is_written(table: Path) -> None:
    outcome = identify_tables([table, table], "single")
    assert (outcome.folder, len(outcome.traces), outcome.document["ok"]) == (None, 2, True)
    assert [trace.name for trace in outcome.traces] == ["swing.csv", "swing.csv"]


@pytest.mark.slow
def test_positions_that_the_dynamics_exclude_are_named_of_every_record(table: Path, tmp_path: Path) -> None:
    record = read_poses(table, load("single"))
    position = record.position.copy()
    position[[20, 21]] += 0.5
    other = tmp_path / "other.csv"
    write_poses(replace(record, position=position), other)
    notes = identify_tables([table, other], "single", tmp_path / "fit").document["advice"]
    assert [note for note in notes if "exclude" in note] == [
        "The identified dynamics exclude the position of joint1 in frame 20 and 21 of other.csv: the "
        "measurement was wrong there."
    ]


def test_notes_of_a_clip_and_of_its_masks_are_said_once(
    monkeypatch: pytest.MonkeyPatch, make_clip: ClipMaker
) -> None:
    video = read(seen(monkeypatch, make_clip))
    masks = pipeline.segment(video)
    video.remarks.extend(["Stamps were restored.", "A frame is missing."])
    masks.video.remarks[:] = ["A frame is missing.", "A mask is missing."]
    monkeypatch.setattr(pipeline, "given_masks", lambda *given: masks)
    opened: Any = object()
    job = Job(RunSettings(), RunLog("track", {}, RunSettings()), None, None, masks=opened)
    pipeline.locate_and_track(job, video, load("single"))
    said = [note for note in job.log.notes if note in {*video.notes, *masks.video.notes}]
    assert said == ["Stamps were restored.", "A frame is missing.", "A mask is missing."]


def test_an_exposure_is_compared_with_the_pictures_that_are_new(
    monkeypatch: pytest.MonkeyPatch, make_clip: ClipMaker
) -> None:
    """All pictures are new: one cannot be exposed for longer than it is to the next."""
    video = read(seen(monkeypatch, make_clip))
    settings = RunSettings(camera=CameraSettings(exposure=0.04))
    job = Job(settings, RunLog("track", {}, settings), None, None)
    with pytest.raises(SettingsError, match=r"camera\.exposure: expected at most 0\.03333 s"):
        pipeline.locate_and_track(job, video, load("single"))


def test_a_tracked_clip_has_its_notes(
    monkeypatch: pytest.MonkeyPatch, make_clip: ClipMaker, tmp_path: Path
) -> None:
    clip = seen(monkeypatch, make_clip, last=9)
    outcome = track_clip(clip, "single", tmp_path / "run")
    assert outcome.notes[0] == "The camera is a guess."
    assert outcome.notes[-1].startswith("Only 9 of 12 frames were tracked; ")
    assert outcome.document["files"] == ["poses.csv", "overlay.mp4", "diagnosis.png", "run.toml", "run.json"]
    assert list(outcome.seconds) == ["segment", "locate", "track", "results"]
    assert read(tmp_path / "run" / "overlay.mp4").count == 12


@pytest.mark.slow
def test_the_way_of_the_camera_that_points_show_is_written(tmp_path: Path) -> None:
    mechanism, names = load("double"), ("joint1", "joint2", "link2")
    px = tracked.seen(mechanism, tracked.swing(mechanism, 60, (0.5, 0.6)), names)
    way = 20.0 * np.sin(np.arange(60) / 20.0)
    draw = np.random.default_rng(0)
    px = px + way[:, None, None] * [1.0, 0.0] + 0.2 * draw.normal(size=px.shape)
    points = tracked.plain_csv(tmp_path / "points.csv", names, px)
    settings = RunSettings(points=points, rate=30.0, points_size=(1280, 720))
    outcome = track_clip(None, "double", tmp_path / "run", settings)
    assert [note for note in outcome.notes if note.startswith("The camera moves: points that stand still ")]
    assert "camera.csv" in outcome.document["files"]
    file = np.genfromtxt(tmp_path / "run" / "camera.csv", delimiter=",", names=True)
    assert file["registered"].tolist() == [1.0] * 60
    np.testing.assert_allclose(file["x_px"] - file["x_px"].mean(), way - way.mean(), atol=1.0)
    np.testing.assert_allclose(file["y_px"], 0.0, atol=1.0)
    np.testing.assert_array_equal(file["zoom"], 1.0)


def test_a_clip_without_the_mechanism_keeps_its_poses(
    monkeypatch: pytest.MonkeyPatch, make_clip: ClipMaker, tmp_path: Path
) -> None:
    clip = seen(monkeypatch, make_clip, last=0)
    with pytest.raises(FitError, match=r"tracked it in none; The camera is a guess\. .*Only 0 of 12"):
        track_clip(clip, "single", tmp_path / "run")
    assert json.loads((tmp_path / "run" / "run.json").read_text())["status"] == "done"
    with pytest.raises(FitError, match="in frames 0 to 8"):
        run(clip, "single", tmp_path / "run", force=True)
    left = json.loads((tmp_path / "run" / "unfinished" / "run.json").read_text())
    assert left["status"] == "failed"
    assert left["files"] == ["poses.csv", "overlay.mp4", "diagnosis.png", "run.toml"]


def test_a_still_clip_leaves_its_pictures(make_clip: ClipMaker, tmp_path: Path) -> None:
    clip = make_clip(places=[5] * 12)
    with pytest.raises(VideoError, match="got next to nothing that differs"):
        run(clip, "single", tmp_path / "run")
    left = json.loads((tmp_path / "run" / "run.json").read_text())
    assert (left["status"], left["files"]) == ("failed", ["overlay.mp4", "diagnosis.png", "run.toml"])
    assert read(tmp_path / "run" / "overlay.mp4").count == 12


def test_pictures_that_cannot_be_written_do_not_hide_the_reason(
    monkeypatch: pytest.MonkeyPatch, make_clip: ClipMaker, tmp_path: Path
) -> None:
    def full(*args: object) -> None:
        raise SettingsError("disk full")

    monkeypatch.setattr(job, "write_diagnosis", full)
    with pytest.raises(VideoError, match="got next to nothing that differs"):
        run(make_clip(places=[5] * 12), "single", tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_fit_that_found_nothing_writes_headers_and_a_film_of_what_was_tracked(
    monkeypatch: pytest.MonkeyPatch, make_clip: ClipMaker, tmp_path: Path
) -> None:
    refused = made_fit(starts=()).doubted([Doubt("refused", "Too few frames.")])
    clip = seen(monkeypatch, make_clip, fit=refused)
    outcome = run(clip, "single", tmp_path / "run", RunSettings(fit_frames=(2, 8)))
    assert outcome.document["fit_frames"] == [2, 8]
    assert outcome.document["camera"]["std"] == {"camera.depth": 0.1 * refused.scale, "camera.roll": 0.2}
    assert (outcome.folder, list(outcome.traces)) == (tmp_path / "run", [])
    assert (
        tmp_path / "run" / "states.csv"
    ).read_text() == "frame,time,joint1,joint1_vel,joint1_std,joint1_vel_std\n"
    assert read(tmp_path / "run" / "overlay.mp4").count == 12
    page = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert "12 frames of 64 × 48 px over 0.37 s, with the model single." in page


@pytest.mark.slow
def test_the_fit_begins_where_the_mechanism_moves_freely(
    monkeypatch: pytest.MonkeyPatch, make_clip: ClipMaker, tmp_path: Path
) -> None:
    refused = made_fit(starts=()).doubted([Doubt("refused", "Too few frames.")])
    span = FreeSpan(3, 11, ("It is held until frame 3.",))
    clip = seen(monkeypatch, make_clip, fit=refused, span=span)
    outcome = run(clip, "single", tmp_path / "run", RunSettings(fit_frames=(0, 8)))
    assert outcome.document["fit_frames"] == [3, 8]
    assert "It is held until frame 3." in outcome.notes
    log = json.loads((tmp_path / "run" / "run.json").read_text())
    assert log["free_frames"] == [3, 11]
    # a square of 10 px moves along the upper left corner; the margin is 16 px
    assert log["region"] == [0, 0, 40, 32]
    # without a range of the user's all but the last quarter of the free stretch
    outcome = run(clip, "single", tmp_path / "run", force=True)
    assert outcome.document["fit_frames"] == [3, 9]
    with refuses(
        FitError,
        "fit-frames: expected frames in which the mechanism moves freely, 3:11, got 0:4; give a range there, "
        "or --time-range A:B [s] where it moves freely.",
    ):
        run(clip, "single", tmp_path / "run", RunSettings(fit_frames=(0, 4)), force=True)


def test_a_clip_that_is_fitted_in_whole_keeps_frames_back(
    monkeypatch: pytest.MonkeyPatch, make_clip: ClipMaker, tmp_path: Path
) -> None:
    fit = identified()
    clip = seen(
        monkeypatch, make_clip, fit=made_fit(time=(fit.time[0][:12],), residual=(fit.residual[0][:12],))
    )
    given = []

    def judged(fit: Fit, records: list[Poses], *args: object) -> list[Doubt]:
        given.append([len(record) for record in records])
        return [Doubt("approximate", "It does not go on.")]

    monkeypatch.setattr(pipeline, "kept_doubts", judged)
    outcome = run(clip, "single", tmp_path / "run", RunSettings(fit_frames=(0, None)))
    assert outcome.document["status"] == "Approximate. It does not go on."
    assert given == [[12]]
    # what is refused for what was seen is not judged again
    monkeypatch.setattr(pipeline, "doubtful_sight", lambda *args, **kwargs: "No.")
    assert not run(clip, "single", tmp_path / "run", force=True).document["ok"]
    assert len(given) == 1


def test_free_torques_leave_the_distance_of_the_camera_open(
    monkeypatch: pytest.MonkeyPatch, make_clip: ClipMaker, tmp_path: Path
) -> None:
    clip = seen(monkeypatch, make_clip, fit=made_fit(starts=(), torque="free"))
    run(clip, "single", tmp_path / "run")
    document = json.loads((tmp_path / "run" / "fit.json").read_text())
    assert document["camera"]["std"] == {"camera.depth": None, "camera.roll": 0.2}


def test_a_run_of_a_clip_never_replaces_its_model(make_clip: ClipMaker, tmp_path: Path) -> None:
    clip, folder = make_clip(), tmp_path / "run"
    monodyn.report(identified(), to=folder)
    said = (
        f"out '{folder}': expected another folder than that of the inputs, got the one of "
        f"'{folder / 'fit.json'}', which the run would replace; give another with --out."
    )
    for made in (run, track_clip, follow):
        with refuses(SettingsError, said):
            made(clip, folder, folder, force=True)


def test_what_can_be_refused_is_refused_before_a_frame_is_read(
    monkeypatch: pytest.MonkeyPatch, make_clip: ClipMaker, tmp_path: Path
) -> None:
    clip = seen(monkeypatch, make_clip)

    def never(*args: object, **kwargs: object) -> None:
        raise AssertionError("a frame was read")

    monkeypatch.setattr(pipeline, "segment", never)
    said = (
        "parameter 'camera.yaw': expected less than a quarter turn, got 2 rad; the camera looks at the "
        "plane, give the angle in radians."
    )
    with refuses(SettingsError, said):
        run(clip, "single", tmp_path / "run", RunSettings(fix={"camera.yaw": 2.0}))
    assert not (tmp_path / "run").exists()


def test_a_prediction_has_the_frame_numbers_of_the_clip_and_goes_on(
    monkeypatch: pytest.MonkeyPatch, make_clip: ClipMaker, tmp_path: Path
) -> None:
    fit = identified()
    part = made_fit(time=(fit.time[0][:9],), residual=(fit.residual[0][:9],))
    clip = seen(monkeypatch, make_clip, fit=part)
    outcome = run(clip, "single", tmp_path / "run", RunSettings(until=0.5))
    (trace,) = outcome.traces
    assert trace.future_frame is not None
    assert trace.future_frame.tolist() == list(range(9, 16))
    assert trace.rows == (0, 9)
    assert list(outcome.seconds) == ["segment", "locate", "track", "identify", "predict", "results"]


def test_ctrl_c_keeps_what_was_finished(
    monkeypatch: pytest.MonkeyPatch, make_clip: ClipMaker, tmp_path: Path
) -> None:
    clip, out = seen(monkeypatch, make_clip), tmp_path / "run"

    def interrupt(*args: object, **kwargs: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(pipeline, "identify", interrupt)
    done = command("run", clip, "--model", "single", "--out", out, "--quiet")
    assert done.code == 130
    assert done.err == f"monodyn: interrupted; what was finished is in '{out}', which --force replaces.\n"
    assert sorted(path.name for path in out.iterdir()) == ["poses.csv", "run.json", "run.toml"]
    log = json.loads((out / "run.json").read_text())
    assert (log["status"], log["files"]) == ("interrupted", ["poses.csv", "run.toml"])


def test_a_full_disk_is_one_line_and_leaves_no_half_file(
    monkeypatch: pytest.MonkeyPatch, make_clip: ClipMaker, tmp_path: Path
) -> None:
    clip, out = seen(monkeypatch, make_clip), tmp_path / "new" / "run"

    def full(poses: object, path: Path, **_: object) -> None:
        path.write_text("half a f")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(job, "write_poses", full)
    done = command("run", clip, "--model", "single", "--out", out, "--quiet")
    assert (done.code, done.err) == (
        2,
        f"monodyn: out '{out}': cannot write poses.csv (No space left on device); "
        "free some space or give another folder with --out.\n",
    )
    assert not (tmp_path / "new").exists()
