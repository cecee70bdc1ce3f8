"""The table of rooms in docs/architecture.md is the rule that the imports follow."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "monodyn"


def rooms() -> dict[str, tuple[int, int]]:
    """Read the row of each room from the table, and its line: what shares a line is one room."""
    found: dict[str, tuple[int, int]] = {}
    for number, line in enumerate(
        (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8").splitlines()
    ):
        match = re.match(r"\|\s*(\d+)\s*\|([^|]*)\|", line)
        if match:
            found.update(dict.fromkeys(re.findall(r"`([\w.]+)`", match[2]), (int(match[1]), number)))
    return {name.removesuffix(".py").rstrip("/"): row for name, row in found.items()}


def imports(path: Path) -> list[tuple[int, str]]:
    """List the line and the monodyn module of every import, nested ones too."""
    module = path.relative_to(SOURCE).with_suffix("").parts
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [(node.lineno, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level:
            package = ("monodyn", *module)[: -node.level]
            found.append((node.lineno, ".".join([*package, node.module or ""]).rstrip(".")))
        elif isinstance(node, ast.ImportFrom) and node.module == "monodyn":
            found += [(node.lineno, f"monodyn.{alias.name}") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found.append((node.lineno, node.module or ""))
    return [(line, name) for line, name in found if name.split(".")[0] == "monodyn"]


def test_the_table_names_every_room() -> None:
    here = {p.stem for p in SOURCE.glob("*.py")} | {p.parent.name for p in SOURCE.glob("*/__init__.py")}
    assert here - {"__init__", "__main__"} == set(rooms())


@pytest.mark.parametrize("path", sorted(SOURCE.rglob("*.py")), ids=lambda p: str(p.relative_to(SOURCE)))
def test_imports_point_up_the_table(path: Path) -> None:
    rows = rooms()
    own = path.relative_to(SOURCE).with_suffix("").parts[0]
    if own == "__init__":
        return
    for line, name in imports(path):
        target = name.split(".")[1] if "." in name else "monodyn"
        if target == own or (own == "cli" and target == "monodyn"):
            continue
        assert target in rows, f"{path.name}:{line} imports {name}, which is no room of the table."
        together = rows[target] == rows[own]
        assert together or rows[target][0] < rows[own][0], (
            f"{path.name}:{line}: room '{own}' may not import '{name}'."
        )


def test_importing_the_package_loads_nothing_heavy() -> None:
    import subprocess
    import sys

    code = (
        "import sys, monodyn; print([m for m in sys.modules if m in ('numpy','numba','mujoco','cv2','av')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
