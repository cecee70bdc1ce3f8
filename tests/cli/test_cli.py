"""The commands from the outside: the run folder, exit codes, and one line for bad input."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from monodyn import cli
from monodyn.estimation.settings import IdentifySettings
from monodyn.results.folder import DRAWN, FILES
from monodyn.vision.locating.locate import STEPS
from support import DEMO, ClipMaker, Done, command

CLIP, MODEL = DEMO / "double.mp4", DEMO / "double.xml"


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Done:
    """Run the main job once on the demo clip, with its result as JSON.

    Every process that has a test with this fixture runs it: all of them are in this file.
    """
    out = tmp_path_factory.mktemp("demo") / "run"
    return command("run", CLIP, "--model", MODEL, "--out", out, "--fit-frames", "0:150", "--json", folder=out)


def table(path: Path) -> dict[str, np.ndarray]:
    rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    return {name: np.array([float(row[i]) for row in rows[1:]]) for i, name in enumerate(rows[0])}


def first_rows(demo: Done, folder: Path, count: int) -> Path:
    """Write the first rows of the demo's poses into a folder."""
    rows = (demo.folder / "poses.csv").read_text().splitlines()[: count + 1]
    path = folder / "first.csv"
    path.write_text("\n".join(rows) + "\n")
    return path


def refused(*words: object) -> str:
    """Run a command that must fail as bad input; return its one line."""
    done = command(*words)
    assert done.code == 2
    assert done.out == ""
    assert done.err.count("\n") == 1
    assert done.err.startswith("monodyn: ")
    return done.err.removeprefix("monodyn: ").strip()


# the run folder


def test_run_leaves_the_folder_that_was_promised(demo: Done) -> None:
    assert demo.code == 0
    assert {path.name for path in demo.folder.iterdir()} == set(FILES) - {
        "torques.csv",
        "camera.csv",
        "clip.mp4",
        *DRAWN,
    }
    columns = list(table(demo.folder / "poses.csv"))
    assert columns[:11] == [
        "frame", "time", "seen", "joint1", "joint2", "joint1_std", "joint2_std", "joint1_seen", "joint2_seen",
        "joint1_excluded", "joint2_excluded",
    ]  # fmt: skip
    # how many errors the positions share depends on the clip; sizes and the camera's place are among them
    shared, joints = columns[11:], ("joint1", "joint2")
    assert len(shared) >= 4
    assert shared == [f"{joint}_shared{k + 1}" for k in range(len(shared) // 2) for joint in joints]
    assert list(table(demo.folder / "states.csv")) == [
        "frame", "time", "joint1", "joint2", "joint1_vel", "joint2_vel", "joint1_std", "joint2_std",
        "joint1_vel_std", "joint2_vel_std",
    ]  # fmt: skip
    assert list(table(demo.folder / "prediction.csv")) == [
        "frame", "time", "joint1", "joint2", "joint1_std", "joint2_std",
    ]  # fmt: skip
    assert len(table(demo.folder / "poses.csv")["frame"]) == 210
    assert table(demo.folder / "prediction.csv")["frame"].tolist() == list(range(150, 210))


def test_run_finds_the_demo_mechanism(demo: Done) -> None:
    truth = json.loads((DEMO / "double.json").read_text())
    fit = json.loads((demo.folder / "fit.json").read_text())
    found = {row["name"]: row["value"] for row in fit["parameters"]}
    assert fit["ok"] is True
    assert fit["fit_frames"] == [0, 150]
    # 1 % of length and 4 % of width are what a clip of this kind must give
    assert found["link1.length"] == pytest.approx(truth["length"][0], rel=0.01)
    assert found["link2.length"] == pytest.approx(truth["length"][1] + truth["overhang"][1], rel=0.01)
    assert found["link1.width"] == pytest.approx(truth["width"][0], rel=0.04)
    q = np.array(truth["q"])
    poses, future = table(demo.folder / "poses.csv"), table(demo.folder / "prediction.csv")
    for dof, joint in enumerate(("joint1", "joint2")):
        # 0.15 deg rms of tracking and 0.75 deg rms of prediction, likewise
        assert np.degrees(np.sqrt(np.mean((poses[joint] - q[:, dof]) ** 2))) < 0.15
        assert np.degrees(np.sqrt(np.mean((future[joint] - q[150:, dof]) ** 2))) < 0.75
        error = poses[joint][150:] - future[joint]
        assert fit["heldout_rms"][0][joint] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-9)


def test_identified_model_moves_like_the_prediction(demo: Done) -> None:
    fit = json.loads((demo.folder / "fit.json").read_text())
    states = table(demo.folder / "states.csv")
    model = mujoco.MjModel.from_xml_path(str(demo.folder / "model.xml"))
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, 1.0 / 30.0 / 50.0
    data = mujoco.MjData(model)
    (start,) = fit["initial_state"]
    data.qpos[:], data.qvel[:] = list(start["position"].values()), list(start["velocity"].values())
    mujoco.mj_step(model, data, 50 * 60)
    # the integration errors of both sides over 2 s are far below
    assert np.allclose(data.qpos, [states["joint1"][60], states["joint2"][60]], atol=1e-4)
    assert mujoco.MjModel.from_xml_path(str(demo.folder / "model.urdf")).nq == 2


def test_the_report_shows_pictures_and_camera(demo: Done) -> None:
    text = (demo.folder / "report.html").read_text(encoding="utf-8")
    assert text.count("data:image/jpeg;base64,") == 3
    assert "Camera" in text
    assert "210 of 210" in text


def test_json_is_the_result_and_nothing_else(demo: Done) -> None:
    result = json.loads(demo.out)
    fit = json.loads((demo.folder / "fit.json").read_text())
    assert result.pop("out") == str(demo.folder)
    assert result == fit
    assert "Infinity" not in demo.out
    assert "NaN" not in demo.out


def test_run_json_says_what_was_run(demo: Done) -> None:
    log = json.loads((demo.folder / "run.json").read_text())
    assert log["status"] == "done"
    assert log["files"] == [*log["files"][:-1], "run.json"]
    assert set(log["files"]) == set(FILES) - {"torques.csv", "camera.csv", "clip.mp4", *DRAWN}
    assert len(log["inputs"]["clip"]["sha256"]) == 64
    assert set(log["seconds"]) == {"segment", "locate", "track", "identify", "predict", "results"}
    assert log["settings"]["fit_frames"] == [0, 150]
    assert log["versions"]["monodyn"]


def test_progress_is_plain_lines_where_there_is_no_terminal(demo: Done) -> None:
    # a step that took over ten seconds, as the first one does where all is compiled first, says so
    for step in ("track", "overlay"):
        assert re.search(rf"^{step}: 210 of 210, \d+/s(, \d+ s)?$", demo.err, re.MULTILINE), demo.err


def test_a_run_is_not_overwritten_without_force(demo: Done) -> None:
    before = (demo.folder / "run.json").read_bytes()
    message = refused("run", CLIP, "--model", MODEL, "--out", demo.folder)
    assert message == (
        f"out '{demo.folder}': expected a folder without a run, it holds poses.csv; "
        "give another folder, or --force to replace the run."
    )
    assert (demo.folder / "run.json").read_bytes() == before


REPEATED = {*FILES} - {"run.json", "report.html"}
"""Files of a run that are the same where it is done again; the others say when, and how long it took."""


def same_files(one: Path, other: Path) -> None:
    names = {path.name for path in one.iterdir()}
    assert names == {path.name for path in other.iterdir()}
    for name in names & REPEATED:
        assert (one / name).read_bytes() == (other / name).read_bytes(), name


@pytest.mark.slow
def test_a_run_is_done_again_to_the_last_digit(
    demo: Done, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # from another folder: the file names its clip and its model
    monkeypatch.chdir(tmp_path)
    done = command("run", "--config", demo.folder / "run.toml", "--out", "again", "--quiet")
    assert (done.code, done.err) == (0, "")
    same_files(demo.folder, tmp_path / "again")


@pytest.mark.slow
def test_an_identification_is_done_again_to_the_last_digit(demo: Done, tmp_path: Path) -> None:
    words = "--fix gravity=9.80665 --bounds link1.width=0.01:0.2 --fit-frames 3:50 --tolerance 4deg --seed 7"
    poses = first_rows(demo, tmp_path, 60)
    one = ("--out", tmp_path / "one", "--quiet", "--ensemble", "2")
    done = command("identify", "--free", "joint1.drag", poses, "--model", MODEL, *words.split(), *one)
    again = command(
        "identify", "--config", tmp_path / "one" / "run.toml", "--out", tmp_path / "two", "--quiet"
    )
    assert done.code == again.code
    same_files(tmp_path / "one", tmp_path / "two")


@pytest.mark.slow
def test_identify_takes_the_poses_of_a_run(demo: Done, tmp_path: Path) -> None:
    poses, out = first_rows(demo, tmp_path, 60), tmp_path / "fit"
    done = command("identify", poses, "--model", MODEL, "--out", out, "--quiet")
    assert (done.code, done.out, done.err) == (0, "", "")
    names = {
        "states.csv", "prediction.csv", "fit.json", "model.xml", "model.urdf", "report.html", "run.toml",
        "run.json",
    }  # fmt: skip
    assert {path.name for path in out.iterdir()} == names
    fit = json.loads((out / "fit.json").read_text())
    assert fit["camera"] is None
    assert fit["fit_frames"] == [0, 60]
    printed = command("identify", poses, "--model", MODEL)
    assert printed.code == 0
    assert "link1.length" in printed.out
    assert "N m s/rad" in printed.out


@pytest.mark.slow
def test_bounds_hold_and_are_recorded(demo: Done, tmp_path: Path) -> None:
    poses = first_rows(demo, tmp_path, 60)
    words = ("identify", poses, "--model", MODEL, "--out", tmp_path / "fit", "--quiet")
    # without bounds the length comes out at 0.24 m
    assert command(*words, "--bounds", "link1.length=0.26:0.4").code in (0, 1)
    log = json.loads((tmp_path / "fit" / "run.json").read_text())
    assert log["settings"]["bounds"] == {"link1.length": [0.26, 0.4]}
    found = {
        row["name"]: row for row in json.loads((tmp_path / "fit" / "fit.json").read_text())["parameters"]
    }
    assert 0.26 * (1 - 1e-9) <= found["link1.length"]["value"] <= 0.4


def test_the_seed_that_is_recorded_is_the_one_that_was_used(
    demo: Done, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from monodyn import tabled

    used = []

    def interrupt(records: object, mechanism: object, settings: IdentifySettings, **kwargs: object) -> None:
        used.append(settings.seed)
        raise KeyboardInterrupt

    monkeypatch.setattr(tabled, "identify", interrupt)
    words = ("identify", demo.folder / "poses.csv", "--model", MODEL, "--out", tmp_path, "--quiet")
    assert command(*words, "--seed", "5", "--identify.starts", "2").code == 130
    log = json.loads((tmp_path / "run.json").read_text())
    assert used == [log["seed"]] == [log["settings"]["identify"]["seed"]] == [5]
    assert log["settings"]["identify"]["starts"] == 2


def test_a_fit_that_cannot_be_trusted_exits_1_and_writes_its_files(demo: Done, tmp_path: Path) -> None:
    few = first_rows(demo, tmp_path, 3)
    done = command("identify", few, "--model", MODEL, "--out", tmp_path / "fit", "--quiet")
    assert done.code == 1
    assert done.err.count("\n") == 1
    fit = json.loads((tmp_path / "fit" / "fit.json").read_text())
    assert fit["ok"] is False
    assert fit["status"] in done.err
    assert (tmp_path / "fit" / "states.csv").read_text().startswith("frame,time,joint1,joint2,joint1_vel")
    assert (tmp_path / "fit" / "report.html").exists()


def test_models_lists_the_bundled_ones() -> None:
    done = command("models", "--json")
    names = [row["name"] for row in json.loads(done.out)]
    assert names == ["single", "double", "triple", "bob", "ball", "cartpole", "chain:N"]
    assert "cartpole" in command("models").out


# what stops a run


def test_ctrl_c_before_anything_was_written(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from monodyn import pipeline

    def interrupt(*args: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(pipeline, "opened", interrupt)
    done = command("run", CLIP, "--model", MODEL, "--out", tmp_path / "run", "--quiet")
    assert (done.code, done.err) == (130, "monodyn: interrupted; nothing was written.\n")
    assert not (tmp_path / "run").exists()


def test_ctrl_c_within_compiled_code_is_an_interruption_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from monodyn import pipeline

    def interrupt(*args: object, **kwargs: object) -> None:
        raise SystemError("returned a result with an exception set") from KeyboardInterrupt()

    monkeypatch.setattr(pipeline, "segment", interrupt)
    assert command("run", CLIP, "--model", MODEL, "--out", tmp_path, "--quiet").code == 130
    assert json.loads((tmp_path / "run.json").read_text())["status"] == "interrupted"


def test_ctrl_c_while_replacing_a_run_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from monodyn import pipeline

    def interrupt(*args: object, **kwargs: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(pipeline, "segment", interrupt)
    (tmp_path / "poses.csv").write_text("old")
    (tmp_path / "mine.txt").write_text("mine")
    assert command("run", CLIP, "--model", MODEL, "--out", tmp_path, "--quiet", "--force").code == 130
    assert (tmp_path / "poses.csv").read_text() == "old"
    assert (tmp_path / "mine.txt").read_text() == "mine"
    assert json.loads((tmp_path / "unfinished" / "run.json").read_text())["status"] == "interrupted"


# bad input


def test_no_motion(make_clip: ClipMaker, tmp_path: Path) -> None:
    clip = make_clip("still.mp4", count=40, step=0)
    message = refused("run", clip, "--model", MODEL, "--out", tmp_path / "run", "--quiet")
    assert "moves" in message
    left = {path.name for path in (tmp_path / "run").iterdir()}
    assert left == {"diagnosis.png", "overlay.mp4", "run.toml", "run.json"}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["bogus"],
         "expected a command, got 'bogus'; commands: 'run', 'live', 'track', 'identify', 'predict', "
         "'control', 'demo', 'warm', 'models', 'completion', 'reproduce'."),
        (["identify", "--model", "double"],
         "identify: expected at least one table of joint positions, got none; name a poses.csv."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--bogus"],
         "run: expected known options, got --bogus; see monodyn run --help."),
        (["run", CLIP, "--modle", MODEL, "--out", "o"],
         f"run: expected known options, got --modle, {MODEL}; see monodyn run --help. "
         "Did you mean --model?"),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--fit-frmes", "0:40"],
         "run: expected known options, got --fit-frmes, 0:40; see monodyn run --help. "
         "Did you mean --fit-frames?"),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--fix", "link1.lenght=1"],
         "parameter 'link1.lenght' is not in the mechanism; did you mean 'link1.length' or 'link2.length'?"),
        (["trakc", CLIP], "expected a command, got 'trakc'; did you mean 'track'?"),
        (["--versoin"], "expected a command, got '--versoin'; did you mean '--version'?"),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--fix", "gravity"],
         "fix: expected NAME=VALUE with a number, got 'gravity'; e.g. gravity=9.81."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--fit-frames", "ten"],
         "fit-frames: expected A:B with whole frame numbers, got 'ten'; e.g. 0:120."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--fit-frames", "5:900"],
         "fit-frames: expected a range of at least two frames within 0:210, got 5:900; "
         "the clip has 210 frames."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--until", "1"],
         "until: expected a time after the last fitted frame at 5.233 s, got 1 s."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--background", "nowhere.png"],
         "background 'nowhere.png': expected a picture file, found none; check the path."),
        (["run", "nowhere.mp4", "--model", MODEL, "--out", "o"],
         "clip 'nowhere.mp4': expected a video file or a folder of pictures, found nothing; check the path."),
        (["run", CLIP, "--model", MODEL, "--out", MODEL],
         f"out '{MODEL}': expected a folder, got a file; give another name."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--fix", "camera.focl=1"],
         "parameter 'camera.focl': expected one of the camera's; did you mean 'camera.focal'?"),
        (["track", CLIP, "--model", MODEL, "--out", "o", "--fix", "camera.depth=-1"],
         "parameter 'camera.depth': expected a value above 0 m, got -1; correct it."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--fix", "camera.focal=nan"],
         "parameter 'camera.focal': expected a finite number, got nan; give it in px."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--fix", "camera.pitch=90"],
         "parameter 'camera.pitch': expected less than a quarter turn, got 90 rad; "
         "the camera looks at the plane, give the angle in radians."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--fix", "camera.roll=0.1", "--free", "camera.roll"],
         "parameter 'camera.roll': is both fixed and freed; choose one of them."),
        (["identify", "nowhere.csv", "--model", MODEL, "--out", "o", "--fix", "camera.bogus=3"],
         "parameter 'camera.bogus': expected one of the mechanism's; tables of joint positions have no "
         "camera, leave it out."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--identify.starts", "0"],
         "identify.starts: expected 1 to 1000, got 0."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--track.reach", "inf"],
         "track.reach: expected 1 to 200, got inf."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--bounds", "link1.length=3"],
         "bounds: expected NAME=LOW:HIGH with two numbers, got 'link1.length=3'; "
         "e.g. link1.length=0.1:0.3."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--bounds", "link1.length=3:1"],
         "bounds of 'link1.length': expected the lower bound first, got 3 and 1."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--bounds", "gravity=1:2"],
         "parameter 'gravity': expected a value between 1 and 2 m/s^2, got 9.81; "
         "change the value or the bounds."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--bounds", "camera.depth=1:2"],
         "bounds of 'camera.depth': expected a parameter of the mechanism; give the camera's with fix."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--until", "1e300"],
         "until: expected at most 136.633 s (the end of the record, ten times its length and a minute, and "
         "no more than 1000000 rows), got 1e+300 s."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--rate", "1e-300"],
         "rate: expected 0.001 to 1e+06 Hz, got 1e-300; give the true frames a second."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--background", "a" * 300],
         f"'{'a' * 80}...{'a' * 40}': expected a place the system can use, got 'File name too long'; "
         "give another."),
        (["run", CLIP, "--model", MODEL, "--out", "o", "--seed", "-1"],
         "seed: expected 0 or more, got -1; give a whole number."),
    ],
)  # fmt: skip
def test_bad_usage(
    words: list[object], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert refused(*words) == message
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("given", "shown"),
    [
        ("b" * 500, "b" * 500),
        ("b" * 5000, f"{'b' * 665}...{'b' * 330}"),
        ("b c " * 300, "b c " * 300),
    ],
)
def test_no_message_is_cut_whatever_was_given(given: str, shown: str) -> None:
    """Lists in it are: the rest of the names is counted."""
    message = refused("run", CLIP, "--model", MODEL, "--out", "o", "--free", given)
    names = message.removeprefix(f"parameter '{shown}' ")
    assert names.startswith("is not in the mechanism; parameters: 'link1.length', ")
    assert names.endswith(" more.")
    assert len(names) < 300


def test_a_long_message_has_its_advice(capsys: pytest.CaptureFixture[str]) -> None:
    message = (
        "clip 'a.mp4': expected " + "one thing or another, " * 30 + "got none; give a folder with a picture."
    )
    cli._fail(message)
    assert capsys.readouterr().err == f"monodyn: {message}\n"


def test_a_name_does_not_command_the_terminal() -> None:
    message = refused("run", "a\x1b[31m\x07b.mp4", "--model", MODEL, "--out", "o")
    assert message.startswith(r"clip 'a\x1b[31m\x07b.mp4': ")


@pytest.mark.parametrize(
    "words",
    [
        ["run", CLIP, "--model", "nowhere.xml", "--out", "o"],
        ["run", CLIP, "--model", MODEL, "--out", "o", "--fix", "link9.length=1"],
        ["run", CLIP, "--model", MODEL, "--out", "o", "--free", "bogus"],
        ["run", CLIP, "--model", MODEL, "--out", "o", "--fix", "link1.length=-1"],
        ["run", CLIP, "--model", MODEL, "--out", "o", "--segment.contrast", "-1"],
        ["run", CLIP, "--model", MODEL, "--out", "o", "--identify.bodies", "odd"],
        ["run", CLIP, "--model", MODEL, "--out", "o", "--identify.error-bound", "nan"],
        ["run", CLIP, "--model", MODEL, "--out", "o", "--identify.outlier", "-1"],
        ["run", CLIP, "--model", MODEL, "--out", "o", "--identify.evaluations", "0"],
        ["run", CLIP, "--model", MODEL, "--out", "o", "--identify.piece", "1"],
        ["run", MODEL, "--model", MODEL, "--out", "o"],
        ["identify", "nowhere.csv", "--model", "double"],
        ["identify", CLIP, "--model", "double"],
        ["run", CLIP, "--model", MODEL, "--out", "o", "--identify.terms", "3"],
        ["run", CLIP, "--model", MODEL, "--out", "o", "--identify.series", "alone"],
        ["run", CLIP, "--model", MODEL, "--out", "o", "--identify.gains", "0.4", "0.1", "0.04"],
        ["run", CLIP, "--model", MODEL, "--out", "o", "--method", "paper", "--identify.gains", "1", "2", "3"],
        ["run", CLIP, "--model", MODEL, "--out", "o", "--identify.rates"],
        ["run", CLIP, "--model", MODEL, "--out", "o", "--locate.start", "evolution"],
        ["run", CLIP, "--model", MODEL, "--out", "o", "--method", "paper", "--free", "camera.focal"],
        [
            "run",
            CLIP,
            "--model",
            MODEL,
            "--out",
            "o",
            "--identify.torque",
            "fourier",
            "--fix",
            "torque.period=-1",
        ],
    ],
)
def test_bad_input_of_the_stages_is_one_line_too(
    words: list[object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    refused(*words)
    assert list(tmp_path.iterdir()) == []


def test_help_of_every_command_shows_an_example() -> None:
    for words in (
        ["--help"],
        ["run", "--help"],
        ["track", "--help"],
        ["identify", "--help"],
        ["models", "--help"],
    ):
        done = command(*words)
        assert done.code == 0
        assert f"monodyn {words[0] if len(words) == 2 else 'run'}" in done.out
        assert "xample" in done.out
    assert command().code == 2
    assert command("--version").out.startswith("monodyn ")


# inputs inside the folder, streams and names


@pytest.mark.parametrize("sub", ["", "unfinished"])
def test_a_run_never_replaces_its_own_input(tmp_path: Path, sub: str) -> None:
    folder = tmp_path / "run" / sub
    folder.mkdir(parents=True)
    model, poses = folder / "model.xml", folder / "poses.csv"
    model.write_bytes(MODEL.read_bytes())
    poses.write_text("time,joint1,joint2\n0,0,0\n0.1,0.1,0.1\n0.2,0.2,0.1\n", encoding="utf-8")
    for words in (["run", CLIP, "--model", model], ["identify", poses, "--model", MODEL]):
        message = refused(*words, "--out", tmp_path / "run", "--force")
        assert "which the run would replace; give another with --out." in message
    assert model.exists()
    assert poses.exists()


def test_free_torques_have_a_table_and_held_sizes(tmp_path: Path) -> None:
    truth = json.loads((DEMO / "double.json").read_text(encoding="utf-8"))
    lines = [f"{t!r},{a!r},{b!r}" for t, (a, b) in zip(truth["times"][:45], truth["q"][:45], strict=True)]
    poses, out = tmp_path / "poses.csv", tmp_path / "free"
    poses.write_text("\n".join(["time,joint1,joint2", *lines]), encoding="utf-8")
    done = command("identify", poses, "--model", MODEL, "--out", out, "--identify.torque", "free")
    assert done.code == 0, done.err
    assert re.search(r"link1\.length\s+\S+\s+held", done.out)
    assert "joint1.torque.0" not in done.out
    table = np.genfromtxt(out / "torques.csv", delimiter=",", names=True)
    assert table.dtype.names == ("frame", "time", "joint1", "joint2", "joint1_std", "joint2_std")
    assert len(table) == 45
    document = json.loads((out / "fit.json").read_text(encoding="utf-8"))
    assert (document["torque"], document["unknowns"]) == ("free", 90)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "torque at joint2" in page
    assert "held" in page


def test_a_period_may_be_bounded_anywhere(tmp_path: Path) -> None:
    time = np.arange(60) / 30.0
    lines = [f"{t!r},{q!r}" for t, q in zip(time.tolist(), (0.5 * np.sin(5.0 * time)).tolist(), strict=True)]
    poses = tmp_path / "poses.csv"
    poses.write_text("\n".join(["time,joint1", *lines]), encoding="utf-8")
    words = ("--identify.torque", "fourier", "--bounds", "torque.period=0.2:0.4")
    done = command("identify", poses, "--model", "single", *words)
    assert done.code in (0, 1)  # whatever comes of it, the bounds are no bad input
    assert "Traceback" not in done.err


@pytest.mark.slow
def test_known_torques_make_masses_absolute(tmp_path: Path) -> None:
    time = np.arange(60) / 30.0
    torque = 0.03 * np.sin(6.0 * time) + 0.02 * np.sin(11.0 * time)
    # Runge-Kutta steps of a rod of 0.2 kg and 0.3 m on a hinge with damping, by its own equation of motion
    length, mass, damping = 0.3, 0.2, 2e-3
    state, rows, fine = np.array([0.5, 0.0]), [], 20

    def rate(at: float, now: np.ndarray) -> np.ndarray:
        load = np.interp(at, time, torque) - damping * now[1] - mass * 9.81 * 0.5 * length * np.sin(now[0])
        return np.array([now[1], load / (mass * length**2 / 3.0)])

    for i in range(60):
        rows.append(state[0])
        for k in range(fine):
            h, at = 1.0 / 30.0 / fine, time[i] + k / 30.0 / fine
            one = rate(at, state)
            two = rate(at + h / 2, state + h / 2 * one)
            three = rate(at + h / 2, state + h / 2 * two)
            state = state + h / 6 * (one + 2 * two + 2 * three + rate(at + h, state + h * three))
    noise = 5e-4 * np.random.default_rng(4).normal(size=60)
    table, model = tmp_path / "poses.csv", tmp_path / "rod.xml"
    lines = [f"{t!r},{q!r},{u!r}" for t, q, u in zip(time, np.array(rows) + noise, torque, strict=True)]
    text = "\n".join(["time,joint1,joint1_torque", *lines]).replace("np.float64(", "").replace(")", "")
    table.write_text(text, encoding="utf-8")
    model.write_text(
        '<mujoco><option gravity="0 0 -9.81"/><worldbody><body name="rod">'
        '<joint name="joint1" axis="0 -1 0"/><geom type="capsule" size="0.001" fromto="0 0 0 0 0 -0.2"/>'
        "</body></worldbody></mujoco>",
        encoding="utf-8",
    )
    out = tmp_path / "out"
    done = command("identify", table, "--model", model, "--torques", table, "--out", out)
    assert done.code == 0, done.err
    assert re.search(r"rod\.mass\s+0\.(19|20)\d* +0\.\d+ to 0\.\d+ +kg", done.out)
    document = json.loads((out / "fit.json").read_text(encoding="utf-8"))
    rows = {row["name"]: row for row in document["parameters"]}
    assert document["mass_scale"] == "torques"
    assert abs(rows["rod.mass"]["value"] / mass - 1) < 0.02
    assert rows["rod.mass"]["lower"] < mass < rows["rod.mass"]["upper"]
    assert rows["joint1.damping"]["lower"] < damping < rows["joint1.damping"]["upper"]
    acted = np.genfromtxt(out / "torques.csv", delimiter=",", names=True)
    assert np.abs(acted["joint1"][np.isfinite(acted["frame"])] - torque).max() < 2e-3
    assert "rod.mass" in (out / "report.html").read_text(encoding="utf-8")
    refused = command("identify", table, table, "--model", model, "--torques", table)
    assert refused.code == 2
    assert refused.err == (
        "monodyn: torques: expected one log for each of 2 records, got 1; name as many, in their order.\n"
    )


@pytest.mark.slow
def test_warm_goes_through_a_run_and_a_stream_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    done = command("warm")
    assert done.code == 0
    seconds = int(re.findall(r"\d+", done.out)[0])
    assert done.out == (
        f"Runs and streams are compiled ({seconds} s); what only a moving camera, motion blur or the "
        "published method needs still is at first use.\n"
    )
    steps = {line.split(":")[0] for line in done.err.splitlines()}
    assert {"background", "locate", "track", "identify", "overlay", "live"} <= steps
    assert any(line.startswith(f"locate: {STEPS} of {STEPS}") for line in done.err.splitlines())
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_demo_is_a_run_of_the_clip_that_is_installed(tmp_path: Path) -> None:
    done = command("demo", "--out", tmp_path / "run", "--json", folder=tmp_path / "run")
    assert done.code == 0
    # the end of a link lies beyond its last hinge
    truth = json.loads((DEMO / "double.json").read_text(encoding="utf-8"))
    found = {row["name"]: row["value"] for row in json.loads(done.out)["parameters"]}
    assert found["link1.length"] == pytest.approx(truth["length"][0], rel=5e-3)
    assert found["link2.length"] == pytest.approx(truth["length"][1] + truth["overhang"][1], rel=5e-3)
    assert (done.folder / "report.html").is_file()
