"""Which of the bundled mechanisms tables of joint positions belong to: their columns and the evidence decide.

The columns limit what may be meant: as many joints as there are, in their order. Each such mechanism is
identified; the best grade counts, then Schwarz's criterion, n ln(mean square residual) + k ln(n) for n
samples and k unknowns, the residuals in units of the noise of the record and not below it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from monodyn.checks import chosen_mechanism
from monodyn.doubtful import unmeasured_joints
from monodyn.errors import MechanismError, MonodynError, SettingsError
from monodyn.estimation.fit import GRADES, Doubt, Fit
from monodyn.estimation.record.tables import column_names, read_poses
from monodyn.kept import kept_doubts
from monodyn.mechanism.bundled import LONGEST_CHAIN
from monodyn.results.log import Compared
from monodyn.settings import RunSettings
from monodyn.stages import identify
from monodyn.types import Poses, Progress, under

if TYPE_CHECKING:
    from monodyn.mechanism import Mechanism

BY_JOINTS = {1: ("single",), 2: ("double", "cartpole"), 3: ("triple",)}
"""Bundled mechanisms by their number of joints; of more there are chains. Whatever hangs on a single hinge
moves alike, so that no table tells a ball from a rod."""


@dataclass(frozen=True, eq=False)
class Tabled:
    """A mechanism with the records read for it.

    Attributes:
        model: Its name.
        mechanism: The mechanism with the user's choices.
        records: The records, their joints named as its own.
        rows: First row to fit of each record and the one after the last; all where there are none.
        fit: The fit, or None where there is none.
        refusal: Why there is none.
    """

    model: str
    mechanism: Mechanism
    records: Sequence[Poses]
    rows: Sequence[tuple[int, int]] = ()
    fit: Fit | None = None
    refusal: str = ""

    @property
    def fitted(self) -> list[Poses]:
        """What is fitted of the records."""
        if not self.rows:
            return list(self.records)
        return [record[slice(*rows)] for record, rows in zip(self.records, self.rows, strict=True)]

    @property
    def noises(self) -> float:
        """Rms residual in units of the stated noise; infinite without a fit."""
        squares = self._squares()
        return float(np.sqrt(np.mean(squares))) if len(squares) else np.inf

    @property
    def criterion(self) -> float:
        """Schwarz's criterion, noise taken to be at least as stated; infinite without a fit."""
        squares = self._squares()
        if self.fit is None or not len(squares):
            return np.inf
        count = len(squares)
        return count * np.log(max(float(np.mean(squares)), 1.0)) + len(self.fit.names) * np.log(count)

    def _squares(self) -> np.ndarray:
        """Return the squared residuals over their variances, of all that was measured, (sample,)."""
        if self.fit is None or not self.fit.residual:
            return np.zeros(0)
        found = []
        for record, residual in zip(self.fitted, self.fit.residual, strict=True):
            variance = np.diagonal(record.covariance, axis1=1, axis2=2)
            found.append((residual**2 / variance)[np.isfinite(residual) & (variance > 0.0)])
        return np.concatenate(found)


def tabled(tables: Sequence[str | Path], settings: RunSettings) -> list[Tabled]:
    """Return the bundled mechanisms that tables may belong to, with their records.

    Args:
        tables: Tables of joint positions; the first one's columns count.
        settings: The user's choices.

    Raises:
        SettingsError: no bundled mechanism has joints like the columns.
        MechanismError: none of them has the parameters that the user names.
    """
    header = column_names(tables[0])
    slides = "slide" in header and "joint1" in header
    count = next(k for k in range(len(header) + 1) if f"joint{k + 1}" not in header)
    models = ("cartpole",) if slides else BY_JOINTS.get(count, (f"chain:{count}",))
    if not 1 <= count <= LONGEST_CHAIN:
        raise SettingsError(
            f"model: expected the columns joint1, joint2, ... in '{Path(tables[0]).name}', "
            f"got {', '.join(header)}; name the mechanism with --model."
        )
    found, refusals = [], []
    for model in models:
        try:
            mechanism = chosen_mechanism(model, settings, camera=False)
        except MechanismError as refusal:
            refusals.append(refusal)
            continue
        own = [joint.name for joint in mechanism.joints]
        names = own if set(own) <= set(header) else [f"joint{k + 1}" for k in range(len(own))]
        records = [replace(read_poses(table, names), joints=tuple(own)) for table in tables]
        found.append(Tabled(model, mechanism, records))
    if not found:
        raise refusals[0]
    return found


def best_fit(
    tried: Sequence[Tabled], settings: RunSettings, progress: Progress | None = None
) -> tuple[Tabled, Fit, tuple[Compared, ...]]:
    """Identify each mechanism; return the one that the records prefer, its fit, and the comparison.

    Args:
        tried: The mechanisms, the likeliest first.
        settings: How to identify.
        progress: Called with the steps done.

    Returns:
        The mechanism with its records, its fit, and what spoke for and against each.

    Raises:
        MonodynError: none of them can be identified; the reason is that of the first one.
    """
    done, errors = [], []
    for one in tried:
        several = f"try {one.model}" if len(tried) > 1 else ""
        try:
            done.append(_fitted(one, settings, under(progress, several)))
        except MonodynError as error:
            errors.append(error)
            done.append(replace(one, refusal=str(error)))
    order = sorted(done, key=lambda one: (_rank(one), one.criterion))
    best, fit = order[0], order[0].fit
    if fit is None:
        raise errors[0]
    said = [Compared(one.model, one is best, _said(one), grade=one.fit and one.fit.grade) for one in order]
    return best, fit, tuple(said)


def _fitted(one: Tabled, settings: RunSettings, progress: Progress | None) -> Tabled:
    """Identify one mechanism."""
    fit = identify(one.fitted, one.mechanism, settings.identify, progress=progress)
    hardly = unmeasured_joints(one.fitted)
    doubts = kept_doubts(fit, one.records, one.mechanism, settings.identify, progress)
    return replace(one, fit=fit.doubted([*([Doubt("approximate", hardly)] if hardly else []), *doubts]))


def _rank(one: Tabled) -> int:
    """Return the place of its grade, the best first."""
    return len(GRADES) if one.fit is None else GRADES.index(one.fit.grade)


def _said(one: Tabled) -> str:
    """Return what spoke for and against one mechanism, a sentence."""
    if one.fit is None:
        return f"not identified: {one.refusal}"
    return (
        f"fit {one.fit.grade}, residuals of {one.noises:.2g} times the noise, {len(one.fit.names)} unknowns."
    )
