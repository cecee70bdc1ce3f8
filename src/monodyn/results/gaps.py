"""A record in which something was hidden in, the motion that stands for it and what is said of that out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from monodyn.estimation.fit import Fit
from monodyn.estimation.wording import listed
from monodyn.results.curves import BAND
from monodyn.results.fill import States, fill
from monodyn.results.smoother import framed, smooth
from monodyn.results.trace import Trace, fitted_rows
from monodyn.types import Poses


class Filled(NamedTuple):
    """How well the hidden positions of records are known.

    Attributes:
        frames: Frames in which a joint was hidden that the motion gives.
        band: Median half width of the 95 % band of the hidden positions by joint [rad or m], NaN for a joint
            that was always seen, (dof,).
    """

    frames: int
    band: np.ndarray


def filled(fit: Fit, poses: Poses, times: np.ndarray | None = None, *, record: int = 0) -> States:
    """Return the motion that stands for a record in the run folder.

    It is the roll-out, which any simulator follows, unless something was hidden that the roll-out does not
    give well: because the model lacks something, or because it is outside of the fitted frames and would have
    been measured more exactly than it is predicted. Then it is that of ``smooth``. A refused fit fills
    nothing.

    Args:
        fit: The identified mechanism.
        poses: The whole record.
        times: Time stamps [s], (frame,), increasing; those of the record when left out.
        record: Which record of the fit it is.

    Returns:
        The motion, as ``smooth`` returns it.
    """
    stamps = poses.time if times is None else times
    hidden = ~poses.measured & fit.ok
    if fit.unmodelled is None:
        first, stop = fitted_rows(fit, poses, record)
        hidden[first:stop] = False
        noise = np.array([fit.rms[name] for name in poses.joints])
        hidden &= fill(fit, poses.time, record=record).std > noise
    if not hidden.any():
        return framed(fit, fill(fit, stamps, record=record), record)
    return smooth(fit, poses, stamps, record=record)


def how_filled(traces: Sequence[Trace], motions: Sequence[States]) -> Filled:
    """Return how well the hidden positions of some records are known.

    Args:
        traces: The records.
        motions: The motions that stand for them.
    """
    hidden = np.concatenate([~trace.poses.measured for trace in traces])
    std = np.concatenate([motion.std for motion in motions])
    known = hidden & np.isfinite(std)
    band = np.full(std.shape[1], np.nan)
    for dof in np.flatnonzero(known.any(axis=0)):
        band[dof] = BAND * np.median(std[known[:, dof], dof])
    return Filled(int(np.sum(known.any(axis=1))), band)


def unfollowed(traces: Sequence[Trace], motions: Sequence[States]) -> list[str]:
    """Return a note on the gaps through which no motion could be followed; none without them.

    Args:
        traces: The records.
        motions: The motions that stand for them.
    """
    said = []
    for trace, motion in zip(traces, motions, strict=True):
        # where nothing is known of any frame it is not for a gap
        lost = ~np.isfinite(motion.std).all(axis=1) & np.isfinite(trace.states.std).all(axis=1)
        edges = np.flatnonzero(np.diff(np.concatenate(([False], lost, [False])).astype(int)))
        time = trace.poses.time
        spans = [f"{time[a]:.2f} to {time[b - 1]:.2f} s" for a, b in edges.reshape(-1, 2).tolist()]
        where = f" of {trace.name}" if len(traces) > 1 else ""
        if spans:
            said.append(
                f"From {listed(spans)}{where} the motion is too wild to be followed through what was hidden: "
                "states.csv knows nothing of it there."
            )
    return said
