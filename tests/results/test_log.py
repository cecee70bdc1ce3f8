"""run.json: what was run, on what, and how it ended."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path

import pytest

from monodyn.errors import FitError
from monodyn.results.folder import RunFolder
from monodyn.results.log import RunLog, recorded
from monodyn.settings import RunSettings


def made(tmp_path: Path) -> tuple[RunFolder, RunLog]:
    (tmp_path / "clip.mp4").write_bytes(b"frames")
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "0.png").write_bytes(b"one")
    inputs = {"clip": tmp_path / "clip.mp4", "folder": tmp_path / "frames", "model": "double"}
    return RunFolder(tmp_path / "run"), RunLog("run", inputs, RunSettings(seed=3))


def read(folder: RunFolder) -> dict:
    return json.loads((folder.path / "run.json").read_text(encoding="utf-8"))


def test_a_run_that_ends_records_its_inputs_and_settings(tmp_path: Path) -> None:
    folder, log = made(tmp_path)
    with recorded(folder, log), log.stage("track"):
        folder.write_text("poses.csv", "frame")
    said = read(folder)
    assert (said["status"], said["message"], said["seed"]) == ("done", "", 3)
    assert said["files"] == ["poses.csv", "run.json"]
    assert (said["inputs"]["clip"]["bytes"], len(said["inputs"]["clip"]["sha256"])) == (6, 64)
    assert (said["inputs"]["folder"]["files"], said["inputs"]["model"]) == (1, {"name": "double"})
    assert list(said["seconds"]) == ["track"]
    assert said["settings"]["identify"]["seed"] == 3


def test_a_failure_records_why(tmp_path: Path) -> None:
    folder, log = made(tmp_path)
    folder.write_text("poses.csv", "frame")
    with pytest.raises(FitError), recorded(folder, log):
        raise FitError("It does not move.")
    assert (read(folder)["status"], read(folder)["message"]) == ("failed", "It does not move.")


def test_a_failure_of_which_nothing_was_written_leaves_no_folder(tmp_path: Path) -> None:
    folder, log = made(tmp_path)
    with pytest.raises(FitError), recorded(folder, log):
        raise FitError("It does not move.")
    assert not folder.path.exists()


def test_the_settings_stand_beside_it_however_the_run_ends(tmp_path: Path) -> None:
    for name, error in (("done", None), ("failed", FitError("It does not move."))):
        folder = RunFolder(tmp_path / name)
        log = RunLog("run", {"model": "double"}, RunSettings(), "model = 'double'\n")
        folder.write_text("poses.csv", "frame")
        with contextlib.suppress(FitError), recorded(folder, log):
            if error is not None:
                raise error
        assert (folder.path / "run.toml").read_text(encoding="utf-8") == "model = 'double'\n"
        assert read(folder)["files"] == ["poses.csv", "run.toml", *(["run.json"] if error is None else [])]


def test_an_interruption_says_where_the_files_are(tmp_path: Path) -> None:
    folder, log = made(tmp_path)
    with pytest.raises(KeyboardInterrupt) as stop, recorded(folder, log):
        # a kernel that is interrupted raises a SystemError of its own
        raise SystemError("returned a result with an exception set") from KeyboardInterrupt()
    assert stop.value.args == (f"what was finished is in '{folder.path}', which --force replaces.",)
    assert read(folder)["status"] == "interrupted"
    with pytest.raises(KeyboardInterrupt) as stop, recorded(None, log):
        raise KeyboardInterrupt
    assert stop.value.args == ()
