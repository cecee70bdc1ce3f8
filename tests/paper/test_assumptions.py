"""What a film shows of the paper's assumptions, each broken by itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from films import COUNT, Change, film
from monodyn.paper.assumptions import (
    ALONE,
    AS_GIVEN,
    DIVIDES,
    IN_VIEW,
    PARALLEL,
    STILL,
    Assumption,
    film_assumptions,
    silhouette_assumptions,
)
from monodyn.paper.filmed import Outlook

GOOD = Outlook(level=50.0, noise=1.0, undecided=0.1, cut=0.0, apart=0.0)
NAMES = (
    "One threshold divides the mechanism from the background.",
    "The camera stands still.",
    "The mechanism moves alone and is seen in one piece.",
    "All of the mechanism is in the picture and nothing is in front of it.",
    "The bodies have the shapes of the model.",
    "The mechanism moves in a plane parallel to the picture.",
)


def judged(folder: Path, change: Change | None = None, **kwargs: object) -> dict[str, Assumption]:
    """Judge a film by the poses that it has in truth."""
    found = film_assumptions(*film(folder, change, **kwargs))  # pyright: ignore[reportArgumentType]
    assert tuple(own.name for own in found) == NAMES
    return {own.name: own for own in found}


def not_held(found: dict[str, Assumption]) -> list[str]:
    """Name what does not hold."""
    return [name for name, own in found.items() if own.held is False]


@pytest.mark.slow
def test_a_film_as_the_paper_assumes_it(tmp_path: Path) -> None:
    found = judged(tmp_path)
    assert all(own.held for own in found.values()), found
    assert found[STILL].numbers == (
        f"The background is displaced by 0.0 px in the median of {COUNT - 1} frames."
    )
    assert found[IN_VIEW].numbers == (
        "It is followed in 100% of the frames; more than 10% of it are hidden in 0% of them, and 0% of its "
        "outline leave the picture."
    )
    assert found[AS_GIVEN].numbers == (
        "The drawn mechanism leaves 0% of its area of the silhouette uncovered and covers 0% outside of it, "
        "pixels at the outline aside."
    )


@pytest.mark.slow
def test_a_camera_that_moves(tmp_path: Path) -> None:
    """By a twentieth of a pixel a frame, so that the links stay on themselves to two pixels."""

    def drift(k: int, picture: np.ndarray) -> np.ndarray:
        moved = np.array([[1.0, 0.0, 0.05 * k], [0.0, 1.0, 0.0]])
        return cv2.warpAffine(picture, moved, picture.shape[::-1], borderMode=cv2.BORDER_REFLECT)

    found = judged(tmp_path, drift)
    assert not_held(found) == [STILL]
    # half of the two pixels that it moves in the end, at the middle of the clip
    assert found[STILL].numbers.startswith("The background is displaced by 1.0 px ")
    assert found[PARALLEL].numbers == "This cannot be judged where another assumption fails."


@pytest.mark.slow
def test_something_else_moves(tmp_path: Path) -> None:
    def ball(k: int, picture: np.ndarray) -> np.ndarray:
        return cv2.circle(picture.copy(), (20 + 2 * k, 250), 12, 60.0, -1)

    found = judged(tmp_path, ball)
    assert not_held(found) == [ALONE]
    far = next(word for word in found[ALONE].numbers.split() if word.endswith("%"))
    assert found[ALONE].numbers == (
        f"Farther than 16 px from the drawn mechanism up to {far} of its area differ from the background."
    )


@pytest.mark.slow
def test_something_in_front(tmp_path: Path) -> None:
    """A board before the lower part of the second link's way."""

    def board(_: int, picture: np.ndarray) -> np.ndarray:
        out = picture.copy()
        out[185:, 60:260] = 120.0
        return out

    found = judged(tmp_path, board)
    assert not_held(found) == [IN_VIEW]
    assert " of the frames; more than 10% of it are hidden in " in found[IN_VIEW].numbers


@pytest.mark.slow
def test_a_link_that_is_lost_behind_something(tmp_path: Path) -> None:
    """Frames without a pose count where a part of the silhouette is missing, not where all of it is seen."""

    def board(_: int, picture: np.ndarray) -> np.ndarray:
        out = picture.copy()
        out[185:, 60:260] = 120.0
        return out

    lost = (0, 1, 2, 3, 14, 15, 16, 17)
    found = judged(tmp_path, board, lost=lost)
    assert not_held(found) == [IN_VIEW]
    assert found[IN_VIEW].numbers.startswith("It is followed in 80% of the frames, in the others down to ")
    (tmp_path / "clear").mkdir()
    assert not not_held(judged(tmp_path / "clear", lost=lost))


@pytest.mark.slow
def test_bodies_of_another_shape(tmp_path: Path) -> None:
    """The model's links are a third as wide as those in the film."""
    scene, poses = film(tmp_path)
    widths = {f"link{i}.width": 0.3 * scene.mechanism.values[f"link{i}.width"] for i in (1, 2)}
    narrow = replace(scene, mechanism=scene.mechanism.with_values(widths))
    found = {own.name: own for own in film_assumptions(narrow, poses)}
    assert not_held(found) == [AS_GIVEN]


@pytest.mark.slow
def test_a_plane_at_a_slant(tmp_path: Path) -> None:
    """A plane turned by 18 degrees about the upright is seen 0.95 times as wide."""
    scene, poses = film(tmp_path, stretch=0.95)
    truly = np.cumsum(poses.position, axis=1)
    shown = np.unwrap(np.arctan2(np.sin(truly), 0.95 * np.cos(truly)), axis=0)
    followed = replace(poses, position=np.column_stack([shown[:, 0], shown[:, 1] - shown[:, 0]]))
    found = film_assumptions(scene, followed)[-1]
    assert found.held is False
    stretch = next(word for word in found.numbers.split() if word.endswith("%"))
    assert 5.0 < float(stretch.rstrip("%")) < 12.0
    assert found.numbers == (
        "The centroid of the silhouette moves as that of the drawn mechanism, with scales that differ by "
        f"{stretch} between directions."
    )


def test_no_pose_at_all(tmp_path: Path) -> None:
    found = judged(tmp_path, lost=tuple(range(COUNT)))
    assert found[AS_GIVEN] == Assumption(AS_GIVEN, None, "The mechanism was followed in no frame.")
    assert found[STILL] == Assumption(STILL, None, "The background shows too little that could be aligned.")
    assert found[PARALLEL] == Assumption(
        PARALLEL, None, "The motion covers too few directions to compare the picture's scales."
    )


@pytest.mark.parametrize(
    ("change", "name", "numbers"),
    [
        (
            {"undecided": 0.6},
            DIVIDES,
            "The threshold is 50 grey levels, the noise of a pixel 1.0; for each 100 pixels above it 60 are "
            "near it.",
        ),
        ({"apart": 0.4}, ALONE, "40% of the silhouette lie apart from its largest patch."),
        ({"cut": 0.5}, IN_VIEW, "The silhouette ends at the border of the picture in 50% of the frames."),
    ],
)
def test_silhouettes_alone_disprove(change: dict[str, float], name: str, numbers: str) -> None:
    found = silhouette_assumptions(replace(GOOD, **change))
    assert [own for own in found if own.held is False] == [Assumption(name, False, numbers)]
    assert [own.held for own in silhouette_assumptions(GOOD)] == [True, None, None]
