"""Further unknowns: the gain that justifies them."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monodyn.estimation.record.samples import prepare
from monodyn.estimation.record.shared import without_shared
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.search import Search
from monodyn.estimation.torque.evidence import EVIDENCE, LIKELY, Cleared, at_noise, cleared, likeliest, pays
from monodyn.types import Poses
from swings import TIMES, leaning, motion, record


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


def cleared_of(poses: Poses, double) -> tuple[bool, Cleared | None]:
    """Return whether friction leaves nothing but noise, and what it leaves less what positions share."""
    problem = posed(double, prepare([poses], double))
    search = Search(problem, (smooth(poses),), IdentifySettings(), None)
    optimum, _ = search.from_starts()
    # a motion that was not followed to its end tells nothing
    lost: Any = SimpleNamespace(complete=False)
    assert cleared(problem, lost, search.route) is None
    return at_noise(problem, optimum), cleared(problem, optimum, search.route)


@pytest.mark.slow
def test_what_positions_share_is_taken_off_as_far_as_it_is_likely(truth, double) -> None:
    position = motion(truth, TIMES, [0.9, 0.5], [0.0, 1.0])
    # each of two directions is within three deviations, both together within the root of eleven
    cases = (((-2.5, 0.0), True), ((-1.6 * LIKELY, 0.0), False), ((2.2, -2.2), True), ((2.7, -2.7), False))
    for off, likely in cases:
        shifts = leaning(position)
        wrong = record(truth, TIMES, position + np.tensordot(off, shifts, axes=1))
        assert cleared_of(wrong, double)[1] is None
        explained, found = cleared_of(replace(wrong, shifts=shifts), double)
        assert not explained
        assert (found is not None) == likely
        if found is not None:
            assert at_noise(found.problem, found.optimum)
            np.testing.assert_allclose(found.common.mean, off, atol=0.4)
            # the problem is that of the positions less what was found
            error = np.tensordot(found.common.mean, shifts, axes=1)
            without, _ = without_shared(wrong.position, error, wrong.measured)
            np.testing.assert_allclose(found.problem.data.position, without, atol=1e-12)


@pytest.mark.slow
def test_what_is_left_over_besides_is_something_else(truth, double) -> None:
    """A wave that no camera makes stays, and so does what the camera makes."""
    position = motion(truth, TIMES, [0.9, 0.5], [0.0, 1.0])
    shifts = leaning(position)
    wave = 0.02 * np.sin(9.0 * TIMES)[:, None] ** 3
    poses = replace(record(truth, TIMES, position - 2.5 * shifts[0] + wave), shifts=shifts)
    assert cleared_of(poses, double) == (False, None)
