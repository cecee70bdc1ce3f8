"""Where compiled functions are kept, and how a process of the command line loads them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from monodyn import errors
from monodyn.cli import compiled, main


def test_compiled_functions_go_to_a_temporary_folder_when_no_other_can_be_written(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "cache"))
    (tmp_path / "file").write_text("", encoding="utf-8")
    monkeypatch.setattr(compiled.tempfile, "gettempdir", lambda: str(tmp_path))
    said = compiled.keep_compiled()
    chosen = Path(os.environ["NUMBA_CACHE_DIR"])
    assert said == (f"no usual folder for compiled functions can be written; they are kept in '{chosen}'.")
    assert chosen.parent == tmp_path
    assert chosen.stat().st_mode & 0o077 == 0
    assert compiled.keep_compiled() == ""


def test_what_fails_as_compiled_functions_are_kept_is_an_error_of_ours() -> None:
    """Only a file that is read can be damaged."""
    raised = {}
    for name in ("_load_index", "save_overload"):
        source = compile(f"def {name}():\n    raise EOFError\n", "/lib/numba/core/caching.py", "exec")
        there: dict[str, Any] = {}
        exec(source, there)
        with pytest.raises(EOFError) as caught:
            there[name]()
        raised[name] = caught.value
    assert errors.is_of_cache(raised["_load_index"])
    assert not errors.is_unforeseen(raised["_load_index"])
    assert not errors.is_of_cache(raised["save_overload"])
    assert errors.is_unforeseen(raised["save_overload"])


def test_a_damaged_program_is_that_of_a_compiled_function() -> None:
    """It is parsed where it is compiled into another function, and not where it is read."""
    from numba.core.registry import cpu_target

    from monodyn.cli.loaded import CalledLibrary

    context: Any = cpu_target.target_context
    library = CalledLibrary(context.codegen(), "damaged")
    library._bitcode = bytes(64)
    with pytest.raises(RuntimeError) as caught:
        library._get_module_for_linking()
    assert errors.is_of_cache(caught.value)
    assert not errors.is_unforeseen(caught.value)


@pytest.mark.slow
def test_functions_are_loaded_without_the_modules_of_numba_that_they_were_made_of(tmp_path: Path) -> None:
    """What is compiled beside them then loads these, and is loaded where functions are as numba does."""
    source = tmp_path / "kernels.py"
    source.write_text(MADE_OF_OTHERS)

    def run(how: str, code: str) -> None:
        begin = (
            f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import numpy as np; {how}; import kernels"
        )
        subprocess.run(
            [sys.executable, "-c", f"{begin}; x = np.eye(3) + 1.0; {code}"],
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "compiled")}, check=True, timeout=300,
        )  # fmt: skip

    calling = "from monodyn.cli.loaded import load_to_call; load_to_call()"
    modules = "{'numba.np.arraymath', 'numba.np.linalg', 'scipy.linalg'} & {*sys.modules}"
    refused = "kernels.said(kernels.{}) == ('below zero', -1.0) or 1 / 0"
    run("pass", "assert kernels.spread(x) == 4.5; assert len(kernels.spread.stats.cache_misses) == 1")
    run(
        calling,
        f"assert kernels.spread(x) == 4.5; assert not {modules};"
        "assert not kernels.spread.stats.cache_misses; assert abs(kernels.both(x) - 52.5) < 1e-9;"
        f"{refused.format('spread')}; {refused.format('both')};"
        f"assert len({modules}) == 3",
    )
    run(
        "pass",
        "assert abs(kernels.both(x) - 52.5) < 1e-9; assert not kernels.both.stats.cache_misses;"
        f"{refused.format('both')}",
    )


MADE_OF_OTHERS = """
import numpy as np
from numba import njit

@njit(cache=True)
def root(x):
    if x < 0.0:
        raise ValueError("below zero", x)
    return x ** 0.5

@njit(cache=True)
def spread(x):
    return x.max() + x.sum() / 6.0 + x[1:].min() - root(x[0, 1]) + 0.5

@njit(cache=True)
def both(x):
    return spread(x) + (x @ x).sum()

def said(kernel):
    try:
        kernel(np.eye(3) - 1.0)
    except ValueError as error:
        return error.args
"""
"""Functions that numba makes of others of its own."""


@pytest.mark.slow
@pytest.mark.parametrize("how", ["as numba does", "to call"])
def test_damaged_files_of_compiled_functions_are_removed(how: str, tmp_path: Path) -> None:
    """Power that fails while they are written leaves such files.

    In a process and with a folder of its own: all that is compiled for what is loaded is removed.
    """
    source = tmp_path / "kernels.py"
    source.write_text("from numba import njit\n@njit(cache=True)\ndef twice(x):\n    return 2 * x\n")
    found = subprocess.run(
        [sys.executable, "-c", DAMAGED, str(source), how],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "compiled")},
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert found.stderr == (
        "monodyn: files of compiled functions were damaged (UnpicklingError), and were removed; the next "
        "command compiles them anew.\n"
    )
    assert found.returncode == 2


DAMAGED = """
import importlib.util, os, sys
from pathlib import Path
from monodyn.cli import main, show

source = Path(sys.argv[1])
if sys.argv[2] == "to call":
    from monodyn.cli.loaded import load_to_call

    load_to_call()

def loaded():
    spec = importlib.util.spec_from_file_location("monodyn.kernels", source)
    sys.modules["monodyn.kernels"] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.twice

assert loaded()(2) == 4
kept = [*source.parent.rglob("kernels.twice*.nbi"), *source.parent.rglob("kernels.twice*.nbc")]
assert len(kept) == 2
for file in kept:
    os.truncate(file, 10)
show.show_models = lambda **_: loaded()(2)
code = main(["models"])
assert not any(file.exists() for file in kept)
assert loaded()(2) == 4
sys.exit(code)
"""
"""Kernels are compiled, their files cut, and loaded by a command."""


@pytest.mark.parametrize(
    ("quiet", "made", "told"), [(False, False, True), (True, False, False), (False, True, False)]
)
def test_who_waits_for_the_compiler_is_told(
    quiet: bool, made: bool, told: bool,
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    if made:
        (tmp_path / "mechanism").mkdir()
        (tmp_path / "mechanism" / "planar.rollouts-1.py311.nbi").touch()
    assert compiled.compiled_before() is made
    assert main(["predict", str(tmp_path / "missing"), *(["--quiet"] if quiet else [])]) == 2
    said = "monodyn: the inner loops are compiled now, once: two to five minutes on two idle cores.\n"
    assert capsys.readouterr().err.startswith(said) is told


KERNELS = """
import numpy as np
from numba import njit

@njit(cache=True)
def twice(x):
    return 2.0 * x

@njit(cache=True)
def scaled(x, count):
    # what takes memory calls numba's own functions
    ones = np.ones(count)
    for one in ones:
        x = twice(x) * one
    return x
"""
LOADED = """
import json, sys

if "to call" in sys.argv:
    from monodyn.cli.loaded import load_to_call

    load_to_call()
from numba import njit
from numba.core.registry import cpu_target
import kernels

values = [kernels.scaled(3.0, 4)]
library = kernels.scaled.overloads[kernels.scaled.signatures[0]].library
def waits():
    return [library._shared_module is None, not cpu_target.target_context._registries]

loaded, waiting = len(kernels.scaled.stats.cache_hits), [waits()]
if "into others" in sys.argv:
    # two that are compiled anew take it into themselves
    values.append(njit(lambda x, count: kernels.scaled(x, count) + 1.0)(5.0, 2))
    values.append(njit(lambda count: kernels.scaled(1.0, count))(3))
    waiting.append(waits())
print(json.dumps([values, loaded, waiting]))
"""


def test_what_only_the_compiler_needs_waits_until_something_is_compiled(tmp_path: Path) -> None:
    (tmp_path / "kernels.py").write_text(KERNELS)
    own = {"NUMBA_CACHE_DIR": str(tmp_path / "compiled"), "PYTHONPATH": str(tmp_path)}

    def done(*words: str) -> list[Any]:
        found = subprocess.run(
            [sys.executable, "-c", LOADED, *words], env={**os.environ, **own},
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        return json.loads(found.stdout)

    there, waits = [False, False], [True, True]
    assert done("to call") == [[48.0], 0, [there]]
    assert done("to call") == [[48.0], 1, [waits]]
    assert done("to call", "into others") == [[48.0, 21.0, 8.0], 1, [waits, there]]
    # as numba loads it, to which the above is the exception
    assert done() == [[48.0], 1, [there]]


@pytest.mark.slow
def test_ctrl_c_while_llvm_takes_a_program_does_not_have_it_destroyed_twice() -> None:
    """In a process of its own, which ends by a fault without owners that are noted before."""
    found = subprocess.run(
        [sys.executable, "-c", STOPPED], capture_output=True, text=True, timeout=300, check=False
    )
    assert found.returncode == 0, found.stderr
    assert found.stdout == "LLVMPY_LinkModules LLVMPY_AddModule\n"


STOPPED = """
import gc
from llvmlite import binding
from llvmlite.binding import executionengine, ffi
from numba.core.registry import cpu_target

from monodyn.cli.owners import note_owners_before

# LLVM is made ready
cpu_target.target_context.codegen()
note_owners_before()

def program(name):
    return binding.parse_assembly(f"define i32 @{name}() {{ ret i32 7 }}")

def stopped(name, job):
    # Ctrl-C waits until LLVM is done
    done = getattr(ffi.lib, name)
    def call(*given):
        done(*given)
        raise KeyboardInterrupt
    ffi.lib._fntab[name] = call
    try:
        job()
    except KeyboardInterrupt:
        return name
    finally:
        ffi.lib._fntab[name] = done

machine = binding.Target.from_default_triple().create_target_machine()
engine = executionengine.create_mcjit_compiler(program("first"), machine)
into, other, given = program("into"), program("other"), program("given")
names = [
    stopped("LLVMPY_LinkModules", lambda: into.link_in(other)),
    stopped("LLVMPY_AddModule", lambda: engine.add_module(given)),
]
assert {one.name for one in into.functions} == {"into", "other"}
del other, given
gc.collect()
engine.finalize_object()
assert engine.get_function_address("given")
engine.close()
into.close()
print(*names, flush=True)
"""
"""Ctrl-C comes as soon as LLVM has taken a program; then all that has an owner is destroyed."""
