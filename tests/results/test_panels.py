"""The panels of the diagnosis, of a film of known poses: colours stand where they should."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monodyn.results import panels
from monodyn.results.sheet import BLUE, GREEN, INK, PALE, PURPLE, RED, SKY, column_width
from monodyn.results.sight import Sight
from monodyn.types import Poses
from monodyn.vision.clip.video import read
from monodyn.vision.foreground.soft import SoftMasks
from monodyn.vision.locating.scene import Scene
from support import ClipMaker


def share(picture: np.ndarray, colour: tuple[int, int, int]) -> float:
    return float((picture == colour).all(axis=2).mean())


def sight_of(filmed: tuple[Scene, Poses], **changes: Any) -> Sight:
    scene, poses = filmed
    return replace(Sight(scene.masks.video, scene.masks, scene, poses), **changes)


def test_unknown_background_is_hatched(filmed: tuple[Scene, Poses]) -> None:
    scene, _ = filmed
    back = scene.masks.background
    known = back.known.copy()
    known[: len(known) // 2] = False
    blind = SimpleNamespace(background=replace(back, known=known), samples=scene.masks.samples)
    shown = [panels.background_panel(Sight(scene.masks.video, masks)) for masks in (scene.masks, blind)]  # type: ignore[arg-type]
    assert share(shown[0], RED) < 0.02
    # two of seven columns of half of the picture, which is most of the panel
    assert 0.10 < share(shown[1], RED) < 0.15


def test_what_moves_is_drawn_and_the_rest_left_out(filmed: tuple[Scene, Poses]) -> None:
    shown = panels.motion_panel(sight_of(filmed))
    # sky blue at about half its strength over a pale background
    bluish = (shown[..., 0].astype(int) - shown[..., 2] > 40).mean()
    assert 0.05 < bluish < 0.5
    assert share(shown, PALE) > 0.005
    assert SKY[0] > SKY[2]


def test_true_outlines_are_green_and_turned_ones_are_not(filmed: tuple[Scene, Poses]) -> None:
    _, poses = filmed
    good = panels.outline_panels(sight_of(filmed))
    bad = panels.outline_panels(sight_of(filmed, poses=replace(poses, position=poses.position + 0.6)))
    assert len(good) == len(bad) == 2
    assert min(share(shown, GREEN) for shown in good) > 3 * max(share(shown, GREEN) for shown in bad)
    assert share(bad[1], RED) > 10 * share(good[1], RED)
    assert share(good[0], INK) > 0


def test_the_foreground_is_drawn_where_the_mechanism_is(filmed: tuple[Scene, Poses]) -> None:
    shown = panels.foreground_panels(sight_of(filmed))
    assert len(shown) == panels.SHOWN_FRAMES
    assert {picture.shape[1] for picture in shown} == {column_width(panels.SHOWN_FRAMES)}
    for picture in shown:
        strong = np.abs(picture[40:200].astype(int) - BLUE).max(axis=2) < 60
        # two links of 0.2 m x 30 mm and 0.15 m x 24 mm at 400 px and 1.1 m, before 360 x 280 px
        assert 0.5 < strong.mean() / ((0.2 * 0.03 + 0.15 * 0.024) * (400 / 1.1) ** 2 / (360 * 280)) < 1.6


def test_a_plane_of_borders_is_no_colour(
    filmed: tuple[Scene, Poses], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, _ = filmed
    masks = scene.masks
    assert isinstance(masks, SoftMasks)
    trust = np.concatenate([masks.palette.trust, 0.1 * masks.palette.trust[:1]])
    part = np.zeros(2, dtype=np.int64)
    palette = replace(masks.palette, trust=trust, part=part, shaded=part > 0)
    bordered = replace(scene, masks=replace(masks, palette=palette))
    said: list[str] = []
    monkeypatch.setattr(
        panels.sheet, "panel", lambda title, picture, keys, width: said.extend(k.text for k in keys)
    )
    panels.foreground_panels(sight_of((bordered, filmed[1])))
    assert {text.split(":")[0] for text in said} == {"colour 1", "any other difference"}


def test_what_is_missing_is_said(make_clip: ClipMaker) -> None:
    sight = Sight(read(make_clip()))
    for shown in (panels.background_panel(sight), panels.motion_panel(sight), *panels.outline_panels(sight)):
        assert shown.shape[1] == column_width(2)
    assert share(panels.motion_panel(sight), PURPLE) == 0.0
    assert len(panels.foreground_panels(sight)) == panels.SHOWN_FRAMES
