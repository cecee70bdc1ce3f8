"""Rounded time stamps against the times that they were rounded from."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from monodyn.vision.clip.stamps import clock_of, explaining_steps, usual_rate

MS, CS, FINE = Fraction(1, 1000), Fraction(1, 100), Fraction(1, 90000)


def rounded(times: list[Fraction], unit: Fraction) -> np.ndarray:
    return np.array([int(time / unit + Fraction(1, 2)) for time in times], dtype=np.int64)


def exact(times: list[Fraction]) -> np.ndarray:
    return np.array([float(time) for time in times])


@pytest.mark.parametrize("unit", [MS, CS, FINE, Fraction(1, 600)])
@pytest.mark.parametrize("rate", [Fraction(25), Fraction(30), Fraction(30000, 1001), Fraction(24000, 1001)])
def test_a_constant_rate_comes_back_exactly(rate: Fraction, unit: Fraction) -> None:
    times = [k / rate for k in range(200)]
    clock = clock_of(rounded(times, unit), unit)
    assert clock.tick == 0.0
    # 200 stamps of a hundredth do not always distinguish 30 from 29.97 frames a second
    assert np.abs(clock.times - exact(times)).max() <= (1e-12 if unit != CS else 0.5 * float(CS))


@pytest.mark.parametrize("rate", [Fraction(60000, 1001), Fraction(240), Fraction(2937, 100)])
def test_missing_frames_stay_missing(rate: Fraction) -> None:
    shown = np.flatnonzero(np.random.default_rng(3).random(400) > 0.1)
    times = [int(k) / rate for k in shown]
    clock = clock_of(rounded(times, MS), MS)
    assert clock.tick == 0.0
    # an unusual rate is known to the rounding over the length of the clip
    assert np.abs(clock.times - exact(times)).max() < 3e-5


def test_a_rate_that_the_file_states_decides_between_two() -> None:
    stamps = rounded([k / Fraction(30000, 1001) for k in range(12)], MS)
    assert np.diff(clock_of(stamps, MS).times)[0] == pytest.approx(1 / 30, abs=1e-12)
    stated = clock_of(stamps, MS, [Fraction(30000, 1001)])
    assert np.diff(stated.times)[0] == pytest.approx(1001 / 30000, abs=1e-12)


def test_the_rounding_of_a_file_that_was_remuxed_is_undone() -> None:
    times = [k / Fraction(30000, 1001) for k in range(150)]
    stamps = rounded([Fraction(int(tick), 1000) for tick in rounded(times, MS)], Fraction(1, 15360))
    clock = clock_of(stamps, Fraction(1, 15360))
    assert clock.tick == 0.0
    assert np.abs(clock.times - exact(times)).max() < 1e-12


@pytest.mark.parametrize(
    ("gaps", "unit", "tick"),
    [
        ([25, 50] * 40, MS, 0.001),
        # within half a tick of three ticks each, but no rounding of three ticks makes two and four
        ([2, 4] * 40, CS, 0.01),
        ([33] * 60 + [40] * 60, MS, 0.001),
        ([2, 3, 3, 2, 2, 2, 3, 3, 3, 2] * 8, CS, 0.01),
        ([3000, 3100, 2950, 3012, 3333] * 10, FINE, 1 / 90000),
    ],
)
def test_a_variable_rate_keeps_its_stamps(gaps: list[int], unit: Fraction, tick: float) -> None:
    stamps = np.concatenate([[7], 7 + np.cumsum(gaps)]).astype(np.int64)
    clock = clock_of(stamps, unit)
    assert clock.tick == pytest.approx(tick)
    assert np.array_equal(clock.times, [float(int(stamp) * unit) for stamp in stamps])


def test_no_stamp_moves_by_more_than_half_its_unit() -> None:
    rng = np.random.default_rng(5)
    for rate in rng.uniform(8.0, 250.0, size=30):
        stamps = np.floor(np.arange(300) / rate * 1000.0 + rng.random()).astype(np.int64)
        clock = clock_of(stamps, MS)
        assert clock.tick == 0.0
        assert np.abs(clock.times - stamps * 1e-3).max() <= 0.5e-3 + 1e-9


def test_steps_are_those_between_which_all_numbers_round() -> None:
    numbers = np.floor(1.2 * np.arange(100) + 0.3).astype(np.int64)
    steps = explaining_steps(numbers, np.arange(100))
    assert steps is not None
    assert steps.shortest < 1.2 < steps.longest
    assert steps.longest - steps.shortest < 0.01
    assert usual_rate(steps, Fraction(1, 30)) == 25
    assert explaining_steps(np.array([0, 1, 2, 4, 5, 7]), np.arange(6)) is not None
    assert explaining_steps(np.array([0, 1, 2, 3, 5, 9]), np.arange(6)) is None
