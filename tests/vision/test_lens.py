"""Pictures and points put straight, against OpenCV's own model of a lens."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from monodyn.errors import SettingsError
from monodyn.types import Frame
from monodyn.vision.clip.lens import Lens, lens_of, straightened
from monodyn.vision.clip.video import Video
from support import refuses

BARREL = (-0.28, 0.09, 0.002, -0.001, -0.01)
WIDTH, HEIGHT, FOCAL = 160, 120, 150.0
MATRIX = np.array([[FOCAL, 0.0, 79.5], [0.0, FOCAL, 59.5], [0.0, 0.0, 1.0]])


def shown(points: np.ndarray, coefficients: tuple[float, ...] = BARREL) -> np.ndarray:
    """Return where OpenCV has a lens show places of a straight picture, (point, 2)."""
    ahead = np.column_stack([(points - MATRIX[:2, 2]) / FOCAL, np.ones(len(points))])
    px, _ = cv2.projectPoints(ahead, np.zeros(3), np.zeros(3), MATRIX, np.array(coefficients))
    return px[:, 0]


def disc(centre: np.ndarray, width: int = WIDTH, height: int = HEIGHT) -> np.ndarray:
    """Draw a blurred dark spot on a light wall."""
    columns, rows = np.meshgrid(np.arange(width), np.arange(height))
    away = (columns - centre[0]) ** 2 + (rows - centre[1]) ** 2
    return np.round(200.0 - 150.0 * np.exp(-away / 18.0)).astype(np.uint8)


def middle(picture: np.ndarray) -> np.ndarray:
    """Return the centroid of what is darker than the wall [px]."""
    dark = np.maximum(190.0 - picture, 0.0)
    rows, columns = np.indices(picture.shape)
    return np.array([(dark * columns).sum(), (dark * rows).sum()]) / dark.sum()


@pytest.mark.parametrize("coefficients", [BARREL, BARREL[:4], (0.3, 0.1, 0.0, 0.0)])
def test_points_are_where_a_straight_lens_shows_them(coefficients: tuple[float, ...]) -> None:
    lens = lens_of(coefficients, FOCAL, WIDTH, HEIGHT)
    straight = np.array([[79.5, 59.5], [10.0, 20.0], [150.0, 100.0], [80.0, 3.0]])
    assert lens.points(shown(straight, coefficients)) == pytest.approx(straight, abs=1e-6)


def test_a_point_that_was_not_found_stays_so() -> None:
    lens = lens_of(BARREL, FOCAL, WIDTH, HEIGHT)
    found = lens.points(np.array([[[np.nan, np.nan], [79.5, 59.5]]]))
    assert np.isnan(found[0, 0]).all()
    assert found[0, 1] == pytest.approx([79.5, 59.5])


def test_what_no_straight_picture_shows_is_not_found() -> None:
    """Points in corners that the coefficients fold have no place, the others have theirs."""
    coefficients = (-0.25, 0.08, 0.0, 0.0, -0.012)
    lens = lens_of(coefficients, 870.0, 1920, 1080)
    assert np.isnan(lens.points(np.array([[2.0, 2.0], [1917.0, 1075.0]]))).all()
    straight = np.stack(np.meshgrid(np.linspace(300, 1600, 9), np.linspace(100, 900, 7)), axis=-1)
    ahead = (straight - lens.centre) / 870.0
    matrix = np.array([[870.0, 0.0, 959.5], [0.0, 870.0, 539.5], [0.0, 0.0, 1.0]])
    rays = np.dstack([ahead, np.ones(ahead.shape[:2])]).reshape(-1, 3)
    px, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), matrix, np.array(coefficients))
    assert lens.points(px.reshape(straight.shape)) == pytest.approx(straight, abs=1e-6)


def test_a_place_behind_a_fold_is_none() -> None:
    """Beyond a fold this lens shows places of the picture once more, in order: they are no preimages."""
    lens = Lens((-1.2, 0.6, 0.0, 0.0), 100.0, 160, 120)
    radius = np.linspace(1.0, 200.0, 400)
    found = lens.points(lens.centre + np.outer(radius, [1.0, 0.0]))
    away = found[:, 0] - lens.centre[0]
    seen = np.isfinite(away)
    # r - 1.2 r^3 + 0.6 r^5 rises to its fold at r = 0.65 and again from r = 0.88
    assert 0 < seen.sum() < len(seen)
    assert np.all(away[seen] < 66.0)


def test_pictures_are_put_straight() -> None:
    lens = lens_of(BARREL, FOCAL, WIDTH, HEIGHT)
    for place in np.array([[25.0, 22.0], [80.0, 60.0], [135.0, 30.0]]):
        bent = shown(place[np.newaxis])[0]
        # colour has half the resolution; a pixel of it lies in the middle of four
        colour = disc((bent - 0.5) / 2.0, WIDTH // 2, HEIGHT // 2)
        frame = lens.frame(Frame(3, 0.1, disc(bent), (colour, colour)))
        assert (frame.index, frame.time) == (3, 0.1)
        assert middle(frame.luma) == pytest.approx(place, abs=0.1)
        assert frame.chroma is not None
        for plane in frame.chroma:
            assert middle(plane) == pytest.approx((place - 0.5) / 2.0, abs=0.2)


def test_masks_of_several_objects_stand_one_below_the_other() -> None:
    lens = lens_of(BARREL, FOCAL, WIDTH, HEIGHT)
    one, other = disc(np.array([25.0, 22.0])), disc(np.array([130.0, 90.0]))
    both = lens.frame(Frame(0, 0.0, np.concatenate([one, other]))).luma
    parts = [lens.frame(Frame(0, 0.0, part)).luma for part in (one, other)]
    assert np.array_equal(both, np.concatenate(parts))


def test_a_clip_is_put_straight_frame_by_frame() -> None:
    lens = lens_of(BARREL, FOCAL, WIDTH, HEIGHT)
    frames = [Frame(k, float(k), disc(np.array([30.0 + k, 40.0]))) for k in range(3)]
    video = Video("clip", WIDTH, HEIGHT, np.arange(3.0), lambda start, stop: iter(frames[start:stop]))  # type: ignore[arg-type]
    found = straightened(video, lens)
    assert [frame.index for frame in found.frames(1)] == [1, 2]
    assert np.array_equal(next(found.frames()).luma, lens.frame(frames[0]).luma)
    assert found.straight is not None
    still = replace(frames[0], index=0)
    assert np.array_equal(found.straight(still).luma, lens.frame(still).luma)


def test_what_cannot_be_a_lens_is_refused() -> None:
    said = (
        "camera.distortion: expected the focal length that the coefficients were found with, got none; give "
        "--locate.focal PX."
    )
    with refuses(SettingsError, said):
        lens_of(BARREL, 0.0, WIDTH, HEIGHT)
    said = (
        "camera.distortion: expected coefficients that bend a picture of 160x120 px at a focal length of 150 "
        "px, got some that fold it or move it far off; give K1,K2,P1,P2[,K3] in the order of OpenCV, and the "
        "focal length in pixels of this clip."
    )
    with refuses(SettingsError, said):
        lens_of((-2.0, 0.0, 0.0, 0.0), FOCAL, WIDTH, HEIGHT)
    # the straight picture is not folded, and a third of the bent one has no place in it
    said = said.replace("160x120", "1280x720").replace("150", "700")
    with refuses(SettingsError, said):
        lens_of((-0.3, 0.0, 0.0, 0.0), 700.0, 1280, 720)
    # in order all over, and far outside; and beyond all numbers, without a warning
    for coefficients in ((50.0, 0.0, 0.0, 0.0), (1e300, 0.0, 0.0, 0.0)):
        with refuses(SettingsError, said):
            lens_of(coefficients, 700.0, 1280, 720)
