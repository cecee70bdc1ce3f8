"""What one picture may mean: the published framework from several starts, told apart by other pictures.

One picture of a chain reads from either end, so the starts that explain the picture equally well are told
apart by the pose problem (3) in a few other frames: the first hinge has to stay where it is.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from monodyn.errors import VideoError
from monodyn.mechanism import Mechanism
from monodyn.paper.sequential import Effort, sequential
from monodyn.paper.slide_gauge import released
from monodyn.paper.starts import SEEDS, evolved_starts, spread_pose, spread_starts
from monodyn.paper.subproblems import History, mismatch
from monodyn.paper.threshold import holds, otsu_level, silhouette
from monodyn.paper.view import DEPTH, Seen, View, X, seen
from monodyn.types import Camera, Frame, Progress
from monodyn.vision.drawing.camera import shrunk
from monodyn.vision.foreground.masks import Masks

COARSE_PX = 150
"""Largest side of the moving part in the reduced picture that starts are ranked in [px]."""
STARTS, FINALISTS = 6, 4
"""Starts of the local search in the reduced picture by joint, and those that go on in the whole one."""
ALIKE = 0.05
"""Finalists explain the picture but for this share of its area more than the best."""
WITNESSES = 8
"""Further frames that tell the finalists apart."""
ACCEPTED = 0.06
"""Mean share of mismatch in the further frames with which neither another picture nor a background without
the mechanism is tried."""
PICTURES = 4
"""Pictures that the framework is tried on at the most, the first frame before others."""
COARSE_SHARE = 0.5
"""Share of the silhouettes left that the starts in the reduced picture may draw."""
ROUGH = Effort(rounds=10, least=0.2, gain=2e-3)
"""For starts in the reduced picture."""


class Meter:
    """Counts the silhouettes that a search draws, and tells how far it is.

    Attributes:
        most: Silhouettes at the most; the part of the search that passes it still ends.
        drawn: Silhouettes so far.
        cut: True once something was left out because they were used up.
    """

    def __init__(self, most: int, progress: Progress | None = None) -> None:
        self.most, self.drawn, self.cut = most, 0, False
        self._progress, self._done, self._total = progress, 0, 0

    def expect(self, steps: int) -> None:
        """Set out on a part of the search; whatever was left of the one before is done.

        Args:
            steps: Its steps at the most.
        """
        self._done = self._total
        self._total += steps
        self._tell()

    def step(self, drawings: int) -> None:
        """Count a step.

        Args:
            drawings: Silhouettes that it drew.
        """
        self.drawn += drawings
        self._done += 1
        self._tell()

    def over(self, limit: float | None = None) -> bool:
        """Return whether the silhouettes are used up, and remember it.

        Args:
            limit: In place of ``most``.
        """
        over = self.drawn >= (self.most if limit is None else limit)
        self.cut = self.cut or over
        return over

    def _tell(self) -> None:
        if self._progress is not None:
            self._progress("locate", self._done, self._total)


@dataclass(frozen=True, eq=False)
class Shot:
    """A picture of the clip and its silhouette.

    Attributes:
        frame: The picture.
        image: Its silhouette.
        drawn: The silhouette as a picture, uint8 (height, width).
    """

    frame: Frame
    image: Seen
    drawn: np.ndarray = field(repr=False)


@dataclass(frozen=True, eq=False)
class Reading:
    """One reading of a picture.

    Attributes:
        frame: The picture.
        view: Mechanism, camera and pose.
        strange: Mean share of mismatch in other frames.
        history: The sub-problems that led to it.
    """

    frame: Frame
    view: View
    strange: float
    history: tuple[History, ...]


def read(
    shots: list[Shot], held: View, mechanism: Mechanism, camera: Camera, reach: int, meter: Meter,
    *, start: str = "spread", seed: int = 0,
) -> Reading:  # fmt: skip
    """Return the reading of one picture that explains the others best; the first that serves is taken.

    Args:
        shots: Pictures with a silhouette, the first before others.
        held: The mechanism as it starts, from ``start_view``.
        mechanism: The mechanism.
        camera: Start camera.
        reach: Largest side of the part of the picture that moves [px].
        meter: Counts; a search that passes its limit ends with the best so far.
        start: Where the local search starts: ``spread`` or ``evolution``.
        seed: Seed of the evolution.
    """
    shrink = max(1, round(reach / COARSE_PX))
    every = max(1, (len(shots) - 1) // (PICTURES - 1))
    best: Reading | None = None
    for shot in [shots[0], *shots[1::every]][:PICTURES]:
        if best is not None and meter.over():
            break
        others = [other for other in shots if other is not shot]
        meter.expect(1 + 2 * FINALISTS + (SEEDS if start == "evolution" else STARTS * len(held.position)))
        for view, history in _readings(shot, held, start, seed, shrink, meter):
            strange, drawings = strangeness(released(view, mechanism, camera), others)
            meter.step(drawings)
            if best is None or strange < best.strange:
                best = Reading(shot.frame, view, strange, history)
        if best is not None and best.strange < ACCEPTED:
            break
    assert best is not None, "every picture has a reading"
    return best


def _readings(
    shot: Shot, held: View, start: str, seed: int, shrink: int, meter: Meter
) -> list[tuple[View, tuple[History, ...]]]:
    """Return the readings of one picture that explain it about as well as the best."""
    small = seen(shot.drawn, shrink=shrink)
    whole = held.base.camera
    coarse = held.before(shrunk(whole, shrink))
    limit = meter.drawn + COARSE_SHARE * (meter.most - meter.drawn)
    if start == "evolution":
        starts, drawings = evolved_starts(small, coarse, seed=seed)
    else:
        starts, drawings = spread_starts(small, coarse, STARTS * len(coarse.position))
    meter.step(drawings)
    rough: list[tuple[float, View]] = []
    for candidate in starts:
        if rough and meter.over(limit):
            break
        view, history = sequential(small, candidate, ROUGH)
        rough.append((mismatch(small, view.rig, view.position), view))
        meter.step(drawings_of(history))
    readings: list[tuple[float, View, tuple[History, ...]]] = []
    for _, candidate in _different(sorted(rough, key=lambda pair: pair[0]))[:FINALISTS]:
        if readings and meter.over():
            break
        camera = whole.copy()
        camera[X : DEPTH + 1] = candidate.base.camera[X : DEPTH + 1]
        view, history = sequential(shot.image, candidate.before(camera))
        readings.append((mismatch(shot.image, view.rig, view.position), view, history))
        meter.step(drawings_of(history))
    least = min(value for value, _, _ in readings)
    return [(view, history) for value, view, history in readings if value <= least + ALIKE * shot.image.area]


def _different(rough: list[tuple[float, View]]) -> list[tuple[float, View]]:
    """Leave out what came to the same pose as a better one."""
    kept: list[tuple[float, View]] = []
    for value, view in rough:
        hinge = view.base.kind == 0
        turns = [(view.position - other.position + np.pi) % (2.0 * np.pi) - np.pi for _, other in kept]
        if all(np.any(np.abs(turn[hinge]) > 0.1) for turn in turns):
            kept.append((value, view))
    return kept


def strangeness(view: View, others: list[Shot]) -> tuple[float, int]:
    """Return the mean share of mismatch of the better three quarters of other frames, and the drawings.

    Args:
        view: The mechanism as it was found.
        others: The other frames.
    """
    shares, drawings = [], 0
    for other in others:
        _, left, more = spread_pose(other.image, view)
        shares.append(left / other.image.area)
        drawings += more
    better = np.sort(shares)[: max(1, (3 * len(shares) + 3) // 4)]
    return (float(np.mean(better)) if shares else 0.0), drawings


def drawings_of(history: tuple[History, ...] | list[History]) -> int:
    """Return how many silhouettes sub-problems drew.

    Args:
        history: The sub-problems.
    """
    return int(sum(int(part.evaluations[-1]) for part in history))


def shots_of(masks: Masks, first: Frame, level: float) -> list[Shot]:
    """Return the first frame, then sample frames spread over the motion, those with a silhouette alone.

    Args:
        masks: The soft foreground of the clip.
        first: Its first frame.
        level: Threshold of the silhouettes [grey levels]; 0 takes Otsu's.

    Raises:
        VideoError: the mechanism stands out from the background in no frame.
    """
    level = level_of(masks, level)
    frames = [first, *(frame for frame in masks.samples.frames if frame.index != first.index)]
    picks = [0, *np.unique(np.linspace(1, len(frames) - 1, WITNESSES).round().astype(int))]
    shots = []
    for i in picks:
        drawn = silhouette(frames[i], masks.background, level)
        if holds(drawn):
            shots.append(Shot(frames[i], seen(drawn), drawn))
    if not shots:
        raise VideoError(
            f"{masks.video.path}: expected the mechanism to stand out by {level:.0f} grey levels, found it "
            "in no frame; set --locate.level lower, or use another method."
        )
    return shots


def shot_of(frame: Frame, masks: Masks, level: float) -> Shot:
    """Return a frame with its silhouette.

    Args:
        frame: The frame.
        masks: The soft foreground of the clip.
        level: Threshold of the silhouettes [grey levels]; 0 takes Otsu's.

    Raises:
        VideoError: the silhouette is empty.
    """
    drawn = silhouette(frame, masks.background, level_of(masks, level))
    return Shot(frame, seen(drawn), drawn)


def level_of(masks: Masks, level: float = 0.0) -> float:
    """Return the threshold of a clip's silhouettes [grey levels].

    Args:
        masks: The masks of the clip.
        level: The user's; 0 takes Otsu's over the sample frames.
    """
    return level or otsu_level(masks.samples.frames, masks.background)
