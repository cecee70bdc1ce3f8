"""Pieces of a drawn page: where a part of a picture is shown, how text is broken, what markers cover."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.results import sheet
from monodyn.results.sheet import PAPER, RED, SOFT, Crop, Key

RAMP = np.arange(60, dtype=np.uint8)[:, None, None] + np.zeros((1, 80, 3), np.uint8)


def test_a_crop_shows_its_part_of_the_picture() -> None:
    crop = Crop(10, 20, 30, 20, 2.0)
    shown = crop.shown(RAMP)
    assert shown.shape == (40, 60, 3)
    # row 25 of the picture lies at row (25 - 20 + 0.5) * 2 - 0.5 of the page
    assert crop.points(np.array([[10.0, 25.0]]))[0].tolist() == [0.5, 10.5]
    assert 25 <= float(shown[10:12, 5].mean()) <= 25.01


def test_a_crop_beyond_the_picture_shows_the_border() -> None:
    shown = Crop(-10, -5, 100, 70, 1.0).shown(RAMP, RED)
    assert shown.shape == (70, 100, 3)
    assert (shown[:5] == RED).all()
    assert (shown[:, :10] == RED).all()
    assert (shown[65:] == RED).all()
    assert np.array_equal(shown[5:65, 10:90], RAMP)
    marked = Crop(-10, -5, 100, 70, 1.0).marked(np.ones((60, 80), bool))
    assert marked.sum() == 60 * 80


def test_a_crop_fits_into_its_place() -> None:
    wide, tall = sheet.fitted_crop((0, 0, 720, 480), 360, 400), sheet.fitted_crop((0, 0, 480, 960), 360, 400)
    assert (wide.scale, wide.size) == (0.5, (360, 240))
    assert tall.size == (200, 400)
    assert sheet.fitted_crop((0, 0, 10, 10), 360, 400).scale == 4.0


def test_text_is_broken_between_words() -> None:
    text = "what stands out from the background is not the mechanism as it was found"
    lines = sheet.wrapped(text, 200)
    assert " ".join(lines) == text
    assert all(sheet.length(line) <= 200 for line in lines)
    assert sheet.wrapped("", 200) == [""]


def test_coverage_is_blended_by_its_share() -> None:
    picture = sheet.blank(2, 2)
    sheet.blended(picture, np.array([[0.0, 1.0], [0.5, 0.01]]), (0, 0, 0))
    assert picture[..., 0].tolist() == [[255, 0], [127, 255]]


def test_stripes_cover_a_part_of_what_is_marked() -> None:
    picture = sheet.blank(28, 28)
    marks = np.zeros((28, 28), bool)
    marks[:, 14:] = True
    sheet.hatch(picture, marks, RED)
    assert (picture[:, :14] == PAPER).all()
    assert (picture[:, 14:] == RED).all(axis=2).mean() == pytest.approx(2 / 7)
    other = sheet.blank(28, 28)
    sheet.hatch(other, marks, RED, rising=False)
    assert not np.array_equal(picture, other)


@pytest.mark.parametrize("shape", ["dot", "ring", "square", "cross", "triangle", "diamond"])
def test_every_marker_lies_about_its_place(shape: str) -> None:
    picture = sheet.blank(40, 40)
    sheet.mark(picture, np.array([20.0, 15.0]), RED, shape)
    rows, columns = np.nonzero((picture != PAPER).any(axis=2))
    assert abs(rows.mean() - 15) < 1.5
    assert abs(columns.mean() - 20) < 1.0
    assert max(np.ptp(rows), np.ptp(columns)) <= 2 * sheet.MARKER + 3


def test_a_legend_takes_as_many_lines_as_it_needs() -> None:
    keys = [Key(f"entry {k}", SOFT, shape) for k, shape in enumerate(("box", "hatch", "line", "dot"))]
    assert sheet.legend(keys, 900).shape == (20, 900, 3)
    assert sheet.legend(keys, 120).shape == (80, 120, 3)


def test_a_panel_has_its_picture_in_the_middle() -> None:
    shown = sheet.panel("Title", sheet.blank(50, 40, RED), [Key("said")], 100)
    assert shown.shape[1] == 100
    assert (shown[30:80, 30:70] == RED).all()
    assert (shown[30:80, :30] == sheet.GROUND).all()


def test_a_row_is_as_wide_as_the_page() -> None:
    width = sheet.column_width(2)
    shown = sheet.row([sheet.blank(10, width, RED), sheet.blank(20, width, RED)])
    assert shown.shape == (20, sheet.WIDTH, 3)
    assert (shown == RED).all(axis=2).sum() == 30 * width


def test_what_is_absent_is_said() -> None:
    picture = sheet.absent("nothing was tracked", 300, 60)
    assert picture.shape == (60, 300, 3)
    assert picture.min() < 100
