"""What a public function is given, held against what it states: a wrong type is a sentence, no traceback.

Annotations are what a caller reads; here they are kept. Values within their types are the functions' own
matter. Checked is at the public door alone: what calls a function from inside pays nothing.
"""

from __future__ import annotations

import inspect
import os
import sys
import threading
from collections.abc import Callable, Collection, Generator, Mapping, Sequence, Set
from functools import cache, wraps
from numbers import Integral, Real
from pathlib import Path
from types import UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from monodyn.errors import SettingsError, behind, is_spent

Function = TypeVar("Function", bound=Callable[..., Any])
Test = Callable[[Any], bool]
"""Tells whether a value is of one type."""
NUMBERS = "biuf"
"""Kinds of arrays of numbers, as numpy calls them."""
TRUTH = ("bool", "bool_")
"""Types of True and False, of Python and of numpy, which is not loaded for this."""

CALLED = ("__call__", "__iter__")
"""What a protocol may state beyond its own names."""
_thread = threading.local()
"""Whether a thread is inside of a function that was checked: ``inside``."""


def checked(function: Function) -> Function:
    """Return a function that refuses arguments of other types than it states.

    Args:
        function: Any function with annotations.

    Returns:
        The function; what the handler of a signal raises comes out of it as itself.

    Raises:
        SettingsError: of what is returned, when it is called: an argument has another type, or names a place
            that the system cannot use; a disk is full, or another limit of the system is reached.
    """
    signature = inspect.signature(function)

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        if getattr(_thread, "inside", False):
            return function(*args, **kwargs)
        given = signature.bind(*args, **kwargs).arguments
        check_types(function.__name__, given, function)
        try:
            _thread.inside = True
            made = function(*args, **kwargs)
        except (OSError, SystemError, ImportError) as error:
            raised = _plain(function.__name__, error)
        else:
            return _watched(function.__name__, made) if inspect.isgenerator(made) else made
        finally:
            _thread.inside = False
        # not while the other is handled: each would lead to the other
        raise raised

    return call  # type: ignore[return-value]


def _watched(where: str, made: Generator[Any, Any, Any]) -> Generator[Any, Any, Any]:
    """Go through a generator, whose errors come out as those of a function do."""
    try:
        return (yield from made)
    except (OSError, SystemError, ImportError) as error:
        raised = _plain(where, error)
    raise raised


def _plain(where: str, error: Exception) -> BaseException:
    """Return what is raised in place of an error: of a file the caller's sentence, of a signal its own."""
    # one that names no file is not of the system, but of what the caller gave to be called
    if not isinstance(error, OSError) or not (error.filename or is_spent(error)):
        return behind(error)
    refused = SettingsError(f"{where}: {unusable(error)}")
    refused.__cause__ = error
    return refused


def unusable(error: OSError) -> str:
    """Return a sentence on the place that the system could not use, or on what it has no more of.

    Args:
        error: What the system said of a file that has a name, or of its limits.
    """
    why = error.strerror or str(error)
    if is_spent(error):
        where = f" at '{_ends(str(error.filename))}'" if error.filename else ""
        return f"the system: expected room for another file, got '{why}'{where}; free some, and try again."
    return f"'{_ends(str(error.filename))}': expected a place the system can use, got '{why}'; give another."


def _ends(name: str) -> str:
    """Return the ends of a name that is too long, which is what the error is about: they are enough to find
    it."""
    return name if len(name) < 200 else f"{name[:80]}...{name[-40:]}"


def check_fields(settings: object, name: str) -> None:
    """Refuse settings of which a field has another type than its class states.

    Args:
        settings: An instance of a dataclass.
        name: What the settings are called in messages.

    Raises:
        SettingsError: a field has another type.
    """
    check_types(name, vars(settings), type(settings))


def check_types(where: str, values: Mapping[str, object], stated: Any) -> None:
    """Refuse values of other types than stated.

    Args:
        where: What takes the values, for the message.
        values: The values by name.
        stated: The function or class whose annotations state the types; what has none may be anything.

    Raises:
        SettingsError: a value has another type.
    """
    tests = _tests(stated)
    for name, value in values.items():
        if name in tests and not tests[name](value):
            what, wrong, hint = _blamed(name, value, _hints(stated)[name])
            raise SettingsError(
                f"{where}: expected {what} to be {_said(hint)}, got {kind_of(wrong)}; give another."
            )


@cache
def _hints(function: Any) -> dict[str, Any]:
    return get_type_hints(function)


@cache
def _tests(function: Any) -> dict[str, Test]:
    """Return what tells values of the annotated names of a function or class."""
    return {name: _test(hint) for name, hint in _hints(function).items()}


def is_a(value: Any, hint: Any) -> bool:
    """Return whether a value is of a type, as far as an annotation says.

    Args:
        value: Anything.
        hint: An annotation; where it is of a kind that is not known here, everything is.
    """
    return _test(hint)(value)


@cache
def _test(hint: Any) -> Test:
    """Return what tells values of a type: an annotation is taken apart once, and not for each frame."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Literal:
        # which words there are is the functions' own matter: they name them all
        words = tuple(type(one) for one in inner)
        return lambda value: isinstance(value, words)
    if origin is not None and inspect.isclass(origin) and issubclass(origin, Callable):
        return callable
    tests = [_test(one) for one in inner if origin is not None and one is not Ellipsis]
    if origin in (Union, UnionType):
        return _either(tests)
    if origin is tuple and inner and inner[-1] is not Ellipsis:
        return lambda value: (
            _listed(value)
            and len(value) == len(tests)
            and all(test(one) for test, one in zip(tests, value, strict=True))
        )
    if inspect.isclass(origin) and issubclass(origin, Mapping):
        key, item = tests
        return lambda value: (
            isinstance(value, Mapping) and all(key(k) and item(one) for k, one in value.items())
        )
    if inspect.isclass(origin) and issubclass(origin, Collection):
        return lambda value: _listed(value) and all(tests[0](one) for one in value)
    return _test_of_class(hint if origin is None else origin)


def _either(tests: Sequence[Test]) -> Test:
    """Return what tells values of any of several types."""

    def test(value: Any) -> bool:
        # a generator for each value would cost more than the tests
        for one in tests:  # noqa: SIM110
            if one(value):
                return True
        return False

    return test


def _test_of_class(kind: Any) -> Test:
    """Return what tells values of a class; numbers of numpy count as numbers, truth does not."""
    if kind is None or kind is type(None):
        return lambda value: value is None
    if kind is float:
        return _is_number
    if kind is int:
        return lambda value: (
            type(value) is int or (isinstance(value, Integral) and not isinstance(value, bool))
        )
    if kind is bool:
        return lambda value: type(value).__name__ in TRUTH
    if kind is str or kind is Path:
        return lambda value: isinstance(value, kind) and _nameable(str(value))
    if getattr(kind, "__name__", "") == "ndarray":
        return lambda value: (
            value.ndim > 0 and value.dtype.kind in NUMBERS if type(value) is kind else _is_array(value)
        )
    if kind is Any or not inspect.isclass(kind):
        return lambda value: True
    if getattr(kind, "_is_protocol", False):
        stated = [name for name in (*vars(kind), *kind.__annotations__) if name in CALLED or name[0] != "_"]
        return lambda value: not inspect.isclass(value) and all(hasattr(value, name) for name in stated)
    return lambda value: isinstance(value, kind)


def _is_number(value: object) -> bool:
    """True for a number; a whole one may be larger than any of a computer's arithmetic."""
    if type(value) is float:
        return True
    small = not isinstance(value, int) or value.bit_length() < sys.float_info.max_exp
    return isinstance(value, Real) and not isinstance(value, bool) and small


def _nameable(text: str) -> bool:
    """True for what the system takes for a name: without a zero, and in its letters."""
    if text.isascii():
        return "\0" not in text
    try:
        return b"\0" not in os.fsencode(text)
    except UnicodeEncodeError:
        return False


def _is_array(value: Any) -> bool:
    """True for what numpy makes an array of numbers of."""
    from numpy import asarray

    try:
        return _listed(value) and asarray(value).dtype.kind in NUMBERS
    except (TypeError, ValueError):
        return False


def _listed(value: Any) -> bool:
    """True for what has items one after the other; a text is one item, and so is a number of numpy."""
    # an array without an axis is a number
    if isinstance(value, str | bytes) or getattr(value, "ndim", 1) == 0:
        return False
    return isinstance(value, Sequence | Set) or (hasattr(value, "__array__") and hasattr(value, "__len__"))


def _blamed(name: str, value: Any, hint: Any) -> tuple[str, Any, Any]:
    """Return what is of another type than stated, as a caller writes it, its value and what was stated.

    That is an item where the value is what holds such items, else the value.
    """
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        within = [_blamed(name, value, one) for one in inner]
        return next((found for found in within if found[0] != name), (name, value, hint))
    held: list[tuple[str, Any, Any]] = []
    if inspect.isclass(origin) and issubclass(origin, Mapping) and isinstance(value, Mapping):
        held = [(f"the keys of {name}", key, inner[0]) for key in value]
        held += [(f"{name}[{key!r}]", item, inner[1]) for key, item in value.items()]
    elif (
        inspect.isclass(origin)
        and issubclass(origin, Sequence)
        and isinstance(value, Sequence)
        and _listed(value)
    ):
        endless = origin is not tuple or inner[-1] is Ellipsis
        kinds = [inner[0]] * len(value) if endless else inner
        # where there are too many, or too few, it is no item that is wrong
        held = [(f"{name}[{k}]", *each) for k, each in enumerate(zip(value, kinds, strict=False))]
        held = held if len(kinds) == len(value) else []
    return next((_blamed(*each) for each in held if not is_a(*each[1:])), (name, value, hint))


def _said(hint: Any) -> str:
    """Write an annotation as a reader of the documentation knows it."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys(_said(one) for one in inner))
    if hint is None or hint is type(None):
        return "None"
    if origin is Literal:
        return " or ".join(f"'{one}'" for one in inner)
    plain = {float: "a number", int: "a whole number", str: "a text", bool: "True or False", Path: "a path"}
    if hint in plain:
        return plain[hint]
    if origin is not None and inspect.isclass(origin) and issubclass(origin, Callable):
        return "a function"
    named = getattr(hint if origin is None else origin, "__name__", str(hint))
    items = [_said(one) for one in inner if one is not Ellipsis]
    count = f"{len(items)} items, " if origin is tuple and Ellipsis not in inner else ""
    return f"{named} of {count}{' and '.join(dict.fromkeys(items))}" if items else named


def kind_of(value: Any) -> str:
    """Return what a value is, for a message: itself where it is short, else its type.

    Args:
        value: Anything.
    """
    if value is None or (isinstance(value, str | Real) and len(repr(value)) <= 40):
        return repr(value)
    kind = getattr(value, "dtype", None)
    if isinstance(value, int):
        return f"a whole number of {value.bit_length()} bits"
    if kind is not None:
        return f"an array of shape {getattr(value, 'shape', ())} and type {kind}"
    count = f" with {len(value)} items" if isinstance(value, tuple) else ""
    return f"a value of type {type(value).__name__}{count}"
