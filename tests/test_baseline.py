"""A run of a benchmark next to an earlier one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from figures import Figure, finish, save, worse

RATIO = Figure("a clip", "tracking / decoding", 1.2, "times", 1.3)
FASTER = Figure("a fit", "another / ours", 80.0, "times", 50.0, least=True)
MEMORY = Figure("a run", "peak memory", 300.0, "MB", 400.0)
SECONDS = Figure("a run", "wall time", 2.0, "s", 3.0)
ASIDE = Figure("a clip", "decode", 0.5, "times")


@pytest.fixture
def baseline(tmp_path: Path) -> Path:
    path = tmp_path / "baseline.json"
    save([RATIO, FASTER, MEMORY, SECONDS, ASIDE], path)
    return path


def test_what_is_worse_by_more_than_a_quarter_is_named(baseline: Path) -> None:
    found = [replace(RATIO, value=1.51), replace(FASTER, value=63.0), replace(MEMORY, value=376.0)]
    assert list(worse(found, baseline)) == [
        "a clip, tracking / decoding: 1.51 times, 1.2 before",
        "a fit, another / ours: 63 times, 80 before",
        "a run, peak memory: 376 MB, 300 before",
    ]
    assert list(worse([replace(RATIO, value=float("nan"))], baseline))


def test_what_is_little_worse_or_depends_on_the_machine_is_not(baseline: Path) -> None:
    near = [replace(RATIO, value=1.49), replace(FASTER, value=65.0), replace(MEMORY, value=374.0)]
    other = [
        replace(SECONDS, value=20.0),
        replace(ASIDE, value=9.0),
        replace(RATIO, case="another", value=9.0),
    ]
    assert list(worse(near + other, baseline)) == []


def test_the_gate_fails_for_it(baseline: Path, capsys: pytest.CaptureFixture[str]) -> None:
    slow = replace(RATIO, value=1.2 * 1.3, target=2.0)
    assert finish([slow], to=None, gate=True, baseline=baseline) == 1
    assert "worse than the baseline: a clip" in capsys.readouterr().out
    assert finish([slow], to=None, gate=False, baseline=baseline) == 0
    assert finish([slow], to=None, gate=True) == 0
