"""Bundled mechanisms: every one loads, and other names are refused with the known ones."""

import pytest

from monodyn.errors import MechanismError
from monodyn.mechanism import BUNDLED, load

NAMES = "'single', 'double', 'triple', 'bob', 'ball', 'cartpole', 'chain:N'"


@pytest.mark.parametrize("name", [*(n for n in BUNDLED if n != "chain:N"), "chain:1", "chain:10"])
def test_every_bundled_mechanism_loads(name: str) -> None:
    mechanism = load(name)
    assert all(p.lower <= p.value <= p.upper for p in mechanism.parameters)
    assert mechanism.name == name
    assert len(mechanism.shapes.body) >= len(mechanism.bodies)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        (
            "quadruple",
            f"mechanism 'quadruple': expected an MJCF or URDF file or a bundled name, got no such file; "
            f"bundled "
            f"names: {NAMES}.",
        ),
        ("chain:0", "mechanism 'chain:0': expected 1 to 10 links, got '0'; write for example 'chain:4'."),
        ("chain:11", "mechanism 'chain:11': expected 1 to 10 links, got '11'; write for example 'chain:4'."),
        (
            "chain:two",
            "mechanism 'chain:two': expected 1 to 10 links, got 'two'; write for example 'chain:4'.",
        ),
    ],
)
def test_refusals_of_names(source: str, message: str) -> None:
    with pytest.raises(MechanismError) as caught:
        load(source)
    assert str(caught.value) == message
