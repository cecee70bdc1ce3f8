"""Shape checks: what is copied, what is refused."""

import numpy as np

from monodyn.arrays import frozen, increasing, plain
from monodyn.errors import MonodynError, SettingsError
from support import refuses


def test_a_frozen_array_is_a_copy_that_cannot_change() -> None:
    given = np.arange(6.0).reshape(2, 3).T
    kept = frozen("x", given, (3, None))
    given[0, 0] = 9.0
    assert kept[0, 0] == 0.0
    assert kept.flags.c_contiguous
    assert not kept.flags.writeable


def test_another_shape_is_refused_with_both() -> None:
    with refuses(MonodynError, "x: expected an array of shape (2, any), got (3, 1)."):
        frozen("x", np.zeros((3, 1)), (2, None))
    with refuses(SettingsError, "x: expected an array of shape (2), got (2, 1)."):
        frozen("x", np.zeros((2, 1)), (2,), error=SettingsError)


def test_times_increase_and_are_finite() -> None:
    times = np.array([0.0, 0.5, 2.0])
    assert increasing("t", times) is times
    with refuses(MonodynError, "t: expected finite times, got nan."):
        increasing("t", np.array([0.0, np.nan]))
    with refuses(MonodynError, "t: must increase, but sample 2 is 0.5 s after 1 s."):
        increasing("t", np.array([0.0, 1.0, 0.5]))


def test_plain_is_a_view_where_it_can_be() -> None:
    given = np.zeros((2, 3))
    assert np.shares_memory(plain(given), given)
    assert not plain(given).flags.writeable
    assert given.flags.writeable
    turned = plain(given.T)
    assert turned.flags.c_contiguous
    assert plain([1, 2], np.float64).dtype == np.float64


def test_what_is_no_number_is_refused() -> None:
    with refuses(MonodynError, "x: expected an array of numbers, got a value of type list; give another."):
        frozen("x", ["a", 1.0], (None,))
    with refuses(MonodynError, "x: expected an array of numbers, got a value of type dict; give another."):
        frozen("x", {}, (None,))
