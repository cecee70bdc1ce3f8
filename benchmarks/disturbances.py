"""Print how exact default runs are before cameras that are tilted, oblique, shaken, slow or bend the picture.

Run: ``python benchmarks/disturbances.py [--only NAME ...] [--json FILE] [--gate] [--runs FOLDER]
[--plot FILE]``. Each mechanism is filmed square and still, and with one disturbance of three sizes of each
kind; one also through lenses, with and without their coefficients. In addition to the errors the table has
by how many standard deviations the worst interval of a fit that is called good misses the truth. ``--plot``
draws the errors against the size of the disturbance.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import monodyn
from accuracy import differences, rms
from clips import wrong
from effects import held
from figures import Figure, command_line, finish, say, table
from filmed import MECHANISMS, WIDE, Take, angle_error, filmed, length_error
from spec import mjcf, view

MOST_STD = 4.0
"""Standard deviations by which the interval of a fit that is called good may miss the truth."""
PREDICTED = 40
"""Frames after the fitted ones that are predicted."""
SIZES = {
    "tilt": (1.0, 3.0, 8.0),
    "yaw": (3.0, 10.0, 20.0),
    "shake": (1.0, 3.0, 6.0),
    "exposure": (0.1, 0.5, 1.0),
}
"""Sizes by kind of disturbance."""
UNITS = {"tilt": "deg", "yaw": "deg", "shake": "px", "exposure": "of the interval"}
"""Units of these sizes."""
LENSES = {"barrel": (-0.3, 0.1, 0.0, 0.0), "pincushion": (0.25, 0.0, 0.002, -0.003)}
"""Coefficients of the lenses, as OpenCV has them."""
UNTOLD = "_untold"
"""End of the kind of a disturbance by a lens that the run is not given."""
BENT = "double"
"""The mechanism that is filmed through lenses."""
COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e")
"""Of the mechanisms in the plot."""


@dataclass(frozen=True)
class Disturbed:
    """One clip.

    Attributes:
        mechanism: What is filmed, of ``MECHANISMS``.
        kind: Kind of disturbance, of ``SIZES`` or ``LENSES``.
        size: Its size, 0 for none.
    """

    mechanism: str
    kind: str
    size: float = 0.0

    @property
    def name(self) -> str:
        """Name of the clip."""
        return f"{self.mechanism}_{self.kind}" + (f"_{self.size:g}" if self.kind in SIZES else "")

    @property
    def take(self) -> Take:
        """The clip."""
        case = replace(MECHANISMS[self.mechanism], name=self.name)
        if self.kind == "shake":
            # a shaken picture lacks its margins: it is drawn wider
            return Take(replace(case, **WIDE), (held(self.size),))
        if self.kind not in SIZES:
            # a wide angle bends the picture most, and the mechanism reaches to its sides
            bends = LENSES[self.kind.removesuffix(UNTOLD)]
            return Take(replace(case, bends=bends, fovy=60.0, fill=0.9, pivot=(0.5, 0.45)))
        turned = (self.size * (self.kind == "tilt"), 0.0, self.size * (self.kind == "yaw"))
        return Take(replace(case, turned=turned, shutter=self.size * (self.kind == "exposure")))

    @property
    def settings(self) -> monodyn.RunSettings:
        """Settings of the run: the defaults, and the lens."""
        settings = monodyn.RunSettings()
        if self.kind not in LENSES:
            return settings
        focal = replace(settings.locate, focal=view(self.take.case)[0])
        return replace(settings, distortion=LENSES[self.kind], locate=focal)


def every() -> list[Disturbed]:
    """Return the clips: every mechanism with every disturbance, each in three sizes and none; the lenses."""
    lenses = [Disturbed(BENT, kind + end) for kind in LENSES for end in ("", UNTOLD)]
    return [
        *(Disturbed(m, kind, size) for m in MECHANISMS for kind in SIZES for size in (0.0, *SIZES[kind])),
        *lenses,
    ]


def measure(clip: Disturbed, folder: Path) -> list[Figure]:
    """Make a clip, run it with default settings and compare with the truth.

    Args:
        clip: What is filmed.
        folder: Where clip and run folder go.

    Returns:
        Whether it was called good, the errors, and the worst miss of an interval.
    """
    folder.mkdir(parents=True, exist_ok=True)
    name, take = clip.name, clip.take
    path, truth = folder / "clip.mp4", filmed(take, folder / "clip.mp4")
    (folder / "model.xml").write_text(mjcf(tuple(wrong(part) for part in take.case.parts)))
    try:
        outcome = monodyn.run(path, folder / "model.xml", folder / "run", clip.settings, force=True)
    except monodyn.MonodynError as error:
        say(f"{name}: refused: {error}")
        return [Figure(name, "called good", 0.0, "")]
    document, poses = outcome.document, outcome.poses
    angle, share = angle_error(take, poses, truth)
    most = max(misses(take, document).items(), key=lambda item: item[1])
    say(f"{name}: {document['status']} {most[0]} misses most.")
    good = bool(document["ok"])
    # nobody relies on the intervals of a fit that is not called good; a lens without its coefficients shows
    # what it costs
    target = MOST_STD if good and not clip.kind.endswith(UNTOLD) else None
    return [
        Figure(name, "called good", float(good), ""),
        Figure(name, "frames seen", share, "%"),
        Figure(name, "angles", angle, "deg"),
        Figure(name, "lengths", length_error(take, document)[0], "%"),
        Figure(name, "prediction", ahead(take, folder / "run", poses.joints, truth), "deg"),
        Figure(name, "worst interval", most[1], "std", target),
    ]


def misses(take: Take, document: dict) -> dict[str, float]:
    """Return by how many standard deviations lengths and the camera's angles are off, by name.

    Args:
        take: What the clip shows.
        document: The content of ``fit.json``.
    """
    rows = {row["name"]: row for row in document["parameters"]}
    hinged = [part for part in take.case.parts if part.kind == "hinge"]
    found = {}
    for i, part in enumerate(hinged, start=1):
        row = rows[f"link{i}.length"]
        found[row["name"]] = abs(row["value"] - part.length) / max(row["std"] or 0.0, 1e-12)
    camera = document["camera"]
    for angle, true in zip(("roll", "pitch", "yaw"), np.radians(take.case.turned), strict=True):
        # a shaken camera has angles of its own in every frame
        std = camera["std"].get(f"camera.{angle}") if not take.effects else None
        if std:
            found[angle] = abs(camera[angle] - float(true)) / std
    return found


def ahead(take: Take, out: Path, joints: Sequence[str], truth: np.ndarray) -> float:
    """Return the largest rms error of a hinge over the first predicted frames [deg]; NaN without any.

    Args:
        take: What the clip shows.
        out: The run folder.
        joints: Names of the joints.
        truth: True joint positions, (frame, dof).
    """
    if not (out / "prediction.csv").exists():
        return float("nan")
    file = np.genfromtxt(out / "prediction.csv", delimiter=",", names=True)[:PREDICTED]
    true = truth[file["frame"].astype(int)]
    errors = [
        rms(np.degrees(differences(file[joint], true[:, dof], turns=True)))
        for dof, (joint, part) in enumerate(zip(joints, take.case.parts, strict=True))
        if part.kind == "hinge"
    ]
    return max(errors)


def plot(figures: Sequence[Figure], clips: Sequence[Disturbed], path: Path) -> None:
    """Write the errors against the size of the disturbance as a page.

    Args:
        figures: The figures.
        clips: The clips that they belong to.
        path: Of the page.
    """
    import plotly.graph_objects as go
    from plotly.subplots import make_subplots

    errors = {"angles": "deg", "lengths": "%", "prediction": "deg"}
    titles = [f"{kind} [{unit}]" for kind, unit in UNITS.items()]
    page = make_subplots(rows=len(errors), cols=len(SIZES), column_titles=titles, shared_yaxes="rows")
    values = {(figure.case, figure.name): figure.value for figure in figures}
    for row, (error, unit) in enumerate(errors.items(), start=1):
        for column, kind in enumerate(SIZES, start=1):
            for colour, mechanism in zip(COLOURS, MECHANISMS, strict=True):
                own = [clip for clip in clips if (clip.mechanism, clip.kind) == (mechanism, kind)]
                good = [values[clip.name, "called good"] for clip in own]
                trace = go.Scatter(
                    x=[clip.size for clip in own], y=[values.get((clip.name, error)) for clip in own],
                    marker={"symbol": ["circle" if g else "circle-open" for g in good], "size": 9},
                    line={"color": colour}, mode="lines+markers", name=mechanism, legendgroup=mechanism,
                    showlegend=row == column == 1,
                )  # fmt: skip
                page.add_trace(trace, row, column)
        page.update_yaxes(type="log", row=row)
        page.update_yaxes(title_text=f"{error} [{unit}]", row=row, col=1)
    title = "Errors of default runs against the size of a disturbance; open circles: not called good"
    page.update_layout(title_text=title, height=950, template="plotly_white")
    page.write_html(path)


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when an interval of a good fit misses the truth, under ``--gate``.
    """
    clips = every()
    parser = command_line(__doc__, tuple(clip.name for clip in clips))
    parser.add_argument("--runs", type=Path, metavar="FOLDER", help="keep clips and run folders there")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="write the errors as a page there")
    options = parser.parse_args()
    clips = [clip for clip in clips if not options.only or clip.name in options.only]
    figures: list[Figure] = []
    with tempfile.TemporaryDirectory() as temporary:
        for clip in clips:
            figures += measure(clip, (options.runs or Path(temporary)) / clip.name)
    print(table(figures))
    if options.plot is not None:
        plot(figures, clips, options.plot)
    return finish(figures, to=options.json, gate=options.gate)


if __name__ == "__main__":
    sys.exit(main())
