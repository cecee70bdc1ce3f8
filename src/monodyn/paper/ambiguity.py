"""How one picture may be interpreted: the published framework from several starts, then a decision.

The picture of a chain does not show which of its ends is the hinge. So starts that explain the picture
equally well are compared by the pose problem (3) in a few other frames: there the first hinge has to be in
the same place.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from monodyn.mechanism.tree import HINGE
from monodyn.paper.hinge import along_first_body
from monodyn.paper.sequential import FRAMEWORKS, RoundSchedule
from monodyn.paper.settings import PaperLocateSettings
from monodyn.paper.silhouettes import SilhouetteFrame
from monodyn.paper.start_model import StartModel
from monodyn.paper.starts import EVOLUTIONS, evolved_starts, grid_starts, pose_by_beam
from monodyn.paper.subproblems import History, mismatch
from monodyn.paper.view import ModelView, silhouette_image
from monodyn.types import Frame, Progress
from monodyn.vision.drawing.camera import DEPTH, X, shrunk

STARTS, FINALISTS = 6, 4
"""Starts of the local search in the reduced picture by joint, and those that go on in the whole one."""
EQUIVALENT_SHARE = 0.05
"""Finalists are kept whose mismatch exceeds the least one by at most this share of the silhouette's area."""
DISTINCT_ANGLE = 0.1
"""Ends of the search are distinct when they differ by this angle at some hinge [rad]."""
ACCEPTED = 0.08
"""Mean share of mismatch in the other frames with which neither another picture nor a background without
the mechanism is tried."""
NARROWED = 0.25
"""Mean share of mismatch in the other frames from which the starts of an evolution are tried too."""
MOST_PICTURES = 4
"""Pictures that the framework is tried on at most, the first frame before others."""
COARSE_SHARE = 0.5
"""Share of the silhouettes left that the starts in the reduced picture may draw."""
COARSE_SCHEDULE = RoundSchedule(rounds=10, least=0.2, gain=2e-3)
"""Rounds in the reduced picture."""


class DrawingBudget:
    """Counts the silhouettes that a search draws against a limit, and reports progress.

    Attributes:
        most: Silhouettes at most; the part of the search that passes the limit still ends.
        drawn: Silhouettes so far.
        cut: True once something was left out because the silhouettes were used up.
    """

    def __init__(self, most: int, progress: Progress | None = None) -> None:
        self.most, self.drawn, self.cut = most, 0, False
        self._progress, self._done, self._total = progress, 0, 0

    def expect(self, steps: int) -> None:
        """Begin a part of the search; steps that the part before left out count as done.

        Args:
            steps: Its steps at most.
        """
        self._done = self._total
        self._total += steps
        self._report()

    def step(self, drawings: int) -> None:
        """Count a step.

        Args:
            drawings: Silhouettes that it drew.
        """
        self.drawn += drawings
        self._done += 1
        self._report()

    def over(self, limit: float | None = None) -> bool:
        """Return whether the silhouettes are used up, and keep that in ``cut``.

        Args:
            limit: In place of ``most``.
        """
        over = self.drawn >= (self.most if limit is None else limit)
        self.cut = self.cut or over
        return over

    def _report(self) -> None:
        if self._progress is not None:
            self._progress("locate", self._done, self._total)


@dataclass(frozen=True, eq=False)
class Interpretation:
    """One interpretation of a picture.

    Attributes:
        frame: The picture.
        view: Mechanism, camera and pose.
        cross_mismatch: Mean share of mismatch in other frames, with the pose alone found anew.
        history: The sub-problems that led to it.
    """

    frame: Frame
    view: ModelView
    cross_mismatch: float
    history: tuple[History, ...]


def interpret(
    shown: list[SilhouetteFrame],
    model: StartModel,
    settings: PaperLocateSettings,
    budget: DrawingBudget,
    *,
    shrink: int,
) -> Interpretation:
    """Return the interpretation of one picture that explains the others best; the first good one is taken.

    Args:
        shown: Frames with a silhouette, the first one before others.
        model: The mechanism and the camera that the search starts with.
        settings: ``start``, ``seed`` and ``framework``.
        budget: Counts the silhouettes; a search that passes its limit ends with the best so far.
        shrink: Pixels by side that are merged into one where starts are ranked.
    """
    # strict ratios are searched before a camera that is held, which shows every size
    start = model.view(reference_held=settings.framework != "strict")
    every = max(1, (len(shown) - 1) // (MOST_PICTURES - 1))
    best: Interpretation | None = None
    for begin in dict.fromkeys((settings.start, "evolution")):
        own_settings = replace(settings, start=begin)
        # links that hide each other in one picture stand apart in another, so where the best is bad, the next
        # one is tried
        for own in [shown[0], *shown[1::every]][:MOST_PICTURES]:
            if best is not None and budget.over():
                break
            others = [other for other in shown if other is not own]
            starts = EVOLUTIONS if begin == "evolution" else STARTS * len(start.position)
            budget.expect(1 + 3 * FINALISTS + starts)
            for found, history in _interpretations(own, start, own_settings, budget, shrink):
                view, more = along_first_body(found, model, own, shown)
                budget.step(more)
                share, drawings = cross_mismatch(model.released(view), others)
                budget.step(drawings)
                if best is None or share < best.cross_mismatch:
                    best = Interpretation(own.frame, view, share, history)
            if best is not None and best.cross_mismatch < ACCEPTED:
                break
        # the paper: with bad initial poses an evolutionary search narrows the search space first
        if best is not None and best.cross_mismatch < NARROWED:
            break
    assert best is not None, "every picture has an interpretation"
    return best


def _interpretations(
    own: SilhouetteFrame, start: ModelView, settings: PaperLocateSettings, budget: DrawingBudget, shrink: int
) -> list[tuple[ModelView, tuple[History, ...]]]:
    """Return the interpretations of one picture that explain it about as well as the best."""
    whole, solve = start.base.camera, FRAMEWORKS[settings.framework]
    found: list[tuple[float, ModelView, tuple[History, ...]]] = []
    for candidate in _finalists(own, start, settings, budget, shrink)[:FINALISTS]:
        if found and budget.over():
            break
        # the place in metres is that of the whole picture; focal length and centre are its own
        camera = whole.copy()
        camera[X : DEPTH + 1] = candidate.base.camera[X : DEPTH + 1]
        view, history = solve(own.image, candidate.before(camera), None)
        found.append((mismatch(own.image, view.rig, view.position), view, history))
        budget.step(drawings_of(history))
    least = min(value for value, _, _ in found)
    most = least + EQUIVALENT_SHARE * own.image.area
    return [(view, history) for value, view, history in found if value <= most]


def _finalists(
    own: SilhouetteFrame, start: ModelView, settings: PaperLocateSettings, budget: DrawingBudget, shrink: int
) -> list[ModelView]:
    """Return distinct ends of the framework in the reduced picture, the best first.

    There a silhouette costs little, so many starts can be followed; the sizes of the ends are right to a
    reduced pixel, which is near enough for the framework in the whole picture.
    """
    small = silhouette_image(own.silhouette, shrink=shrink)
    coarse = start.before(shrunk(start.base.camera, shrink))
    # half of the silhouettes that remain at the start; the finalists in the whole picture need the rest
    limit = budget.drawn + COARSE_SHARE * (budget.most - budget.drawn)
    if settings.start == "evolution":
        starts, drawings = evolved_starts(small, coarse, seed=settings.seed)
    else:
        starts, drawings = grid_starts(small, coarse, STARTS * len(coarse.position))
    budget.step(drawings)
    ends: list[tuple[float, ModelView]] = []
    for candidate in starts:
        if ends and budget.over(limit):
            break
        view, history = FRAMEWORKS[settings.framework](small, candidate, COARSE_SCHEDULE)
        ends.append((mismatch(small, view.rig, view.position), view))
        budget.step(drawings_of(history))
    return _distinct([view for _, view in sorted(ends, key=lambda pair: pair[0])])


def _distinct(views: list[ModelView]) -> list[ModelView]:
    """Leave out views whose search ended in the same pose as a better one before them."""
    kept: list[ModelView] = []
    for view in views:
        hinge = view.base.kind == HINGE
        turns = [(view.position - other.position + np.pi) % (2.0 * np.pi) - np.pi for other in kept]
        if all(np.any(np.abs(turn[hinge]) > DISTINCT_ANGLE) for turn in turns):
            kept.append(view)
    return kept


def cross_mismatch(view: ModelView, others: list[SilhouetteFrame]) -> tuple[float, int]:
    """Return the mean share of mismatch of the better three quarters of other frames, and the drawings.

    It is a trimmed mean: a few frames in which a part of the mechanism is hidden should not decide.

    Args:
        view: The mechanism as it was found.
        others: The other frames.
    """
    shares, drawings = [], 0
    for other in others:
        _, left, more = pose_by_beam(other.image, view)
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
