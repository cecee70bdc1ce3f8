"""A settings file gives the options that a command line would; what the command line says wins."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from monodyn.cli.parse import parsed
from monodyn.errors import SettingsError
from monodyn.settings import RunSettings
from support import refuses

WHOLE = """
clip = "clip.mp4"
model = "models/double.xml"
out = "run"
force = true
fit-frames = "0:120"
until = 5
torques = ["motor.csv"]
free = "gravity"
track.reach = 5
"points.axis" = "auto"

[fix]
gravity = 9.81
"link1.length" = 0.2

[bounds]
"link2.length" = "0.1:0.3"

[track]
adaptive = true

[camera]
distortion = "-0.28,0.09,0,0"
readout = -0.01
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "own.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_says_what_a_command_line_would(tmp_path: Path) -> None:
    (tmp_path / "models").mkdir()
    text = WHOLE.replace("track.reach = 5\n", "").replace("[track]", "[track]\nreach = 5")
    found = parsed("run", ["--config", str(written(tmp_path, text))])
    words = (
        f"{tmp_path}/clip.mp4 --model {tmp_path}/models/double.xml --out {tmp_path}/run --force --fit-frames "
        f"0:120 --until 5 --torques {tmp_path}/motor.csv --free gravity --track.reach 5 --fix gravity=9.81 "
        "link1.length=0.2 --bounds link2.length=0.1:0.3 --camera.distortion -0.28,0.09,0,0 "
        "--camera.readout -0.01"
    )
    assert found == parsed("run", words.split())


def test_paths_start_at_the_folder_of_the_file_and_names_stay(tmp_path: Path) -> None:
    for model, there in (
        ("double", "double"),
        ("auto", "auto"),
        ("chain:3", "chain:3"),
        ("./double", "double"),
    ):
        path = written(tmp_path, f'clip = "../clip.mp4"\nmodel = "{model}"\nout = "/elsewhere"')
        found = parsed("run", ["--config", str(path)])
        assert found.model == (model if model == there else str(tmp_path / there))
        assert (found.clip, found.out) == (tmp_path / "../clip.mp4", Path("/elsewhere"))
    for source in ("0", "-", "rtsp://camera/1"):
        path = written(tmp_path, f'source = "{source}"\nmodel = "double"\nndjson = "-"\nlive.pace = "real"')
        found = parsed("live", ["--config", str(path)])
        assert (found.source, found.ndjson, found.live.pace) == (source, "-", "real")


def test_the_command_line_wins_of_named_values_name_by_name(tmp_path: Path) -> None:
    path = written(
        tmp_path, 'clip = "a.mp4"\nout = "o"\nfree = ["gravity"]\nforce = true\nfix = {a = 1, b = 2}'
    )
    words = ["b.mp4", "--config", str(path), "--fix", "b=3,c=4", "--free", "time_scale", "--no-force"]
    found = parsed("run", words)
    assert (found.clip, found.out, found.force) == (Path("b.mp4"), tmp_path / "o", False)
    assert found.settings.fix == {"a": 1.0, "b": 3.0, "c": 4.0}
    assert found.settings.free == ("time_scale",)


def test_the_method_of_the_command_line_is_that_of_every_stage(tmp_path: Path) -> None:
    path = written(tmp_path, 'clip = "a.mp4"\nout = "o"\nmethod = "fast"')
    found: RunSettings = parsed("run", ["--config", str(path), "--method", "paper"]).settings
    assert {found.camera.method, found.locate.method, found.identify.method} == {"paper"}


def test_items_of_lists_and_tables_are_taken_as_they_are(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        """clip = "a.mp4"
        out = "o"
        points = "p.csv"
        free = ["a,b", "c"]
        torques = ["one, two.csv", "three.csv"]
        fix = {"x,y" = 1, "k=v" = -2.5}
        bounds = {"x,y" = "-1:2", "" = "0:1"}
        points.map = {}
        """.replace("points.map = {}", '"points.map" = {"a,b=c" = "d,e=f"}'),
    )
    found: RunSettings = parsed("run", ["--config", str(path)]).settings
    assert found.free == ("a,b", "c")
    assert found.torques == (tmp_path / "one, two.csv", tmp_path / "three.csv")
    assert found.fix == {"x,y": 1.0, "k=v": -2.5}
    assert found.bounds == {"x,y": (-1.0, 2.0), "": (0.0, 1.0)}
    assert found.points_map == {"a,b=c": "d,e=f"}
    # a text is written as on the command line
    path.write_text('clip = "a.mp4"\nout = "o"\nfree = "a,b"')
    assert parsed("run", ["--config", str(path)]).settings.free == ("a", "b")


def test_editors_of_windows_write_settings_files_too(tmp_path: Path) -> None:
    for mark, end in ((b"\xef\xbb\xbf", b"\r\n"), (b"\xef\xbb\xbf", b"\n"), (b"", b"\r\n")):
        path = tmp_path / "own.toml"
        path.write_bytes(
            mark + end.join([b'clip = "a.mp4"', b"", b'out = "o"', b"[fix]", b"gravity = 9", b""])
        )
        found = parsed("run", ["--config", str(path)])
        assert (found.clip, found.settings.fix) == (tmp_path / "a.mp4", {"gravity": 9.0})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("fit-frmes = '0:9'", "monodyn run has no option 'fit-frmes'; did you mean 'fit-frames'?"),
        ("[track]\nreech = 4", "monodyn run has no option 'track.reech'; did you mean 'track.reach'?"),
        ("fixx = {a = 1}", "monodyn run has no option 'fixx'; did you mean 'fix'?"),
        ("[trak]\nreach = 4", "monodyn run has no option 'trak.reach'; did you mean 'track.reach'?"),
        ("method = 'fsat'", "method: expected one of 'fast', 'paper', got 'fsat'; did you mean 'fast'?"),
        ("config = 'other.toml'", "monodyn run has no option 'config'; options: 'settings'."),
        ("track = 3", "monodyn run has no option 'track'; options: 'settings'."),
        ("until = 'x'", "until: expected a number, got 'x'."),
        ("seed = true", "seed: expected a whole number, got 'true'."),
        ("force = 1", "force: expected true or false, got '1'."),
        ("fix = 'gravity=9.81'",
         "fix: expected a table of NAME = VALUE, got 'gravity=9.81'; e.g. [fix]."),
        ("fix = {gravity = [1]}",
         "fix: expected a text or a number, got [1]; write it as on the command line."),
        ("fit-frames = [0, 9]",
         "fit-frames: expected a text or a number, got [0, 9]; write it as on the command line."),
        ("identify.torque = 'frictoin'",
         "identify.torque: expected one of 'auto', 'friction', 'fourier', 'free', got 'frictoin'; "
         "did you mean 'friction'?"),
    ],
)  # fmt: skip
def test_what_a_file_cannot_say_is_refused(text: str, message: str, tmp_path: Path) -> None:
    path = written(tmp_path, text)
    with pytest.raises(SettingsError) as found:
        parsed("run", ["a.mp4", "--out", "o", "--config", str(path)])
    said = str(found.value)
    if "options: " in message:
        # all names, or the first dozen
        said = said.partition("options: ")[0] + "options: 'settings'."
    assert said == f"config '{path}': {message}"


def test_a_file_that_is_none_is_refused(tmp_path: Path) -> None:
    def refused(name: object, message: str) -> None:
        with refuses(SettingsError, message):
            parsed("run", ["a.mp4", "--out", "o", "--config", str(name)])

    refused(
        "no.toml",
        "config 'no.toml': expected a settings file, got 'No such file or directory'; check the path.",
    )
    (tmp_path / "run.toml").touch()
    refused(
        tmp_path / "rnu.toml",
        f"config '{tmp_path}/rnu.toml': expected a settings file, got 'No such file or directory'; did you "
        f"mean '{tmp_path}/run.toml'?",
    )
    refused(tmp_path, f"config '{tmp_path}': expected a settings file, got 'Is a directory'; check the path.")
    path = written(tmp_path, "until = 'x'")
    refused(path, f"config '{path}': until: expected a number, got 'x'.")
    path = written(tmp_path, "[trak]\nreach = 1")
    refused(path, f"config '{path}': monodyn run has no option 'trak.reach'; did you mean 'track.reach'?")
    path = written(tmp_path, "background = ''")
    refused(path, f"config '{path}': background: expected a name, got an empty one; give one.")
    path = written(tmp_path, "fit_frames = '0:9'\nfit-frames = '0:8'")
    refused(path, f"config '{path}': expected one 'fit-frames', got two; leave one out.")
    path = written(tmp_path, "ndjson = '-'")
    refused(
        path,
        f"config '{path}': monodyn run has no option 'ndjson'; it belongs to monodyn live; leave it out.",
    )
    path = written(tmp_path, "seed = ")
    refused(
        path, f"config '{path}': expected TOML, got an error: Invalid value (at end of document); correct it."
    )
    path.write_bytes(b"\xff")
    refused(path, f"config '{path}': expected TOML, got an error: no UTF-8 text; correct it.")
    refused("", "run: --config: expected a name, got an empty one; give one.")


@pytest.mark.skipif(os.name == "nt", reason="has neither devices nor pipes as files")
def test_what_has_no_end_is_no_settings_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for name in ("/dev/zero", str(tmp_path / "pipe")):
        said = f"config '{name}': expected a settings file, got a device or pipe; name a file."
        with refuses(SettingsError, said):
            parsed("run", ["--config", name])


def test_a_settings_file_has_an_end_and_a_bottom(tmp_path: Path) -> None:
    path = tmp_path / "long.toml"
    path.write_text("# long\n" * 200_000, encoding="utf-8")
    with refuses(SettingsError, f"config '{path}': expected at most 1 MB of settings, got more; shorten it."):
        parsed("run", ["--config", str(path)])
    path.write_text(f"a = {'[' * 5000}{']' * 5000}", encoding="utf-8")
    said = f"config '{path}': expected TOML, got an error: too many brackets in one another; correct it."
    with refuses(SettingsError, said):
        parsed("run", ["--config", str(path)])


def test_commands_without_inputs_take_no_file() -> None:
    said = "models: expected known options, got --config, a.toml; see monodyn models --help."
    with refuses(SettingsError, said):
        parsed("models", ["--config", "a.toml"])


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (f"seed = {'9' * 5000}", "a number of too many digits"),
        (f"seed = 0x{'f' * 5000}", "a whole number of more than 64 bits"),
        (f"fix = {{gravity = 0x{'f' * 5000}}}", "a whole number of more than 64 bits"),
        (".".join(["a"] * 3000) + " = 1", "too many tables in one another"),
        ('out = "o\\u0000p"', "a text with a zero in it"),
        ('"a\\u0000b" = 1', "a text with a zero in it"),
    ],
)
def test_what_no_option_can_have_is_refused(text: str, why: str, tmp_path: Path) -> None:
    path = written(tmp_path, text)
    with refuses(SettingsError, f"config '{path}': expected TOML, got an error: {why}; correct it."):
        parsed("run", ["--config", str(path)])


def test_a_folder_of_nobody_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, 'clip = "~nosuchuser/x.mp4"')
    with refuses(
        SettingsError,
        f"config '{path}': clip: expected a file, got '~nosuchuser/x.mp4' of nobody here; write where it is.",
    ):
        parsed("run", ["--config", str(path)])
