"""The examples do what they say."""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("balance_cartpole", "the true one stays up: in the last second it is within"),
        ("swing_up_pendubot", "the true one is swung up and stays up: in the last"),
    ],
)
def test_a_true_mechanism_is_controlled_by_what_was_measured(
    name: str, said: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # as ``python examples/NAME.py`` has it
    monkeypatch.syspath_prepend(str(EXAMPLES))
    example = runpy.run_path(str(EXAMPLES / f"{name}.py"))
    assert example["main"]() == 0
    lines = capsys.readouterr().out.splitlines()
    assert said in lines
    assert lines[0].startswith("Identified from ")


DRAWS = "import mujoco; mujoco.Renderer(mujoco.MjModel.from_xml_string('<mujoco/>'), 8, 8).close()"
"""Fails where no OpenGL draws without a screen."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["cartpole", "pendubot"])
def test_what_is_only_seen_is_swung_up_and_held(kind: str) -> None:
    # the pictures' OpenGL is chosen when MuJoCo is loaded: in a process of its own
    environment = {"MUJOCO_GL": "egl", **os.environ}
    tried = subprocess.run([sys.executable, "-c", DRAWS], capture_output=True, env=environment)
    if tried.returncode:
        pytest.skip("no OpenGL draws without a screen: MUJOCO_GL=egl or osmesa")
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / "balance_live.py"), kind],
        capture_output=True, text=True, env=environment,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    lines = done.stdout.splitlines()
    assert lines[-1] == "the true one is swung up and stays up"
    begun = next(line for line in lines if line.endswith("brings it to rest"))
    assert float(begun.split()[0]) < 5.1
