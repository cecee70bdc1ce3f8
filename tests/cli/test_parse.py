"""The words of a command line: every complaint is one sentence."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from monodyn.cli.parse import parsed
from monodyn.errors import SettingsError
from support import refuses

WORDS = ["a.mp4", "--model", "double", "--out", "o"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "run: expected --out, got nothing; see monodyn run --help."),
        (["a.mp4", "--model", "m"], "run: expected --out, got a.mp4 --model m; see monodyn run --help."),
        ([*WORDS, "--bogus"], "run: expected known options, got --bogus; see monodyn run --help."),
        ([*WORDS, "--identify.seed", "3"],
         "run: expected known options, got --identify.seed, 3; see monodyn run --help."),
        ([*WORDS, "--until", "abc"], "until: expected a number, got 'abc'."),
        ([*WORDS, "--track.patience", "1.5"], "track.patience: expected a whole number, got '1.5'."),
        ([*WORDS, "--identify.bodies", "odd"],
         "identify.bodies: expected one of 'auto', 'uniform', 'free', got 'odd'."),
        ([*WORDS, "b.mp4"], "run: expected one CLIP, got 'a.mp4' and 'b.mp4'; leave one out."),
        ([*WORDS, "--clip", "b.mp4"], "run: expected one CLIP, got 'a.mp4' and 'b.mp4'; leave one out."),
        ([*WORDS, "--seed", "1", "--seed=2"], "run: expected one --seed, got '1' and '2'; leave one out."),
        ([*WORDS, "--until"], "run: --until: expected S, got nothing; see monodyn run --help."),
        ([*WORDS, "--until", "--force"], "run: --until: expected S, got nothing; see monodyn run --help."),
        ([*WORDS, "--force=yes"], "run: --force: expected no value, got 'yes'; leave it out."),
        ([*WORDS, "-f"], "run: expected known options, got -f; see monodyn run --help."),
        ([*WORDS, "--track.patienc", "2", "--until", "3", "--bogus"],
         "run: expected known options, got --track.patienc, 2, --bogus; see monodyn run --help. "
         "Did you mean --track.patience?"),
    ],
)  # fmt: skip
def test_complaints_are_one_sentence(words: list[str], message: str) -> None:
    with refuses(SettingsError, message):
        parsed("run", words)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("identify a.csv --points.map a=b",
         "identify: expected known options, got --points.map, a=b; --points.map belongs to monodyn run and "
         "track; leave it out."),
        ("track a.mp4 --out o --fit_frames 0:9",
         "track: expected known options, got --fit_frames, 0:9; --fit-frames belongs to monodyn run and "
         "identify; leave it out."),
        ("predict run --form joint1=0.5",
         "predict: expected known options, got --form, joint1=0.5; see monodyn predict --help. Did you mean "
         "--from?"),
        ("run a.mp4 --out o --method fsat",
         "method: expected one of 'fast', 'paper', got 'fsat'; did you mean 'fast'?"),
    ],
)  # fmt: skip
def test_what_was_meant_is_said(line: str, message: str) -> None:
    command, *words = line.split()
    with refuses(SettingsError, message):
        parsed(command, words)


@pytest.mark.parametrize(
    ("option", "word", "end"),
    [
        ("predict --from", "joint1:0.5", "JOINT=POSITION with a number, got 'joint1:0.5'; e.g. joint1=0.5."),
        ("predict --rates", "joint1", "JOINT=RATE with a number, got 'joint1'; e.g. joint1=-2."),
        ("predict --fix", "gravity", "NAME=VALUE with a number, got 'gravity'; e.g. gravity=9.81."),
        ("control --at", "x", "JOINT=POSITION with a number, got 'x'; e.g. joint1=1.5708."),
        ("control --start", "x", "JOINT=POSITION with a number, got 'x'; e.g. joint1=0.5."),
        ("control --limit", "x=y", "JOINT=TORQUE with a number, got 'x=y'; e.g. joint1=0.5."),
        ("control --within", "x=1", "JOINT=LOW:HIGH with two numbers, got 'x=1'; e.g. slide=-0.3:0.3."),
        ("control --allowed", "x", "NAME=VALUE with a number, got 'x'; e.g. effort=1."),
    ],
)
def test_the_example_is_one_of_the_option(option: str, word: str, end: str) -> None:
    command, name = option.split()
    with refuses(SettingsError, f"{name.removeprefix('--')}: expected {end}"):
        parsed(command, ["run", name, word])


@pytest.mark.parametrize("name", ["--out", "--model", "--background"])
def test_an_empty_name_is_not_the_current_folder(name: str) -> None:
    for words in ([name, ""], [f"{name}="]):
        with refuses(SettingsError, f"run: {name}: expected a name, got an empty one; give one."):
            parsed("run", ["a.mp4", *words])


CLIP = Path("a.mp4")
GIVEN = {"gravity": 9.81, "link1.length": 0.2}
FREED = ("joint1.drag", "torque.lag", "gravity")


@pytest.mark.parametrize(
    "words",
    [
        "a.mp4 --model m --fix gravity=9.81 link1.length=0.2 --free joint1.drag torque.lag,gravity --out o",
        "--fix gravity=9.81 link1.length=0.2 a.mp4 --model m --free joint1.drag,torque.lag gravity --out o",
        "--model m --out o --free joint1.drag torque.lag gravity a.mp4 --fix link1.length=0.2,gravity=9.81",
        "--free joint1.drag --out o --fix gravity=9.81 --model m --free torque.lag gravity --fix "
        "link1.length=0.2 a.mp4",
        "--clip a.mp4 --model=m --out=o --fix=gravity=9.81 --fix=link1.length=0.2 --free "
        "joint1.drag,torque.lag,gravity",
    ],
)
def test_clip_and_options_stand_in_any_order(words: str) -> None:
    found = parsed("run", words.split())
    assert (found.clip, found.model, found.out) == (CLIP, "m", Path("o"))
    assert found.settings.fix == GIVEN
    assert found.settings.free == FREED


def test_tables_runs_and_sources_stand_in_any_order() -> None:
    found = parsed(
        "identify",
        ["a.csv", "--torques", "l.csv", "b.csv", "--free", "gravity", "c.csv", "--torques", "k.csv"],
    )
    assert found.poses == (Path("a.csv"), Path("b.csv"), Path("c.csv"))
    assert found.settings.torques == (Path("l.csv"), Path("k.csv"))
    found = parsed("control", ["--actuated", "slide,turn", "--at", "joint1=1", "turn=2", "run", "--swing"])
    assert (found.run, found.actuated, found.at) == (
        Path("run"),
        ("slide", "turn"),
        {"joint1": 1.0, "turn": 2.0},
    )
    found = parsed("predict", ["--from", "joint1=0.5", "joint2=-1", "run", "--until", "-0.5"])
    assert (found.run, found.start, found.until) == (Path("run"), {"joint1": 0.5, "joint2": -1.0}, -0.5)
    assert parsed("live", ["--model", "m", "-"]).source == "-"


def test_numbers_may_be_negative_and_names_have_either_dash() -> None:
    words = "--camera.distortion -0.28,0.09,0,0 --camera.readout -.01 --fit_frames 0:9"
    found = parsed("run", [*WORDS, *words.split()]).settings
    assert found.distortion == (-0.28, 0.09, 0.0, 0.0)
    assert (found.camera.readout, found.fit_frames) == (-0.01, (0, 9))
    one, three = ["--identify.gains", "0.4,0.1,0.06"], ["--identify.gains", "0.4", "0.1", "0.06"]
    for words in (one, three):
        found = parsed("run", [*words, *WORDS, "--method", "paper"])
        assert (found.settings.identify.gains, found.clip) == ((0.4, 0.1, 0.06), CLIP)


def test_a_flag_is_set_and_taken_back_by_name() -> None:
    assert parsed("run", [*WORDS, "--force", "--no-quiet"]).force is True
    assert parsed("run", [*WORDS, "--no-force"]).force is False
    assert parsed("control", ["run", "--no-film"]).film is False
    assert parsed("control", ["run", "--film"]).film is True
    with refuses(SettingsError, "run: expected one --quiet, got 'true' and 'false'; leave one out."):
        parsed("run", [*WORDS, "--quiet", "--no-quiet"])


def test_help_is_an_exit_code() -> None:
    assert parsed("models", ["--help"]) == 0


@pytest.mark.parametrize(
    "words",
    [["--help"], ["run", "--help-all"], ["live", "--help"], ["models", "--help"], ["completion", "bash"]],
)
def test_help_loads_nothing_heavy(words: list[str]) -> None:
    heavy = ("numpy", "scipy", "numba", "mujoco", "cv2", "av", "jinja2")
    code = (
        f"import sys; from monodyn.cli import main; main({words}); "
        f"print('loaded', [m for m in {heavy} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "loaded []"


@pytest.mark.parametrize("columns", ["1", "2", "12"])
def test_help_of_a_narrow_terminal_is_there_at_once(
    columns: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    assert parsed("models", ["--help"]) == 0
    assert "Print the list as JSON." in " ".join(capsys.readouterr().out.split())
    assert os.environ["COLUMNS"] == columns


def test_what_follows_two_dashes_is_no_option() -> None:
    found = parsed("run", ["--free", "camera.focal", "--model", "double", "--out", "run", "--", "-clip.mp4"])
    assert (found.clip, found.settings.free) == (Path("-clip.mp4"), ("camera.focal",))
