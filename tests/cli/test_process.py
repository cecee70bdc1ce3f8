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


LOADING = """
import sys
from monodyn import cli
code = cli.main({words})
from numba.core.registry import cpu_target
print(code, cpu_target.target_context.codegen()._library_class.__name__)
"""


@pytest.mark.parametrize(
    ("words", "said"),
    [("None", "2 CalledLibrary"), ("['predict', 'missing']", "2 JITCodeLibrary")],
    ids=["own", "caller's"],
)
def test_how_functions_are_loaded_is_changed_in_a_process_of_its_own_alone(words: str, said: str) -> None:
    code = LOADING.format(words=words)
    done = subprocess.run(
        [sys.executable, "-c", code, "predict", "missing"], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == said


def test_a_command_that_computes_nothing_does_not_load_the_compiler() -> None:
    code = "import sys; from monodyn import cli; cli.main(); print('numba' in sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code, "models"], capture_output=True, text=True, check=True)
    assert done.stderr.splitlines()[-1] == "False"
