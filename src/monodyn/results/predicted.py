"""A run folder in, the motion of its mechanism from any start out: a table, a plot, a film over the clip."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from monodyn.choices import Tolerance
from monodyn.errors import SettingsError
from monodyn.estimation.fit import Fit
from monodyn.estimation.wording import listed
from monodyn.mechanism import Mechanism
from monodyn.mechanism.dimensions import MASS_KINDS
from monodyn.mechanism.steps import spacing
from monodyn.mechanism.tree import INERTIA, MASS
from monodyn.numbers import shown_in
from monodyn.results.curves import BAND, state_curves
from monodyn.results.export import json_text, motion_table
from monodyn.results.fill import States, fill
from monodyn.results.folder import FolderKind, RunFolder
from monodyn.results.horizon import Horizon, allowed, horizon, horizon_said, lasts
from monodyn.results.opened import clip_of, filmed_by, is_other_clip, open_run
from monodyn.results.overlay import PREDICTED, Drawing, write_overlay
from monodyn.results.predict import evenly
from monodyn.results.restart import acting, restart
from monodyn.results.run_toml import RUN_TOML, command_toml
from monodyn.results.sequel import Sequel, notes_of, sequel_text
from monodyn.results.sight import outlines_of
from monodyn.types import Frame, Progress
from monodyn.vision.clip.video import Video, read

PREDICTION = FolderKind(
    "prediction",
    ("prediction.csv", "prediction.json", "prediction.html", "prediction.mp4", RUN_TOML),
    whole=True,
)


SIZES = ("length", "width", "thickness", "tail", "tip")
"""Kinds of sizes of a body, for which its mass may stand."""


@dataclass(frozen=True)
class Wanted:
    """What is to be predicted.

    Attributes:
        positions: Position of every joint at the start [rad or m], by name; None begins where the record is.
        rates: Rates there [rad/s or m/s], by name; those left out are zero.
        at: Time stamp of the start [s]; 0 with positions, the last fitted frame without.
        until: Time stamp of the end [s]; as long as the record is, when left out.
        fix: Parameters that have another value than was identified, by name.
        record: Which record of the run.
        tolerance: How far off a prediction may be; how long it stays within is said.
    """

    positions: Mapping[str, float] | None = field(default=None, metadata={"name": "from"})
    rates: Mapping[str, float] = field(default_factory=dict)
    at: float | None = None
    until: float | None = None
    fix: Mapping[str, float] = field(default_factory=dict)
    record: int = 0
    tolerance: Tolerance = field(default_factory=Tolerance)


@dataclass(frozen=True, eq=False)
class Predicted:
    """A mechanism's motion from a start.

    Attributes:
        fit: The mechanism, whose one record ends at the start.
        states: The motion, the start its first row.
        horizon: How long it stays within the tolerance.
        notes: What one should know about it, in sentences.
        folder: Where the files are; None where none were written.
    """

    fit: Fit
    states: States
    horizon: Horizon
    notes: tuple[str, ...] = ()
    folder: Path | None = None

    @property
    def document(self) -> dict[str, Any]:
        """The content of ``prediction.json``."""
        joints = [joint.name for joint in self.fit.mechanism.joints]
        states = self.states
        columns = {
            "position": states.position, "velocity": states.velocity,
            "position_std": states.std, "velocity_std": states.velocity_std,
        }  # fmt: skip
        return {
            "grade": self.fit.grade,
            "notes": list(self.notes),
            "horizon": {"seconds": self.horizon.seconds, "joint": self.horizon.joint or None},
            "time": states.time,
            **{name: dict(zip(joints, values.T, strict=True)) for name, values in columns.items()},
        }


def predict_run(
    run: str | Path,
    out: str | Path | None = None,
    wanted: Wanted | None = None,
    *,
    film: bool = False,
    clip: str | Path | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Predicted:
    """Predict how the mechanism of a run moves from a start.

    Args:
        run: The run folder.
        out: Folder for table, plot and film; None writes nothing.
        wanted: From where, and until when.
        film: Draw the motion over the first frame of the clip.
        clip: Where the clip is, if no longer where the run found it.
        force: Replace a prediction that is already in ``out``.
        progress: Called with the frames drawn.

    Returns:
        The motion.

    Raises:
        SettingsError: There is no such run, it has nothing identified, the end is not after the start, or
            there is nothing to draw the film on.
    """
    wanted = wanted or Wanted()
    if clip is not None and not film:
        raise SettingsError("clip: expected --film with it, got none; add it, or leave the clip out.")
    if out is None:
        return _predicted(open_run(run), wanted)
    if Path(out).resolve() == Path(run).resolve():
        raise SettingsError(
            f"out '{out}': expected another folder than that of the run, whose prediction.csv it would "
            "replace; give another with --out."
        )
    folder = RunFolder(out, force=force, inputs=[clip], kind=PREDICTION)
    with folder.filling():
        fit = open_run(run)
        over = _clip(Path(run), clip) if film else None
        background = None if over is None else _background(Path(run), over)
        found = _predicted(fit, wanted)
        notes = [] if over is None else _other_clip(Path(run), over)
        found = replace(found, notes=(*found.notes, *notes, *folder.notes))
        _write(folder, found, wanted, Path(run), background, progress)
        folder.write_text(RUN_TOML, command_toml("predict", {"run": run, "film": film, "clip": clip}, wanted))
    return replace(found, folder=folder.path)


def _predicted(fit: Fit, wanted: Wanted) -> Predicted:
    """Return the motion of an identified mechanism, and what one should know about it."""
    if wanted.positions is not None:
        # what pushed the record does not push what is let go by hand
        fit = replace(fit, torques=())
    _refuse_sizes(fit, wanted.fix)
    begun = restart(fit, wanted.positions, wanted.rates, at=wanted.at, fix=wanted.fix, record=wanted.record)
    stamps, start = begun.time[0], begun.starts[0].time
    ends = float(fit.time[wanted.record][0]), float(fit.time[wanted.record][-1])
    end = start + float(stamps[-1] - stamps[0]) if wanted.until is None else wanted.until
    if not start < end < np.inf:
        raise SettingsError(f"until: expected a time after the start at {start:g} s, got {end:g} s.")
    states = _followed(begun, evenly(start, end, spacing(stamps)))
    notes = (
        *_stayed(fit.mechanism, begun.mechanism, wanted.fix), *_alone(fit, wanted.fix),
        *_notes(begun, states, ends),
    )  # fmt: skip
    return Predicted(begun, states, horizon(begun, wanted.tolerance), notes)


def _refuse_sizes(fit: Fit, fix: Mapping[str, float]) -> None:
    """Refuse sizes of a body on which the motion does not depend, as its mass was written in their place."""
    mechanism = fit.mechanism.with_choices(fix=fix)
    for name, value in fix.items():
        row = mechanism.parameter(name)
        if row.kind in SIZES and not acting(mechanism, [name]):
            raise SettingsError(
                f"fix: expected parameters on which the motion depends, got {name}; in place of the sizes of "
                f"{row.owner} give its .mass, .com_x or .inertia, or identify again with --fix "
                f"{name}={value:g}."
            )


def _followed(fit: Fit, times: np.ndarray) -> States:
    """Return the motion, which has to be one that an integration can follow."""
    with np.errstate(all="ignore"):
        states = fill(fit, times)
    lost = ~np.isfinite(states.position).all(axis=1)
    if lost.any():
        raise SettingsError(
            f"predict: expected a motion that can be followed to {times[-1]:g} s, lost it at "
            f"{times[int(np.argmax(lost))]:g} s: rates or frictions are too large for frames of "
            f"{times[1] - times[0]:g} s; give others, or an earlier end."
        )
    return states


def _stayed(before: Mechanism, after: Mechanism, fix: Mapping[str, float]) -> list[str]:
    """Return notes on lengths that have another value while the masses of their body stay where they are."""
    notes, inertial = [], slice(MASS, INERTIA + 1)
    for name in fix:
        row = after.parameter(name)
        links = [i for i, joint in enumerate(after.joints) if joint.body == row.owner]
        same = np.array_equal(before.tree.links[links, inertial], after.tree.links[links, inertial])
        if row.kind == "length" and row.value != before.values[name] and same:
            notes.append(
                f"{name} moves what hangs on {row.owner} and nothing else: its mass, centre of mass and "
                f"inertia stay as identified; where they differ, too, give {row.owner}.mass, "
                f"{row.owner}.com_x and {row.owner}.inertia with it."
            )
    return notes


def _alone(fit: Fit, fix: Mapping[str, float]) -> list[str]:
    """Return a note on masses that are changed alone where only their ratios are known."""
    rows = [fit.mechanism.parameter(name) for name in fix]
    heavy = [p.name for p in rows if p.kind in MASS_KINDS and fix[p.name] not in (p.value, 0.0)]
    if not heavy or fit.mass_scale is not None:
        return []
    return [
        f"Known only in ratios, and changed alone: {listed(heavy, 12)}. The other masses, inertias and "
        "frictions stay as in the run, so that the motion is another one; a measured value belongs to the "
        f"run (monodyn run --fix {heavy[0]}={fix[heavy[0]]:g}), where the others follow it."
    ]


def _notes(fit: Fit, states: States, record: tuple[float, float]) -> tuple[str, ...]:
    """Return what one should know about a prediction; ``record`` is where the fitted frames begin and end."""
    notes, start = [], fit.starts[0].time
    if not record[0] - 1e-9 <= start <= record[1] + 1e-9 and np.any(fit.starts[0].covariance):
        where = "after" if start > record[1] else "before"
        off = start - record[1] if start > record[1] else record[0] - start
        notes.append(f"It starts {off:.3g} s {where} the fitted frames, in a state that is predicted itself.")
    if not fit.ok:
        notes.append(f"The mechanism is not to be relied on: {fit.status}")
    if fit.torque == "known" and not fit.torques:
        notes.append("The known torques belong to the record: here none act.")
    if fit.torques and np.isinf(states.std).any():
        notes.append(
            "The known torques of the run reach to the end of its prediction; after that the last of them "
            "stands for them, and nothing is known."
        )
    if fit.torque == "free" and np.isinf(states.std).any():
        notes.append("Free torques are known within the fitted frames alone: outside of these none act.")
    elif fit.torque in ("fourier", "free"):
        notes.append(
            f"The torques over time that were identified act here, too: it begins with those of {start:g} s, "
            "and with others at another --at."
        )
    return tuple(notes)


def _write(
    folder: RunFolder, found: Predicted, wanted: Wanted, run: Path, background: Frame | None,
    progress: Progress | None,
) -> None:  # fmt: skip
    """Write the files of a prediction, the ones that cost least first."""
    joints, states = found.fit.mechanism.joints, found.states
    names = [joint.name for joint in joints]
    table = motion_table(names, [(range(len(states.time)), states)])
    folder.write_text("prediction.csv", table)
    folder.write_text("prediction.json", json_text(found.document))
    files = [*folder.written, RUN_TOML, *(["prediction.mp4"] if background is not None else [])]
    folder.write_text("prediction.html", sequel_text(_page(found, wanted, run), files, run, folder.path))
    if background is not None:
        folder.write("prediction.mp4", lambda path: _film(path, found, run, background, progress))


def _page(found: Predicted, wanted: Wanted, run: Path) -> Sequel:
    """Return what the page of a prediction says."""
    fit, states = found.fit, found.states
    within, ends = allowed(fit.mechanism, wanted.tolerance), (states.time[0], states.time[-1])
    whence = "as given" if wanted.positions is not None else f"as record {wanted.record} has it there"
    begins = [f"{ends[0]:g} s, {whence}", *_state(fit.mechanism, states)]
    asked = [
        ("start", "; ".join(begins)),
        ("until", f"{ends[1]:g} s, a row every {spacing(states.time):.4g} s"),
        ("tolerance", within),
    ]
    if wanted.fix:
        given = (f"{name} {x:g} {fit.mechanism.parameter(name).unit}" for name, x in wanted.fix.items())
        asked.append(("other values", ", ".join(given)))
    half = [
        f"{BAND * std * shown_in(joint)[0]:.2g} {shown_in(joint)[1]}" if np.isfinite(std) else "unknown"
        for joint, std in zip(fit.mechanism.joints, states.std[-1], strict=True)
    ]
    facts = [
        (f"{ends[1] - ends[0]:.3g} s", "predicted"),
        (lasts(found.horizon), f"within {within}"),
        (" · ".join(half), "half width of the 95 % bands at the end"),
    ]
    return Sequel(
        title=f"{fit.mechanism.name} from {ends[0]:g} s on",
        subtitle=f"Motion of the mechanism that was identified in '{run.resolve().name}'.",
        grade=fit.grade,
        status=horizon_said(fit, found.horizon, wanted.tolerance, since="the start"),
        notes=notes_of(fit, found.notes),
        facts=facts,
        asked=asked,
        plots=state_curves(fit.mechanism, states),
        legend=[("predicted", "predicted, with its 95 % band")],
    )


def _state(mechanism: Mechanism, states: States) -> list[str]:
    """Write the first state of a motion, joint by joint."""
    found = []
    for joint, position, rate in zip(mechanism.joints, states.position[0], states.velocity[0], strict=True):
        scale, unit = shown_in(joint)
        found.append(f"{joint.name} {position * scale:z.4g} {unit}, {rate * scale:z.4g} {unit}/s")
    return found


def _clip(run: Path, clip: str | Path | None) -> Path:
    """Return the clip of a run: the one that was named, or the one that it found."""
    # without a camera no clip is of any use
    filmed_by(run)
    clip = clip_of(run) if clip is None else clip
    if clip is None or not Path(clip).exists():
        raise SettingsError(
            f"film: expected the clip of the run, got {'none' if clip is None else f'no file {clip}'}; name "
            "it with --clip."
        )
    return Path(clip)


def _other_clip(run: Path, clip: Path) -> list[str]:
    """Return a note on a clip that is not the file of the run, but may be a copy of it in another format."""
    if not is_other_clip(run, clip):
        return []
    return [
        f"The film is drawn over '{clip}', which is not the file that the run was made of: unless it is a "
        "copy of the same clip, camera and scene are others, and the mechanism is drawn in the wrong place."
    ]


def _background(run: Path, clip: Path) -> Frame:
    """Return the first frame of a clip, which has to be of the size of that of a run."""
    camera, _ = filmed_by(run)
    video = read(clip)
    # a run looks at large pictures reduced, or whole
    if video.shrink > 1 and (video.width, video.height) != (camera.width, camera.height):
        video = read(clip, whole=True)
    frame = next(video.frames(0, 1))
    height, width = frame.luma.shape
    if (width, height) != (camera.width, camera.height):
        raise SettingsError(
            f"film: expected a clip of {camera.width}x{camera.height} pixels, got {width}x{height}; name "
            "that of the run with --clip."
        )
    return frame


def _film(path: Path, found: Predicted, run: Path, background: Frame, progress: Progress | None) -> None:
    """Write the motion over one picture."""
    camera, thickness = filmed_by(run)
    mechanism, states = found.fit.mechanism, found.states
    mechanism = mechanism.with_values({n: v for n, v in thickness.items() if n in mechanism.values})

    def frames(first: int, stop: int) -> Iterator[Frame]:
        for row in range(first, stop):
            yield replace(background, index=row, time=float(states.time[row]))

    def drawing(frame: Frame) -> Drawing:
        outlines = outlines_of(mechanism, camera, states.position[frame.index])
        return Drawing([(polygon, PREDICTED) for polygon in outlines], f"{frame.time:.2f} s  predicted")

    still = Video(path, camera.width, camera.height, states.time, frames)
    write_overlay(path, still, drawing, progress=progress)
