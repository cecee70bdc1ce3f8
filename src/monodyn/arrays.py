"""Checks of the arrays that flow between the stages, and the usual step of their times."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields
from typing import Any, TypeGuard

import numpy as np

from monodyn.errors import MonodynError, VideoError

WILD = 1e30
"""Largest number of a record; powers of larger ones go beyond what the arithmetic can hold."""
SHORTEST = 1e-9
"""Shortest time between two rows of a record [s]."""
MOST_PAUSES = 10.0
"""Time without rows over what the rows of a record cover at their usual pace, above which it is refused: its
phase is not known after that, and simulating it would take most of the time."""


def frozen(
    where: str,
    values: object,
    shape: tuple[int | None, ...],
    *,
    dtype: type = np.float64,
    error: type[MonodynError] = MonodynError,
) -> np.ndarray:
    """Copy ``values`` into a read-only array of a stated shape, unless they are one.

    Args:
        where: Name of the field, for the message.
        values: Anything numpy can make an array of.
        shape: Expected length by axis; ``None`` takes any length.
        dtype: Element type of the copy.
        error: Class of the exception.

    Returns:
        A read-only, C-contiguous array, (...,) with the axes of ``shape``.

    Raises:
        MonodynError: (or ``error``) the values are no numbers, or the number of axes or a length differs.
    """
    try:
        array = values if _is_frozen(values, dtype) else _copied(values, dtype)
    except (TypeError, ValueError, OverflowError, FloatingPointError):
        got = f"a value of type {type(values).__name__}"
        raise error(f"{where}: expected an array of numbers, got {got}; give another.") from None
    # most arrays are right at first sight; a generator for each would cost more than its copy
    if array.shape != shape and (
        array.ndim != len(shape)
        or any(want is not None and want != got for want, got in zip(shape, array.shape, strict=True))
    ):
        expected = ", ".join("any" if n is None else str(n) for n in shape)
        raise error(f"{where}: expected an array of shape ({expected}), got {array.shape}.")
    array.flags.writeable = False
    return array


def freeze(
    record: object,
    shape: tuple[int | None, ...],
    *names: str,
    dtype: type = np.float64,
    error: type[MonodynError] = MonodynError,
) -> None:
    """Make fields of a frozen dataclass read-only arrays of a stated shape.

    They are set past its guard once, so that objects can share them.

    Args:
        record: The dataclass, while it is made.
        shape: Expected length by axis; ``None`` takes any length.
        names: Names of the fields.
        dtype: Element type.
        error: Class of the exception.

    Raises:
        MonodynError: (or ``error``) as ``frozen`` does.
    """
    for name in names:
        where = f"{type(record).__name__}.{name}"
        array = frozen(where, getattr(record, name), shape, dtype=dtype, error=error)
        object.__setattr__(record, name, array)


def _is_frozen(values: object, dtype: type) -> TypeGuard[np.ndarray]:
    """True for an array of a type that owns what it holds and was made read-only: a search makes hundreds of
    trees of the same joints. A view of another array is none, for that one may still be written to."""
    if type(values) is not np.ndarray or values.dtype != dtype:
        return False
    flags = values.flags
    return not flags.writeable and flags.owndata and flags.c_contiguous


def _copied(values: object, dtype: type) -> np.ndarray:
    if dtype is np.float64:
        return np.array(values, dtype=dtype, order="C")
    # what is no whole number where one is wanted
    with np.errstate(invalid="raise"):
        return np.array(values, dtype=dtype, order="C")


class Frozen:
    """Base of dataclasses with read-only arrays: out of a pickle these are read-only again.

    A pickle of numpy forgets that an array is, and for one that is not the kernels would be compiled anew.
    What was computed from the fields is left behind.
    """

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        values = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        return _made, (type(self), values, [array.flags.writeable for array in _arrays(values.values())])


def _made(kind: type, values: dict[str, Any], writeable: list[bool]) -> Any:
    """Return an object with these fields, whose arrays were writeable or not."""
    for array, free in zip(_arrays(values.values()), writeable, strict=True):
        if not free:
            array.flags.writeable = False
    return kind(**values)


def _arrays(values: Iterable[Any]) -> Iterator[np.ndarray]:
    """Yield the arrays among values and in their tuples."""
    for value in values:
        if isinstance(value, np.ndarray):
            yield value
        elif isinstance(value, tuple):
            yield from _arrays(value)


def increasing(where: str, times: np.ndarray, *, error: type[MonodynError] = MonodynError) -> np.ndarray:
    """Return ``times`` [s] (sample,) if they are finite and strictly increase.

    Args:
        where: Name of the field, for the message.
        times: Time stamps [s], shape (sample,).
        error: Class of the exception.

    Raises:
        MonodynError: (or ``error``) a time is not finite or does not come after the one before it.
    """
    if not np.all(np.isfinite(times)):
        raise error(f"{where}: expected finite times, got {times[~np.isfinite(times)][0]}.")
    steps = np.diff(times)
    if np.any(steps <= 0):
        i = int(np.argmax(steps <= 0))
        raise error(f"{where}: must increase, but sample {i + 1} is {times[i + 1]:g} s after {times[i]:g} s.")
    return times


def clock(where: str, times: np.ndarray, *, error: type[MonodynError] = MonodynError) -> np.ndarray:
    """Return ``times`` [s] (row,) if they increase as a clock of seconds does.

    Args:
        where: Name of the field or column, for the message.
        times: Time stamps [s], shape (row,).
        error: Class of the exception.

    Raises:
        MonodynError: (or ``error``) they are not finite, do not increase, or are such as no clock shows.
    """
    # NaN is neither
    if np.abs(times).max(initial=0.0) <= WILD and np.diff(times).min(initial=np.inf) >= SHORTEST:
        return times
    increasing(where, times, error=error)
    if np.abs(times).max(initial=0.0) > WILD:
        raise error(
            f"{where}: expected times within {WILD:g} s of 0, got {times[np.argmax(np.abs(times))]:g}; give "
            "them in seconds."
        )
    if np.diff(times).min(initial=np.inf) < SHORTEST:
        raise error(
            f"{where}: expected rows {SHORTEST:g} s apart or more, got two with {np.diff(times).min():g} s "
            "between them; give the times in seconds."
        )
    return times


def usual_step(times: np.ndarray) -> float:
    """Return the median of the steps between times [s]; NaN where there are fewer than two.

    Args:
        times: Time stamps [s], (row,).
    """
    steps = np.diff(times)
    return float(medians(steps)) if len(steps) else np.nan


def medians(values: np.ndarray) -> np.ndarray:
    """Return what ``numpy.median`` does along the first axis, several times sooner.

    Args:
        values: At least one row, none of it NaN, (row, column) or (row,).

    Returns:
        The medians, (column,); of (row,) one number.
    """
    ordered, half = np.sort(values, axis=0), len(values) // 2
    return 0.5 * (ordered[half] + ordered[-half - 1])


def median(values: np.ndarray) -> float:
    """Return what ``numpy.median`` does of all values, those of a picture several times sooner.

    Args:
        values: At least one, of floating point and none of it NaN, (row, column) or (row,).
    """
    half = values.size // 2
    # numpy partitions about one place by vector instructions, about several at once it does not
    ordered = np.partition(values, half, axis=None)
    low = ordered[half] if values.size % 2 else ordered[:half].max()
    return float(0.5 * (low + ordered[half]))


def check_unbroken(where: str, times: np.ndarray) -> None:
    """Refuse a record that consists of pauses for the most part.

    Args:
        where: Name of the record, for the message.
        times: Its time stamps [s], increasing, (row,).

    Raises:
        VideoError: Its pauses are so long that it is no record of one motion.
    """
    steps = np.diff(times)
    if not len(steps):
        return
    covered, longest = usual_step(times) * len(steps), int(np.argmax(steps))
    pauses = float(steps.sum()) - covered
    if pauses > MOST_PAUSES * covered:
        raise VideoError(
            f"{where}: expected rows that follow each other, got pauses of {pauses:.4g} s between rows of "
            f"{covered:.4g} s, the longest after {times[longest]:.6g} s; give what comes before and after a "
            "pause as records of their own."
        )


def plain(array: object, dtype: type | np.dtype | None = None) -> np.ndarray:
    """Return ``array`` contiguous and read-only: the one form in which the kernels are compiled.

    Args:
        array: Anything numpy can make an array of.
        dtype: Element type; None keeps the array's own.

    Returns:
        A read-only view of the same shape (...,), or a copy where the array is not contiguous or of another
        type.
    """
    view = np.ascontiguousarray(array, dtype=dtype).view()
    view.flags.writeable = False
    return view
