"""A Jacobian in, directions of the unknowns out in which a quasi-Newton search over rollouts gets on.

A torque early in a record moves all that follows and a late one hardly anything, neighbours do nearly the
same, and any of them makes up for sizes that are off. Along the principal directions of their Jacobian, each
scaled to the same effect on the motion, the search begins as Gauss and Newton's would.
"""

from __future__ import annotations

import numpy as np

WEAKEST_MODE = {"fourier": 1e-3, "free": 0.01}
"""Modes of torques below this share of the strongest are taken as that strong."""


def modes(jacobian: np.ndarray, turned: np.ndarray, weakest: float) -> np.ndarray:
    """Return directions of the unknowns of equal effect, single unknowns kept single where not ``turned``.

    With J = (T, S) the parts of the turned unknowns and of the others, and T = U D V' by singular values: the
    turned ones move along V D^-1; another one moves together with the turned ones that make up for it best,
    -V D^-1 U' S, and is scaled by what is left of its column. So the others keep their bounds.

    Args:
        jacobian: Of all residuals by the unknowns, (row, param).
        turned: True for the unknowns that are searched along modes, (param,).
        weakest: Singular values below this share of the largest count as that share.

    Returns:
        The directions as columns, in the order of the unknowns, (param, param).
    """
    found = np.eye(len(turned))
    left, sizes, vectors = np.linalg.svd(jacobian[:, turned])
    # fewer rows than torques leave directions that move nothing: they count as the weakest
    sizes = np.append(sizes, np.zeros(len(vectors) - min(len(sizes), len(vectors))))[: len(vectors)]
    strength = np.hypot(sizes, weakest * sizes[0])
    found[np.ix_(turned, turned)] = vectors.T / strength
    shown = min(left.shape[1], len(vectors))
    along = left[:, :shown].T @ jacobian[:, ~turned]
    share = (sizes / strength**2)[:shown, None]
    instead = -vectors[:shown].T @ (share * along)
    rest = np.linalg.norm(jacobian[:, ~turned] + jacobian[:, turned] @ instead, axis=0)
    rest = np.maximum(rest, weakest * sizes[0])
    found[np.ix_(turned, ~turned)] = instead / rest
    found[np.ix_(~turned, ~turned)] = np.diag(1.0 / rest)
    return found
