"""Which module imports which, and whether that keeps to the tables of rooms; for ``test_architecture.py``."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path


@dataclass(frozen=True)
class Place:
    """Where the tables put a room, or a part of a room.

    Attributes:
        row: Its row; arrows point to rows of smaller number.
        line: Line of the document; what shares a line counts as one room.
    """

    row: int
    line: int


@dataclass(frozen=True)
class Tree:
    """Modules below one folder.

    Attributes:
        folder: The folder.
        package: Name that its modules are imported by; empty where they are imported by their own names.
    """

    folder: Path
    package: str = ""

    @cached_property
    def modules(self) -> dict[str, Path]:
        """Every module by its dotted name; a package by that of its folder."""
        found = {}
        for path in sorted(self.folder.rglob("*.py")):
            parts = path.relative_to(self.folder).with_suffix("").parts
            dotted = ".".join(part for part in (self.package, *parts) if part)
            found[dotted.removesuffix(".__init__")] = path
        return found

    def imports(self, path: Path) -> list[tuple[int, str]]:
        """List line and name of every import of the tree, within functions too, as the name that is reached.

        ``from package.room import module`` gives ``package.room.module`` where that is a module, otherwise
        ``package.room``, which then holds the imported name.

        Args:
            path: One of the modules.
        """
        modules = self.modules
        package = (self.package, *path.relative_to(self.folder).with_suffix("").parts)
        found = []
        for node in _importing(path):
            for name in _named(node, [part for part in package if part]):
                within = self.package and name.split(".")[0] == self.package
                if within or name in modules or name.rpartition(".")[0] in modules:
                    reached = name if name in modules else name.rpartition(".")[0] or name
                    found.append((node.lineno, reached))  # type: ignore[attr-defined]
        return found


@cache
def _importing(path: Path) -> list[ast.AST]:
    """Parse a module, once, and return what may import something in it."""
    kinds = ast.Import | ast.ImportFrom | ast.Call
    return [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, kinds)]


def _named(node: ast.AST, here: list[str]) -> list[str]:
    """Return the dotted names that a statement or call imports; ``here`` is the importing module."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom):
        package = here[: -node.level] if node.level else []
        origin = ".".join([*package, *([node.module] if node.module else [])])
        return [f"{origin}.{alias.name}".strip(".") for alias in node.names]
    if isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
        called = getattr(node.func, "attr", getattr(node.func, "id", ""))
        name = node.args[0].value
        if called in ("import_module", "__import__") and isinstance(name, str):
            dots = len(name) - len(name.lstrip("."))
            return [".".join([*(here[:-dots] if dots else []), name.lstrip(".")])]
    return []


def places(text: str) -> dict[str, Place]:
    """Read the place of every room and of every part of a room from the tables of a document.

    Args:
        text: Markdown with tables: a number in the first column, names in backquotes in the second.
    """
    found: dict[str, Place] = {}
    for number, line in enumerate(text.splitlines()):
        match = re.match(r"\|\s*(\d+)\s*\|([^|]*)\|", line)
        if match:
            found.update(dict.fromkeys(re.findall(r"`([\w.]+)`", match[2]), Place(int(match[1]), number)))
    return found


def upward(tree: Tree, path: Path, table: dict[str, Place]) -> Iterator[str]:
    """Yield a complaint for each import of a module that does not point to a smaller row.

    Between rooms their rows count, between parts of one room the rows of the parts.

    Args:
        tree: All modules.
        path: The module.
        table: Place of every room and part.
    """
    module = ".".join(path.relative_to(tree.folder).with_suffix("").parts)
    own, own_part = _room(module, table)
    for line, name in tree.imports(path):
        target = name.removeprefix(tree.package).lstrip(".")
        if not target:
            if own != "cli":
                yield f"{module}:{line} imports the whole package."
            continue
        room, part = _room(target, table)
        if room not in table:
            yield f"{module}:{line} imports {name}, which is no room of the table."
            continue
        ours, theirs = (own_part, part) if room == own else (own, room)
        apart = bool(ours and theirs) and table[ours].line != table[theirs].line
        if apart and table[theirs].row >= table[ours].row:
            high, low = table[theirs].row, table[ours].row
            yield f"{module}:{line}: '{ours}' (row {low}) may not import '{name}' of row {high}."


def _room(module: str, table: dict[str, Place]) -> tuple[str, str]:
    """Return the room of a module, and its part of that room; empty where the room has no parts."""
    # ``python -m monodyn`` is the command
    parts = module.replace("__main__", "cli").split(".")
    part = ".".join(parts[:2])
    return parts[0], part if part in table else ""


def circle(tree: Tree) -> list[str]:
    """Return the modules of one circle of imports, its first module again at the end; empty without one.

    Args:
        tree: All modules.
    """
    modules = tree.modules
    arrows = {
        module: sorted({name for _, name in tree.imports(path) if name in modules and name != module})
        for module, path in modules.items()
    }
    # a package whose __init__ gathers names for users is not followed to the modules that it gathers
    arrows |= {module: [] for module, path in modules.items() if path.name == "__init__.py"}
    done: set[str] = set()

    def walk(module: str, above: list[str]) -> list[str]:
        if module in above:
            return [*above[above.index(module) :], module]
        if module in done:
            return []
        for target in arrows[module]:
            found = walk(target, [*above, module])
            if found:
                return found
        done.add(module)
        return []

    return next((found for module in arrows if (found := walk(module, []))), [])
