"""What a docstring must say, read from the source text without importing it: used by ``test_docs.py``."""

from __future__ import annotations

import ast
import builtins
import re
from collections.abc import Iterator
from dataclasses import dataclass

SECTIONS = ("Args", "Returns", "Yields", "Raises", "Attributes", "Source", "Example")
"""Headings of a docstring; each stands at its left margin."""
OPENINGS = ("Return ", "Yield ", "List ", "Name ", "Count ", "Find ")
"""First words of a docstring whose first line says what comes back; any other needs a section 'Returns'."""
UNLISTED = ("NotImplementedError", "AssertionError", "StopIteration", "AttributeError")
"""Exceptions that no caller is meant to handle: they need no entry under ``Raises``."""
NOTHING = ("None", "NoReturn", "Never", "Iterator[None]", "Generator[None]")
"""Result annotations that need no description."""
OPERATORS = ("or", "x")
"""Words between the axes of a shape."""
SHAPE = r"\((|[\w.+*/ -]+,[\w.+*/ ,-]*)\)"
"""A shape: parentheses around axes with commas."""
MOST_LITERAL = 4
"""Largest length of an axis that a shape may give as a number."""

Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Rules:
    """What the names in docstrings may be.

    Attributes:
        axes: Names of array axes.
        errors: Names of exception classes of the program.
    """

    axes: frozenset[str]
    errors: frozenset[str]


def violations(source: str, rules: Rules) -> list[str]:
    """List what the docstrings of a module lack, as ``line name: what``.

    Args:
        source: Text of the module.
        rules: Known axes and exceptions.
    """
    tree = ast.parse(source)
    local = {node.name for node in tree.body if isinstance(node, ast.ClassDef)}
    rules = Rules(rules.axes, rules.errors | local)
    found = []
    for name, function in _public_functions(tree):
        found += [f"{function.lineno} {name}: {what}" for what in _of_function(function, rules)]
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            found += [f"{node.lineno} {node.name}: {what}" for what in _of_class(node, rules)]
    return found


def _public_functions(tree: ast.Module) -> Iterator[tuple[str, Function]]:
    """Yield the public functions of a module and the public methods of its public classes."""
    for node in tree.body:
        inside = node.body if isinstance(node, ast.ClassDef) and not node.name.startswith("_") else []
        owner = f"{node.name}." if isinstance(node, ast.ClassDef) else ""
        for each in [node, *inside]:
            if isinstance(each, Function) and not each.name.startswith("_"):
                yield owner + each.name, each


def _of_function(function: Function, rules: Rules) -> Iterator[str]:
    """Yield what one docstring lacks; of a kernel or a property only that there is one at all."""
    text = ast.get_docstring(function)
    if not text:
        yield "no docstring"
        return
    decorators = " ".join(ast.unparse(decorator) for decorator in function.decorator_list)
    if re.search(r"\b(njit|jit|property|cached_property|setter|overload|override)\b", decorators):
        return
    sections = sections_of(text)
    yield from _arguments(function, sections.get("Args", ""), rules)
    yield from _result(function, text, sections, rules)
    yield from _exceptions(function, sections.get("Raises", ""), rules)
    if (
        re.search(r"\beqs?\. ?\(?\d", sections[""])
        and "Source" not in sections
        and "2012" not in sections[""]
    ):
        yield "an equation is cited without its source: add 'Source:'"


def _arguments(function: Function, section: str, rules: Rules) -> Iterator[str]:
    """Yield arguments without an entry, entries without an argument, and arrays without a shape."""
    entries = entries_of(section)
    each = function.args
    named = [*each.posonlyargs, *each.args, *each.kwonlyargs, *filter(None, (each.vararg, each.kwarg))]
    arguments = {a.arg: a.annotation for a in named if a.arg not in ("self", "cls") and a.arg[0] != "_"}
    for name in arguments.keys() - entries.keys():
        yield f"argument '{name}' has no entry under 'Args:'"
    for name in entries.keys() - arguments.keys():
        yield f"'Args:' has '{name}', which is no argument"
    for name, annotation in arguments.items():
        if name in entries and is_array(annotation):
            yield from _shape(f"argument '{name}'", entries[name], rules)


def _result(function: Function, text: str, sections: dict[str, str], rules: Rules) -> Iterator[str]:
    """Yield what is missing about the result: that it is described, and the shape of an array."""
    if function.returns is None or ast.unparse(function.returns) in NOTHING:
        return
    described = sections.get("Returns", "") + sections.get("Yields", "")
    if not described and not text.startswith(OPENINGS):
        verbs = ", ".join(verb.strip() for verb in OPENINGS)
        yield f"has no 'Returns:', and its first line begins with none of {verbs}"
    elif is_array(function.returns):
        yield from _shape("the result", described + sections[""], rules)


def _exceptions(function: Function, section: str, rules: Rules) -> Iterator[str]:
    """Yield raised classes that 'Raises:' lacks, and entries that are no exception class."""
    listed = set(entries_of(section))
    for name in sorted(raised_in(function) - listed - set(UNLISTED)):
        yield f"raises {name}, which 'Raises:' does not list"
    for name in sorted(listed):
        known = getattr(builtins, name, None)
        if name not in rules.errors and not (isinstance(known, type) and issubclass(known, BaseException)):
            yield f"'Raises:' lists '{name}', which is no exception class"


def _of_class(node: ast.ClassDef, rules: Rules) -> Iterator[str]:
    """Yield the fields of a dataclass or named tuple without an entry, and the entries without a field."""
    text = ast.get_docstring(node)
    if not text:
        yield "no docstring"
        return
    bases = [ast.unparse(base) for base in node.bases]
    decorators = " ".join(ast.unparse(decorator) for decorator in node.decorator_list)
    if "dataclass" not in decorators and not any(base.endswith("NamedTuple") for base in bases):
        return
    fields = {
        each.target.id: each.annotation
        for each in node.body
        if isinstance(each, ast.AnnAssign)
        and isinstance(each.target, ast.Name)
        and not each.target.id.startswith("_")
        and "ClassVar" not in ast.unparse(each.annotation)
    }
    entries = entries_of(sections_of(text).get("Attributes", ""))
    for name in fields.keys() - entries.keys():
        yield f"field '{name}' has no entry under 'Attributes:'"
    # a subclass may describe the fields of its base again, and a property counts as an attribute
    inherits = [base for base in bases if not base.endswith("NamedTuple")]
    methods = {each.name for each in node.body if isinstance(each, Function)}
    for name in entries.keys() - fields.keys() - methods if not inherits else ():
        yield f"'Attributes:' has '{name}', which is no field"
    for name in fields.keys() & entries.keys():
        if is_array(fields[name]):
            yield from _shape(f"field '{name}'", entries[name], rules)


def sections_of(text: str) -> dict[str, str]:
    """Split a docstring at its headings; what comes before the first one has the key ''.

    Args:
        text: The docstring, its margin removed.
    """
    found, heading = {"": ""}, ""
    for line in text.splitlines():
        match = re.match(rf"({'|'.join(SECTIONS)}):(?:\s|$)(.*)", line)
        if match:
            heading, line = match[1], match[2]
        elif heading and line and not line.startswith(" "):
            heading = ""  # text at the margin ends a section
        found[heading] = found.get(heading, "") + line + "\n"
    return found


def entries_of(section: str) -> dict[str, str]:
    """Return the entries of a section, name by name; one entry may stand for several names.

    Args:
        section: Its lines, indented by four.
    """
    found: dict[str, str] = {}
    names: list[str] = []
    for line in section.splitlines():
        match = re.match(r"    ([*\w`.]+(?:(?:, | and )[*\w`.]+)*):(?:\s|$)", line)
        if match:
            names = [name.strip("*`").rpartition(".")[2] for name in re.split(", | and ", match[1])]
        for name in names:
            found[name] = (
                found.get(name, "") + line.partition(":")[2] * bool(match) + line * (not match) + " "
            )
    return found


def is_array(annotation: ast.expr | None) -> bool:
    """Return whether an annotation holds an array, other than as argument or result of a callable.

    Args:
        annotation: As it stands in the source, or None.
    """
    if annotation is None:
        return False
    written = re.sub(r"Callable\[.*\]", "", ast.unparse(annotation).strip("'\""))
    return bool(re.search(r"\b(ndarray|NDArray)\b", written))


def shapes_of(text: str) -> list[list[str]]:
    """Return the shapes in a text: for each ``(a, 2 b + 1)`` of axes and numbers the words in it.

    Args:
        text: Part of a docstring.
    """
    # one axis alone is written with its comma, (frame,), as in numpy: a word in parentheses is no shape
    inner = re.findall(SHAPE, " ".join(text.split()))
    return [re.findall(r"[A-Za-z_]+", each) for each in inner]


def _shape(what: str, text: str, rules: Rules) -> Iterator[str]:
    """Yield a complaint when no parenthesis of a text is made of known axes and numbers alone.

    A length above ``MOST_LITERAL`` is one too: columns have names, and ``(dof, column)`` says so.
    """
    known = rules.axes | {*OPERATORS}
    for shape in re.findall(SHAPE, " ".join(text.split())):
        for number in re.findall(r"(?<![\w.])\d+(?![\w.])", shape):
            if int(number) > MOST_LITERAL:
                yield f"{what} has the shape ({shape}) with the number {number}: name the axis"
    if not any(all(word in known or word.removesuffix("s") in known for word in s) for s in shapes_of(text)):
        tried = [" ".join(words) for words in shapes_of(text)]
        yield f"{what} is an array without its shape, such as (frame, dof)" + (f": {tried}" if tried else "")


def raised_in(function: Function) -> set[str]:
    """Return the names of the classes that the body of a function raises itself, not in a function within.

    Args:
        function: Its syntax tree.
    """
    found: set[str] = set()
    waiting: list[ast.AST] = [*function.body]
    while waiting:
        node = waiting.pop()
        if isinstance(node, Function | ast.Lambda | ast.ClassDef):
            continue
        if isinstance(node, ast.Raise) and node.exc is not None:
            raised = node.exc.func if isinstance(node.exc, ast.Call) else node.exc
            name = ast.unparse(raised).rpartition(".")[2]
            # a capital letter: a class rather than a variable or a helper that makes the error
            found |= {name} if name[:1].isupper() else set()
        waiting.extend(ast.iter_child_nodes(node))
    return found
