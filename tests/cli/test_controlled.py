"""``monodyn control``: its options, and what it prints."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

import monodyn
from controllable import identified
from monodyn.cli import controlled
from monodyn.cli.parse import parsed
from monodyn.estimation.fit import Doubt
from monodyn.results.controlled import Aim, control
from monodyn.results.regulator import Allowed
from support import command


def test_options_become_an_aim(monkeypatch: pytest.MonkeyPatch) -> None:
    words = (
        "run --at joint1=1.57,slide=0.1 --actuated slide --out up --swing --start joint1=-1.5 --limit "
        "slide=3 --within slide=-0.3:0.3 --seconds 2 --rate 100 --allowed "
        "effort=1,length=0.05 --draws 7 --seed 3 --no-film --force"
    )
    options = parsed("control", words.split())
    seen = {}

    def run(folder, out, aim, **how):
        seen.update(folder=folder, out=out, aim=aim, **how)
        return control(identified("cartpole")[1], Aim({"joint1": 1.57}, ["slide"], draws=0))

    monkeypatch.setattr("monodyn.results.controlled.control_run", run)
    assert replace(options, quiet=True).go() == 0
    assert seen.pop("progress") is None
    assert seen == {
        "folder": Path("run"),
        "out": Path("up"),
        "film": False,
        "force": True,
        "aim": Aim(
            at={"joint1": 1.57, "slide": 0.1}, actuated=("slide",), swing=True, start={"joint1": -1.5},
            limit={"slide": 3.0}, within={"slide": (-0.3, 0.3)}, seconds=2.0, rate=100.0,
            allowed=Allowed(length=0.05, effort=1.0), draws=7, seed=3,
        ),
    }  # fmt: skip


def test_what_was_found_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    found = control(identified("cartpole")[1], Aim({"joint1": 1.57}, ["slide"], draws=0))
    controlled._print(replace(found, folder=Path("up")))
    lines = capsys.readouterr().out.splitlines()
    gain = found.regulator.gain[0]
    assert lines[0].startswith("equilibrium: slide=")
    assert lines[0].endswith("joint1=1.5708")
    assert lines[1] == (
        f"gains of slide: slide {gain[0]:.5g}, joint1 {gain[1]:.5g}, slide_vel {gain[2]:.5g}, "
        f"joint1_vel {gain[3]:.5g}"
    )
    assert lines[2:-1] == [f"- {note}" for note in found.notes]
    assert lines[-1] == "plot: up/control.html"


def test_what_is_printed_goes_with_the_exit_code(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A quiet command that ends with 1 says why, as those that identify do."""
    _, fit = identified("cartpole")
    good = control(fit, Aim({"joint1": 1.57}, ["slide"], draws=0))
    fallen = replace(good, loop=replace(good.loop, balanced=False), push=None)
    doubted = replace(good, fit=fit.doubted([Doubt("refused", "It is another mechanism.")]))
    for found, code, said in (
        (good, 0, ""),
        (fallen, 1, "monodyn: In MuJoCo the identified mechanism does not stay balanced.\n"),
        (doubted, 1, "monodyn: It is another mechanism.\n"),
    ):
        monkeypatch.setattr("monodyn.results.controlled.control_run", lambda *_, one=found, **__: one)
        words = ["run", "--at", "joint1=1.57", "--actuated", "slide", "--quiet"]
        assert parsed("control", words).go() == code
        printed = capsys.readouterr()
        assert (printed.out, printed.err) == ("", said)
        assert parsed("control", [*words, "--json"]).go() == code
        document = json.loads(capsys.readouterr().out)
        assert document["gain"][0] == pytest.approx(found.regulator.gain[0].tolist())
        assert document["out"] is None


@pytest.mark.slow
def test_the_settings_file_of_a_controller_designs_it_again(tmp_path: Path) -> None:
    _, fit = identified("cartpole")
    monodyn.report(fit, to=tmp_path / "run")
    first, second = tmp_path / "first", tmp_path / "second"
    words = (
        "--at", "joint1=1.5708", "--actuated", "slide", "--start", "joint1=1.5", "--rate", 150,
        "--allowed", "effort=1,length=0.05", "--draws", 5, "--seed", 3,
        "--no-film",
    )  # fmt: skip
    done = command("control", tmp_path / "run", *words, "--out", first)
    again = command("control", "--config", first / "run.toml", "--out", second)
    assert (done.code, done.err, again.code) == (0, "", 0), again.err
    assert (second / "run.toml").read_text() == (first / "run.toml").read_text()
    assert (second / "control.json").read_bytes() == (first / "control.json").read_bytes()
    assert not (second / "control.mp4").exists()


def test_a_weight_of_another_name_is_refused() -> None:
    done = command("control", "run", "--at", "joint1=1", "--actuated", "slide", "--allowed", "torque=1")
    assert (done.code, done.out) == (2, "")
    assert done.err == (
        "monodyn: allowed: no weight is called 'torque'; weights: 'angle', 'length', 'rate', 'effort'.\n"
    )


def test_a_seed_below_zero_is_refused(tmp_path: Path) -> None:
    _, fit = identified("cartpole")
    monodyn.report(fit, to=tmp_path / "run")
    done = command("control", tmp_path / "run", "--at", "joint1=1.57", "--actuated", "slide", "--seed", "-1")
    assert (done.code, done.out) == (2, "")
    assert done.err == "monodyn: seed: expected 0 or more, got -1; give a whole number.\n"


def test_a_folder_that_is_no_run_is_refused(tmp_path: Path) -> None:
    done = command("control", tmp_path, "--at", "joint1=1", "--actuated", "slide")
    assert (done.code, done.out) == (2, "")
    assert done.err == (
        f"monodyn: '{tmp_path}': expected the folder of a run, got a folder without fit.json; name the one "
        "given as --out, of a run that came to a fit.\n"
    )
