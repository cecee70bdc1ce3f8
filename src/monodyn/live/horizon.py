"""Parameters and state at every frame: a window of the last frames, and a cost that stands for all before.

A fit of the first seconds begins it. From then on each frame is one more row of a least-squares problem that
starts at the solution of the frame before; what rows say that leave the window is kept as a cost of the
parameters and the state at its first row (``estimation.window``). Every now and then the last seconds are
identified anew from nothing, by the stage that a whole run has, and it goes on from there: so an error of one
linearization does not stay, and the verdict is that of a run. ``docs/live.md`` has the derivation.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import replace

import numpy as np

from monodyn.arrays import usual_step
from monodyn.errors import FitError, MonodynError
from monodyn.estimation.arrival import Arrival
from monodyn.estimation.fit import Doubt, Fit
from monodyn.estimation.record.samples import Pieces
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.verdict.uncertainty import noise_factors
from monodyn.estimation.window import (
    FEW_STEPS,
    Refitted,
    Window,
    ahead,
    refit,
    slid,
    start_of,
    window_of,
)
from monodyn.live.estimate import Estimate
from monodyn.live.record import joined
from monodyn.live.settings import LiveSettings
from monodyn.mechanism import Mechanism
from monodyn.mechanism.simulate import transitions
from monodyn.results.fill import random_push
from monodyn.results.predict import Prediction
from monodyn.types import Poses, TorqueLog

MEMORY = 60.0
"""Seconds in which what left the window is forgotten to 1 / e: a bearing warms up, a camera is touched."""
PULL = 5.0
"""Whitened residual from which on the pull of a row no longer grows."""
NEAR = replace(FEW_STEPS, decrease=1e-4)
"""When the search of a frame stops: a step of a hundredth of a standard deviation is left to the next."""
ASTRAY = 4.0
"""Size of the residuals of a window, in standard deviations of the noise as the fit before has found it, from
which on the motion is no longer that of the mechanism."""
Acting = Callable[[float, float], TorqueLog | None]
"""Returns the torques that are known to have acted from one time to another [s]; None for none."""
PREDICTED_OFF = 0.03
"""How far off the derivatives of a prediction may be, as ``simulate`` has it, a percent of its deviations."""
LONGEST_GAP = 1.0
"""Seconds out of sight over which the motion is carried on: after more it is begun anew."""
GROWN = 30.0
"""How much an error may grow within the window: what nobody sees pushes a mechanism, and a motion beside an
equilibrium that does not hold itself cannot be followed for long without."""
EXPLAINED, MOST_ROWS = 3.0, 0.9
"""Residual over that of the fit, or over the noise, up to which a stretch is followed as one motion; and the
share of its rows that have no larger one."""
MOST_GROWN = 1e6
"""How much an error may grow over rows that begin a window: its square leaves four digits of the rest."""
ROUGH_STEPS = 2
"""Integration steps between two rows by which it is seen how errors grow."""
SURE = 1e10
"""Size of a matrix times that of its inverse up to which rounding leaves the latter as it is."""
AT_ONCE = 0.25
"""Seconds of rows that leave the window at once: over more, rounding in what is known of the directions in
which motions come together would drown what is known of the others."""
BEGUN = replace(FEW_STEPS, evaluations=50)
"""Search from the state that smooth motion has, which is not as near as the frame before."""
LEAST_ROWS = 6
"""Measured frames from which on a motion that broke off is taken up again."""


class Horizon:
    """The estimate of a stream, frame by frame.

    Args:
        fit: A fit of the poses that begins it.
        mechanism: What that fit began with, as the picture has measured it.
        poses: The fitted poses, one record.
        window: Seconds of motion that are fitted again at every frame.
        ahead: How far ahead the motion is predicted [s].
        acting: Returns the torques that are known to have acted from one time to another [s]; None for none.

    Raises:
        FitError: a torque over time that is not known acts in the fit, or the stretch cannot be followed from
            its first state: what is held upright falls over without, and errors grow by as much.
    """

    def __init__(
        self, fit: Fit, mechanism: Mechanism, poses: Poses, *, window: float, ahead: float,
        acting: Acting = lambda *_: None,
    ) -> None:  # fmt: skip
        self._base, self._seconds, self._ahead, self._acting = fit, window, ahead, acting
        self._common, self._rows = fit.common_of(0), _measured(poses)
        self._window = window_of(fit, mechanism, self._rows)
        self._noise: np.ndarray | float = 1.0
        x, state = start_of(fit, self._window)
        stated = refit(self._with(self._rows), None, x, state)
        _check_followed(fit, stated)
        noise = noise_factors(stated.window.problem.data, stated.residual, len(x) + len(state))
        self._noise = noise.size * noise.correlation
        self._arrival: Arrival | None = None
        self._found: Refitted | None = refit(self._with(self._rows), None, stated.x, stated.state)
        self._x, self._state = self._found.x, self._found.state
        known = np.diag(_natural(self._found))
        stds = {p.name: p.std for p in fit.parameters}
        # what pushes at random moves within a window by less than the noise does not show there
        unseen = 3.0 * np.nanmean(self._found.window.problem.data.std**2, axis=0) / window**3
        lacks = 0.0 if fit.unmodelled is None else fit.unmodelled.density
        self._pushed = np.maximum(unseen * self._found.unit**2, lacks)
        self._added = {
            name: max(stds[name] ** 2 - float(variance), 0.0)
            for name, variance in zip(fit.shared, known, strict=False)
            if np.isfinite(stds[name])
        }
        # all but the window leaves, a little at a time
        while self._slide():
            self._found = refit(self._with(self._rows), self._arrival, self._x, self._state)
            self._x, self._state = self._found.x, self._found.state

    def add(self, poses: Poses) -> Estimate | None:
        """Take the next poses and estimate anew.

        Args:
            poses: One row or more.

        Returns:
            What is known with them; None where nothing was seen, or too little of a motion that has broken
            off to take it up again.
        """
        poses = _measured(poses)
        if not len(poses):
            return None
        gaps = np.flatnonzero(np.diff(poses.time) > LONGEST_GAP)
        if len(gaps):
            last = int(gaps[-1]) + 1
            self.add(poses[:last])
            poses = poses[last:]
        since = float(poses.time[0] - self._rows.time[-1]) if len(self._rows) else np.inf
        if since > LONGEST_GAP:
            self._break_off()
        self._rows = joined([self._rows, poses]) if len(self._rows) else poses
        if self._found is None and len(self._rows) < LEAST_ROWS:
            return None
        window = self._with(self._rows)
        state = self._begun(window) if self._found is None else self._state
        search = BEGUN if self._found is None else NEAR
        self._found = refit(window, self._arrival, self._x, state, limit=PULL, settings=search)
        estimate = self._estimated(self._found)
        if estimate is None or estimate.astray:
            # its last rows are of another motion: what came before them stays known of the mechanism
            self._rows, self._found = self._rows[:0], None
            self._arrival = None if self._arrival is None else self._arrival.broken_off(len(state) // 2)
            return estimate
        self._x, self._state = self._found.x, self._found.state
        self._slide()
        return estimate

    def doubted(self, why: str) -> Horizon:
        """Return the same with a doubt about the fit that it goes on from.

        Args:
            why: Why a later stretch by itself is not explained, a sentence.
        """
        other = copy(self)
        said = f"A later stretch by itself is not explained: {why}"
        other._base = self._base.doubted([Doubt("approximate", said)])
        return other

    def broken_off(self) -> Horizon:
        """Return what goes on after a break over which no motion goes on: what is known of the mechanism
        stays, the state is open."""
        other = copy(self)
        other._break_off()
        return other

    def _break_off(self) -> None:
        """Forget the state."""
        if self._found is not None and len(self._rows) > 1:
            last = len(self._found.window.times) - 1
            self._arrival = slid(self._found, last).broken_off(len(self._state) // 2)
        self._found, self._rows = None, self._rows[:0]

    def _with(self, poses: Poses) -> Window:
        """Return the window with rows, and with what acted meanwhile."""
        acted = self._acting(float(poses.time[0]), float(poses.time[-1]))
        rows = poses if acted is poses.torques else replace(poses, torques=acted)
        return self._window.on(rows, self._noise, self._common)

    def _begun(self, window: Window) -> np.ndarray:
        """Return the state at the first row that smooth motion has, positions then rates, (2 dof,)."""
        problem = window.problem
        pieces = Pieces(np.array([0, len(window.times)]), np.array([0]))
        return problem.started(self._x, pieces, (smooth(self._rows),)).states[0]

    def _slide(self) -> bool:
        """Let the rows that are too old leave the window; what they say is kept.

        Returns:
            Whether further ones are too old: those of a long stretch do not leave at once.
        """
        found, rows = self._found, self._rows
        assert found is not None
        old = int(np.searchsorted(rows.time, rows.time[-1] - self._seconds - 1e-9))
        most = max(int(np.searchsorted(rows.time, rows.time[0] + AT_ONCE + 1e-9)), 1)
        # how errors grow over a long stretch is a matter of rounding, too
        old = old if old > most else max(old, self._followed(found))
        stays = min(old, most)
        if stays == 0:
            return False
        row = int(np.searchsorted(found.window.times, rows.time[stays]))
        self._arrival = self._aged(slid(found, row), float(rows.time[stays] - rows.time[0]))
        self._state, self._rows = ahead(found, row).state, rows[stays:]
        return stays < old

    def _followed(self, found: Refitted) -> int:
        """Return the first row from which on the motion can be followed without a push: before it an error
        has grown too much, as beside an equilibrium that does not hold itself."""
        problem, times, dofs = found.window.problem, found.window.times, len(found.state) // 2
        slopes = found.motion[1][:, :, len(found.x) :]
        at = np.searchsorted(times, self._rows.time[: len(self._rows) - LEAST_ROWS])
        if not len(at):
            return 0
        # how the last positions follow those at each row, in deviations of the noise
        # (what has shrunk to nothing by a row does not grow any more)
        grown = (slopes[-1] @ _inverses(slopes[at]))[:, :dofs, :dofs]
        noise = np.sqrt(np.nanmean(problem.data.std**2, axis=0))
        size = np.abs(grown * noise / noise[:, None]).max(axis=(1, 2))
        return int(np.sum(size > GROWN))

    def _aged(self, arrival: Arrival, seconds: float) -> Arrival:
        """Return what is known after some time: what pushes that nobody has seen have done to the state, and
        the rest is a little out of date."""
        arrival = arrival.widened(random_push(self._pushed, seconds))
        return arrival.faded(float(np.exp(-seconds / MEMORY)))

    def _estimated(self, found: Refitted) -> Estimate | None:
        """Return what is known at the optimum; None where the motion grows beyond all bounds."""
        try:
            covariance, future = _natural(found), self._future(found)
        except (ArithmeticError, np.linalg.LinAlgError):
            return None
        if not (np.isfinite(covariance).all() and np.isfinite(future.position).all()):
            return None
        astray, off = "", _off(found)
        if off > ASTRAY and len(self._rows) >= LEAST_ROWS:
            seconds = float(self._rows.time[-1] - self._rows.time[0])
            astray = (
                f"The motion of the last {seconds:.1f} s is not that of the mechanism as identified before: "
                f"{off:.1f} times as far off as the noise; something may touch it, or it has changed."
            )
        return Estimate(self._base, found, self._rows.time, covariance, future, self._added, astray)

    def _future(self, found: Refitted) -> Prediction:
        """Return the motion from the last row on."""
        last, now = float(self._rows.time[-1]), ahead(found, -1)
        step = usual_step(self._rows.time) if len(self._rows) > 1 else self._ahead
        count = max(int(np.ceil(self._ahead / step - 1e-6)), 2)
        times = last + step * np.arange(count + 1)
        problem = found.window.problem
        coming = problem.with_data(replace(problem.data, times=times))
        run = (0, count + 1, now.state)
        q, v, dq, dv = coming.tangents(found.instance, found.window.substeps, [run], most_off=PREDICTED_OFF)
        slopes = np.concatenate((dq, dv), axis=1)
        variance = np.sum((slopes @ now.covariance) * slopes, axis=2)
        std, dofs = np.sqrt(np.maximum(variance, 0.0)), q.shape[1]
        return Prediction(self._rows.joints, times, q, v, std[:, :dofs], std[:, dofs:])


def horizon_of(
    fit: Fit, mechanism: Mechanism, poses: Poses, live: LiveSettings, acting: Acting = lambda *_: None
) -> Horizon | None:
    """Return what goes on from a fit; None where it cannot be used, has a torque over time, or is of a motion
    that is only followed piece by piece, as where it is held upright.

    Args:
        fit: The fit.
        mechanism: What it began with.
        poses: Its rows.
        live: How long the window is, how far ahead is predicted.
        acting: Returns the torques that are known to have acted from one time to another.
    """
    if not fit.ok:
        return None
    try:
        return Horizon(fit, mechanism, poses, window=live.window, ahead=live.ahead, acting=acting)
    except (MonodynError, ArithmeticError, np.linalg.LinAlgError):
        return None


def followed_from(fit: Fit, poses: Poses) -> int:
    """Return the first row from which one motion can be followed to the last one, as a window is.

    Args:
        fit: What is known of the mechanism.
        poses: Rows of one record.

    Returns:
        The row from before which an error has grown by more than ``MOST_GROWN``, as where the mechanism was
        held upright for long; between rows in which not all joints are measured none is known to grow.
    """
    smoothed, stretch = smooth(poses), fit.mechanism.values["time_scale"]
    whole = np.asarray(poses.measured.all(axis=1))
    unit = np.where(fit.mechanism.slides & (not poses.metric), fit.scale, 1.0)
    motion = np.hstack((smoothed.position * unit, smoothed.velocity * unit / stretch))
    slopes = transitions(fit.mechanism.tree, stretch * smoothed.time, motion, substeps=ROUGH_STEPS)
    grown = np.eye(motion.shape[1])[: len(unit)]
    for row in 1 + np.flatnonzero(whole[1:] & whole[:-1])[::-1]:
        grown = grown @ slopes[row]
        if np.abs(grown).max() > MOST_GROWN:
            return int(row)
    return 0


def _inverses(matrices: np.ndarray) -> np.ndarray:
    """Return the inverses of matrices, without what has shrunk to nothing, (matrix, row, row)."""
    try:
        inverses = np.linalg.inv(matrices)
    except np.linalg.LinAlgError:
        return np.linalg.pinv(matrices)
    # for most motions this is all, in a fifth of the time
    with np.errstate(over="ignore"):
        size = np.abs(matrices).max(axis=(1, 2)) * np.abs(inverses).max(axis=(1, 2))
    return inverses if np.all(size < SURE) else np.linalg.pinv(matrices)


def _off(found: Refitted) -> float:
    """Return the size of the residuals of a window, over that of the noise and of what moves all positions
    together: a motion in another place is off by the latter in another way."""
    data = found.window.problem.data
    variance = data.std**2
    if data.shifts is not None:
        variance = variance + np.sum(data.shifts**2, axis=0)
    return float(np.sqrt(np.nanmean(found.residual**2 / variance)))


def _check_followed(fit: Fit, found: Refitted) -> None:
    """Refuse a window over all rows of a fit that does not follow them as the fit does."""
    usual, off = (
        np.nanquantile(np.abs(rows), MOST_ROWS, axis=0)
        for rows in (fit.residual[0], found.residual * found.unit)
    )
    noise = np.nanmean(found.window.problem.data.std, axis=0) * found.unit
    follows = np.all(off <= EXPLAINED * np.maximum(usual, noise))
    if not follows or np.abs(found.motion[1][:, :, len(found.x) :]).max() > MOST_GROWN:
        raise FitError(
            "horizon: expected rows that one motion follows from its first state on, got such as the fit "
            "follows piece by piece; begin with fewer."
        )


def _natural(found: Refitted) -> np.ndarray:
    """Return the covariance of unknowns and state in the units of the parameters, (unknown, unknown)."""
    count = len(found.x)
    slope = np.eye(len(found.information))
    slope[:count, :count] = found.window.problem.unknowns.slope(found.x)
    with np.errstate(over="ignore", invalid="ignore"):
        return slope @ found.covariance @ slope.T


def _measured(poses: Poses) -> Poses:
    """Return the rows in which any joint was measured."""
    rows = np.flatnonzero(poses.measured.any(axis=1))
    if len(rows) == len(poses):
        return poses
    return joined([poses[k : k + 1] for k in rows.tolist()]) if len(rows) else poses[:0]
