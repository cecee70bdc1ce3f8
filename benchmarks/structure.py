"""Print how the source is built: ``python benchmarks/structure.py [CHECKOUT]``.

Modules and imports by room, long files and functions, parameters, comments; of another checkout to compare.
"""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from collections import Counter
from pathlib import Path

LONG_FILE, LONG_FUNCTION, MANY_PARAMETERS = 400, 50, 6


def functions_of(tree: ast.Module) -> list[tuple[int, int, bool]]:
    """Return lines, parameters and whether it is compiled, of each function of a module.

    Args:
        tree: The module.
    """
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            arguments = [a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
            own = [name for name in arguments if name not in ("self", "cls")]
            compiled = any("jit" in ast.unparse(decorator) for decorator in node.decorator_list)
            found.append(((node.end_lineno or 0) - node.lineno + 1, len(own), compiled))
    return found


def comments_of(text: str) -> int:
    """Count the comments of a module, without those that are written for tools.

    Args:
        text: Its source.
    """
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    plain = (t.string.lstrip("# ") for t in tokens if t.type == tokenize.COMMENT)
    return sum(not comment.startswith(("fmt:", "noqa", "pyright", "pragma", "type:")) for comment in plain)


def imports_of(tree: ast.Module, modules: set[str]) -> set[str]:
    """Return the modules of the package that a module imports.

    Args:
        tree: The module.
        modules: All modules of the package.
    """
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            whole = [f"{node.module}.{alias.name}" for alias in node.names]
            found |= {name if name in modules else node.module or "" for name in whole}
    return found & modules


def main() -> None:
    """Print the figures of one checkout."""
    root = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parents[1]) / "src" / "monodyn"
    texts = {p.relative_to(root): p.read_text(encoding="utf-8") for p in sorted(root.rglob("*.py"))}
    trees = {".".join(("monodyn", *p.with_suffix("").parts)): ast.parse(t) for p, t in texts.items()}
    names = {name for name in trees if not name.endswith("__init__")}
    lines = sum(len(text.splitlines()) for text in texts.values())
    functions = [function for tree in trees.values() for function in functions_of(tree)]
    many = [compiled for _, count, compiled in functions if count > MANY_PARAMETERS]
    rows = {
        "lines of source": lines,
        f"files over {LONG_FILE} lines": sum(len(t.splitlines()) > LONG_FILE for t in texts.values()),
        "longest function": max(functions)[0],
        f"functions over {LONG_FUNCTION} lines": sum(n > LONG_FUNCTION for n, _, _ in functions),
        f"functions over {MANY_PARAMETERS} parameters": f"{len(many)}, {many.count(False)} not compiled",
        "comments per 1000 lines": f"{1e3 * sum(map(comments_of, texts.values())) / lines:.1f}",
    }
    for title, value in rows.items():
        print(f"{title:<30} {value}")
    rooms, arrows = Counter(name.split(".")[1] for name in names), Counter()
    for name in names:
        same = [n for n in imports_of(trees[name], names) if n.split(".")[1] == name.split(".")[1]]
        arrows[name.split(".")[1]] += len(set(same) - {name})
    for room in sorted(room for room in rooms if rooms[room] > 1):
        print(f"{room:<14} modules {rooms[room]:>3}, imports inside {arrows[room]:>4}")


if __name__ == "__main__":
    main()
