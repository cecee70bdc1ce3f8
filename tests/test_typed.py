import inspect
import os
import signal
from collections.abc import Iterator
from typing import get_type_hints

import numpy as np
import pytest

import monodyn
from monodyn.errors import MonodynError, SettingsError, is_interrupt
from monodyn.mechanism.simulate import rollout
from monodyn.typed import checked, is_a
from monodyn.types import Poses
from support import refuses

PUBLIC = [name for name in monodyn.__all__ if inspect.isfunction(getattr(monodyn, name))]


@pytest.mark.parametrize("name", PUBLIC)
def test_every_argument_of_a_public_function_has_a_type_that_is_checked(name: str) -> None:
    hints = get_type_hints(getattr(monodyn, name))
    hints.pop("return")
    assert [word for word, hint in hints.items() if is_a(object(), hint)] == []


@pytest.mark.parametrize("name", PUBLIC)
@pytest.mark.parametrize("wrong", [None, "x\0y", 3, [], object(), np.zeros(2), {3: "x"}])
def test_no_first_argument_ends_in_a_traceback(name: str, wrong: object) -> None:
    function = getattr(monodyn, name)
    needed = [p for p in inspect.signature(function).parameters.values() if p.default is p.empty]
    given = {p.name: wrong for p in needed}
    # what is refused is the caller's; what is not there yet is found missing
    try:
        made = function(**given)
        if inspect.isgenerator(made):
            next(made)
    except MonodynError:
        return
    pytest.fail(f"{name} took {wrong!r}")


def test_a_message_says_what_was_expected_and_what_was_given() -> None:
    with refuses(SettingsError, "load: expected source to be a text or a path, got None; give another."):
        monodyn.load(None)  # type: ignore[arg-type]
    with refuses(
        SettingsError,
        "track: expected masks to be Masks or PointTracks, got a value of type list; give another.",
    ):
        monodyn.track([], None)  # type: ignore[arg-type]
    with refuses(
        SettingsError,
        "identify: expected poses to be Poses or Sequence of Poses, got 'poses.csv'; give another.",
    ):
        monodyn.identify("poses.csv", monodyn.load("single"))  # type: ignore[arg-type]


def test_numbers_and_names_that_a_computer_cannot_hold_are_refused() -> None:
    with refuses(
        SettingsError,
        "read: expected rate to be a number or None, got a whole number of 1329 bits; give another.",
    ):
        monodyn.read("clip.mp4", rate=10**400)
    with refuses(
        SettingsError, "read_points: expected path to be a text or a path, got '\\ud800'; give another."
    ):
        monodyn.read_points("\ud800")
    assert is_a(10**300, float)
    # names of files that are no text are names all the same
    assert is_a(os.fsdecode(b"a\xff"), str)


def test_settings_and_choices_of_other_types_are_refused() -> None:
    with refuses(SettingsError, "locate: expected focal to be a number, got 'wide'; give another."):
        monodyn.LocateSettings(focal="wide")  # type: ignore[arg-type]
    mechanism = monodyn.load("single")
    with refuses(
        SettingsError, "with_choices: expected fix['gravity'] to be a number, got 'abc'; give another."
    ):
        mechanism.with_choices(fix={"gravity": "abc"})  # type: ignore[dict-item]
    with refuses(
        SettingsError, "with_choices: expected free to be Sequence of a text, got 'gravity'; give another."
    ):
        mechanism.with_choices(free="gravity")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"fix": {3: 1.0}}, "the keys of fix to be a text, got 3"),
        ({"fix": [("gravity", 1.0)]},
         "fix to be Mapping of a text and a number, got a value of type list"),
        ({"free": ["gravity", 3]}, "free[1] to be a text, got 3"),
        ({"bounds": {"a": (1, "x")}}, "bounds['a'][1] to be a number, got 'x'"),
        ({"bounds": {"a": (1, 2, 3)}},
         "bounds['a'] to be tuple of 2 items, a number, got a value of type tuple with 3 items"),
        ({"fit_frames": (1, 2.5)}, "fit_frames[1] to be a whole number or None, got 2.5"),
        ({"torques": ["a.csv"]}, "torques[0] to be a path, got 'a.csv'"),
    ],
)  # fmt: skip
def test_the_item_that_is_wrong_is_named(given: dict, said: str) -> None:
    with refuses(SettingsError, f"settings: expected {said}; give another."):
        monodyn.RunSettings(**given)


def test_a_place_that_the_system_cannot_use_is_one_sentence() -> None:
    with refuses(SettingsError, f"load: '{80 * 'x'}...{40 * 'x'}': expected a place the system can use, got "
                 f"'{os.strerror(36)}'; give another."):  # fmt: skip
        monodyn.load(5000 * "x")


@pytest.mark.parametrize(
    ("value", "hint", "right"),
    [
        (np.float32(1.0), float, True),
        (True, float, False),
        (np.int64(3), int, True),
        (3.0, int, False),
        (np.bool_(True), bool, True),
        ("ab", "tuple", False),
        ((1, 2), tuple[int, int], True),
        ((1, 2, 3), tuple[int, int], False),
        ([1.0, 2.0], np.ndarray, True),
        ([0.0, []], np.ndarray, False),
        (["1"], np.ndarray, False),
        (np.array(1.0), np.ndarray, False),
        (np.array(1.0), tuple[int, int], False),
        (np.float64(1.0), "tuple", False),
    ],
)
def test_numbers_are_numbers_whoever_made_them(value: object, hint: object, right: bool) -> None:
    assert is_a(value, tuple[str, ...] if hint == "tuple" else hint) is right


def test_a_checked_function_is_otherwise_the_same() -> None:
    def half(of: float, *, twice: bool = False) -> float:
        """Return half of a number."""
        return of if twice else of / 2

    assert checked(half)(3.0) == 1.5
    assert checked(half)(3.0, twice=True) == 3.0
    assert checked(half).__doc__ == half.__doc__
    with pytest.raises(TypeError, match="missing a required argument"):
        checked(half)()


def test_only_the_public_door_is_checked() -> None:
    """What a checked function calls is not checked again, what is called after it is, whatever it raised."""

    @checked
    def inner(count: int) -> int:
        return count

    @checked
    def outer(count: int, wrong: bool) -> object:
        if wrong:
            raise ValueError(count)
        return inner("two")  # type: ignore[arg-type]

    @checked
    def each(count: int) -> Iterator[object]:
        yield inner(count)

    assert outer(1, wrong=False) == "two"
    with pytest.raises(ValueError, match=r"^1$"):
        outer(1, wrong=True)
    assert list(each(3)) == [3]
    said = "inner: expected count to be a whole number, got 'two'; give another."
    with refuses(SettingsError, said):
        inner("two")  # type: ignore[arg-type]


@pytest.mark.parametrize("raised", [KeyboardInterrupt(), TimeoutError("too long")])
def test_what_a_signal_raises_in_compiled_code_comes_out_as_itself(raised: BaseException) -> None:
    def compiled() -> None:
        """Fail as a compiled function does, in which a signal's handler has raised."""
        raise SystemError("returned a result with an exception set") from raised

    def streamed() -> Iterator[int]:
        """Fail on the way."""
        yield 1
        compiled()

    for act in (checked(compiled), lambda: list(checked(streamed)())):
        with pytest.raises(type(raised)) as caught:
            act()
        assert caught.value is raised
        # who looks for what led to it comes to an end
        assert is_interrupt(caught.value) is isinstance(raised, KeyboardInterrupt)


def test_a_library_whose_loading_ctrl_c_stops_is_not_missing() -> None:
    def loads(behind: BaseException) -> None:
        """Fail while a library is loaded."""
        raise ImportError("numpy is not installed") from behind

    with pytest.raises(KeyboardInterrupt):
        checked(loads)(KeyboardInterrupt())
    with pytest.raises(ImportError):
        checked(loads)(ValueError())


@pytest.mark.slow
def test_ctrl_c_stops_a_prediction() -> None:
    tree = monodyn.load("chain:4").tree
    rows = np.linspace(0.0, 20.0, 400_000)
    rollout(tree, rows[:3], np.ones(4), np.zeros(4), substeps=1)
    signal.setitimer(signal.ITIMER_REAL, 0.2)
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            checked(rollout)(tree, rows, np.ones(4), np.zeros(4), substeps=4)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("error", [OSError("disk"), TimeoutError()])
def test_an_error_of_what_the_caller_gave_is_the_callers(error: OSError) -> None:
    def progress(step: str, done: int, total: int | None) -> None:
        """Fail as a callback may."""
        raise error

    with pytest.raises(type(error)) as caught:
        monodyn.identify(swinging(), monodyn.load("single"), progress=progress)
    assert caught.value is error


def swinging() -> Poses:
    """Return a record of a single pendulum."""
    time = np.arange(40) / 30
    position, _ = rollout(monodyn.load("single").tree, time, np.array([0.5]), np.array([0.0]), substeps=8)
    covariance, seen = np.full((40, 1, 1), 1e-6), np.ones(40, dtype=bool)
    return Poses(("joint1",), np.arange(40), time, position, covariance, seen)
