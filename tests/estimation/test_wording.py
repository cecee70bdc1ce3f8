"""Numbers, shares and lists as sentences write them."""

import numpy as np
import pytest

from monodyn.estimation.wording import amount, amounts, listed, percent, two_digits
from monodyn.mechanism import load


def test_lists_are_cut_short():
    assert listed(["a"]) == "a"
    assert listed(["a", "b"]) == "a and b"
    assert listed(["a", "b", "c"]) == "a, b and c"
    assert listed(["a", "b", "c", "d"], 2) == "a, b and 2 more"


@pytest.mark.parametrize(
    ("share", "text"), [(0.5, "50 %"), (0.096, "10 %"), (0.0934, "9.3 %"), (0.0012, "0.12 %")]
)
def test_shares_in_per_cent(share, text):
    assert percent(share) == text


def test_degrees_of_hinges_and_millimetres_of_slides():
    cart = load("cartpole")
    slide, hinge = (joint.name for joint in cart.joints)
    assert amount(cart, slide, 0.01234) == "12.3 mm"
    assert amounts(cart, {slide: 0.001, hinge: np.radians(3.0)}) == f"1 mm ({slide}) and 3 deg ({hinge})"


@pytest.mark.parametrize(
    ("value", "text"), [(527.0, "530"), (180.0, "180"), (3.44, "3.4"), (0.0123, "0.012")]
)
def test_two_digits_without_an_exponent(value, text):
    assert two_digits(value) == text
