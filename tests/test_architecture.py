"""The table of rooms in docs/architecture.md is the rule that the imports follow."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

from imports import Place, Tree, circle, places, upward

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "monodyn"
MONODYN = Tree(SOURCE, "monodyn")
ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
TABLE = places(ARCHITECTURE)
PAPER_USERS = ("paper", "settings", "stages", "reproduce")
"""The only rooms that may import ``paper``: itself and three more."""

KERNELS = tuple(
    f"mechanism/{name}"
    for name in ("planar", "tangents", "variational", "slopes", "brakes", "branches", "ahead", "reversals")
)
"""What stands behind the one door to motion."""

every_module = pytest.mark.parametrize(
    "path", sorted(SOURCE.rglob("*.py")), ids=lambda p: str(p.relative_to(SOURCE))
)


def parts_of(folder: Path) -> set[str]:
    """Name the modules and packages directly in a folder."""
    return {p.stem for p in folder.glob("*.py")} | {p.parent.name for p in folder.glob("*/__init__.py")}


def test_the_tables_name_every_room_and_part() -> None:
    assert parts_of(SOURCE) - {"__init__", "__main__"} == {name for name in TABLE if "." not in name}
    for room in {name.partition(".")[0] for name in TABLE if "." in name}:
        parts = parts_of(SOURCE / room) - {"__init__"}
        assert {f"{room}.{part}" for part in parts} == {n for n in TABLE if n.startswith(f"{room}.")}


def test_the_tables_name_every_module_of_a_folder() -> None:
    described = {}
    for line in ARCHITECTURE.splitlines():
        match = re.match(r"\|(?:\s*\d+\s*\|)?\s*`(\w+(?:\.\w+)?)`\s*\|([^|]*)\|", line)
        if match and (SOURCE / match[1].replace(".", "/")).is_dir():
            described[match[1]] = set(re.findall(r"`(\w+)`", match[2]))
    folders = {str(p.parent.relative_to(SOURCE)).replace("/", ".") for p in SOURCE.glob("**/__init__.py")} - {
        "."
    }
    for folder in folders - {"vision", "estimation"}:
        path = SOURCE / folder.replace(".", "/")
        assert {p.stem for p in path.glob("*.py")} - {"__init__"} <= described[folder], folder


@every_module
def test_imports_point_up_the_tables(path: Path) -> None:
    if path != SOURCE / "__init__.py":
        assert not list(upward(MONODYN, path, TABLE))


@every_module
def test_only_its_users_know_the_published_method(path: Path) -> None:
    room = path.relative_to(SOURCE).with_suffix("").parts[0]
    if room not in PAPER_USERS:
        assert not [name for _, name in MONODYN.imports(path) if f"{name}.".startswith("monodyn.paper.")]


@every_module
def test_motion_has_one_door(path: Path) -> None:
    """The kernels of the dynamics are called by ``mechanism.simulate`` and by one another, by nobody else."""
    module = str(path.relative_to(SOURCE).with_suffix(""))
    if module not in ("mechanism/simulate", *KERNELS):
        behind = {f"monodyn.{name.replace('/', '.')}" for name in KERNELS}
        assert not [name for _, name in MONODYN.imports(path) if name in behind]


@pytest.mark.parametrize(
    "tree", [MONODYN, Tree(ROOT / "benchmarks"), Tree(ROOT / "tests")], ids=lambda t: t.folder.name
)
def test_no_circle_of_imports(tree: Tree) -> None:
    """No module reaches itself, by imports at its top or inside of its functions."""
    assert " -> ".join(circle(tree)) == ""


@pytest.mark.parametrize(
    "text",
    [
        "import house.attic.beam",
        "from house import attic",
        "from house.attic import beam",
        "from house.attic.beam import NAIL",
        "from .. import attic",
        "from ..attic import beam",
        "def f():\n    from ..attic.beam import NAIL",
        "from importlib import import_module\nimport_module('house.attic.beam')",
        "import importlib\nimportlib.import_module('..attic.beam', __package__)",
    ],
)
def test_an_arrow_that_points_down_and_a_circle_are_found(text: str, tmp_path: Path) -> None:
    files = {
        "cellar/stone.py": text,
        "cellar/__init__.py": "",
        "attic/__init__.py": "from house.cellar import stone" if "beam" not in text else "",
        "attic/beam.py": "from house.cellar.stone import FLAT\nNAIL = FLAT",
    }
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(content, encoding="utf-8")
    house = Tree(tmp_path, "house")
    table = places("| 0 | `cellar` | |\n| 1 | `attic` | |\n")
    assert table == {"cellar": Place(0, 0), "attic": Place(1, 1)}
    assert list(upward(house, tmp_path / "attic/beam.py", table)) == []
    (complaint,) = set(upward(house, tmp_path / "cellar/stone.py", table))
    assert re.fullmatch(
        r"cellar\.stone:\d: 'cellar' \(row 0\) may not import 'house\.attic(\.beam)?' of row 1\.", complaint
    )
    if "beam" in text:
        assert circle(house) == ["house.attic.beam", "house.cellar.stone", "house.attic.beam"]


def test_parts_of_a_room_have_rows_of_their_own(tmp_path: Path) -> None:
    for name, content in {"low": "from house.room import high", "high": "", "outside": ""}.items():
        (tmp_path / "room").mkdir(exist_ok=True)
        (tmp_path / "room" / f"{name}.py").write_text(content, encoding="utf-8")
    table = places("| 0 | `room` | |\n\n| 0 | `room.low` | |\n| 1 | `room.high` | |\n")
    assert list(upward(Tree(tmp_path, "house"), tmp_path / "room" / "low.py", table)) == [
        "room.low:1: 'room.low' (row 0) may not import 'house.room.high' of row 1."
    ]


def test_importing_the_package_loads_nothing_heavy() -> None:
    code = (
        "import sys, monodyn; print([m for m in sys.modules if m in ('numpy','numba','mujoco','cv2','av')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("path", sorted((ROOT / "benchmarks").glob("*.py")), ids=lambda p: p.stem)
def test_benchmarks_import_names_that_exist(path: Path) -> None:
    """No test runs the benchmarks: a name that has moved would be found only when somebody measures."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("monodyn"):
            home = import_module(node.module or "")
            for alias in node.names:
                found = hasattr(home, alias.name) or find_spec(f"{node.module}.{alias.name}")
                assert found, f"{path.name}:{node.lineno}: no {alias.name} in {node.module}."
