"""Print how well real encoder records are fitted, from the bundled models' naive start.

Run: ``MONODYN_DATA=<folder> python benchmarks/encoders.py [--json FILE]``; the folder holds
``encoders/*.csv``.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import dataclass
from pathlib import Path

from figures import Figure, save
from monodyn.estimation.fit import Fit
from monodyn.estimation.record.tables import read_poses
from monodyn.estimation.settings import IdentifySettings
from monodyn.mechanism import load
from monodyn.stages import identify

KNOWN_RATIOS = {
    "link1.J / link2.J": 1.796,
    "link1.length * link2.mx / link2.J": 0.8824,
    "link1.mx * gravity / link2.J": 105.9,
    "link2.mx * gravity / link2.J": 50.11,
}
"""What is published of the double pendulum, by name of the combination."""
MOST_RESIDUAL = 3.0
"""Largest residual of a good fit, rms [mrad]."""
MOST_OFF = 2.0
"""Largest error of a ratio in the required window [%]."""
REQUIRED_WINDOW = "double_12"
"""The window of the double pendulum that must be good; the others are counted."""


@dataclass(frozen=True)
class Window:
    """The fit of one record.

    Attributes:
        name: The record, ``single_NN`` or ``double_NN``.
        fit: Its fit with free bodies.
    """

    name: str
    fit: Fit

    @property
    def rms(self) -> dict[str, float]:
        """Residual of each joint [mrad]."""
        return {joint: 1000.0 * value for joint, value in self.fit.rms.items()}

    @property
    def off(self) -> dict[str, float]:
        """Error of each known ratio [%]."""
        found = {combination.name: combination.value for combination in self.fit.combinations}
        return {
            name: 100.0 * (found[name] / value - 1.0) for name, value in KNOWN_RATIOS.items() if name in found
        }

    @property
    def double(self) -> bool:
        """Whether it is the double pendulum."""
        return len(self.fit.rms) == 2

    @property
    def good(self) -> bool:
        """Whether the fit is to be used and its residuals are small."""
        return self.fit.ok and max(self.rms.values()) <= MOST_RESIDUAL

    @property
    def missed(self) -> bool:
        """Whether it is a required record, and its fit or a ratio misses its mark."""
        required = not self.double or self.name == REQUIRED_WINDOW
        return required and not (self.good and all(abs(error) <= MOST_OFF for error in self.off.values()))

    def row(self) -> str:
        """Return the line of the table."""
        residuals = " ".join(f"{value:5.2f}" for value in self.rms.values())
        errors = " ".join(f"{error:+6.2f}" for error in self.off.values())
        return f"{self.name:<12}{residuals:>14}{errors:>40}{self.fit.seconds:>10.2f}"

    def figures(self) -> list[Figure]:
        """Return residuals, errors of the ratios and the time as figures."""
        return [
            *(Figure(self.name, f"{joint} residual", value, "mrad") for joint, value in self.rms.items()),
            *(Figure(self.name, f"{name} off", error, "%") for name, error in self.off.items()),
            Figure(self.name, "fit to be used", float(self.fit.ok), ""),
            Figure(self.name, "time", self.fit.seconds, "s"),
        ]


def main() -> int:
    """Fit every window and print a row each.

    Returns:
        The exit code: 1 when a required window misses its mark, 2 when the data are missing.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there, too")
    options = parser.parse_args()
    folder = Path(os.environ.get("MONODYN_DATA", "")) / "encoders"
    files = sorted(folder.glob("*.csv"))
    if "MONODYN_DATA" not in os.environ or not files:
        print(
            "benchmarks/encoders.py: set MONODYN_DATA to the folder that holds encoders/*.csv.",
            file=sys.stderr,
        )
        return 2
    print(f"{'record':<12}{'rms [mrad]':>14}{'ratios, % off the published ones':>40}{'seconds':>10}")
    windows = []
    for file in files:
        mechanism = load(file.stem.split("_")[0])
        fit = identify(read_poses(file, mechanism), mechanism, IdentifySettings(bodies="free"))
        windows.append(Window(file.stem, fit))
        print(windows[-1].row())
    reached = sum(window.good for window in windows if window.double)
    doubles = sum(window.double for window in windows)
    missed = [window.name for window in windows if window.missed]
    print(
        f"{reached} of {doubles} double windows within {MOST_RESIDUAL:g} mrad; "
        f"required and missed: {missed or 'none'}"
    )
    if options.json is not None:
        save([figure for window in windows for figure in window.figures()], options.json)
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
