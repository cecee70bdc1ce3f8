"""A film within a number of bytes: as it is, or reduced and cut."""

from __future__ import annotations

import io
from pathlib import Path

import av
import pytest

from fits import noisy_film
from monodyn.results.embedded import SIDE, embedded


def test_a_film_that_fits_in_is_taken_as_it_is(tmp_path: Path) -> None:
    film = noisy_film(tmp_path / "film.mp4")
    assert embedded(film, film.stat().st_size) == (film.read_bytes(), None)


@pytest.mark.parametrize("size", [(96, 64), (SIDE * 2, 98)])
def test_a_larger_one_is_reduced_and_cut_to_what_there_is_room_for(
    size: tuple[int, int], tmp_path: Path
) -> None:
    film = noisy_film(tmp_path / "film.mp4", size)
    most = film.stat().st_size // 3
    made, shown = embedded(film, most)
    assert len(made) <= most
    with av.open(io.BytesIO(made)) as container:
        pictures = list(container.decode(video=0))
    assert 10 < len(pictures) <= 90
    assert max(pictures[0].width, pictures[0].height) <= SIDE
    assert pictures[0].width / pictures[0].height == pytest.approx(size[0] / size[1], rel=0.05)
    # what is shown ends with the last picture that is there
    assert shown is None or shown == pytest.approx(len(pictures) / 30.0, abs=0.05)
