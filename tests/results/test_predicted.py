"""A run folder, and what its mechanism does from another start: numbers, files, pictures."""

from __future__ import annotations

import csv
import json
import re
import shutil
from html import unescape

import av
import numpy as np
import pytest

import monodyn
from fits import identified, record
from monodyn.choices import Tolerance
from monodyn.errors import SettingsError
from monodyn.estimation.fit import Doubt
from monodyn.estimation.settings import IdentifySettings
from monodyn.mechanism.simulate import simulate
from monodyn.results import predicted as predicted_module
from monodyn.results.horizon import horizon_said
from monodyn.results.lock import FolderLock
from monodyn.results.predicted import Wanted, predict_run
from monodyn.types import Poses
from support import refuses


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("predicted") / "run"
    monodyn.report(identified(), to=folder, poses=record(identified()))
    return folder


def test_the_motion_is_that_of_the_mechanism_and_stands_in_all_files(run, tmp_path):
    out = tmp_path / "ahead"
    found = predict_run(run, out, Wanted({"joint1": 1.0}, {"joint1": 0.5}, until=1.0))
    assert found.folder == out
    back = simulate(identified().mechanism, found.states.time, np.array([1.0]), np.array([0.5]))
    np.testing.assert_allclose(found.states.position, back.position, atol=1e-5)
    with (out / "prediction.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header == ["frame", "time", "joint1", "joint1_vel", "joint1_std", "joint1_vel_std"]
    table = np.array(rows, dtype=float)
    np.testing.assert_array_equal(table[:, 2], found.states.position[:, 0])
    document = json.loads((out / "prediction.json").read_text())
    assert document["position"]["joint1"] == found.states.position[:, 0].tolist()
    page = (out / "prediction.html").read_text()
    assert "<h1>single from 0 s on</h1>" in page
    assert unescape(page).count("Motion of the mechanism that was identified in 'run'.") == 1
    back = re.search(r'<a href="([^"]*)">The report of the run', page)[1]
    assert (out / back).resolve() == (run / "report.html").resolve()
    for name, said in (
        ("start", "0 s, as given; joint1 57.3 deg, 28.65 deg/s"),
        ("until", "1 s, a row every 0.03333 s"),
        ("tolerance", "5 deg"),
    ):
        assert f"<dt>{name}</dt><dd>{said}</dd>" in page
    assert horizon_said(found.fit, found.horizon, Tolerance(), since="the start") in page
    assert 'Files in this folder: <a href="prediction.csv"><code>prediction.csv</code></a>, <a' in page
    assert "prediction.mp4" not in page
    # its figures hold what the table does
    (plot,) = json.loads(re.search(r"const PLOTS = (.*);", page)[1])
    np.testing.assert_allclose(plot["predicted"]["value"], np.degrees(table[:, 2]), rtol=1e-5, atol=1e-9)
    half = 1.96 * np.degrees(table[:, 4])
    np.testing.assert_allclose(
        np.subtract(plot["predicted"]["upper"], plot["predicted"]["lower"]), 2.0 * half, rtol=1e-2, atol=1e-3
    )
    assert not (out / "prediction.mp4").exists()


def test_the_page_says_what_was_changed_and_where_it_begins(run, tmp_path):
    predict_run(run, tmp_path / "a", Wanted(at=0.3, until=1.0, fix={"gravity": 1.62}))
    page = (tmp_path / "a" / "prediction.html").read_text()
    assert "<dt>start</dt><dd>0.3 s, as record 0 has it there; joint1 " in page
    assert "<dt>other values</dt><dd>gravity 1.62 m/s^2</dd>" in page


def test_a_run_without_a_report_and_an_approximate_one_have_a_page(run, tmp_path):
    fit = identified().doubted([Doubt("approximate", "It is rough.")])
    lone = tmp_path / "lone run"
    monodyn.report(fit, to=lone)
    predict_run(lone, tmp_path / "a", Wanted(until=1.5))
    page = (tmp_path / "a" / "prediction.html").read_text()
    assert '<a href="../lone%20run/report.html">' in page
    assert "<li>Approximate. It is rough.</li>" in page
    assert 'class="status approximate"' in page
    (lone / "report.html").unlink()
    predict_run(lone, tmp_path / "b", Wanted(until=1.5))
    assert "report.html" not in (tmp_path / "b" / "prediction.html").read_text()


@pytest.mark.slow
def test_a_length_that_moves_the_next_hinge_alone_is_told(tmp_path):
    """A written model has masses in place of densities: another length leaves them where they are."""
    mechanism = monodyn.load("double")
    times, rng = np.arange(60) / 30.0, np.random.default_rng(0)
    position = simulate(mechanism, times, np.array([-1.0, 0.3]), np.zeros(2)).position
    covariance, seen = np.tile(1e-6 * np.eye(2), (60, 1, 1)), np.ones(60, dtype=bool)
    poses = Poses(
        ("joint1", "joint2"),
        np.arange(60),
        times,
        position + 1e-3 * rng.normal(size=(60, 2)),
        covariance,
        seen,
    )
    fit = monodyn.identify(poses, mechanism, IdentifySettings(torque="friction"))
    monodyn.report(fit, to=tmp_path / "run", poses=poses)
    said = (
        "link1.length moves what hangs on link1 and nothing else: its mass, centre of mass and inertia stay "
        "as identified; where they differ, too, give link1.mass, link1.com_x and link1.inertia with it."
    )
    assert predict_run(tmp_path / "run", None, Wanted(fix={"link1.length": 0.3})).notes[0] == said
    before, after = (
        predict_run(tmp_path / "run", None, Wanted(fix=fix)).fit.mechanism.tree.links
        for fix in ({}, {"link1.length": 0.3})
    )
    # the frame of the second link alone is elsewhere
    np.testing.assert_array_equal(after[0], before[0])
    # one that moves nothing has a mass in its place
    with refuses(
        SettingsError,
        "fix: expected parameters on which the motion depends, got link2.length; in place of the "
        "sizes of link2 give its .mass, .com_x or .inertia, or identify again with --fix link2.length=0.3.",
    ):
        predict_run(tmp_path / "run", None, Wanted(fix={"link2.length": 0.3}))
    alone = (
        "Known only in ratios, and changed alone: link1.mass. The other masses, inertias and frictions stay "
        "as in the run, so that the motion is another one; a measured value belongs to the run (monodyn run "
        "--fix link1.mass=0.3), where the others follow it."
    )
    assert predict_run(tmp_path / "run", None, Wanted(fix={"link1.mass": 0.3})).notes == (alone,)
    # without any friction, or with the mass that it has, nothing is out of proportion
    same = predict_run(tmp_path / "run").fit.mechanism.values["link1.mass"]
    for fix in ({"joint1.damping": 0.0}, {"link1.mass": same}):
        assert predict_run(tmp_path / "run", None, Wanted(fix=fix)).notes == ()


def test_it_is_as_long_as_the_record_and_begins_where_that_ends(run):
    states, fit = predict_run(run).states, identified()
    assert states.time[0] == pytest.approx(fit.time[0][-1])
    assert states.time[-1] - states.time[0] == pytest.approx(fit.time[0][-1] - fit.time[0][0])


def test_a_start_outside_of_the_record_is_told(run):
    after, before = (predict_run(run, wanted=Wanted(at=at, until=2.0)).notes for at in (1.6, -0.5))
    assert after[0].startswith(
        "It starts 0.967 s after the fitted frames, in a state that is predicted itself."
    )
    assert before[0] == "It starts 0.5 s before the fitted frames, in a state that is predicted itself."
    assert predict_run(run, wanted=Wanted({"joint1": 0.0}, at=1.6, until=2.0)).notes == ()


def test_what_cannot_be_predicted_or_drawn_is_refused(run, tmp_path):
    with refuses(SettingsError, "until: expected a time after the start at 0 s, got -1 s."):
        predict_run(run, wanted=Wanted({"joint1": 0.0}, until=-1.0))
    with refuses(
        SettingsError, "until: expected at most 1000000 rows of 0.0333333 s, got 30000001; end it earlier."
    ):
        predict_run(run, wanted=Wanted({"joint1": 0.0}, until=1e6))
    with refuses(
        SettingsError,
        f"out '{run}': expected another folder than that of the run, whose prediction.csv it would replace; "
        "give another with --out.",
    ):
        predict_run(run, run, force=True)
    with refuses(SettingsError, "clip: expected --film with it, got none; add it, or leave the clip out."):
        predict_run(run, clip=tmp_path)
    step = float(np.median(np.diff(identified().time[0])))
    with refuses(
        SettingsError,
        f"predict: expected a motion that can be followed to {30 * step:g} s, lost it at {step:g} s: rates "
        f"or frictions are too large for frames of {step:g} s; give others, or an earlier end.",
    ):
        predict_run(run, wanted=Wanted({"joint1": 0.5}, fix={"joint1.damping": 1e6}, until=1.0))
    with refuses(
        SettingsError,
        f"'{run}': expected the run of a clip, got one of tables, which has no camera; leave --film out.",
    ):
        predict_run(run, tmp_path / "ahead", film=True)


def test_a_folder_that_is_in_use_or_taken_is_refused_before_the_work(run, tmp_path, monkeypatch):
    def worked(*_) -> None:
        raise AssertionError("began to work")

    predict_run(run, tmp_path / "taken", Wanted({"joint1": 0.3}, until=0.5))
    with monkeypatch.context() as patch:
        for name in ("open_run", "restart", "_followed"):
            patch.setattr(predicted_module, name, worked)
        with pytest.raises(SettingsError, match=r"it holds prediction.csv; give another folder, or --force"):
            predict_run(run, tmp_path / "taken")
        lock = FolderLock(tmp_path / "held")
        with pytest.raises(SettingsError, match="got one in use by process"):
            predict_run(run, tmp_path / "held", force=True)
        lock.release()
    # what is refused later leaves no folder
    with pytest.raises(SettingsError, match="until: expected"):
        predict_run(run, tmp_path / "new", Wanted({"joint1": 0.0}, until=-1.0))
    assert not (tmp_path / "new").exists()


def test_a_film_that_is_interrupted_leaves_the_folder_as_it_was(run, tmp_path, monkeypatch):
    def stopped(*_) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(predicted_module, "_clip", lambda *_: tmp_path)
    monkeypatch.setattr(predicted_module, "_background", lambda *_: object())
    monkeypatch.setattr(predicted_module, "_film", stopped)
    with pytest.raises(KeyboardInterrupt):
        predict_run(run, tmp_path / "none", film=True)
    assert not (tmp_path / "none").exists()
    before = predict_run(run, tmp_path / "old", Wanted({"joint1": 0.3})).folder
    text = (before / "prediction.csv").read_text()
    with pytest.raises(KeyboardInterrupt):
        predict_run(run, tmp_path / "old", Wanted({"joint1": 0.5}), film=True, force=True)
    assert (before / "prediction.csv").read_text() == text
    assert sorted(path.name for path in before.iterdir()) == [
        "prediction.csv", "prediction.html", "prediction.json", "run.toml",
    ]  # fmt: skip


@pytest.mark.slow
def test_a_film_shows_the_motion_over_the_first_frame(filmed, make_clip, tmp_path):
    scene, poses = filmed
    run, out, clip = tmp_path / "run", tmp_path / "ahead", scene.video.path
    monodyn.report(monodyn.identify(poses, scene.mechanism), to=run, poses=poses, scene=scene)
    joints = {joint.name: 0.5 for joint in monodyn.open_run(run).mechanism.joints}
    predict_run(run, out, Wanted(joints, until=0.5), film=True, clip=clip)
    with av.open(str(out / "prediction.mp4")) as film:
        pictures = [frame.to_ndarray(format="gray").astype(int) for frame in film.decode(video=0)]
    first = next(monodyn.read(clip).frames(0, 1)).luma.astype(int)
    changed = [np.abs(picture - first) > 40 for picture in pictures]
    # something is drawn, elsewhere from frame to frame, and most of the picture stays as it is
    assert 20 < changed[0].sum() < 0.1 * first.size
    assert np.any(changed[0] != changed[-1])
    # the folder knows where its clip is
    found = predict_run(run, tmp_path / "found", Wanted(joints, until=0.5), film=True)
    (refused,) = found.notes
    assert (tmp_path / "found" / "prediction.mp4").read_bytes() == (out / "prediction.mp4").read_bytes()
    copy = tmp_path / "copy"
    shutil.copytree(clip, copy)
    assert predict_run(run, tmp_path / "copied", Wanted(joints, until=0.5), film=True, clip=copy).notes == (
        refused,
    )
    (copy / "more.txt").write_text("Another one.")
    said = (
        f"The film is drawn over '{copy}', which is not the file that the run was made of: unless it is a "
        "copy of the same clip, camera and scene are others, and the mechanism is drawn in the wrong place."
    )
    assert predict_run(run, tmp_path / "other", Wanted(joints, until=0.5), film=True, clip=copy).notes == (
        refused,
        said,
    )
    assert json.loads((tmp_path / "other" / "prediction.json").read_text())["notes"] == [refused, said]
    shutil.rmtree(tmp_path / "other")
    (run / "run.json").unlink()
    for named, got in ((None, "none"), (tmp_path / "x", f"no file {tmp_path / 'x'}")):
        with refuses(SettingsError, f"film: expected the clip of the run, got {got}; name it with --clip."):
            predict_run(run, tmp_path / "other", film=True, clip=named)
    small = make_clip()
    with refuses(
        SettingsError,
        f"film: expected a clip of {scene.camera.width}x{scene.camera.height} pixels, got 64x48; name "
        "that of the run with --clip.",
    ):
        predict_run(run, tmp_path / "other", film=True, clip=small)
    assert not (tmp_path / "other").exists()
