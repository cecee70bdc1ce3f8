"""Colours measured inside of located geoms."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from models import mjcf, read
from monodyn.mechanism import load
from monodyn.types import Frame
from monodyn.vision.drawing.outline import outline
from monodyn.vision.foreground.background import Background, Window
from monodyn.vision.foreground.masks import BACK, FRONT, NOT_SHOWN, VARIED
from monodyn.vision.locating import colours
from monodyn.vision.locating.colours import geom_colours
from monodyn.vision.locating.search import SceneGuess
from pictures import CAMERA

SIZE = (CAMERA.height, CAMERA.width)
BACKGROUND = Background(
    np.full(SIZE, 160.0, np.float32), None, 1.0, np.ones(SIZE, bool), Window(0, SIZE[0], 0, SIZE[1])
)
POSES = np.array([[-0.9, 0.8], [-0.5, 1.1], [-0.2, 0.9]])
MECHANISM = load("double").with_values({"link1.width": 0.05, "link2.width": 0.05})
GUESS = SceneGuess(MECHANISM, CAMERA, POSES, np.zeros(3))
FOUR = SceneGuess(MECHANISM, CAMERA, POSES[[0, 0, 1, 2]], np.zeros(4))


def painted(*levels: int, stripes: int = 0, guess: SceneGuess = GUESS) -> list[Frame]:
    """Paint each geom in its grey level; ``stripes`` alternates the last one's with the background's."""
    frames = []
    for i, q in enumerate(guess.positions):
        luma = np.full(SIZE, 160, np.uint8)
        for (_, polygon), level in zip(outline(guess.mechanism, CAMERA, q), levels, strict=True):
            cv2.fillPoly(luma, [np.round(polygon).astype(np.int32)], level)
        if stripes:
            inside = luma == levels[-1]
            luma[inside & ((np.indices(SIZE).sum(axis=0) // stripes) % 3 == 0)] = 160
        frames.append(Frame(i, i / 30, luma))
    return frames


def test_each_geom_has_its_own_colour() -> None:
    found = geom_colours(painted(60, 230), BACKGROUND, GUESS, np.ones(3, bool))
    assert found is not None
    assert found.colours[found.part, 0].tolist() == [60.0, 230.0]
    assert not found.shaded.any()


def test_what_two_geoms_cover_shows_the_one_in_front() -> None:
    for levels in ((60, 230), (230, 60), (60, 100)):
        found = geom_colours(painted(*levels), BACKGROUND, GUESS, np.ones(3, bool))
        assert found is not None
        assert found.order is not None
        assert found.order.tolist() == [[0, BACK], [FRONT, 0]]
    alike = geom_colours(painted(60, 62), BACKGROUND, GUESS, np.ones(3, bool))
    assert alike is not None
    assert alike.order is not None
    assert not alike.order.any()


def test_a_geom_that_shows_nothing_alone_has_no_place_in_the_order(tmp_path: Path) -> None:
    """A disc that lies wholly on the link that it is painted on, in its own colour."""
    disc = (
        '<body name="link1"><joint type="hinge" axis="0 -1 0"/>'
        '<geom type="box" size="0.15 0.003 0.05" pos="0.15 0 0"/>'
        '<geom name="disc" type="cylinder" size="0.03 0.005" pos="0.15 0 0" euler="90 0 0"/></body>'
    )
    mechanism = read(tmp_path, mjcf(disc))
    guess = SceneGuess(mechanism, CAMERA, POSES[:, :1], np.zeros(3))
    found = geom_colours(painted(60, 230, guess=guess), BACKGROUND, guess, np.ones(3, bool))
    assert found is not None
    assert found.order is not None
    assert not found.order.any()


def test_where_thin_geoms_cross_all_is_mixed_and_no_order_known() -> None:
    # at the same places in 42 frames: enough pixels for a vote
    thin = SceneGuess(
        MECHANISM.with_values({"link1.width": 0.004, "link2.width": 0.004}),
        CAMERA, np.repeat(POSES, 14, axis=0), np.zeros(42),
    )  # fmt: skip
    found = geom_colours(painted(60, 230, guess=thin), BACKGROUND, thin, np.ones(42, bool))
    assert found is not None
    assert sorted(found.part.tolist()) == [0, 1]
    assert found.order is not None
    assert not found.order.any()


def test_where_either_shows_no_geom_is_known_to_lie_in_front() -> None:
    """Painted one over the other in turn, as pages are that are turned."""
    frames = painted(60, 230)
    for frame, q in zip(frames[:1], POSES, strict=False):
        first = np.round(outline(MECHANISM, CAMERA, q)[0][1]).astype(np.int32)
        cv2.fillPoly(frame.luma, [first], 60)
    found = geom_colours(frames, BACKGROUND, GUESS, np.ones(3, bool))
    assert found is not None
    assert found.order is not None
    assert not found.order.any()


def test_colours_of_what_moves_are_those_of_pixels_covered_all_the_time() -> None:
    """Each picture is the mean of seven poses; rims are darker than the middle, with which motion mixes that
    of the second link."""
    wide = MECHANISM.with_values({"link1.width": 0.1, "link2.width": 0.1})
    guess = replace(GUESS, mechanism=wide)
    turn = np.linspace(-0.06, 0.06, 7)[:, None] * [1.0, 0.5]
    during = [q + turn for q in POSES]
    frames = []
    for i, poses in enumerate(during):
        mean = np.zeros(SIZE)
        for q in poses:
            luma = np.full(SIZE, 160.0, np.float32)
            for _, polygon in outline(wide, CAMERA, q):
                corners = [np.round(polygon).astype(np.int32)]
                cv2.fillPoly(luma, corners, 80.0)
                cv2.polylines(luma, corners, True, 60.0, 13)
            mean += luma / len(poses)
        frames.append(Frame(i, i / 30, mean.round().astype(np.uint8)))
    found = geom_colours(frames, BACKGROUND, guess, np.ones(3, bool), meanwhile=during)
    assert found is not None
    assert found.colours[found.part, 0] == pytest.approx([60.0, 70.0], abs=3.0)
    sharp = geom_colours(frames, BACKGROUND, guess, np.ones(3, bool))
    assert sharp is not None
    assert sharp.colours[sharp.part, 0].min() > 68.0


def test_a_frame_that_does_not_show_every_geom_gives_no_colours(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the first pose the first geom is behind the camera: the other's pixels must not count as its own."""
    frames = painted(60, 230)
    monkeypatch.setattr(
        colours, "outline", lambda m, c, q: outline(m, c, q)[1 if q[0] == POSES[0, 0] else 0 :]
    )
    found = geom_colours(frames[:1] * 2 + frames[1:], BACKGROUND, FOUR, np.ones(4, bool))
    assert found is not None
    assert found.colours[found.part, 0].tolist() == [60.0, 230.0]


def test_the_light_on_a_geom_is_measured_beyond_the_noise() -> None:
    """Eleven levels from 0.75 to 1.25 of the colour: 0.34 of that range lie on either side of its middle."""
    rng = np.random.default_rng(0)
    frames = []
    for frame in painted(116, 230):
        blue, red = (np.full((SIZE[0] // 2, SIZE[1] // 2), 128, np.uint8) for _ in range(2))
        light = rng.integers(0, 11, SIZE) / 20 + 0.75
        luma = np.where(frame.luma == 116, np.round(16 + 100 * light), frame.luma).astype(np.uint8)
        frames.append(Frame(frame.index, frame.time, luma, (blue, red)))
    grey = np.full((SIZE[0] // 2, SIZE[1] // 2), 128, np.float32)
    found = geom_colours(frames, replace(BACKGROUND, chroma=(grey, grey)), GUESS, np.ones(3, bool))
    assert found is not None
    assert found.light is not None
    assert found.light[found.part] == pytest.approx([0.17, 0.0], abs=0.03)


@pytest.mark.parametrize("stripes", [0, 5])
def test_a_geom_that_shows_the_wall_alone_is_not_shown(stripes: int) -> None:
    """The second link is a thread that the camera does not see, before a wall with a pattern of its own."""
    wall = np.where(np.indices(SIZE)[1] // 12 % 2, 150, 160).astype(np.uint8)
    thread = replace(GUESS, mechanism=MECHANISM.with_values({"link2.width": 0.01}))
    frames = []
    for frame in painted(60, 160):
        luma = np.where(frame.luma == 60, 60, wall).astype(np.uint8)
        if stripes:
            luma[(luma == 60) & ((np.indices(SIZE).sum(axis=0) // stripes) % 3 == 0)] = 230
        frames.append(Frame(frame.index, frame.time, luma))
    behind = replace(BACKGROUND, luma=wall.astype(np.float32))
    found = geom_colours(frames, behind, thread, np.ones(3, bool))
    assert found is not None
    assert found.part.tolist() == [VARIED if stripes else 0, NOT_SHOWN]
    # something wide that looks like what is behind it stands before its own picture
    wide = geom_colours(frames, behind, GUESS, np.ones(3, bool))
    assert wide is not None
    assert wide.part[1] != NOT_SHOWN
    nothing = geom_colours(painted(160, 160), BACKGROUND, thread, np.ones(3, bool))
    # where nothing stands out, noise may hide all, and all may be there
    assert nothing is not None
    assert (nothing.part >= 0).all()


@pytest.mark.parametrize(("light", "shared"), [(0.25, True), (0.02, False)])
def test_what_the_light_on_a_geom_explains_is_no_other_colour(light: float, shared: bool) -> None:
    """The second link is lit by an eighth more than the first, on which the light differs by ``light``."""
    rng = np.random.default_rng(0)
    frames = []
    for frame in painted(60, 230):
        lit = np.where(frame.luma == 60, 1.0 + light * rng.uniform(-1.0, 1.0, SIZE), 1.125)
        inside = frame.luma != 160
        luma = np.where(inside, np.round(16 + 100 * lit), 160).astype(np.uint8)
        blue, red = (
            np.where(inside, np.round(128 + tint * lit), 128).astype(np.uint8)[::2, ::2] for tint in (60, -40)
        )
        frames.append(Frame(frame.index, frame.time, luma, (blue, red)))
    grey = np.full((SIZE[0] // 2, SIZE[1] // 2), 128, np.float32)
    found = geom_colours(frames, replace(BACKGROUND, chroma=(grey, grey)), GUESS, np.ones(3, bool))
    assert found is not None
    assert (found.part[0] == found.part[1]) == shared


def test_geoms_alike_share_a_colour() -> None:
    found = geom_colours(painted(60, 65), BACKGROUND, GUESS, np.ones(3, bool))
    assert found is not None
    assert len(found.colours) == 1
    assert found.part.tolist() == [0, 0]


def test_a_geom_that_often_looks_like_the_background_has_no_colour() -> None:
    found = geom_colours(painted(60, 230, stripes=2), BACKGROUND, GUESS, np.ones(3, bool))
    assert found is not None
    assert found.part[1] == VARIED
    # its edges are taken against its own level
    assert found.shaded.tolist() == [False, True]


def test_noise_does_not_choose_the_colour_of_a_thin_geom() -> None:
    thin = MECHANISM.with_values({"link1.width": 0.02, "link2.width": 0.02})
    rng = np.random.default_rng(3)
    frames = []
    for i, q in enumerate(POSES):
        covered = np.zeros(SIZE, np.float32)
        for _, polygon in outline(thin, CAMERA, q):
            cv2.fillPoly(covered, [np.round(polygon).astype(np.int32)], 1.0)
        covered = cv2.GaussianBlur(covered, (0, 0), 0.7)
        luma = 160.0 - 80.0 * covered + rng.normal(scale=4.0, size=SIZE)
        frames.append(Frame(i, i / 30, np.clip(np.round(luma), 0, 255).astype(np.uint8)))
    guess = SceneGuess(thin, CAMERA, POSES, np.zeros(3))
    found = geom_colours(frames, BACKGROUND, guess, np.ones(3, bool))
    assert found is not None
    # the quarter that stands out most would be at 75: 1.15 times the noise below
    assert abs(found.colours[0, 0] - 80.0) <= 2.0


def test_frames_in_which_the_mechanism_is_not_found_do_not_count() -> None:
    assert geom_colours(painted(60, 230), BACKGROUND, GUESS, np.zeros(3, bool)) is None


def test_a_geom_before_its_own_colour_is_camouflaged() -> None:
    found = geom_colours(painted(60, 230), BACKGROUND, GUESS, np.ones(3, bool))
    assert found is not None
    assert not found.camouflaged
    behind = BACKGROUND.luma.copy()
    behind[:, : SIZE[1] // 2] = 60.0
    half = replace(BACKGROUND, luma=behind)
    found = geom_colours(painted(60, 230), half, GUESS, np.ones(3, bool))
    assert found is not None
    assert found.camouflaged
