"""Lines of the pages are run as they stand there: those of Python find what the command finds."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import monodyn
from support import DEMO, command

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGE = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
NAMES = {"clip.mp4": DEMO / "double.mp4", "double.xml": DEMO / "double.xml"}
"""What the pages call the clip and its mechanism."""


def blocks(page: str, language: str) -> list[str]:
    """List the blocks of a language in a page."""
    return re.findall(rf"```{language}\n(.*?)```", page, re.DOTALL)


def folder_of(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a folder with the clip and the model that the pages name, and go there."""
    path.mkdir()
    for name, source in NAMES.items():
        shutil.copy(source, path / name)
    monkeypatch.chdir(path)


def same(line: str, other: str) -> bool:
    """Return whether two lines have the same words, and numbers as another machine rounds them."""
    one, two = line.split(), other.split()
    number = re.compile(r"[\d.]+")
    return len(one) == len(two) and all(
        a == b
        or (
            bool(number.fullmatch(a) and number.fullmatch(b))
            and float(a) == pytest.approx(float(b), rel=0.02)
        )
        for a, b in zip(one, two, strict=True)
    )


@pytest.mark.slow
def test_the_demo_prints_what_the_readme_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    printed = iter(command("demo", "--out", "demo-run").out.splitlines())
    (block,) = blocks(README, "text")
    # three dots stand for lines that are left out, and each line is looked for after the one before
    for line in block.splitlines():
        assert line == " ..." or any(same(line, other) for other in printed), line


def test_the_mechanism_of_the_readme_stands_away_from_the_origin(tmp_path: Path) -> None:
    (text,) = blocks(README, "xml")
    (tmp_path / "double.xml").write_text(text)
    mechanism = monodyn.load(tmp_path / "double.xml")
    assert [(joint.name, joint.kind, joint.body) for joint in mechanism.joints] == [
        ("shoulder", "hinge", "upper"),
        ("elbow", "hinge", "lower"),
    ]
    assert 'pos="0 0 1"' in text
    assert len(text.splitlines()) <= 15


def column(path: Path, name: str) -> np.ndarray:
    table: Any = np.genfromtxt(path, delimiter=",", names=True)
    return table[name]


@pytest.mark.slow
def test_the_lines_of_python_find_what_the_command_finds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = next(block for block in blocks(PAGE, "python") if "monodyn.report(" in block)
    (said,) = re.findall(r"These lines find what `monodyn ([^`]*)` finds", PAGE)
    folder_of(tmp_path / "lines", monkeypatch)
    found: dict[str, Any] = {}
    exec(compile(lines, "python.md", "exec"), found)
    folder_of(tmp_path / "command", monkeypatch)
    assert command(*said.split(), "--quiet").code == 0
    ours, theirs = (tmp_path / name / "run" for name in ("lines", "command"))
    one, other = (json.loads((run / "fit.json").read_text(encoding="utf-8")) for run in (ours, theirs))
    # the clip's stamps go on a rounding away from where the prediction of Python goes on
    for document in (one, other):
        del document["sha256"]
    ahead = [document.pop("heldout_rms")[0] for document in (one, other)]
    assert ahead[0] == pytest.approx(ahead[1], rel=1e-9)
    assert one == other
    assert one["grade"] == "trusted"
    for name in ("poses.csv", "states.csv", "model.xml", "model.urdf"):
        assert (ours / name).read_bytes() == (theirs / name).read_bytes(), name
    # Python goes on to 10 s, the command to the end of the clip
    for name in ("time", "joint1", "joint2", "joint2_std"):
        longer, shorter = column(ours / "prediction.csv", name), column(theirs / "prediction.csv", name)
        np.testing.assert_allclose(longer[: len(shorter)], shorter, rtol=1e-9, atol=1e-9)
    assert column(ours / "prediction.csv", "time")[-1] == pytest.approx(10.0, abs=1 / 30)
    # what the lines left behind are the objects that are public
    assert isinstance(found["scene"], monodyn.Scene)
    assert isinstance(found["future"], monodyn.Prediction)
    assert isinstance(found["fit"], monodyn.Fit)
