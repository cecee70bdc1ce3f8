"""A picture aligned with a key picture, against the map that it was made with."""

from __future__ import annotations

import math

import numpy as np
import pytest

from monodyn.types import Frame
from monodyn.vision.clip.homography import Homography, at_rest
from monodyn.vision.registration.align import align, more_alike_blocks
from monodyn.vision.registration.keypicture import key_of, pyramid
from scenes import SIZE, disc, moved, taken, wall

REST = at_rest(SIZE)
SCENE = wall()
KEY = key_of(pyramid(taken(SCENE, REST, 100).luma), REST)


@pytest.mark.parametrize(
    "at",
    [
        moved((0.0, 0.0)),
        moved((0.37, -0.61)),
        moved((5.2, 3.7), 0.02),
        moved((-7.0, 2.0), -0.01, 1.03),
        # as a turn of the camera by a degree looks
        moved((4.2, 0.0), 0.0, 1.0, -4.2 / 240.0**2),
    ],
)
def test_the_map_is_found(at: Homography) -> None:
    found = align(pyramid(taken(SCENE, at, 1).luma), KEY, REST)
    assert found.known
    assert found.blocks == 12
    assert found.at.apart(at) < 0.1
    # the stated deviation is of the size of the error
    assert 0.002 < found.std < 0.15


def test_what_moves_does_not_count() -> None:
    at = moved((3.0, -2.0))
    still = align(pyramid(taken(SCENE, at, 1).luma), KEY, REST)
    key = key_of(pyramid(disc(taken(SCENE, REST, 100), 90, 70, 30).luma), REST)
    found = align(pyramid(disc(taken(SCENE, at, 1), 99, 72, 30).luma), key, REST)
    assert found.known
    assert found.at.apart(at) < 0.1
    assert found.agreeing < still.agreeing


def test_another_light_changes_nothing() -> None:
    at = moved((3.0, -2.0))
    frame = taken(SCENE, at, 1)
    dim = Frame(1, 0.0, np.round(0.8 * frame.luma + 20.0).astype(np.uint8))
    found = align(pyramid(dim.luma), KEY, REST)
    assert found.known
    assert found.at.apart(at) < 0.1


def test_another_scene_is_not_known() -> None:
    assert not align(pyramid(taken(wall(8), REST).luma), KEY, REST).known


def test_a_bare_wall_holds_nothing() -> None:
    bare = Frame(0, 0.0, np.full(SIZE[::-1], 120, np.uint8))
    key = key_of(pyramid(bare.luma), REST)
    assert not key.holds
    assert align(pyramid(bare.luma), key, REST).std == math.inf
    # one moving thing before it is no scene
    lone = key_of(pyramid(disc(bare, 60, 50).luma), REST)
    assert not lone.holds
    assert not align(pyramid(disc(bare, 66, 50).luma), lone, REST).known


def test_what_moves_alone_is_more_alike_in_its_own_blocks() -> None:
    at = moved((6.0, 4.0))
    finest = KEY.levels[-1]
    picture = pyramid(taken(SCENE, at, 1).luma)[-1]
    assert more_alike_blocks(picture, finest, at, REST) == 12
    assert more_alike_blocks(picture, finest, REST, at) == 0
    # a disc that moves before blobs that are others in every picture, as noise before a bare wall is
    key = key_of(pyramid(disc(taken(wall(8), REST), 90, 70, 30).luma), REST).levels[-1]
    other = pyramid(disc(taken(wall(9), REST), 96, 74, 30).luma)[-1]
    assert 1 <= more_alike_blocks(other, key, at, REST) <= 5


def test_points_outside_of_the_picture_do_not_count() -> None:
    # the last of the four columns of blocks is out of the picture in one of the places
    away = moved((75.0, 0.0))
    finest = KEY.levels[-1]
    picture = pyramid(taken(SCENE, REST, 1).luma)[-1]
    assert more_alike_blocks(picture, finest, REST, away) == 9
    picture = pyramid(taken(SCENE, away, 1).luma)[-1]
    assert more_alike_blocks(picture, finest, away, REST) == 9
    assert more_alike_blocks(picture, finest, moved((999.0, 0.0)), REST) == 0


def test_large_pictures_are_aligned_at_half_their_size() -> None:
    sizes = [picture.shape for picture in pyramid(np.zeros((480, 720), np.uint8))]
    assert sizes == [(60, 90), (120, 180), (240, 360)]
    key = key_of(pyramid(np.zeros((480, 720), np.uint8)), at_rest((720, 480)))
    assert [level.scale for level in key.levels] == [8.0, 4.0, 2.0]
