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
    assert found == ReproduceOptions(out=Path("page"), clip=Path("a.mp4"), model="double", seed=3)
    found = parsed("reproduce", ["--out", "page", "--seeds", "5", "--truth", "t.json"])
    assert found == ReproduceOptions(out=Path("page"), truth=Path("t.json"), seeds=5)
    for seed in (-1, 2**64):
        with refuses(
            SettingsError, f"seed: expected 0 to 4294967295, got {seed}; give a whole number in between."
        ):
            ReproduceOptions(out=Path("page"), seed=seed).go()
    with refuses(SettingsError, "seeds: expected 1 to 20, got 21; give another number."):
        ReproduceOptions(out=Path("page"), seeds=21).go()
    with refuses(
        SettingsError, "seeds: expected none with --clip, which is one pendulum, got 2; leave it out."
    ):
        ReproduceOptions(out=Path("page"), clip=Path("a.mp4"), model="double", seeds=2).go()


def test_the_tables_stand_in_columns_and_each_claim_has_its_verdicts(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from monodyn.reproduce import tables

    rows = (["case", "method", "torque", "rms"], [["1", "paper", "none", "0.5"], ["2", "fast", "none", "12"]])
    monkeypatch.setattr(tables, "plain_rows", lambda repetition: rows)
    monkeypatch.setattr(tables, "legend", lambda repetitions: ["Errors are rms."])
    judged = {"paper": SimpleNamespace(words="held in 2 of 3"), "fast": SimpleNamespace(words="no verdict")}
    assumed = SimpleNamespace(name="It swings.", held=False, numbers="It stands.")
    clip = SimpleNamespace(name="clip.mp4", settings=None, assumptions=[assumed])
    made: Any = SimpleNamespace(
        notes=(),
        repetitions=[clip],
        claims=[SimpleNamespace(text="The error falls.", judged=judged)],
        seconds=12.4,
        folder=Path("page"),
    )
    reproduced._print(made)
    assert capsys.readouterr().out.splitlines() == [
        "clip.mp4",
        "case  method  torque  rms",
        "1     paper   none    0.5",
        "2     fast    none     12",
        "",
        "Errors are rms.",
        "",
        "Assumptions of the paper",
        "  does not hold   It swings. It stands.",
        "",
        "claim             published         default",
        "The error falls.  held in 2 of 3    no verdict",
        "",
        "12 s. page: page/reproduce.html",
    ]
