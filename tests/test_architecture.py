"""The table of rooms in docs/architecture.md is the rule that the imports follow."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "monodyn"


def rows() -> dict[str, tuple[int, int]]:
    """Read the row of each room and of each part of a room, and its line: what shares a line is one room."""
    found: dict[str, tuple[int, int]] = {}
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    for number, line in enumerate(text.splitlines()):
        match = re.match(r"\|\s*(\d+)\s*\|([^|]*)\|", line)
        if match:
            found.update(dict.fromkeys(re.findall(r"`([\w.]+)`", match[2]), (int(match[1]), number)))
    return found


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
            found += [(node.lineno, f"{node.module}.{alias.name}") for alias in node.names]
    return [(line, name) for line, name in found if name.split(".")[0] == "monodyn"]


def test_the_tables_name_every_room_and_part() -> None:
    named = rows()
    here = {p.stem for p in SOURCE.glob("*.py")} | {p.parent.name for p in SOURCE.glob("*/__init__.py")}
    assert here - {"__init__", "__main__"} == {name for name in named if "." not in name}
    for room in {name.partition(".")[0] for name in named if "." in name}:
        folder = SOURCE / room
        parts = {p.stem for p in folder.glob("*.py")} | {p.parent.name for p in folder.glob("*/__init__.py")}
        assert {f"{room}.{part}" for part in parts - {"__init__"}} == {
            name for name in named if name.startswith(f"{room}.")
        }


def test_the_tables_name_every_module_of_a_divided_room() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    for line in text.splitlines():
        match = re.match(r"\|\s*\d+\s*\|\s*`((?:vision|estimation)\.\w+)`\s*\|([^|]*)\|", line)
        folder = SOURCE / match[1].replace(".", "/") if match else SOURCE / "none"
        if match and folder.is_dir():
            modules = {p.stem for p in folder.glob("*.py")} - {"__init__"}
            assert set(re.findall(r"`(\w+)`", match[2].split(":")[0])) == modules, match[1]


def _place(named: dict[str, tuple[int, int]], module: str) -> tuple[str, str]:
    """Return the room of a dotted module below ``monodyn``, and its part of that room or an empty string."""
    parts = module.split(".")
    part = ".".join(parts[:2])
    return parts[0], part if part in named else ""


@pytest.mark.parametrize("path", sorted(SOURCE.rglob("*.py")), ids=lambda p: str(p.relative_to(SOURCE)))
def test_imports_point_up_the_tables(path: Path) -> None:
    named = rows()
    module = ".".join(path.relative_to(SOURCE).with_suffix("").parts)
    own, own_part = _place(named, module)
    if own == "__init__":
        return
    for line, name in imports(path):
        target = name.partition(".")[2]
        if not target:
            assert own == "cli", f"{module}:{line} imports the whole package."
            continue
        room, part = _place(named, target)
        assert room in named, f"{module}:{line} imports {name}, which is no room of the table."
        ours, theirs = (own_part, part) if room == own else (own, room)
        if ours and theirs and named[ours][1] != named[theirs][1]:
            assert named[theirs][0] < named[ours][0], f"{module}:{line}: '{ours}' may not import '{name}'."


def test_no_circle_of_imports() -> None:
    """No module reaches itself, by imports at its top or inside of its functions."""
    modules = {}
    for path in sorted(SOURCE.rglob("*.py")):
        module = ".".join(("monodyn", *path.relative_to(SOURCE).with_suffix("").parts))
        modules[module.removesuffix(".__init__")] = path
    arrows = {
        module: {name for _, name in imports(path) if name in modules and name != module}
        for module, path in modules.items()
        if path.name != "__init__.py"
    }
    done: set[str] = set()
    for start in arrows:
        _walk(start, (), arrows, done)


def _walk(module: str, above: tuple[str, ...], arrows: dict[str, set[str]], done: set[str]) -> None:
    assert module not in above, f"circle: {' -> '.join((*above[above.index(module) :], module))}"
    if module not in done:
        for target in sorted(arrows.get(module, ())):
            _walk(target, (*above, module), arrows, done)
        done.add(module)


@pytest.mark.parametrize("path", sorted(SOURCE.rglob("*.py")), ids=lambda p: str(p.relative_to(SOURCE)))
def test_only_three_rooms_know_the_published_method(path: Path) -> None:
    module = path.relative_to(SOURCE).with_suffix("").parts
    if module[0] not in ("paper", "settings", "stages", "reproduce"):
        assert not [name for _, name in imports(path) if name.startswith("monodyn.paper")]


def test_importing_the_package_loads_nothing_heavy() -> None:
    import subprocess
    import sys

    code = (
        "import sys, monodyn; print([m for m in sys.modules if m in ('numpy','numba','mujoco','cv2','av')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
