"""Commands that go on from a run: each is one that the program takes."""

from __future__ import annotations

import shlex

import monodyn
from controllable import identified as swung
from fits import identified, record
from monodyn.cli.parse import parsed
from monodyn.estimation.fit import Doubt
from monodyn.results.findings import Findings
from monodyn.results.log import RunLog
from monodyn.results.next_steps import next_steps
from monodyn.results.trace import trace_of
from monodyn.settings import RunSettings
from support import command


def test_every_command_is_understood():
    """Each one as it stands, of a pendulum and of a mechanism with a slide."""
    fit = identified()
    _, cart = swung("cartpole")
    commands = [step.command for one in (fit, cart) for step in next_steps(Findings(one))]
    words = [shlex.split(line) for line in commands]
    ours = [(word[1], word[2:]) for word in words if word[0] == "monodyn"]
    names = [name for name, _ in ours]
    assert names.count("predict") == 2
    assert names.count("identify") == 4
    assert names.count("control") == 1
    said = [step.what for step in next_steps(Findings(fit)) if step.what.startswith("Film it once more")]
    assert len(said) == 1
    for name, rest in ours:
        parsed(name, rest)
    assert sum(word[0] == "python" for word in words) == 2


def test_the_prediction_that_is_named_runs(tmp_path, monkeypatch):
    fit = identified()
    monodyn.report(fit, to=tmp_path / "run", poses=record(fit))
    monkeypatch.chdir(tmp_path / "run")
    line = next(step.command for step in next_steps(Findings(fit)) if "predict" in step.command)
    assert command(*shlex.split(line)[1:], "--quiet").code == 0
    assert (tmp_path / "run" / "ahead" / "prediction.csv").is_file()


def test_tables_are_found_from_the_folder_of_the_run(tmp_path, monkeypatch):
    """The command that takes both records is for another folder than that in which the table was named."""
    poses = record(identified(), 20)
    monodyn.write_poses(poses, tmp_path / "swing.csv")
    monkeypatch.chdir(tmp_path)
    log = RunLog("identify", {"model": "single", "poses 1": "swing.csv"}, RunSettings())
    steps = next_steps(Findings(identified(), log=log))
    line = next(step.command for step in steps if "again.csv" in step.command)
    assert shlex.split(line)[2] == str(tmp_path / "swing.csv")


def test_nothing_is_done_with_what_is_refused():
    fit = identified().doubted([Doubt("refused", "It is another mechanism.")])
    assert next_steps(Findings(fit, [trace_of(fit, record(fit))])) == []
