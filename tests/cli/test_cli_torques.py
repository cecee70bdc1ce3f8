"""Torque models from the outside: the files they add, and options that do not fit together."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from support import EXAMPLES, command

MODEL = EXAMPLES / "double.xml"


def test_free_torques_have_a_table_and_held_sizes(tmp_path: Path) -> None:
    truth = json.loads((EXAMPLES / "double.json").read_text(encoding="utf-8"))
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


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--fix torque.period=1", "torque.period': a torque over time belongs to --identify.torque fourier"),
        ("--identify.torque free --fix joint1.torque.3=1", "a torque over time cannot be chosen"),
        ("--identify.terms 3", "expected --identify.torque fourier with them"),
        ("--identify.series alone", "expected --identify.torque fourier with them"),
        ("--method paper --identify.gains 0.4 0.1 0.5", "eq. 7"),
        ("--identify.gains 0.4 0.1 0.04", "belongs to --identify.method paper"),
        ("--identify.rates", "belong to --identify.method paper"),
        ("--locate.start evolution", "belongs to locate.method paper"),
        ("--method paper --free camera.focal", "camera.method paper estimates"),
        ("--identify.torque fourier --fix torque.period=-1", "above 0"),
        ("--identify.torque fourier --bounds torque.period=6:5", "expected the lower bound first"),
    ],
)
def test_options_that_do_not_fit_are_refused_before_the_clip_is_read(words: str, said: str) -> None:
    done = command("run", EXAMPLES / "double.mp4", "--model", MODEL, "--out", "never", *words.split())
    assert done.code == 2
    assert said in done.err
    assert "background" not in done.err  # no frame was read
    assert not Path("never").exists()


def test_a_period_may_be_bounded_anywhere(tmp_path: Path) -> None:
    time = np.arange(60) / 30.0
    lines = [f"{t!r},{q!r}" for t, q in zip(time.tolist(), (0.5 * np.sin(5.0 * time)).tolist(), strict=True)]
    poses = tmp_path / "poses.csv"
    poses.write_text("\n".join(["time,joint1", *lines]), encoding="utf-8")
    words = ("--identify.torque", "fourier", "--bounds", "torque.period=0.2:0.4")
    done = command("identify", poses, "--model", "single", *words)
    assert done.code in (0, 1)  # whatever comes of it, the bounds are no bad input
    assert "Traceback" not in done.err
