"""What the program changes of a process of its own, and leaves as it is in that of a caller."""

from __future__ import annotations

import subprocess
import sys

import pytest

from monodyn.cli import SELDOM

SAID = """
import gc, sys
from monodyn import cli, cores
calls, before = [], gc.get_threshold()
cores.share_one_heap = lambda: calls.append("shared")
code = cli.main({words})
print(code, calls, "as before" if gc.get_threshold() == before else gc.get_threshold(), file=sys.stderr)
"""


@pytest.mark.parametrize(
    ("words", "said"),
    [("None", f"0 ['shared'] {SELDOM}"), ("['models']", "0 [] as before")],
    ids=["own", "caller's"],
)
def test_heaps_and_garbage_are_those_of_whoever_has_the_process(words: str, said: str) -> None:
    code = SAID.format(words=words)
    done = subprocess.run([sys.executable, "-c", code, "models"], capture_output=True, text=True, check=True)
    assert done.stderr.splitlines()[-1] == said
