"""A record and its motion as a figure of matplotlib."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monodyn.extras import extra
from monodyn.mechanism import Joint
from monodyn.numbers import shown_in

MEASURED, FITTED, ZERO = "0.35", "#0072b2", "0.7"
"""Colours of what was measured, of the motion, and of no residual."""
WIDE, TALL = 7.0, 2.6
"""Width of the figure, and height of a joint's part of it [inches]."""


def plot_motion(
    joints: Sequence[Joint], time: np.ndarray, motion: np.ndarray, residual: np.ndarray, *, title: str
) -> np.ndarray:
    """Draw positions that were measured, the motion that was identified, and what is left, joint by joint.

    Args:
        joints: The joints.
        time: Time stamps [s], (frame,).
        motion: Positions under the fit [rad or m], (frame, dof).
        residual: Measured less these, (frame, dof); NaN where not measured.
        title: Stands above all.

    Returns:
        Axes of the motion and of the residuals of each joint, (dof, 2).
    """
    pyplot = extra("plot", "matplotlib.pyplot", "plots")
    figure, axes = pyplot.subplots(
        2 * len(joints), 1, sharex=True, layout="constrained", squeeze=False,
        figsize=(WIDE, TALL * len(joints)), gridspec_kw={"height_ratios": [3.0, 1.0] * len(joints)},
    )  # fmt: skip
    axes = axes.reshape(-1, 2)
    for dof, (joint, (above, below)) in enumerate(zip(joints, axes, strict=True)):
        scale, unit = shown_in(joint)
        off = residual[:, dof] * scale
        above.plot(time, motion[:, dof] * scale + off, ".", color=MEASURED, markersize=4, label="measured")
        above.plot(time, motion[:, dof] * scale, color=FITTED, linewidth=1.2, label="fitted")
        below.axhline(0.0, color=ZERO, linewidth=0.8)
        below.plot(time, off, ".", color=MEASURED, markersize=3)
        above.set_ylabel(f"{joint.name} [{unit}]")
        below.set_ylabel(f"residual\n[{unit}]", fontsize="small")
    figure.align_ylabels(axes.ravel())
    axes[0, 0].legend(loc="upper right", ncols=2, fontsize="small")
    axes[-1, 1].set_xlabel("time [s]")
    figure.suptitle(title, fontsize="medium")
    return axes
