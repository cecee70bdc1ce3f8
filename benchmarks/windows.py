"""How well what was identified on the first part of a real film predicts the rest of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

import monodyn
from figures import Figure

WINDOW = 45
"""Frames of a window that is predicted from its own start state."""
MOST_DEG = 3.0
"""Error of a window [deg] up to which it counts as predicted, in three of four."""
LAST_DEG = 2.0
"""Error [deg] of the last third of the rod pendulum's film, predicted from the first two."""


def real_films(data: Path, runs: Path) -> list[Figure]:
    """Fit the first part of both films with defaults, and compare the rest.

    Args:
        data: The data folder.
        runs: Where the run folders go; one that is there already is not run again.

    Returns:
        Errors of the windows of the double pendulum and of the last third of the rod pendulum.
    """
    films, name = data / "real", "double_pendulum"
    document, poses, out = fitted(films / f"{name}.webm", "double", runs, 0.6)
    mechanism = monodyn.load(out / "model.xml")
    # everything is held but the start state of the window
    held = mechanism.with_choices(fix={p.name: p.value for p in mechanism.parameters if p.free})
    stop, figures = document["fit_frames"][1], [graded(name, document)]
    worst = []
    for first in range(int(np.searchsorted(poses.frame, stop)), len(poses) - WINDOW + 1, WINDOW):
        fit = monodyn.identify(poses[first : first + WINDOW], held)
        worst.append(np.rad2deg(max(fit.rms.values())))
        figures.append(Figure(name, f"frames {first} to {first + WINDOW - 1}", worst[-1], "deg"))
    share = 100.0 * float(np.mean(np.array(worst) <= MOST_DEG))
    figures.append(Figure(name, f"windows within {MOST_DEG:g} deg", share, "%", 75.0, least=True))
    name = "holonomic_pendulum"
    document, _, _ = fitted(films / f"{name}.webm", "bob", runs, 2.0 / 3.0)
    off = max(document["heldout_rms"][0].values())
    figures += [graded(name, document), Figure(name, "last third", float(np.rad2deg(off)), "deg", LAST_DEG)]
    return figures


def fitted(clip: Path, model: str, runs: Path, share: float) -> tuple[dict[str, Any], monodyn.Poses, Path]:
    """Run a film with defaults, fitted on its first frames.

    Args:
        clip: The film.
        model: Name of a bundled model.
        runs: Where its run folder goes.
        share: Share of its frames that are fitted.

    Returns:
        The content of ``fit.json``, the poses of all frames, the run folder.
    """
    out = runs / clip.stem
    if not (out / "fit.json").is_file():
        frames = (0, round(share * monodyn.read(clip).count))
        monodyn.run(clip, model, out, monodyn.RunSettings(fit_frames=frames), force=True)
    document = json.loads((out / "fit.json").read_text(encoding="utf-8"))
    return document, monodyn.read_poses(out / "poses.csv", monodyn.load(model)), out


def graded(name: str, document: dict[str, Any]) -> Figure:
    """Return whether a run was refused, which no film here is to be.

    Args:
        name: The film.
        document: The content of ``fit.json``.
    """
    return Figure(name, "refused", float(document["grade"] == "refused"), "", 0.0)
