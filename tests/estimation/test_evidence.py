"""Further unknowns: the gain that justifies them."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monodyn.estimation.torque.evidence import EVIDENCE, likeliest, pays


def optimum(cost: float, sigma: float = 1.0, complete: bool = True) -> Any:
    return SimpleNamespace(cost=cost, sigma=sigma, complete=complete)


@pytest.mark.parametrize("added", [1, 4])
@pytest.mark.parametrize("sigma", [0.5, 1.0, 3.0])
def test_a_gain_pays_beyond_the_threshold_alone(added: int, sigma: float) -> None:
    """Twice the cost must fall by EVIDENCE for each unknown, in units of the noise or of larger residuals."""
    least = 0.5 * EVIDENCE * added * max(sigma, 1.0) ** 2
    assert pays(optimum(1000.0), optimum(1000.0 - 1.001 * least, sigma), added)
    assert not pays(optimum(1000.0), optimum(1000.0 - 0.999 * least, sigma), added)
    assert not pays(optimum(1000.0), optimum(0.0, sigma, complete=False), added)


def test_an_unknown_is_charged_the_logarithm_of_the_samples() -> None:
    """Costs of 10 and 10 - gain with three and four unknowns: the larger wins beyond log(samples) / 2."""

    def problem(unknowns: int) -> Any:
        return SimpleNamespace(unknowns=range(unknowns), data=SimpleNamespace(samples=100))

    charge = 0.5 * np.log(100.0)
    for share, best in ((0.99, 0), (1.01, 1)):
        tried = [(problem(3), optimum(10.0)), (problem(4), optimum(10.0 - share * charge))]
        assert likeliest(tried) == best
    # residuals of twice the stated noise are charged for as noise: a gain counts a quarter
    tried = [(problem(3), optimum(10.0, 2.0)), (problem(4), optimum(10.0 - 3.9 * charge, 2.0))]
    assert likeliest(tried) == 0
    tried = [(problem(3), optimum(10.0)), (problem(4), optimum(0.0, complete=False))]
    assert likeliest(tried) == 0
