"""What the key frames of a refinement know of the sizes, the places of geoms and the camera."""

from __future__ import annotations

import numpy as np

from monodyn.mechanism import Measured
from monodyn.vision.drawing.camera import PARAMETERS, value_of
from monodyn.vision.locating.bundle import LOG_CAMERA, Bundle

SYSTEMATIC_PX = 0.2
"""Standard deviation of a size that more key frames do not reduce: blur, light and the codec shift edges
[px]."""
UNSEEN = 16.0
"""Information of a logarithm, or of a ratio to a length, below which a size or place is not determined."""
LOADED = 0.02
"""Share of a direction that is not seen from which on a place is part of it."""


def size_information(bundle: Bundle, *, scale_free: bool) -> Measured:
    """Return what the key frames know of the sizes, camera and offsets eliminated.

    Args:
        bundle: A refined bundle.
        scale_free: True where nothing pins the common scale; then the information along it, which stems
            only from thicknesses and offsets held at their start, is taken out.

    Returns:
        Information matrix on the logarithms of the sizes and the places' ratios, as far as they are seen.
    """
    variables, values = bundle.variables, bundle.mechanism.values
    shown = variables.is_size | variables.is_place
    sizes, others = np.flatnonzero(shown), np.flatnonzero(~shown)
    # The Schur complement of the others: what is known of the sizes when the others are free to follow.
    rest = bundle.information[np.ix_(others, others)] + 1e-9 * np.eye(len(others))
    cross = bundle.information[np.ix_(sizes, others)]
    known = bundle.information[np.ix_(sizes, sizes)] - cross @ np.linalg.solve(rest, cross.T)
    # Adding the same number to all logarithms is the common scale; places are ratios and do not change by it.
    # Eliminating that direction, instead of setting it to zero, keeps what is known of the ratios and makes
    # the matrix exactly blind to it.
    gauge = variables.is_size[sizes].astype(np.float64)
    along = known @ gauge
    if scale_free and gauge @ along > 1e-9 * np.trace(known):
        known = known - np.outer(along, along) / (gauge @ along)
    names = [variables.names[i] for i in sizes]
    px = np.array([values[variables.against[i] or variables.names[i]] for i in sizes])
    px = px * bundle.camera.focal / bundle.camera.depth
    # (K^-1 + D)^-1 for a K that may be singular, D the variance that no number of frames takes away
    floor = np.diag((px / SYSTEMATIC_PX) ** 2)
    known = known - known @ np.linalg.solve(known + floor, known)
    hidden = _hidden(known, gauge, variables.is_place[sizes])
    kept = [i for i in range(len(names)) if i not in hidden]
    known = known[np.ix_(kept, kept)]
    return Measured(tuple(names[i] for i in kept), 0.5 * (known + known.T))


def _hidden(known: np.ndarray, gauge: np.ndarray, places: np.ndarray) -> set[int]:
    """Return which places of geoms no picture determines together with the other sizes.

    An end of a geom that lies inside of another one moves its middle and its extent together, unseen: each
    of them alone would seem to be known. The place is taken as given, until the rest is determined.
    """
    hidden: set[int] = set()
    while True:
        open_ = [i for i in range(len(places)) if i not in hidden]
        candidates = [k for k, i in enumerate(open_) if places[i]]
        if not candidates:
            return hidden
        part, scale = known[np.ix_(open_, open_)], gauge[open_]
        # a stiff spring on the common scale, so that it does not count as a direction that is not seen
        part = part + UNSEEN / max(len(open_), 1) * 1e3 * np.outer(scale, scale)
        values, vectors = np.linalg.eigh(part)
        loads = np.abs(vectors[:, 0])
        worst = candidates[int(np.argmax(loads[candidates]))]
        if values[0] >= UNSEEN or loads[worst] < LOADED:
            return hidden
        hidden.add(open_[worst])


def camera_std(bundle: Bundle, *, scale_free: bool) -> dict[str, float]:
    """Return the standard deviations of the refined camera parameters [m, rad, px].

    Args:
        bundle: A refined bundle.
        scale_free: True where nothing pins the common scale; then it is held, as for the mean size.

    Returns:
        Standard deviation by name.
    """
    names = bundle.variables.names
    information = bundle.information + 1e-6 * np.eye(len(names))
    sizes = bundle.variables.is_size.astype(np.float64)
    if scale_free:
        # the gauge: a stiff spring on the mean logarithm of the sizes holds the common scale
        information = information + 1e6 * np.trace(information) * np.outer(sizes, sizes) / max(
            sizes.sum(), 1.0
        )
    covariance = np.linalg.pinv(information, hermitian=True)
    std = {}
    for i, name in enumerate(names):
        if name in PARAMETERS:
            unit = value_of(bundle.camera, name) if name in LOG_CAMERA else 1.0
            std[name] = unit * float(np.sqrt(max(covariance[i, i], 0.0)))
    return std
