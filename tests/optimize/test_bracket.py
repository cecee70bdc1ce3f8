"""Least values along a line: what is enclosed, how many evaluations, what is refused."""

import numpy as np
import pytest

from minima import Counted
from monodyn.errors import SettingsError
from monodyn.optimize import DirectSettings, golden_section, line_search, swann
from support import refuses


def test_swann_doubles_its_steps_until_the_function_rises():
    function = Counted(lambda x: (x - 12.0) ** 2)
    found = swann(function, 0.0, 1.0)
    assert [float(x) for x in function.places] == [0.0, 1.0, 3.0, 7.0, 15.0, 31.0]
    assert (found.low, found.middle, found.high, found.value) == (7.0, 15.0, 31.0, 9.0)
    assert found.closed
    assert found.evaluations == function.calls


@pytest.mark.parametrize("target", [-37.3, -0.2, 0.0, 0.4, 5.0, 1e4])
def test_swann_encloses_the_minimum(target):
    found = swann(lambda x: abs(x - target), 0.0, 0.5)
    assert found.low <= target <= found.high
    assert found.low <= found.middle <= found.high
    assert found.value <= min(abs(found.low - target), abs(found.high - target))


def test_swann_ends_on_a_bound_and_never_calls_beyond():
    function = Counted(lambda x: -x)
    found = swann(function, 0.0, 1.0, (-5.0, 10.0))
    assert found.middle == found.high == 10.0
    assert max(function.places) <= 10.0
    assert found.evaluations == function.calls


def test_swann_says_when_the_function_falls_for_ever():
    function = Counted(lambda x: -x)
    found = swann(function, 0.0, 1.0, most=9)
    assert not found.closed
    assert found.evaluations == function.calls == 9
    assert found.value == -found.middle == min(-x for x in function.places)


def test_the_golden_section_takes_the_evaluations_of_its_ratio():
    """Each evaluation keeps 0.618 of the interval; one more is spent on the first point."""
    function = Counted(lambda x: (x - 2.2) ** 2)
    found = golden_section(function, (0.0, 5.0), 1e-4)
    expected = int(np.ceil(np.log(1e-4 / 5.0) / np.log((5.0**0.5 - 1.0) / 2.0))) + 1
    assert found.evaluations == function.calls == expected
    assert abs(found.x - 2.2) <= 1e-4


@pytest.mark.parametrize("seed", range(5))
def test_a_line_search_gives_the_best_point_it_ever_evaluated(seed):
    """Rough functions have no single valley; the answer is still the least value seen."""
    rng = np.random.default_rng(seed)
    phases = rng.uniform(0.0, 6.0, 8)
    function = Counted(lambda x: 0.01 * x * x + float(np.sum(np.sin(np.arange(1, 9) * x + phases))))
    found = line_search(function, 1.0, 0.3, (-6.0, 6.0), settings=DirectSettings(1e-3, 200))
    values = [function.function(x) for x in function.places]
    assert found.value == min(values) <= values[0]
    assert found.evaluations == function.calls


def test_a_minimum_on_the_bound_is_exact():
    assert (
        line_search(lambda x: (x - 3.0) ** 2, 0.0, 0.4, (-1.0, 2.0), settings=DirectSettings(1e-3)).x == 2.0
    )
    assert (
        line_search(lambda x: (x + 3.0) ** 2, 0.0, 0.4, (-1.0, 2.0), settings=DirectSettings(1e-3)).x == -1.0
    )


def test_nan_on_a_line_counts_as_infinite():
    found = line_search(
        lambda x: x * x - 4.0 * x if x < 1.5 else np.nan, 0.0, 0.5, settings=DirectSettings(1e-4)
    )
    assert 1.4999 < found.x < 1.5


def test_lines_refuse_what_they_cannot_use():
    with refuses(SettingsError, "swann: expected a step above 0, got 0."):
        swann(abs, 0.0, 0.0)
    with refuses(SettingsError, "swann: the start 3 is outside its bounds 0 to 1; move it inside."):
        swann(abs, 3.0, 1.0, (0.0, 1.0))
    with refuses(SettingsError, "golden_section: expected 2 <= 1.61803 <= 1; order the points."):
        golden_section(abs, (2.0, 1.0), 0.1)
    with refuses(SettingsError, "golden_section: expected 0 <= 3 <= 1; order the points."):
        golden_section(abs, (0.0, 1.0), 0.1, inside=(3.0, 3.0))
