"""Every message that is raised on purpose is compared whole in some test."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "monodyn"
ERRORS = ("MonodynError", "MechanismError", "VideoError", "SettingsError", "FitError")
HOLE = "\0"
"""What stands for a value in a message."""


def text_of(node: ast.expr) -> str | None:
    """Return a string expression with ``HOLE`` for each value in it, or None for what is no string."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(HOLE if isinstance(part, ast.FormattedValue) else part.value for part in node.values)  # type: ignore[attr-defined]
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        left, right = text_of(node.left), text_of(node.right)
        return None if left is None and right is None else (left or HOLE) + (right or HOLE)
    return None


def raised() -> list[tuple[str, str]]:
    """List place and text of every message that is raised with its text beside it."""
    found = []
    for path in sorted(SOURCE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            call = node.exc if isinstance(node, ast.Raise) else None
            if not isinstance(call, ast.Call) or not call.args:
                continue
            name = getattr(call.func, "id", getattr(call.func, "attr", ""))
            text = text_of(call.args[0])
            if (name in ERRORS or name == "error") and text:
                found.append((f"{path.relative_to(SOURCE)}:{node.lineno}", text))
    return found


def told() -> str:
    """Collect the strings of all tests, one a line."""
    lines = []
    for path in sorted((ROOT / "tests").rglob("*.py")):
        if path.name == "test_messages.py":
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            text = text_of(node) if isinstance(node, ast.expr) else None
            if text and len(text) > 10:
                lines.append(text.replace("\n", " "))
    return "\n".join(lines)


TOLD = told()


@pytest.mark.parametrize(("place", "text"), raised(), ids=[place for place, _ in raised()])
def test_every_message_is_tested_whole(place: str, text: str) -> None:
    pattern = ".*?".join(re.escape(part) for part in text.split(HOLE))
    assert re.search(f"^{pattern}$", TOLD, re.MULTILINE), f"{place}: no test has the whole of: {text}"
