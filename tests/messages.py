"""The sentences in a source text: what is raised, and what is said otherwise; for ``test_messages.py``."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import SequenceMatcher
from itertools import product

HOLE = "\0"
"""What stands for a value in a text."""
MOST_ALTERNATIVES = 16
"""Texts that one expression with conditions may become; more are cut off."""

Scope = dict[str, list[ast.expr]]
"""What a name was assigned, each time."""


@dataclass(frozen=True)
class Sentence:
    """A text that a user can see.

    Attributes:
        line: Where it stands.
        error: The exception class that carries it; empty for a status or advice.
        text: The text, ``HOLE`` for each value in it.
    """

    line: int
    error: str
    text: str

    @property
    def shown(self) -> str:
        """The text for reading: ``{}`` for each value."""
        return self.text.replace(HOLE, "{}")

    def inside(self, lines: list[str], *, whole: bool) -> bool:
        """Return whether one of the lines is the text (``whole``) or has it in it.

        Args:
            lines: Texts without line breaks.
            whole: True when nothing may stand before or after it.
        """
        parts = [part.replace("\n", " ") for part in self.text.split(HOLE)]
        pattern = re.compile(".*?".join(re.escape(part) for part in parts))
        found = pattern.fullmatch if whole else pattern.search
        longest = max(parts, key=len)
        return any(longest in line and found(line) for line in lines)

    def nearest(self, lines: list[str]) -> str:
        """Return the line that is most like the text, or an empty one when none is like it at all.

        Args:
            lines: Texts without line breaks.
        """
        words = set(self.shown.split())
        likely = sorted(lines, key=lambda line: -len(words & set(line.split())))[:20]
        rated = [
            (SequenceMatcher(None, self.shown, line.replace(HOLE, "{}")).ratio(), line) for line in likely
        ]
        ratio, line = max(rated, default=(0.0, ""))
        return line.replace(HOLE, "{}") if ratio > 0.5 else ""


def texts_of(node: ast.expr, scope: Scope | None = None) -> list[str]:
    """Return what a string expression can become, ``HOLE`` for each value; nothing for what is no string.

    Joins ``+`` and f-strings, follows names that stand for strings and ``"...".format(...)``, and takes both
    sides of a condition.

    Args:
        node: The expression.
        scope: The names that it may use.
    """
    scope = scope or {}
    if isinstance(node, ast.Constant):
        return [node.value] if isinstance(node.value, str) else []
    if isinstance(node, ast.JoinedStr):
        return _joined([_part(part, scope) for part in node.values])
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        left, right = texts_of(node.left, scope), texts_of(node.right, scope)
        return _joined([left or [HOLE], right or [HOLE]]) if left or right else []
    if isinstance(node, ast.IfExp):
        return [*texts_of(node.body, scope), *texts_of(node.orelse, scope)]
    if isinstance(node, ast.Name):
        # the name itself is left out below, so that x = x + "..." ends
        rest = {name: values for name, values in scope.items() if name != node.id}
        return [text for value in scope.get(node.id, []) for text in texts_of(value, rest)]
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "format":
        return [re.sub(r"\{[^{}]*\}", HOLE, text) for text in texts_of(node.func.value, scope)]
    return []


def _part(node: ast.expr, scope: Scope) -> list[str]:
    """Return what a part of an f-string can become: a value is a hole, unless it is a known string."""
    if isinstance(node, ast.FormattedValue):
        plain = node.conversion == -1 and node.format_spec is None
        return (texts_of(node.value, scope) if plain and isinstance(node.value, ast.Name) else []) or [HOLE]
    return texts_of(node, scope)


def _joined(parts: list[list[str]]) -> list[str]:
    """Return every way to choose one text of each part, one after the other."""
    return ["".join(chosen) for chosen, _ in zip(product(*parts), range(MOST_ALTERNATIVES), strict=False)]


def constants(tree: ast.Module) -> Scope:
    """Return what the names at the top of a module are assigned.

    Args:
        tree: The module.
    """
    return _assigned(tree.body)


def _assigned(body: list[ast.stmt]) -> Scope:
    """Return what each name is assigned in statements, in nested blocks too but not in functions within."""
    found: Scope = {}
    waiting: list[ast.AST] = [*body]
    while waiting:
        node = waiting.pop(0)
        if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            found.setdefault(node.targets[0].id, []).append(node.value)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value:
            found.setdefault(node.target.id, []).append(node.value)
        if not isinstance(node, ast.FunctionDef | ast.ClassDef):
            waiting.extend(child for child in ast.iter_child_nodes(node) if isinstance(child, ast.stmt))
    return found


def raised(tree: ast.Module, errors: set[str], shared: Scope) -> Iterator[Sentence]:
    """Yield the texts of the errors that a module raises, or makes for others to raise.

    Args:
        tree: The module.
        errors: Names of exception classes.
        shared: Constants that the module may import.
    """
    for scope, node in _with_scope(tree, {**shared, **constants(tree)}):
        if isinstance(node, ast.Call) and node.args:
            name = ast.unparse(node.func).rpartition(".")[2]
            if name in errors:
                for text in texts_of(node.args[0], scope):
                    yield Sentence(node.lineno, name, text)


def said(tree: ast.Module, errors: set[str], least: int = 40) -> Iterator[Sentence]:
    """Yield the longer sentences of a module that are neither raised nor documentation.

    Args:
        tree: The module.
        errors: Names of exception classes.
        least: Shortest length of such a sentence.
    """
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop(0)
        if isinstance(node, ast.Raise | ast.Assert | ast.FormattedValue):
            continue
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            continue  # a docstring
        if isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2] in errors:
            continue
        text = (texts_of(node) or [""])[0] if isinstance(node, ast.expr) else ""
        if text:
            if len(text) > least and text.endswith("."):
                yield Sentence(node.lineno, "", text.strip(HOLE).strip())  # type: ignore[attr-defined]
            continue
        waiting.extend(ast.iter_child_nodes(node))


def _with_scope(node: ast.AST, scope: Scope) -> Iterator[tuple[Scope, ast.AST]]:
    """Yield every node below with the names that are known there."""
    for child in ast.iter_child_nodes(node):
        inner = {**scope, **_assigned(child.body)} if isinstance(child, ast.FunctionDef) else scope
        yield inner, child
        yield from _with_scope(child, inner)
