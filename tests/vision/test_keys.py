"""Frames registered one after the other, against the maps that they were made with."""

from __future__ import annotations

import numpy as np

from monodyn.types import Frame
from monodyn.vision.clip.homography import at_rest
from monodyn.vision.registration.keypicture import key_of, pyramid
from monodyn.vision.registration.keys import PATIENCE, Registrar
from scenes import SIZE, hand_held, moved, taken, wall

SCENE = wall()


def black(index: int) -> Frame:
    return Frame(index, index / 30, np.zeros(SIZE[::-1], np.uint8))


def test_errors_do_not_add_up() -> None:
    maps = hand_held(24)
    registrar = Registrar(SIZE)
    for k, at in enumerate(maps):
        found = registrar.add(taken(SCENE, at, k))
        assert found is not None
        assert found.at.apart(at.after(maps[0].inverse)) < 0.12
    assert registrar.scene == 0


def test_a_long_way_goes_over_several_key_pictures() -> None:
    registrar = Registrar(SIZE)
    for k in range(56):
        # out of the first view, and back again
        at = moved((2.0 * (k - 10) if k < 38 else 2.0 * (66 - k), 0.0))
        found = registrar.add(taken(SCENE, at, k, noise=0.5))
        assert found is not None, k
        assert found.at.apart(at.after(moved((20.0, 0.0)))) < 0.5, k


def test_a_leap_is_found() -> None:
    registrar = Registrar(SIZE)
    registrar.add(taken(SCENE, moved(), 0))
    at = moved((31.0, -22.0))
    found = registrar.add(taken(SCENE, at, 1))
    assert found is not None
    assert found.at.apart(at) < 0.2


def test_black_pictures_and_cuts() -> None:
    registrar = Registrar(SIZE)
    assert registrar.add(black(0)) is None
    assert registrar.scene == -1
    assert registrar.add(taken(SCENE, moved(), 1)) is not None
    assert registrar.scene == 0
    assert registrar.add(black(2)) is None
    assert registrar.add(taken(SCENE, moved((2.0, 0.0)), 3)) is not None
    assert registrar.scene == 0
    other = wall(8)
    found = [registrar.add(taken(other, moved(), 4 + k)) for k in range(PATIENCE + 2)]
    assert all(place is None for place in found[:PATIENCE])
    assert found[-1] is not None
    assert registrar.scene == 1


def test_a_given_scene_stays() -> None:
    rest = at_rest(SIZE)
    registrar = Registrar(SIZE, key_of(pyramid(taken(SCENE, rest, 100).luma), rest))
    for k in range(PATIENCE + 2):
        assert registrar.add(taken(wall(8), rest, k)) is None
    # far from the last place, but where it may be
    at = moved((40.0, 30.0), 0.1)
    found = registrar.add(taken(SCENE, at, 9), moved((38.0, 31.0), 0.1))
    assert found is not None
    assert found.at.apart(at) < 0.2
