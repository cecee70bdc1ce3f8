"""Every parameter with its interval: what follows from others, and what the picture alone knows."""

import numpy as np
import pytest

from monodyn.estimation.verdict.gravity import GRAVITY_STD
from monodyn.stages import identify


def test_what_follows_is_known_as_well_as_what_it_follows_from(fit, truth):
    """Masses are open with the thickness; the centre of mass is in the middle between the ends."""
    for body in ("link1", "link2"):
        for name in (f"{body}.mass", f"{body}.inertia"):
            assert np.isinf(fit.parameter(name).std)
            assert not fit.parameter(name).identifiable
        centre, half = fit.parameter(f"{body}.com_x"), {"length": 0.5, "tip": 0.5, "tail": -0.5}
        slope = np.array(
            [half.get(name.split(".")[1], 0.0) if name.startswith(body) else 0.0 for name in fit.shared]
        )
        variance = slope @ np.nan_to_num(fit.shared_covariance) @ slope + (GRAVITY_STD * centre.value) ** 2
        assert centre.std == pytest.approx(np.sqrt(variance), rel=1e-3)
        assert centre.lower < truth.values[f"{body}.com_x"] < centre.upper
        assert fit.parameter(f"{body}.com_y").std == 0.0


def test_values_of_the_picture_alone_have_no_interval(poses, double):
    """An offset does not move anything; it follows the length of its body, and is not among the unknowns."""
    seen_so = double.with_values({"link2.offset": -0.008})
    fit = identify(poses, seen_so)
    scale = fit.parameter("link2.length").value / double.values["link2.length"]
    assert ("link2.offset", "link2.length") in fit.tied
    assert fit.parameter("link2.offset").value == pytest.approx(-0.008 * scale, rel=1e-12)
    estimate = fit.parameter("link2.offset")
    assert (estimate.std, estimate.free, estimate.identifiable) == (np.inf, False, False)
    assert estimate.lower < estimate.value < estimate.upper
    assert not any("link2.offset" in line for line in fit.advice)
    known = identify(poses, seen_so.with_choices(fix={"link2.offset": -0.008})).parameter("link2.offset")
    assert (known.value, known.std, known.identifiable) == (-0.008, 0.0, True)
