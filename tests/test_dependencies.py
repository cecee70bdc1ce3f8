"""What is imported is declared, what is declared is imported, and the main job needs no extra."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "monodyn"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

PACKAGES = {"mujoco": "mujoco-core", "cv2": "opencv-python-headless"}
"""Packages that are not called as what is imported of them."""
BESIDE = {"markupsafe": "jinja2", "llvmlite": "numba"}
"""What comes with a package that is declared."""
EXTRAS = {
    "scipy": ("control", "paper"),
    "control": ("control",),
    "h5py": ("hdf5",),
    "matplotlib": ("plots",),
    "pandas": ("tables",),
    "xarray": ("tables",),
    "waitress": ("live",),
}
"""What only extras need."""
INTERNAL = {"bench", "dev", "test-clients"}
"""Extras for those who work on the program."""
SCIPY = {
    "optimize/bfgs.py", "optimize/evolution.py", "paper/starts.py", "paper/pose_series.py", "settings.py",
    "results/caveats.py", "results/regulator.py", "results/shot.py", "results/swing.py",
}  # fmt: skip
"""Where scipy may be imported: in what the published method and controllers alone need."""


def declared(requirements: list[str]) -> set[str]:
    return {re.split(r"[\[<>=]", each)[0] for each in requirements}


def imports(path: Path) -> Iterator[str]:
    """Yield the packages that a file imports, by any way of importing."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
            yield node.module.partition(".")[0]
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
            yield from (each.value.partition(".")[0] for each in node.args if isinstance(each, ast.Constant))


FOUND = {
    path.relative_to(SOURCE).as_posix(): set(imports(path)) - sys.stdlib_module_names - {"monodyn"}
    for path in sorted(SOURCE.rglob("*.py"))
}
"""Foreign packages by file."""


def test_every_import_is_declared_and_every_dependency_imported() -> None:
    used = {BESIDE.get(name, name) for names in FOUND.values() for name in names} - set(EXTRAS)
    assert {PACKAGES.get(name, name) for name in used} == declared(PROJECT["dependencies"])


@pytest.mark.parametrize("name", EXTRAS)
def test_what_only_extras_need_is_in_them(name: str) -> None:
    extras = PROJECT["optional-dependencies"]
    assert {extra for extra in set(extras) - {"bench", "dev"} if name in declared(extras[extra])} == set(
        EXTRAS[name]
    )
    assert set(EXTRAS[name]) <= set(re.findall(r"\w+", extras["dev"][0]))


BUILDING = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]["requires"]


def test_versions_are_minima() -> None:
    extras = PROJECT["optional-dependencies"]
    stated = [
        *BUILDING,
        *PROJECT["dependencies"],
        *(one for name in set(extras) - {"dev"} for one in extras[name]),
    ]
    assert [each for each in stated if not re.fullmatch(r"[\w.-]+(\[\w+\])?>=[\d.]+", each)] == []


def test_the_pages_on_installing_name_every_package_and_extra() -> None:
    text = (ROOT / "docs" / "installing.md").read_text(encoding="utf-8")
    said = set(re.findall(r"^\| `?([\w-]+)", text, re.MULTILINE))
    assert declared(PROJECT["dependencies"]) | set(PROJECT["optional-dependencies"]) - INTERNAL <= said


def test_scipy_is_needed_by_extras_alone() -> None:
    assert {path for path, names in FOUND.items() if "scipy" in names} == SCIPY


@pytest.mark.slow
def test_kernels_need_no_scipy() -> None:
    """Numba takes products of matrices, and what is in numpy.linalg, from scipy."""
    for path in SOURCE.rglob("*.py"):
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(function, ast.FunctionDef):
                continue
            if not any("njit" in ast.unparse(each) for each in function.decorator_list):
                continue
            for node in ast.walk(function):
                product = isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult)
                algebra = isinstance(node, ast.Attribute) and node.attr in ("linalg", "dot", "vdot")
                assert not any((product, algebra)), f"{path.relative_to(SOURCE)}: {ast.unparse(node)}"
