"""``monodyn predict``: its options, and its table on the standard output."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from monodyn.choices import Tolerance
from monodyn.cli.shared import ResultOptions

if TYPE_CHECKING:
    from monodyn.results.predicted import Predicted

SHOWN_ROWS = 11
"""Rows of the table, the first and the last among them."""


@dataclass(frozen=True, kw_only=True)
class PredictOptions(ResultOptions):
    """Predict how the mechanism of a run moves, from any state or from any moment of its record.

    Attributes:
        run: Folder of a run that identified a mechanism.
        start: Position of every joint at the start [rad, m for slides]; where the record is, when left out.
        rates: Rates at the start [rad/s, m/s]; zero when left out.
        at: Time stamp of the start [s]; 0 with --from, else the last fitted frame.
        until: Time stamp of the end [s]; as long as the record is, when left out.
        fix: Parameters that have another value than was identified, e.g. gravity=1.62.
        record: Which record of the run, from 0.
        tolerance: How far off the prediction may be, of a hinge and of a slide, e.g. 5deg,2cm; how long it
            stays within is said.
        out: Folder for prediction.csv, prediction.json, prediction.html and the film; nothing is written when
            left out.
        film: Draw the motion over the first frame of the clip, as prediction.mp4.
        clip: Where the clip is, if no longer where the run found it.
    """

    run: Path = field(metadata={"metavar": "RUN", "word": True})
    start: Mapping[str, float] = field(
        default_factory=dict,
        metadata={"name": "from", "metavar": "JOINT=POSITION ...", "example": "joint1=0.5"},
    )
    rates: Mapping[str, float] = field(
        default_factory=dict, metadata={"metavar": "JOINT=RATE ...", "example": "joint1=-2"}
    )
    at: float | None = field(default=None, metadata={"metavar": "S"})
    until: float | None = field(default=None, metadata={"metavar": "S"})
    fix: Mapping[str, float] = field(default_factory=dict)
    record: int = 0
    tolerance: Tolerance = field(default_factory=Tolerance)
    out: Path | None = field(default=None, metadata={"metavar": "DIR"})
    film: bool = False
    clip: Path | None = field(default=None, metadata={"metavar": "CLIP"})

    def go(self) -> int:
        """Return the exit code after running the command.

        Raises:
            SettingsError: a film is wanted, and no folder for it.
        """
        from monodyn.cli.show import show_result
        from monodyn.errors import SettingsError
        from monodyn.results.predicted import Wanted, predict_run

        if self.film and self.out is None:
            raise SettingsError("film: expected a folder for it, got none; name one with --out.")
        wanted = Wanted(
            positions=self.start or None,
            rates=self.rates,
            at=self.at,
            until=self.until,
            fix=self.fix,
            record=self.record,
            tolerance=self.tolerance,
        )
        with self.progress() as progress:
            found = predict_run(
                self.run, self.out, wanted, film=self.film, clip=self.clip, force=self.force,
                progress=progress,
            )  # fmt: skip
        return show_result(
            found.document, found.folder, None if found.fit.ok else found.fit.status,
            lambda: _print(found, wanted.tolerance, film=self.film), as_json=self.json, quiet=self.quiet,
        )  # fmt: skip


def _print(found: Predicted, tolerance: Tolerance, *, film: bool) -> None:
    """Print the motion, with half the width of its 95 % bands."""
    import numpy as np

    from monodyn.cli.show import console, plain_table
    from monodyn.numbers import shown_in
    from monodyn.results.curves import BAND
    from monodyn.results.horizon import horizon_said

    states, joints = found.states, found.fit.mechanism.joints
    table = plain_table("time", *(f"{joint.name} [{shown_in(joint)[1]}]" for joint in joints))
    last = len(states.time) - 1
    # evenly, but for the last one
    for row in [*range(0, last, max(1, math.ceil(last / (SHOWN_ROWS - 1)))), last]:
        cells = [f"{states.time[row]:.3f} s"]
        for dof, joint in enumerate(joints):
            scale = shown_in(joint)[0]
            value, half = states.position[row, dof] * scale, BAND * states.std[row, dof] * scale
            known = f"{half:.2g}" if np.isfinite(half) else "unknown"
            cells.append(f"{value:.4g} ± {known}".replace("-", "−"))
        table.add_row(*cells)
    out = console()
    out.print(table)
    out.print("± half the width of the 95 % band", markup=False)
    out.print(horizon_said(found.fit, found.horizon, tolerance, since="the start"), markup=False)
    for note in found.notes:
        out.print(f"- {note}", markup=False)
    if found.folder is not None:
        out.print(f"plot: {found.folder}/prediction.html", markup=False)
        if film:
            out.print(f"film: {found.folder}/prediction.mp4", markup=False)
