"""The program without the published method: the default path runs, the choice of that method is refused."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import cv2
import pytest

from support import EXAMPLES

FRAMES = 30
PROGRAM = """
import sys

sys.modules["monodyn.paper"] = None  # every import from the room fails, as if it were not installed
from monodyn.cli import main

code = main(sys.argv[1:])
assert not [name for name in sys.modules if name.startswith("monodyn.paper.")]
sys.exit(code)
"""


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Take the first frames of the example as a folder of pictures."""
    folder = tmp_path_factory.mktemp("clip")
    film = cv2.VideoCapture(str(EXAMPLES / "double.mp4"))
    for i in range(FRAMES):
        _, picture = film.read()
        cv2.imwrite(str(folder / f"{i:03d}.png"), picture)
    return folder


def run_without_paper(*words: object) -> subprocess.CompletedProcess[str]:
    """Run a command in a process that cannot import the published method."""
    command = [sys.executable, "-c", PROGRAM, *(str(word) for word in words)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_the_default_path_runs(pictures: Path, tmp_path: Path) -> None:
    model, out = EXAMPLES / "double.xml", tmp_path / "out"
    done = run_without_paper("run", pictures, "--model", model, "--rate", "30", "--out", out, "--quiet")
    assert (done.returncode, done.stderr) == (0, "")
    assert (out / "fit.json").exists()
    assert (out / "report.html").exists()


def test_help_leaves_out_the_options_of_the_method() -> None:
    done = run_without_paper("run", "--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert "--locate.search-frames" in done.stdout
    assert "--track.move-share" not in done.stdout


@pytest.mark.parametrize(
    "choice", [("--method", "paper"), ("--locate.method", "paper"), ("--camera.method", "paper")]
)
def test_the_method_is_refused_in_one_line(pictures: Path, tmp_path: Path, choice: tuple[str, str]) -> None:
    model, out = EXAMPLES / "double.xml", tmp_path / "out"
    words = ("run", pictures, "--model", model, "--rate", "30", "--out", out, "--quiet", *choice)
    done = run_without_paper(*words)
    assert done.returncode == 2
    assert done.stderr == (
        "monodyn: method 'paper': the published method is not part of this installation; "
        "use the method 'fast'.\n"
    )
