"""What the documentation says exists, and what exists is documented."""

from __future__ import annotations

import inspect
import re
from functools import reduce
from pathlib import Path

import pytest

import monodyn
from monodyn.cli.options import COMMANDS, parsed

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "monodyn"
README = (ROOT / "README.md").read_text(encoding="utf-8")
ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")


def shell_lines() -> list[str]:
    blocks = re.findall(r"```sh\n(.*?)```", README, re.DOTALL)
    return [line.strip() for block in blocks for line in block.splitlines() if line.strip()]


def public_functions() -> list[str]:
    """Name the public functions and the public methods of the public classes."""
    found = []
    for name in monodyn.__all__:
        value = getattr(monodyn, name)
        if inspect.isfunction(value):
            found.append(name)
        elif inspect.isclass(value):
            methods = inspect.getmembers(value, inspect.isfunction)
            own = [m for m, f in methods if not m.startswith("_") and f.__module__.startswith("monodyn.")]
            found += [f"{name}.{method}" for method in own]
    return found


@pytest.mark.parametrize("name", monodyn.__all__)
def test_public_names_load_and_have_a_docstring(name: str) -> None:
    value = getattr(monodyn, name)
    if name != "__version__":
        assert (inspect.getdoc(value) or "").strip()


def test_unknown_names_are_refused_with_the_known_ones() -> None:
    with pytest.raises(
        AttributeError, match=r"^module 'monodyn' has no attribute 'nothing'; public names: .*track"
    ):
        monodyn.nothing  # noqa: B018


@pytest.mark.parametrize("name", public_functions())
def test_docstrings_name_every_argument(name: str) -> None:
    function = reduce(getattr, name.split("."), monodyn)
    text = inspect.getdoc(function)
    assert text, f"{name} has no docstring."
    arguments = [a for a in inspect.signature(function).parameters if a not in ("self", "cls")]
    missing = [a for a in arguments if not re.search(rf"\b{a}\b", text)]
    assert not missing, f"{name} says nothing of {missing}."


@pytest.mark.parametrize("line", [line for line in shell_lines() if line.startswith("monodyn ")])
def test_commands_in_the_readme_parse(line: str) -> None:
    command, *words = line.split()[1:]
    assert command in COMMANDS
    assert isinstance(parsed(command, words), COMMANDS[command][0])


def test_make_targets_in_the_readme_exist() -> None:
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    named = set(re.findall(r"`make (\w+)`", README)) | {
        line.split()[1] for line in shell_lines() if line.startswith("make ")
    }
    assert {"demo", "test", "check", "fmt", "bench", "docs"} <= named <= targets


def test_files_in_the_readme_exist() -> None:
    named = set(re.findall(r"(?:examples|docs)/[\w./]+", README))
    assert named
    assert all((ROOT / name).exists() for name in named)


def test_verbs_in_the_documents_exist() -> None:
    for name in re.findall(r"monodyn\.(\w+)\(", README + ARCHITECTURE):
        assert name in monodyn.__all__


def test_the_run_folder_in_the_readme_is_the_one_written() -> None:
    from monodyn.results.folder import FILES

    table = README.split("### The run folder")[1].split("Exit codes")[0]
    assert set(re.findall(r"`(\w+\.\w+)`", table)) == set(FILES)


def test_no_file_is_too_long() -> None:
    # one file, one idea: 400 lines, with a tenth to spare
    for path in SOURCE.rglob("*.py"):
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 440, path.name


def test_equations_name_functions_and_tests_that_exist():
    from importlib import import_module

    text = (ROOT / "docs" / "equations.md").read_text(encoding="utf-8")
    rows = [line.split(" | ") for line in text.splitlines() if line.startswith("| ") and " | `" in line]
    assert len(rows) >= 25
    for row in rows:
        for name in re.findall(r"`([\w.]+)`", row[1]):
            module, _, function = name.rpartition(".")
            assert hasattr(import_module(f"monodyn.{module}"), function), name
        file = ""
        for mention in re.findall(r"`([^`]+)`", row[2]):
            file, test = mention.split(": ") if ": " in mention else (file, mention)
            path = next((ROOT / "tests").rglob(file))
            assert f"def {test}(" in path.read_text(encoding="utf-8"), mention
        assert ": test_" in row[2], row[0]
