"""``monodyn reproduce``: its options, and its table."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from monodyn.cli import reproduced
from monodyn.cli.parse import parsed
from monodyn.cli.reproduced import ReproduceOptions
from monodyn.errors import SettingsError
from support import refuses


def test_options() -> None:
    found = parsed("reproduce", ["--out", "page", "--clip", "a.mp4", "--model", "double", "--seed", "3"])
    assert found == ReproduceOptions(Path("page"), Path("a.mp4"), "double", seed=3)
    with refuses(SettingsError, "seed: expected 0 or more, got -1; give a whole number."):
        ReproduceOptions(Path("page"), seed=-1).go()


def test_the_table_stands_in_columns_and_each_claim_has_its_verdicts(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from monodyn.reproduce import tables
    from monodyn.reproduce.vision import TITLES

    rows = (["case", "method", "torque", "rms"], [["1", "paper", "none", "0.5"], ["2", "fast", "none", "12"]])
    monkeypatch.setattr(tables, "plain_rows", lambda cases, joints: rows)
    method, other = list(TITLES)[:2]
    verdicts = {method: SimpleNamespace(held=True), other: SimpleNamespace(held=None)}
    made: Any = SimpleNamespace(
        cases=[SimpleNamespace(clip_period=True)],
        joints=("joint1",),
        claims=[SimpleNamespace(text="The error falls:", verdicts=verdicts)],
        seconds=12.4,
        folder=Path("page"),
    )
    reproduced._print(made)
    assert capsys.readouterr().out.splitlines() == [
        "case  method  torque  rms",
        "1     paper   none    0.5",
        "2     fast    none     12",
        f"{tables.STAR} the period is that of the whole clip, predicted frames included",
        "",
        f"The error falls: {TITLES[method]} held, {TITLES[other]} no verdict.",
        "",
        "12 s. page: page/reproduce.html",
    ]
