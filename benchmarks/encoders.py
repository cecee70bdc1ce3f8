"""Print how well real encoder records are fitted, from the bundled models' naive start.

Run: ``MONODYN_DATA=<folder> python benchmarks/encoders.py``; the folder holds ``encoders/*.csv``.
"""

import os
import sys
from pathlib import Path

from monodyn.estimation.record.tables import read_poses
from monodyn.estimation.settings import IdentifySettings
from monodyn.mechanism import load
from monodyn.stages import identify

COLUMNS = {
    "link1.J / link2.J": 1.796,
    "link1.length * link2.mx / link2.J": 0.8824,
    "link1.mx * gravity / link2.J": 105.9,
    "link2.mx * gravity / link2.J": 50.11,
}


def main() -> int:
    """Fit every window and print a row each; 1 when a required one misses its mark."""
    folder = Path(os.environ.get("MONODYN_DATA", "")) / "encoders"
    files = sorted(folder.glob("*.csv"))
    if "MONODYN_DATA" not in os.environ or not files:
        print(
            "benchmarks/encoders.py: set MONODYN_DATA to the folder that holds encoders/*.csv.",
            file=sys.stderr,
        )
        return 2
    print(f"{'record':<12}{'rms [mrad]':>14}{'ratios, % off the published ones':>40}{'seconds':>10}")
    missed, reached = [], 0
    for file in files:
        mechanism = load(file.stem.split("_")[0])
        fit = identify(read_poses(file, mechanism), mechanism, IdentifySettings(bodies="free"))
        found = {c.name: c.value for c in fit.combinations}
        off = [100.0 * (found[name] / value - 1.0) for name, value in COLUMNS.items() if name in found]
        rms = [1000.0 * value for value in fit.rms.values()]
        good = fit.ok and max(rms) <= 3.0
        reached += good and len(rms) == 2
        required = len(rms) == 1 or file.stem == "double_12"
        if required and not (good and all(abs(x) <= 2.0 for x in off)):
            missed.append(file.stem)
        cells = " ".join(f"{value:5.2f}" for value in rms), " ".join(f"{x:+6.2f}" for x in off)
        print(f"{file.stem:<12}{cells[0]:>14}{cells[1]:>40}{fit.seconds:>10.2f}")
    windows = sum(file.stem.startswith("double") for file in files)
    print(f"{reached} of {windows} double windows within 3 mrad; required and missed: {missed or 'none'}")
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
