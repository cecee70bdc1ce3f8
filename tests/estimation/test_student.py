"""Half widths of intervals, against scipy's quantiles of Student's distribution."""

from __future__ import annotations

import pytest
from scipy.special import stdtrit

from monodyn.estimation.verdict.student import half_width


@pytest.mark.parametrize("freedom", [1.0, 1.5, 2.0, 10.0, 333.3, 1e4, 1e7])
def test_half_widths_are_quantiles(freedom: float) -> None:
    # the gamma functions of large numbers differ by little, of which rounding takes a share; scipy 1.13 has
    # ten digits
    assert half_width(freedom) == pytest.approx(stdtrit(freedom, 0.975), rel=1e-10 + 1e-14 * freedom)


def test_less_than_one_counts_as_one() -> None:
    assert half_width(0.3) == half_width(1.0)
