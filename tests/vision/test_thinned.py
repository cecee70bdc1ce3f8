"""As many frames as are wanted, about."""

from __future__ import annotations

import pytest

from monodyn.vision.foreground.thinned import spacing


@pytest.mark.parametrize("wanted", [12, 24])
def test_about_as_many_frames_as_are_wanted_are_taken(wanted: int) -> None:
    for count in range(1, 145):
        taken = len(range(0, count, spacing(count, wanted)))
        if count <= wanted:
            assert taken == count
        else:
            assert 0.75 * wanted <= taken <= 1.5 * wanted
    assert len(range(0, 71, spacing(71, wanted))) == wanted
