"""``monodyn reproduce``: its options, and its tables on the standard output."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from monodyn.cli.shared import FolderOptions
from monodyn.errors import SettingsError

if TYPE_CHECKING:
    from monodyn.reproduce.experiment import Experiment
    from monodyn.reproduce.repetition import Repetition

USUAL_SEEDS = 3
"""Pendulums of the experiment where the user does not say."""
MOST_SEED = 2**32 - 1
"""Greatest seed; the seeds of drawn pendulums count on from it."""
MOST_PROCESSES = 2
"""Processes that work side by side at most; each takes up to half a gigabyte."""


@dataclass(frozen=True, kw_only=True)
class ReproduceOptions(FolderOptions):
    """Repeat the experiment of the 2012 paper with the published and the default method; write one page.

    Attributes:
        out: Folder for the page, the tables and the clip.
        clip: A clip of a mechanism in place of the made ones. Needs --model.
        model: Mechanism file (MJCF, URDF) or bundled name for --clip.
        truth: The true motion of --clip: a JSON document with q by frame [rad, m for slides], or a table as
            monodyn identify reads it.
        seed: Random numbers of the made clips, of the drawn pendulums and of the start values.
        seeds: How many pendulums: the usual one, then others drawn by --seed; 3 unless --clip is given.
    """

    out: Path = field(metadata={"metavar": "DIR"})
    clip: Path | None = field(default=None, metadata={"metavar": "CLIP"})
    model: str | None = field(default=None, metadata={"metavar": "MODEL", "file": True})
    truth: Path | None = None
    seed: int = 0
    seeds: int | None = None

    def go(self) -> int:
        """Return the exit code after running the command.

        Raises:
            SettingsError: the seed is out of range, or there are several seeds for one clip.
        """
        if not 0 <= self.seed <= MOST_SEED:
            raise SettingsError(
                f"seed: expected 0 to {MOST_SEED}, got {self.seed}; give a whole number in between."
            )
        if self.clip is not None and self.seeds is not None:
            raise SettingsError(
                f"seeds: expected none with --clip, which is one pendulum, got {self.seeds}; leave it out."
            )
        from monodyn.cli.streams import printing
        from monodyn.settings import published_method

        with published_method():
            from monodyn.reproduce.experiment import ReproduceSettings, reproduce
        from monodyn.reproduce.clip import ClipSettings
        from monodyn.reproduce.given import GivenClip
        from monodyn.reproduce.plans import Design

        given = GivenClip.of(self.clip, self.model, self.truth)
        seeds = self.seeds if self.seeds is not None else USUAL_SEEDS
        settings = ReproduceSettings(
            ClipSettings(seed=self.seed),
            Design(seed=self.seed),
            1 if given is not None else seeds,
            min(MOST_PROCESSES, os.cpu_count() or 1),
        )
        with self.progress() as progress:
            made = reproduce(self.out, settings, given=given, force=self.force, progress=progress)
        if not self.quiet:
            with printing():
                _print(made)
        return 0


def _print(made: Experiment) -> None:
    """Print the three cases of each pendulum, assumptions, verdicts and where the page is."""
    from monodyn.reproduce.page_tables import HELD
    from monodyn.reproduce.tables import legend
    from monodyn.reproduce.vision import TITLES

    for repetition in made.repetitions:
        _print_cases(repetition)
    for line in legend(made.repetitions):
        print(line)
    print()
    first = made.repetitions[0]
    if first.settings is None:
        print("Assumptions of the paper")
        for assumed in first.assumptions:
            print(f"  {HELD[assumed.held]:15} {assumed.name} {assumed.numbers}")
        print()
    width = max(len(claim.text) for claim in made.claims)
    methods = list(TITLES)
    print("  ".join(["claim".ljust(width), *(TITLES[method].ljust(16) for method in methods)]).rstrip())
    for claim in made.claims:
        said = [claim.judged[method].words.ljust(16) for method in methods]
        print("  ".join([claim.text.ljust(width), *said]).rstrip())
    for note in made.notes:
        print(f"\n{note}")
    print(f"\n{made.seconds:.0f} s. page: {made.folder / 'reproduce.html'}")


def _print_cases(repetition: Repetition) -> None:
    """Print the table of the three cases with one pendulum."""
    from monodyn.reproduce.tables import plain_rows

    columns, rows = plain_rows(repetition)
    widths = [max(len(row[i]) for row in [columns, *rows]) for i in range(len(columns))]
    print(repetition.name)
    for row in [columns, *rows]:
        cells = [
            cell.ljust(width) if i < 3 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        print("  ".join(cells).rstrip())
    print()
