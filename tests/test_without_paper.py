"""The program without the published method and scipy: the default path runs, that method is refused."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import pytest

from monodyn import stages
from monodyn.errors import SettingsError
from monodyn.settings import RunSettings
from support import DEMO, refuses

FRAMES = 30
MESSAGE = "method 'paper': the published method is not part of this installation; use the method 'fast'."
PROGRAM = """
import sys

# every import from them fails, as if they were not installed
sys.modules["monodyn.paper"] = sys.modules["scipy"] = None
from monodyn.cli import main

code = main(sys.argv[1:])
assert not [name for name in sys.modules if name.startswith("monodyn.paper.")]
sys.exit(code)
"""


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Take the first frames of the example, at half its size."""
    folder = tmp_path_factory.mktemp("clip")
    film = cv2.VideoCapture(str(DEMO / "double.mp4"))
    for i in range(FRAMES):
        _, picture = film.read()
        size = (picture.shape[1] // 2, picture.shape[0] // 2)
        cv2.imwrite(str(folder / f"{i:03d}.png"), cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
    return folder


def run_without_paper(*words: object) -> subprocess.CompletedProcess[str]:
    """Run a command in a process that cannot import the published method."""
    command = [sys.executable, "-c", PROGRAM, *(str(word) for word in words)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_the_default_path_runs(pictures: Path, tmp_path: Path) -> None:
    model, out = DEMO / "double.xml", tmp_path / "out"
    done = run_without_paper("run", pictures, "--model", model, "--rate", "30", "--out", out, "--quiet")
    assert (done.returncode, done.stderr) == (0, "")
    assert (out / "fit.json").exists()
    assert (out / "report.html").exists()


def test_help_leaves_out_the_options_of_the_method() -> None:
    done = run_without_paper("run", "--help-all")
    assert (done.returncode, done.stderr) == (0, "")
    assert "--locate.search-frames" in done.stdout
    assert "--track.move-share" not in done.stdout


def test_no_stage_takes_the_method(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stage on its own refuses it before it looks at anything it is given."""
    for name in [name for name in sys.modules if name.startswith("monodyn.paper")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "monodyn.paper", None)
    nothing: Any = None
    for methods in (("paper", "fast"), ("fast", "paper"), ("paper", "paper")):
        with refuses(SettingsError, MESSAGE):
            stages.LOCATE_METHODS[methods](nothing)
    with refuses(SettingsError, MESSAGE):
        stages.TRACK_METHODS["paper"](nothing, nothing, nothing, None)
    with refuses(SettingsError, MESSAGE):
        stages.IDENTIFY_METHODS["paper"](nothing, nothing, nothing, None)


def test_no_stage_takes_the_method_without_scipy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "scipy", None)
    nothing: Any = None
    said = (
        "method 'paper': expected the package scipy, which is not installed; install it with "
        "pip install 'monodyn[paper]'."
    )
    with refuses(SettingsError, said):
        stages.IDENTIFY_METHODS["paper"](nothing, nothing, nothing, None)
    with refuses(SettingsError, said):
        RunSettings(method="paper")
    assert RunSettings().method == "fast"


def test_the_method_is_refused_in_one_line(pictures: Path, tmp_path: Path) -> None:
    model, out = DEMO / "double.xml", tmp_path / "out"
    words = ("run", pictures, "--model", model, "--rate", "30", "--out", out, "--quiet")
    done = run_without_paper(*words, "--method", "paper")
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr == f"monodyn: {MESSAGE}\n"
