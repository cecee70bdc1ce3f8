"""Every message that is raised on purpose, and every status and advice, is compared whole in some test."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest

from messages import HOLE, Scope, Sentence, constants, raised, said, texts_of

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "monodyn"
MODULES = sorted(
    path for path in SOURCE.rglob("*.py") if path.name != "__init__.py" or path.parent.name == "cli"
)


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def errors() -> set[str]:
    """Name the exceptions of the program, and the functions that make one."""
    classes = {node.name for node in parsed(SOURCE / "errors.py").body if isinstance(node, ast.ClassDef)}
    return {*classes, "error"}


@cache
def shared() -> Scope:
    """Collect the constants of all modules that are strings: names in capitals."""
    found: Scope = {}
    for path in MODULES:
        found |= {name: values for name, values in constants(parsed(path)).items() if name.isupper()}
    return found


@cache
def told() -> list[str]:
    """Collect the strings of all tests, ``HOLE`` for each value in them, without line breaks."""
    found: set[str] = set()
    for path in sorted((ROOT / "tests").rglob("*.py")):
        if path not in (Path(__file__), Path(__file__).with_name("messages.py")):
            known = constants(parsed(path))
            for node in ast.walk(parsed(path)):
                if isinstance(node, ast.expr):
                    found |= {_bare(text) for text in texts_of(node, known) if len(text) > 10}
    return sorted(found)


def _bare(text: str) -> str:
    """Return a text without line breaks, and without what the command line puts before and after an error."""
    return text.replace("\n", " ").removeprefix("monodyn: ").rstrip()


def complaint(path: Path, sentence: Sentence) -> str:
    """Say what is not tested, what comes nearest in the tests, and what to write."""
    near = sentence.nearest(told())
    lines = [f"{path.relative_to(ROOT)}:{sentence.line}: no test has the whole of", f"    {sentence.shown}"]
    lines += [f"  nearest:\n    {near}"] if near else []
    if sentence.error:
        lines.append(
            f'  write: with refuses({sentence.error}, f"..."): (tests/support.py), the text literally'
        )
    return "\n".join(lines)


by_module = pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(SOURCE)))


@by_module
def test_every_message_is_tested_whole(path: Path) -> None:
    found = [sentence for sentence in raised(parsed(path), errors(), shared()) if sentence.text.strip(HOLE)]
    missing = [complaint(path, sentence) for sentence in found if not sentence.inside(told(), whole=True)]
    assert not missing, f"{len(missing)} of {len(found)} messages:\n" + "\n".join(missing)


@by_module
def test_every_status_and_advice_is_tested_whole(path: Path) -> None:
    found = list(said(parsed(path), errors()))
    missing = [complaint(path, sentence) for sentence in found if not sentence.inside(told(), whole=False)]
    assert not missing, f"{len(missing)} of {len(found)} sentences:\n" + "\n".join(missing)


ROOM = '''
"""A docstring that is longer than forty characters and ends in a period."""
BAD = "The door is shut"
def enter(name, key):
    """A docstring that is longer than forty characters and ends in a period."""
    if not key:
        raise FitError(f"{name}: {BAD} and locked.")
    text = f"{name}: " + "no such key; keys: " + key
    if name:
        raise FitError(text)
    if key:
        raise FitError("Open." if name else "Shut: {n}.".format(n=name))
    status = f"The key {key:.3f} was turned " + f"{name} times before the lock gave way."
    return status, ["Knock before you enter, and wait for {} answers.".format(key)]
'''


def test_messages_are_found_whatever_they_are_built_from() -> None:
    tree = ast.parse(ROOM)
    assert {s.text for s in raised(tree, {"FitError"}, {})} == {
        f"{HOLE}: The door is shut and locked.",
        f"{HOLE}: no such key; keys: {HOLE}",
        "Open.",
        f"Shut: {HOLE}.",
    }
    assert {s.text for s in said(tree, {"FitError"})} == {
        f"The key {HOLE} was turned {HOLE} times before the lock gave way.",
        f"Knock before you enter, and wait for {HOLE} answers.",
    }


def test_a_message_counts_as_tested_only_when_a_test_has_all_of_it() -> None:
    sentence = Sentence(1, "FitError", f"joint '{HOLE}' is not there; joints: {HOLE}.")
    assert sentence.inside(["joint 'a' is not there; joints: 'b', 'c'."], whole=True)
    assert not sentence.inside(["joint 'a' is not there"], whole=False)
    assert not sentence.inside(["model.xml: joint 'a' is not there; joints: 'b'."], whole=True)
    assert sentence.inside(["model.xml: joint 'a' is not there; joints: 'b'."], whole=False)
    assert (
        sentence.nearest(["something else", "joint 'a' is not there; links:"])
        == "joint 'a' is not there; links:"
    )
