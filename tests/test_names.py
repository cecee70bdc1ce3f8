"""Which name was meant."""

from __future__ import annotations

import pytest

from monodyn.names import known

PARAMETERS = ["link1.length", "link1.width", "link2.length", "camera.x", "camera.y", "gravity"]


@pytest.mark.parametrize(
    ("given", "end"),
    [
        ("link1.lenght", "did you mean 'link1.length' or 'link2.length'?"),
        ("gravty", "did you mean 'gravity'?"),
        # of the same group, and nothing else
        ("camera.zoom", "parameters: 'link1.length', 'link1.width', 'link2.length', 'camera.x', 'camera.y', "
         "'gravity'."),
    ],
)  # fmt: skip
def test_what_is_near_is_asked_about(given: str, end: str) -> None:
    assert known("parameters", PARAMETERS, given) == end


def test_a_long_list_is_cut() -> None:
    names = [f"joint{k}.damping" for k in range(1, 15)]
    said = known("parameters", names, "gravity")
    assert said == f"parameters: {', '.join(map(repr, names[:12]))} and 2 more."
