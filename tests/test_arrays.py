"""Shape checks: what is copied, what is refused."""

import copy
import pickle
from collections.abc import Callable, Iterator
from dataclasses import is_dataclass, replace
from typing import Any

import numpy as np
import pytest

import monodyn
from monodyn.arrays import check_unbroken, clock, frozen, increasing, median, medians, plain, usual_step
from monodyn.errors import MonodynError, SettingsError, VideoError
from monodyn.mechanism.simulate import rollout
from monodyn.types import Poses
from support import refuses


def test_a_frozen_array_is_a_copy_that_cannot_change() -> None:
    given = np.arange(6.0).reshape(2, 3).T
    kept = frozen("x", given, (3, None))
    given[0, 0] = 9.0
    assert kept[0, 0] == 0.0
    assert kept.flags.c_contiguous
    assert not kept.flags.writeable


def test_what_is_frozen_stays_itself_and_what_another_array_can_change_is_copied() -> None:
    kept = frozen("x", [1.0, 2.0], (2,))
    assert frozen("y", kept, (2,)) is kept
    assert frozen("y", kept, (2,), dtype=np.int64).dtype == np.int64
    given = np.zeros(2)
    seen = given.view()
    seen.flags.writeable = False
    copied = frozen("y", seen, (2,))
    given[0] = 1.0
    assert copied[0] == 0.0
    with refuses(MonodynError, "y: expected an array of shape (3), got (2,)."):
        frozen("y", kept, (3,))


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


def test_a_record_of_pauses_is_no_record_of_one_motion() -> None:
    time = 0.05 * np.arange(40)
    for pauses in ((), ((10, 1.0),), ((10, 9.0), (30, 9.0))):
        check_unbroken("record 0", time + sum(wait * (np.arange(40) > row) for row, wait in pauses))
    for one in (time[:1], time[:0]):
        check_unbroken("record 0", one)
    with refuses(
        VideoError,
        "record 0: expected rows that follow each other, got pauses of 25 s between rows of 1.95 s, the "
        "longest after 6 s; give what comes before and after a pause as records of their own.",
    ):
        check_unbroken("record 0", time + 5.0 * (np.arange(40) > 10) + 20.0 * (np.arange(40) > 20))


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


@pytest.mark.parametrize("changed", [lambda x: pickle.loads(pickle.dumps(x)), copy.deepcopy, copy.copy])
def test_what_is_pickled_is_as_read_only_as_it_was(changed: Callable[[Any], Any]) -> None:
    mechanism = monodyn.load("single").with_torque("free", knots=np.array([0.0, 1.0]))
    poses = replace(swinging(), torques=monodyn.TorqueLog(("joint1",), np.array([0.0, 2.0]), np.ones((2, 1))))
    fit = monodyn.identify(swinging(), monodyn.load("single"), monodyn.IdentifySettings(torque="friction"))
    ahead = monodyn.predict(fit, until=2.0)
    picture = np.zeros((8, 8), np.uint8)
    picture.flags.writeable = False
    frame = monodyn.Frame(0, 0.0, picture, (picture, picture))
    for given in (mechanism, mechanism.tree, mechanism.shapes, mechanism.drive, poses, fit, ahead, frame):
        before, after = dict(arrays(given)), dict(arrays(changed(given)))
        assert {name: laid_out(before[name]) for name in after} == {
            name: laid_out(array) for name, array in after.items()
        }
        assert all(np.array_equal(before[name], array, equal_nan=True) for name, array in after.items())
        assert after
    again = changed(fit)
    assert laid_out(again.mechanism.tree.links) == laid_out(fit.mechanism.tree.links)


def arrays(given: Any, where: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """Yield all arrays of an object by their place in it."""
    if isinstance(given, np.ndarray):
        yield where, given
    elif isinstance(given, tuple):
        for k, one in enumerate(given):
            yield from arrays(one, f"{where}[{k}]")
    elif is_dataclass(given):
        for name, value in vars(given).items():
            yield from arrays(value, f"{where}.{name}")


def laid_out(array: np.ndarray) -> tuple[Any, ...]:
    """Return what a compiled function knows of an array."""
    return array.dtype, array.shape, array.flags.writeable, array.flags.c_contiguous


def swinging() -> Poses:
    """Return a record of a single pendulum."""
    time = np.arange(40) / 30
    position, _ = rollout(monodyn.load("single").tree, time, np.array([0.5]), np.array([0.0]), substeps=8)
    covariance, seen = np.full((40, 1, 1), 1e-6), np.ones(40, dtype=bool)
    return Poses(("joint1",), np.arange(40), time, position, covariance, seen)


@pytest.mark.parametrize("count", [2, 3, 4, 9])
def test_the_usual_step_is_the_median_of_the_steps(count: int) -> None:
    times = np.cumsum(np.random.default_rng(count).exponential(size=count))
    assert usual_step(times) == np.median(np.diff(times))


def test_a_single_time_has_no_step() -> None:
    assert np.isnan(usual_step(np.zeros(1)))


@pytest.mark.parametrize(
    "wrong", [[0.0, np.nan], [np.nan, 1.0], [0.0, np.inf], [0.0, 1e31], [0.0, 1e-10], [1.0, 0.0]]
)
def test_what_no_clock_shows_is_refused(wrong: list[float]) -> None:
    with pytest.raises(MonodynError, match="times"):
        clock("times", np.array(wrong))


@pytest.mark.parametrize("shape", [(1,), (6,), (1, 4), (2, 4), (5, 4), (96, 70)])
def test_medians_are_those_of_numpy(shape: tuple[int, ...]) -> None:
    values = np.random.default_rng(len(shape)).integers(0, 255, shape).astype(np.float32)
    assert np.array_equal(medians(values), np.median(values, axis=0))


@pytest.mark.parametrize("shape", [(1,), (2,), (7,), (8,), (5, 7), (6, 7)])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_median_of_a_picture_is_that_of_numpy(shape: tuple[int, ...], dtype: type) -> None:
    values = np.random.default_rng(0).normal(size=shape).astype(dtype)
    assert median(values) == float(np.median(values))
    assert median(np.zeros_like(values)) == 0.0
