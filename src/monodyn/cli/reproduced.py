"""``monodyn reproduce``: its options, and its table on the standard output."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro import conf

from monodyn.errors import SettingsError

if TYPE_CHECKING:
    from monodyn.reproduce.experiment import Experiment


@dataclass(frozen=True)
class ReproduceOptions:
    """Repeat the experiment of the 2012 paper with the published and the default method; write one page.

    Attributes:
        out: Folder for the page, the tables and the clip.
        clip: A clip of a pendulum in place of the made one; its truth is not known. Needs --model.
        model: Mechanism file (MJCF, URDF) or bundled name for --clip.
        force: Replace an experiment that is already in DIR.
        quiet: No progress, no table.
        seed: Seed of the made clip and of the start values.
    """

    out: Annotated[Path, conf.arg(metavar="DIR")]
    clip: Annotated[Path | None, conf.arg(metavar="CLIP")] = None
    model: Annotated[str | None, conf.arg(metavar="MODEL")] = None
    force: bool = False
    quiet: bool = False
    seed: int = 0

    def go(self) -> int:
        """Return the exit code after running the command.

        Raises:
            SettingsError: the seed is negative.
        """
        if self.seed < 0:
            raise SettingsError(f"seed: expected 0 or more, got {self.seed}; give a whole number.")
        from monodyn.cli.show import progress_on
        from monodyn.cli.streams import printing
        from monodyn.reproduce.cases import Design
        from monodyn.reproduce.clip import ClipSettings
        from monodyn.reproduce.experiment import ReproduceSettings, reproduce

        settings = ReproduceSettings(ClipSettings(seed=self.seed), Design(seed=self.seed))
        with progress_on(sys.stderr, quiet=self.quiet) as progress:
            made = reproduce(
                self.out, settings, clip=self.clip, model=self.model, force=self.force, progress=progress
            )
        if not self.quiet:
            with printing():
                _print(made)
        return 0


def _print(made: Experiment) -> None:
    """Print the three cases, the verdicts and where the page is."""
    from monodyn.reproduce.tables import STAR, plain_rows
    from monodyn.reproduce.vision import TITLES

    columns, rows = plain_rows(made.cases, made.joints)
    widths = [max(len(row[i]) for row in [columns, *rows]) for i in range(len(columns))]
    for row in [columns, *rows]:
        cells = [
            cell.ljust(width) if i < 3 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        print("  ".join(cells).rstrip())
    if any(case.clip_period for case in made.cases):
        print(f"{STAR} the period is that of the whole clip, predicted frames included")
    words = {True: "held", False: "did not hold", None: "no verdict"}
    print()
    for claim in made.claims:
        said = ", ".join(
            f"{TITLES[method]} {words[verdict.held]}" for method, verdict in claim.verdicts.items()
        )
        print(f"{claim.text} {said}.")
    print(f"\n{made.seconds:.0f} s. page: {made.folder / 'reproduce.html'}")
