"""Measured joint positions in, filtered positions, rates and accelerations out: the alpha-beta-gamma filter.

The filter is linear in the measurements, so the covariance of its states follows from theirs without any
approximation. It looks only backwards, hence its states lag behind fast motion; the covariance contains the
noise alone, and not that lag.

In the last line of eq. (6) the paper prints a_p(k-1), though a_p is defined nowhere: it is read as the
prediction of a constant acceleration. Where the filter starts is left open: here from the parabola through
the first three seen samples, taken at the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monodyn.arrays import frozen, increasing
from monodyn.choices import check_choice
from monodyn.errors import SettingsError, VideoError

READINGS = ("printed", "consistent")
"""How the last line of eq. (6) is read: gamma / T^2 as it stands, or gamma / (2 T^2), as in (7)."""
FIRST = 3
"""Seen samples that a filter starts from."""

POSITION, VELOCITY, ACCELERATION = range(3)
"""Rows of a filter's state."""


@dataclass(frozen=True)
class Gains:
    """Gains of the filter: 0 < alpha <= 1, 0 < beta < 1, 0 < gamma < 4 alpha beta / (2 - alpha), eq. (7).

    The last bound is that of a filter whose acceleration takes gamma / (2 T^2) of the innovation: the reading
    ``consistent``. Eq. (6) has gamma / T^2: the reading ``printed``, with which errors only die out for
    gamma < 2 alpha beta / (2 - alpha), see ``stable``. The paper's own gains lie on that edge, and ring
    without end.

    Attributes:
        alpha: Share of the innovation that the position takes.
        beta: That of the rate, times the step.
        gamma: That of the acceleration, times the step squared, once or twice.
        reading: ``printed`` or ``consistent``.
    """

    alpha: float = 0.4
    beta: float = 0.1
    gamma: float = 0.05
    reading: str = "printed"

    def __post_init__(self) -> None:
        check_choice("gains.reading", self.reading, READINGS)
        if not 0.0 < self.alpha <= 1.0:
            raise SettingsError(f"gains: expected alpha above 0 and up to 1 (eq. 7), got {self.alpha:g}.")
        if not 0.0 < self.beta < 1.0:
            raise SettingsError(f"gains: expected beta between 0 and 1 (eq. 7), got {self.beta:g}.")
        most = 4.0 * self.alpha * self.beta / (2.0 - self.alpha)
        if not 0.0 < self.gamma < most:
            raise SettingsError(
                f"gains: expected gamma between 0 and 4 alpha beta / (2 - alpha) = {most:g} (eq. 7) with "
                f"alpha {self.alpha:g} and beta {self.beta:g}, got {self.gamma:g}."
            )

    @property
    def acceleration(self) -> float:
        """Share of the innovation that the acceleration takes, times the step squared, as it was read."""
        return self.gamma if self.reading == "printed" else 0.5 * self.gamma

    @property
    def ringing(self) -> float:
        """The gamma from which on an error of the filter's states does not die out."""
        most = 2.0 * self.alpha * self.beta / (2.0 - self.alpha)
        return most if self.reading == "printed" else 2.0 * most

    @property
    def stable(self) -> bool:
        """True when an error of the filter's states dies out, which as ``consistent`` it always does."""
        return self.gamma < (1.0 - 1e-9) * self.ringing

    @classmethod
    def of(cls, values: Sequence[float], reading: str = "printed") -> Gains:
        """Return the gains given as alpha, beta, gamma.

        Args:
            values: The three of them.
            reading: How eq. (6) is read, ``printed`` or ``consistent``.

        Raises:
            SettingsError: They are not three, or outside of eq. (7).
        """
        if len(values) != 3:
            raise SettingsError(f"gains: expected alpha, beta and gamma, got {len(values)} numbers.")
        alpha, beta, gamma = (float(value) for value in values)
        return cls(alpha, beta, gamma, reading)


@dataclass(frozen=True, eq=False)
class Filtered:
    """Filtered motion of a record, NaN for a joint before its first seen sample.

    Attributes:
        time: Time stamps [s], (frame,).
        position: Joint positions [rad or m], (frame, dof).
        velocity: Joint rates [rad/s or m/s], (frame, dof).
        acceleration: Joint accelerations [rad/s^2 or m/s^2], (frame, dof).
        covariance: Covariance of the positions, then the rates, (frame, 2 dof, 2 dof), or None where that of
            the measurements was not given.
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    covariance: np.ndarray | None


def filtered(
    time: np.ndarray, observed: np.ndarray, gains: Gains, covariance: np.ndarray | None = None
) -> Filtered:
    """Filter joint positions, each separately: predict with constant acceleration, correct by the innovation.

    x_p(k) = x_s(k-1) + T v_s(k-1) + T^2/2 a_s(k-1), v_p(k) = v_s(k-1) + T a_s(k-1), a_p(k) = a_s(k-1);
    x_s = x_p + alpha e, v_s = v_p + beta/T e, a_s = a_p + gamma/T^2 e with e = x_o - x_p and T the time since
    the joint was last seen, so that an unseen frame counts as much as one that is not in the record. In the
    reading ``consistent`` gamma/(2 T^2) takes the place of gamma/T^2.

    Args:
        time: Increasing time stamps [s], (frame,).
        observed: Measured positions [rad or m], NaN where not seen, (frame, dof).
        gains: The gains.
        covariance: Covariance of each frame's measurements, independent of each other, (frame, dof, dof).

    Returns:
        The filtered motion at ``time``.

    Raises:
        SettingsError: The times do not increase or the arrays do not belong together.
        VideoError: A joint was seen in under three frames.

    Source:
        Eq. (6) of "Estimating dynamics on-the-fly using monocular video", 2012.

    Example:
        >>> import numpy as np
        >>> time = np.arange(5) / 10
        >>> fall = filtered(time, 0.5 * 9.81 * time[:, None] ** 2, Gains())
        >>> [round(float(v), 3) for v in fall.velocity[:, 0]]
        [0.0, 0.981, 1.962, 2.943, 3.924]
    """
    observed = np.asarray(observed, dtype=float)
    if observed.ndim != 2:
        raise SettingsError(f"filter: expected positions (frame, dof), got shape {observed.shape}.")
    frames, dofs = observed.shape
    times = increasing("filter: time", np.asarray(time, dtype=float), error=SettingsError)
    times = frozen("filter: time", times, (frames,), error=SettingsError)
    seen = np.isfinite(observed)
    heads = _heads(seen)
    start = [parabola(times[head]) @ observed[head, dof] for dof, head in enumerate(heads)]
    steps = _steps(times, seen, heads, gains)
    states = np.full((frames, 3, dofs), np.nan)
    for dof in range(dofs):
        states[:, :, dof] = _run(steps[dof], observed[:, dof], start[dof], heads[dof])
    state_covariance = None
    if covariance is not None:
        covariance = frozen("filter: covariance", covariance, (frames, dofs, dofs), error=SettingsError)
        state_covariance = _covariance(steps, times, covariance, seen, heads)
    return Filtered(
        time=times,
        position=states[:, POSITION],
        velocity=states[:, VELOCITY],
        acceleration=states[:, ACCELERATION],
        covariance=state_covariance,
    )


def filter_response(time: np.ndarray, seen: np.ndarray, gains: Gains) -> np.ndarray:
    """Return the filter as a matrix: what a one in each sample adds to the states of its joint.

    Args:
        time: Increasing time stamps [s], (frame,).
        seen: True where a joint was seen, bool (frame, dof).
        gains: The gains.

    Returns:
        Responses of position and rate, (frame, 2, dof, sample); 0 before a joint's first sample.

    Raises:
        VideoError: A joint was seen in under three frames.
    """
    heads = _heads(seen)
    frames, dofs = seen.shape
    found = np.zeros((frames, 2, dofs, frames))
    for dof, (steps, head) in enumerate(zip(_steps(time, seen, heads, gains), heads, strict=True)):
        state = np.zeros((3, frames))
        # the columns of the start's samples carry the parabola; each sample then adds a column of its gain
        state[:, head] = parabola(time[head])
        for k in range(head[0], frames):
            state = steps.transition[k] @ state
            state[:, k] += steps.gain[k]
            found[k, :, dof] = state[:2]
    return found


@dataclass(frozen=True, eq=False)
class _Steps:
    """The filter of one joint as a linear recursion s(k) = transition(k) s(k-1) + gain(k) x_o(k).

    Attributes:
        transition: (frame, 3, 3).
        gain: Zero where the joint was not seen, (frame, 3).
    """

    transition: np.ndarray
    gain: np.ndarray


def _heads(seen: np.ndarray) -> list[np.ndarray]:
    """Frames of the first three seen samples (3,), by joint."""
    heads = [np.flatnonzero(use)[:FIRST] for use in seen.T]
    for dof, head in enumerate(heads):
        if len(head) < FIRST:
            raise VideoError(
                f"filter: joint {dof} was measured in {len(head)} frames, expected at least {FIRST}; give "
                "more frames."
            )
    return heads


def parabola(times: np.ndarray) -> np.ndarray:
    """Return position, rate and acceleration at the first of three times by the samples there, (3, 3).

    Args:
        times: Three time stamps [s], (3,).
    """
    # x = q + v t + a t^2 / 2 at three times, solved for q, v and a
    offset = times - times[0]
    return np.linalg.inv(np.stack((np.ones(FIRST), offset, 0.5 * offset**2), axis=1))


def _steps(times: np.ndarray, seen: np.ndarray, heads: list[np.ndarray], gains: Gains) -> list[_Steps]:
    """The recursion of each joint."""
    found = []
    for dof, head in enumerate(heads):
        frames = len(times)
        transition, gain = np.tile(np.eye(3), (frames, 1, 1)), np.zeros((frames, 3))
        last = times[head[0]]
        for k in range(head[0] + 1, frames):
            step = times[k] - times[k - 1]
            predict = np.array([[1.0, step, 0.5 * step**2], [0.0, 1.0, step], [0.0, 0.0, 1.0]])
            # the innovation of several steps at once: rates divide by all the time since the last sample
            if seen[k, dof]:
                since = times[k] - last
                gain[k] = gains.alpha, gains.beta / since, gains.acceleration / since**2
                last = times[k]
            # s = s_p + g (x_o - x_p) with s_p = predict s': (predict - g predict_0) s' + g x_o
            transition[k] = predict - np.outer(gain[k], predict[0])
        found.append(_Steps(transition, gain))
    return found


def _run(steps: _Steps, observed: np.ndarray, start: np.ndarray, head: np.ndarray) -> np.ndarray:
    """States of one joint, (frame, 3), NaN before the first seen sample."""
    states = np.full((len(observed), 3), np.nan)
    states[head[0]] = start
    values = np.where(np.isfinite(observed), observed, 0.0)
    for k in range(head[0] + 1, len(observed)):
        states[k] = steps.transition[k] @ states[k - 1] + steps.gain[k] * values[k]
    return states


def _covariance(
    steps: list[_Steps], times: np.ndarray, noise: np.ndarray, seen: np.ndarray, heads: list[np.ndarray]
) -> np.ndarray:
    """Covariance of positions, then rates, (frame, 2 dof, 2 dof), NaN before a joint's first sample.

    A sample that a start is made of enters the state again at its own frame, so the response to the samples
    of the first frames is kept; that to later ones is summed up in the covariance itself.
    """
    frames, dofs = seen.shape
    noise = np.where(seen[:, :, None] & seen[:, None, :], noise, 0.0)
    early = 1 + max(int(head[-1]) for head in heads)
    response, later = np.zeros((early, dofs, 3, dofs)), np.zeros((dofs, 3, dofs, 3))
    found = np.full((frames, 2 * dofs, 2 * dofs), np.nan)
    for k in range(frames):
        transition = np.stack([step.transition[k] for step in steps])
        gain = np.stack([step.gain[k] for step in steps])
        # both parts move on with the filter; then the frame's own samples come in
        response = np.einsum("dij,edjc->edic", transition, response)
        later = np.einsum("aij,ajbl,bkl->aibk", transition, later, transition, optimize=True)
        if k < early:
            response[k, range(dofs), :, range(dofs)] += gain
        else:
            later += np.einsum("ai,ab,bk->aibk", gain, noise[k], gain)
        for dof, head in enumerate(heads):
            if head[0] == k:
                response[head, dof, :, dof] = parabola(times[head]).T
        total = later + np.einsum("eaic,ecd,ebkd->aibk", response, noise[:early], response, optimize=True)
        # a joint has no state before its first sample
        begun = np.tile([head[0] <= k for head in heads], 2)
        block = total[:, :2, :, :2].transpose(1, 0, 3, 2).reshape(2 * dofs, 2 * dofs)
        found[k] = np.where(begun[:, None] & begun[None, :], block, np.nan)
    return found
