"""Growing one fit after the other until the motion is explained."""

from __future__ import annotations

import numpy as np

from monodyn.estimation.record.samples import Data
from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.problem import Problem, smooth_motion
from monodyn.estimation.shooting.shoot import Grown, Route, grow
from monodyn.estimation.shooting.starts import starts
from monodyn.estimation.verdict.advice import listed
from monodyn.estimation.verdict.trust import motion_sizes, typical_differences
from monodyn.optimize import SearchSettings, first_good
from monodyn.types import Progress


class Search:
    """Growing one fit after the other until the motion is explained."""

    def __init__(
        self,
        problem: Problem,
        smoothed: tuple[Smoothed, ...],
        settings: IdentifySettings,
        progress: Progress | None,
    ) -> None:
        fine = SearchSettings(evaluations=settings.evaluations, decrease=1e-4, relative=1e-7)
        self.problem, self.smoothed, self.settings = problem, smoothed, settings
        self.route = Route(settings.piece, settings.error_bound, fine)
        self.motion = smooth_motion(problem, smoothed)
        self._size = np.maximum(motion_sizes(problem.data), 1e-12)
        self._progress, self._done = progress, 0

    def from_starts(self) -> tuple[Grown, int]:
        """Return the best optimum and the number of starts that were tried."""
        tried = starts(
            self.problem, self.motion, self.smoothed, self.route, self.settings.starts, self.settings.seed
        )
        best, count = first_good(
            lambda start: grow(self.problem, start[0], self.smoothed, start[1], self.report, self._hopeless),
            tried,
            cost=price,
            good=self.explained,
        )
        return (best if best.complete else self.grown(best.x, self.route)), count

    def grown(self, x: np.ndarray, route: Route) -> Grown:
        """Return the optimum that one start leads to."""
        return grow(self.problem, x, self.smoothed, route, self.report)

    def explained(self, grown: Grown) -> bool:
        """True when the motion follows the record, within its noise or nearly."""
        return grown.complete and (grown.sigma < 3.0 or self._unexplained(grown) < 0.005)

    def report(self, _: Grown) -> None:
        """Count a stage."""
        self._done += 1
        if self._progress is not None:
            self._progress("identify", self._done, None)

    def _unexplained(self, grown: Grown) -> float:
        return float((typical_differences(self.problem, grown) / self._size).max())

    def _hopeless(self, grown: Grown) -> bool:
        return not np.isfinite(grown.cost) or (grown.sigma > 10.0 and self._unexplained(grown) > 0.01)


def price(grown: Grown) -> float:
    """Rank results: mean size of the whitened residuals, so that gross errors do not rule; abandoned last."""
    size = float(np.mean(np.abs(grown.residuals)))
    return size if grown.complete else 1e12 + size


def hopeless(problem: Problem, smoothed: tuple[Smoothed, ...]) -> str | None:
    """Say why there is no point in a search, or None."""
    data, unusable = problem.data, problem.prior.unusable
    records, dofs = data.slide.shape
    if unusable:
        verb = "is" if len(unusable) == 1 else "are"
        return (
            f"What the picture knows of {listed(unusable, 12)} {verb} not a finite number; locate the "
            "mechanism in a clearer part of the clip, or give measured values with --fix."
        )
    # what the picture knows of the sizes counts as data
    known = problem.prior.rank
    unknowns = len(problem.unknowns) - known + 2 * dofs * records
    if data.samples <= unknowns:
        return (
            f"{data.samples} measured joint positions cannot determine {unknowns} unknowns (parameters and "
            "start states); give more frames or fix parameters."
        )
    names = [joint.name for joint in problem.mechanism.joints]
    for i, found in enumerate(smoothed):
        for dof in range(dofs):
            if not np.isfinite(found.noise[dof]):
                return f"Joint {names[dof]!r} was measured under 5 times in record {i}; give more frames."
    if all(_still(data, dof) for dof in range(dofs)):
        return "Nothing moves in the record: no joint leaves its noise; give frames with motion."
    return None


def _still(data: Data, dof: int) -> bool:
    """True when a joint stays within four standard deviations of its noise in every record."""
    for first, stop in zip(data.first[:-1], data.first[1:], strict=True):
        use = data.measured[first:stop, dof]
        if use.any():
            values = data.position[first:stop, dof][use]
            if np.std(values) > 4.0 * np.median(data.std[first:stop, dof][use]):
                return False
    return True
