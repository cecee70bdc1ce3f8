"""The examples do what they say."""

from __future__ import annotations

import runpy

import pytest

from support import EXAMPLES


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
