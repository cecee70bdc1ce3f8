"""What happens to a made clip: a hand, a post, somebody at the edge, light, a camera that is held by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from spec import Colour

SKIN, POST, COAT = (214, 168, 140), (96, 120, 88), (40, 60, 110)
"""Colours of a hand, of a post and of a person, RGB."""


@dataclass(frozen=True, eq=False)
class Moment:
    """What an effect may look at.

    Attributes:
        index: Number of the picture.
        time: Since the clip began [s].
        held: Until when the mechanism is held [s].
        places: Where each body ends in the picture [px], (body, 2).
        covered: Share of each pixel that shows the mechanism, (height, width).
    """

    index: int
    time: float
    held: float
    places: np.ndarray
    covered: np.ndarray


FOCAL_PX, MARGIN_PX = 660.0, 60
"""Focal length of a camera that is held by hand, and what its pictures lack at each side [px]."""

Effect = Callable[[np.ndarray, Moment], np.ndarray]
"""Changes a picture before its noise, float RGB (height, width, 3)."""


def _hand(picture: np.ndarray, moment: Moment) -> np.ndarray:
    """Draw a hand that holds the last part and then goes away to the right, an arm behind it."""
    away = np.array([260.0, 60.0]) * max(0.0, moment.time - moment.held)
    tip = moment.places[-1] + away
    corner = tip + np.array([700.0, 160.0])
    return _drawn(picture, lambda to: _line(to, tip, corner, 34, SKIN), lambda to: _disc(to, tip, 26, SKIN))


def _post(picture: np.ndarray, moment: Moment) -> np.ndarray:
    """Draw an upright post a quarter of the way from the middle."""
    width, height = picture.shape[1], picture.shape[0]
    top, foot = np.array([0.6 * width, -9.0]), np.array([0.57 * width, height + 9.0])
    return _drawn(picture, lambda to: _line(to, top, foot, 34, POST))


def _passer_by(picture: np.ndarray, moment: Moment) -> np.ndarray:
    """Draw somebody who sways at the left edge all the time."""
    height = picture.shape[0]
    head = np.array([22.0 + 14.0 * np.sin(1.7 * moment.time), 0.35 * height])
    feet = np.array([12.0 + 6.0 * np.sin(1.7 * moment.time + 0.6), 1.1 * height])
    return _drawn(picture, lambda to: _line(to, head, feet, 52, COAT), lambda to: _disc(to, head, 24, SKIN))


def _clock(picture: np.ndarray, moment: Moment) -> np.ndarray:
    """Write a running clock and a caption that changes once."""
    letters = np.zeros(picture.shape[:2], np.uint8)
    caption = "Double pendulum" if moment.time < 3.0 else "by the window"
    for text, place in ((f"{moment.time:05.2f}", (12, 34)), (caption, (470, 462))):
        cv2.putText(letters, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.9, 255, 2, cv2.LINE_AA)
    share = letters[..., None] / 255.0
    return picture * (1.0 - share) + 250.0 * share


def _fade(picture: np.ndarray, moment: Moment) -> np.ndarray:
    """Fade in from black during the first 0.8 s."""
    return picture * min(1.0, moment.time / 0.8)


def _lamp(picture: np.ndarray, moment: Moment) -> np.ndarray:
    """Make all a quarter darker within 0.4 s, half-way through."""
    return picture * (1.0 - 0.25 * float(np.clip((moment.time - 3.0) / 0.4, 0.0, 1.0)))


def _shadow(picture: np.ndarray, moment: Moment) -> np.ndarray:
    """Cast a soft shadow on the wall, to the right and down."""
    height, width = moment.covered.shape
    shift = np.array([[1.0, 0.0, 34.0], [0.0, 1.0, 22.0]])
    cast = cv2.GaussianBlur(cv2.warpAffine(moment.covered, shift, (width, height)), (0, 0), 3.0)
    return picture * (1.0 - 0.3 * cast * (1.0 - moment.covered))[..., None]


def _pane(picture: np.ndarray, moment: Moment) -> np.ndarray:
    """Put a plot beside the scene whose curve grows and whose cursor moves."""
    height = picture.shape[0]
    beside = np.full((height, 320, 3), 248.0)
    t = np.linspace(0.0, moment.time, 2 + int(40 * moment.time))
    x, y = 20 + 45 * t, height * (0.5 + 0.3 * np.sin(4.4 * t) * np.exp(-0.1 * t))
    curve = np.column_stack([x, y]).round().astype(np.int32)
    cv2.polylines(beside, [curve], False, (30.0, 60.0, 200.0), 3, cv2.LINE_AA)
    cv2.circle(beside, curve[-1].tolist(), 9, (200.0, 40.0, 40.0), -1, cv2.LINE_AA)
    return np.hstack([picture, beside])


EFFECTS: dict[str, Effect] = {
    "hand": _hand,
    "post": _post,
    "passer_by": _passer_by,
    "clock": _clock,
    "fade": _fade,
    "lamp": _lamp,
    "shadow": _shadow,
    "pane": _pane,
}
"""What may happen, by name."""


def held(shake: float = 0.0, drift: float = 0.0, turn: float = 0.0, zoom: float = 0.0) -> Effect:
    """Return the effect of a camera that turns in somebody's hands; its picture is less wide and high.

    Args:
        shake: Jitter of every frame to the right and down, standard deviation [px].
        drift: Slow swaying, amplitude [px].
        turn: Swaying about the optical axis with a period of 3 s, amplitude [deg].
        zoom: Growth of the picture over ten seconds, as a share.
    """

    def effect(picture: np.ndarray, moment: Moment) -> np.ndarray:
        height, width = picture.shape[:2]
        jitter = np.random.default_rng(moment.index).normal(scale=shake, size=2)
        sway = drift * np.array([np.sin(0.9 * moment.time), np.sin(1.3 * moment.time + 1.0)])
        yaw, pitch = (jitter + sway) / FOCAL_PX
        # level on average over a clip of whole periods
        roll = np.radians(turn) * np.sin(2.0 * np.pi / 3.0 * moment.time)
        lens = np.array(
            [[FOCAL_PX, 0.0, (width - 1) / 2], [0.0, FOCAL_PX, (height - 1) / 2], [0.0, 0.0, 1.0]]
        )
        seen = lens @ np.diag([1.0 + 0.1 * zoom * moment.time] * 2 + [1.0])
        turned = cv2.Rodrigues(np.array([-pitch, yaw, roll]))[0]
        warped = cv2.warpPerspective(
            picture, seen @ turned @ np.linalg.inv(lens), (width, height), flags=cv2.INTER_CUBIC
        )
        return warped[MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX]

    return effect


def _drawn(picture: np.ndarray, *strokes: Callable[[np.ndarray], None]) -> np.ndarray:
    """Return a picture with something opaque before it."""
    picture = np.ascontiguousarray(picture)
    for stroke in strokes:
        stroke(picture)
    return picture


def _line(to: np.ndarray, start: np.ndarray, end: np.ndarray, width: int, colour: Colour) -> None:
    cv2.line(
        to, start.round().astype(int).tolist(), end.round().astype(int).tolist(), colour, width, cv2.LINE_AA
    )


def _disc(to: np.ndarray, middle: np.ndarray, radius: int, colour: Colour) -> None:
    cv2.circle(to, middle.round().astype(int).tolist(), radius, colour, -1, cv2.LINE_AA)
