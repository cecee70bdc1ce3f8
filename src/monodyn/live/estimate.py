"""What a stream knows of a mechanism at one frame: state, parameters with deviations, and what comes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from monodyn.estimation.fit import Doubt, Fit, Grade
from monodyn.estimation.parts import Start
from monodyn.estimation.verdict.intervals import errs_by_factor, stated
from monodyn.estimation.window import Refitted
from monodyn.results.predict import Prediction

SURELY = 1.96
"""Half width of a 95 % interval in standard deviations."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """What was identified at one frame.

    Attributes:
        base: The last fit of a whole stretch, whose verdict holds until the next.
        found: The optimum of the window.
        time: Time stamps of the window [s], (row,).
        covariance: Covariance of unknowns and state at its first row in the units of the parameters,
            (unknown, unknown).
        future: The motion from the last frame on.
        added: What the last fit of a whole stretch has added to the variance of its parameters for what the
            model lacks, by name.
        astray: Why the motion is no longer that of the mechanism, a sentence; empty where it is.
    """

    base: Fit
    found: Refitted = field(repr=False)
    time: np.ndarray
    covariance: np.ndarray
    future: Prediction
    added: Mapping[str, float] = field(default_factory=dict)
    astray: str = ""

    @property
    def grade(self) -> Grade:
        """How far it can be relied on."""
        return "refused" if self.astray else self.base.grade

    def state(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the state at a time.

        Args:
            time: A time [s]; beyond the prediction its end counts.

        Returns:
            Joint positions [rad or m] and rates [rad/s or m/s], each (dof,).
        """
        future = self.future
        at = min(max(int(np.searchsorted(future.time, time)) - 1, 0), len(future.time) - 2)
        begin, end = future.time[at : at + 2].tolist()
        step = end - begin
        u = min(max((time - begin) / step, 0.0), 1.0)
        # cubic through positions and rates at either side (Hermite)
        bent, steep = u * u * (3.0 - 2.0 * u), 6.0 * u * (1.0 - u) / step
        weights = np.array(
            (
                (1.0 - bent, bent, step * u * (1.0 - u) ** 2, step * u * u * (u - 1.0)),
                (-steep, steep, (1.0 - u) * (1.0 - 3.0 * u), u * (3.0 * u - 2.0)),
            )
        )
        ends = np.concatenate((future.position[at : at + 2], future.velocity[at : at + 2]))
        position, velocity = weights @ ends
        return position, velocity

    def expected(self, time: float) -> np.ndarray:
        """Return where the dynamics have the joints, as pictures have them.

        Args:
            time: A time [s]; beyond the prediction its end counts.

        Returns:
            Joint positions [rad; m in the start scale], (dof,).
        """
        problem = self.found.window.problem
        turned = problem.roll(self.found.x) * problem.data.by_roll[0]
        return (self.state(time)[0] - turned) / self.found.unit

    @cached_property
    def std(self) -> dict[str, float]:
        """Standard deviations of the estimated parameters by name; infinite where the data do not fix one."""
        variance = np.maximum(np.diag(self.covariance), 0.0).tolist()
        known = dict(zip(self.base.shared, variance, strict=False))
        return {
            p.name: p.std if np.isinf(p.std) else math.sqrt(known[p.name] + self.added.get(p.name, 0.0))
            for p in self.base.parameters
            if p.free
        }

    @cached_property
    def fit(self) -> Fit:
        """The same as a fit, with the window as its record."""
        mechanism, unknowns = self.found.mechanism, self.found.window.problem.unknowns
        values, parameters = {now.name: now for now in mechanism.parameters}, []
        for p in self.base.parameters:
            now = values[p.name]
            if p.free or p.std != 0.0 or now.value != p.value:
                std = self.std.get(p.name, p.std)
                by_factor = errs_by_factor(unknowns, now)
                one = stated(now, std, SURELY, by_factor=by_factor, free=p.free, at_bound=p.at_bound)
                # what is determined is said with the verdict
                known = p.identifiable
                p = one if one.identifiable == known else replace(one, identifiable=known)
            parameters.append(p)
        dofs = len(mechanism.joints)
        position, velocity = np.split(self.found.state, 2)
        own = self.covariance[-2 * dofs :, -2 * dofs :]
        residual = self.found.residual * self.found.unit
        rms = np.sqrt(np.nanmean(residual**2, axis=0)).tolist()
        fit = replace(
            self.base, mechanism=mechanism, parameters=tuple(parameters), combinations=(),
            starts=(Start(float(self.time[0]), position, velocity, own),), covariance=self.covariance,
            residual=(residual,), time=(self.time,), scale=self.found.scale,
            rms=dict(zip((joint.name for joint in mechanism.joints), rms, strict=True)),
            common=(),
        )  # fmt: skip
        return fit.doubted([Doubt("refused", self.astray)]) if self.astray else fit
