"""Tests of the harness of bad input: that it sees faults, and that a slice of its cases has none."""

from __future__ import annotations

import json
import signal
from pathlib import Path

import pytest

import fuzz
import mutations


def test_draws_the_same_cases_again() -> None:
    kinds = tuple(fuzz.KINDS)
    assert list(fuzz.drawn_cases(40, 3, kinds)) == list(fuzz.drawn_cases(40, 3, kinds))
    assert {kind for kind, _ in fuzz.drawn_cases(400, 0, kinds)} == set(kinds)


def test_odd_names_are_names_of_files(tmp_path: Path) -> None:
    for name in mutations.ODD_NAMES:
        (tmp_path / name).write_text("", encoding="utf-8")
    assert len(list(tmp_path.iterdir())) == len(mutations.ODD_NAMES)


@pytest.mark.parametrize(
    ("code", "said", "fault"),
    [
        (1, "Traceback (most recent call last):\n  ...", "traceback"),
        (0, "x.py:3: RuntimeWarning: overflow", "noise"),
        (0, "[h264 @ 0x55d0] error while decoding MB 3 4", "noise"),
        (None, "", "hang"),
        (70, "", "exit code"),
        (-11, "", "exit code"),
        (2, f"monodyn: {'long ' * 500}", "long message"),
    ],
)
def test_sees_what_a_run_should_not_say(code: int | None, said: str, fault: str) -> None:
    assert [kind for kind, _ in fuzz.judged(fuzz.Case(("run",)), code, said)] == [fault]


def test_takes_a_refusal_and_a_signal_for_no_fault() -> None:
    killed = fuzz.Case(("run",), stop=(signal.SIGKILL, 1.0))
    assert not list(fuzz.judged(killed, -9, ""))
    assert not list(fuzz.judged(fuzz.Case(("run",)), 2, "monodyn: clip.mp4: expected a video."))


def test_sees_files_that_are_lost_changed_or_left(tmp_path: Path) -> None:
    (tmp_path / "work").mkdir()
    (tmp_path / "clip.mp4").write_bytes(b"clip")
    before = fuzz.snapshot(tmp_path)
    case = fuzz.Case(("run", "clip.mp4", "--out", "out"))
    assert not list(fuzz.lost(case, before, tmp_path))
    (tmp_path / "out").mkdir()
    for name, text in (("run.json", json.dumps({"files": ["run.json"]})), ("states.csv", "")):
        (tmp_path / "out" / name).write_text(text, encoding="utf-8")
    assert ["states.csv" in why for _, why in fuzz.lost(case, before, tmp_path)] == [True]
    (tmp_path / "out" / "states.csv").unlink()
    assert not list(fuzz.lost(case, before, tmp_path))
    (tmp_path / "clip.mp4").write_bytes(b"other")
    (tmp_path / "work" / "MUJOCO_LOG.TXT").write_text("", encoding="utf-8")
    assert [kind for kind, _ in fuzz.lost(case, before, tmp_path)] == ["lost or mixed"] * 2


def test_sees_a_folder_of_two_runs(tmp_path: Path) -> None:
    def digests(**files: str) -> dict[str, str]:
        for name, text in files.items():
            (tmp_path / "out" / name.replace("_", ".")).write_text(text, encoding="utf-8")
        return {n: d for n, d in fuzz.snapshot(tmp_path).items() if n.startswith("out/")}

    (tmp_path / "out").mkdir()
    old = digests(run_json=json.dumps({"files": ["fit.json", "run.json"]}), fit_json="1")
    assert "run.json" in fuzz.mixed(tmp_path / "out", old, digests(fit_json="2"))
    new = digests(run_json=json.dumps({"files": ["fit.json", "run.json"], "seed": 2}))
    assert fuzz.mixed(tmp_path / "out", old, new) == ""
    assert "states.csv" in fuzz.mixed(tmp_path / "out", old, digests(states_csv=""))
    assert "gone" in fuzz.mixed(tmp_path / "out", old, {})


def test_sees_what_is_trusted_and_wrong(tmp_path: Path) -> None:
    row = {"name": "link1.length", "value": 0.25, "std": 0.001, "free": True}
    document = {"grade": "trusted", "parameters": [row]}
    (tmp_path / "fit.json").write_text(json.dumps(document), encoding="utf-8")
    wrong, right = (fuzz.Case((), {"link1.length": true}) for true in (0.24, 0.2495))
    assert [kind for kind, _ in fuzz.misled(wrong, tmp_path)] == ["trusted and wrong"]
    assert not list(fuzz.misled(right, tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(fuzz.KINDS))
def test_a_slice_of_the_cases(kind: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    home = tmp_path_factory.getbasetemp() / "fuzz"
    good = fuzz.prepared(home / "good")
    for seed in (101, 102):
        assert fuzz.tried(kind, seed, good, home).faults == ()
