"""The composition: a clip and a mechanism file in, a run folder out.

Everything that can be refused is refused before the first frame is decoded and before anything is written.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from monodyn.errors import MechanismError, SettingsError
from monodyn.estimation.fit import Fit
from monodyn.estimation.record.tables import read_poses, write_poses
from monodyn.estimation.settings import USUAL_TERMS
from monodyn.results.checks import check_camera, check_tracked, fitted_range, prediction_times
from monodyn.results.export import Trace
from monodyn.results.folder import RunFolder
from monodyn.results.log import RunLog, recorded
from monodyn.results.page import Page
from monodyn.results.predict import predict
from monodyn.results.report import result_document, trace_of, view_of, write_results
from monodyn.settings import RunSettings
from monodyn.stages import identify, locate, segment, track
from monodyn.types import Poses, Progress
from monodyn.vision.clip.video import Video, read
from monodyn.vision.locating.scene import Scene

if TYPE_CHECKING:
    from monodyn.mechanism import Mechanism


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a run found.

    Attributes:
        folder: The run folder, or None when nothing was written.
        document: The content of ``fit.json``, or of ``run.json`` where nothing was fitted.
        poses: The tracked clip, or the first record.
        fit: The fit, or None where nothing was fitted.
        traces: The records beside their motion.
        notes: What the user should know about clip, camera and tracking.
        seconds: Wall time by stage [s].
    """

    folder: Path | None
    document: dict[str, Any]
    poses: Poses
    fit: Fit | None = None
    traces: Sequence[Trace] = ()
    notes: Sequence[str] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)


def run(
    clip: str | Path,
    model: str | Path,
    out: str | Path,
    settings: RunSettings | None = None,
    *,
    force: bool = False,
    progress: Progress | None = None,
) -> Outcome:
    """Track a clip, identify on some of its frames, predict the others, write the run folder.

    Args:
        clip: Video file or folder of pictures.
        model: Mechanism file (MJCF, URDF) or a bundled name.
        out: The run folder.
        settings: What to do.
        force: Replace a run that is already in ``out``.
        progress: Called with the frames done by each step.

    Returns:
        What was found; a fit that is not to be trusted says so in ``fit.status``.

    Raises:
        MechanismError: the model, or a parameter named in ``fix`` or ``free``, cannot be used.
        VideoError: the clip cannot be used.
        SettingsError: a setting, the frame range or the folder cannot be used.

    Example:
        >>> monodyn.run("clip.mp4", "double.xml", "run")  # doctest: +SKIP
    """
    settings = settings or RunSettings()
    mechanism, video = opened(clip, model, settings)
    first, stop = fitted_range(settings.fit_frames, video.count)
    times, numbers = prediction_times(video, stop, settings.until)
    log = RunLog("run", {"clip": clip, "model": model}, settings)
    folder = RunFolder(out, force=force, inputs=(clip, model, settings.background))
    with recorded(folder, log):
        scene, poses = see(folder, log, video, mechanism, settings, progress)
        part = poses.part(*np.searchsorted(poses.frame, [first, stop]))
        check_tracked(part, video, log.notes)
        with log.stage("identify"):
            fit = identify(part, scene.mechanism, settings.identify, progress=progress)
        with log.stage("predict"):
            traces = []
            if fit.starts:
                future = predict(fit, times=times) if len(times) else None
                trace = trace_of(fit, poses, future, name=video.path.name)
                traces = [replace(trace, future_frame=numbers)]
        view = view_of(fit, scene, poses)
        folder.write("poses.csv", lambda path: write_poses(view.tracked, path))
        page = Page(video.path.name, _about(video, mechanism), log.notes, log=log)
        with log.stage("results"):
            document = write_results(
                folder, fit, traces, page, view=view, fit_frames=(first, stop), progress=progress
            )
    return Outcome(folder.path, document, view.tracked, fit, traces, log.notes, log.seconds)


def track_clip(
    clip: str | Path,
    model: str | Path,
    out: str | Path,
    settings: RunSettings | None = None,
    *,
    force: bool = False,
    progress: Progress | None = None,
) -> Outcome:
    """Track a clip and write ``poses.csv``; slides are in the start scale of the model.

    Args:
        clip: Video file or folder of pictures.
        model: Mechanism file (MJCF, URDF) or a bundled name.
        out: The run folder.
        settings: What to do.
        force: Replace a run that is already in ``out``.
        progress: Called with the frames done by each step.

    Raises:
        MechanismError: the model, or a parameter named in ``fix`` or ``free``, cannot be used.
        VideoError: the clip cannot be used.
        SettingsError: a setting or the folder cannot be used.
    """
    settings = settings or RunSettings()
    mechanism, video = opened(clip, model, settings)
    log = RunLog("track", {"clip": clip, "model": model}, settings)
    folder = RunFolder(out, force=force, inputs=(clip, model, settings.background))
    with recorded(folder, log):
        _, poses = see(folder, log, video, mechanism, settings, progress)
    check_tracked(poses, video, log.notes)
    return Outcome(
        folder.path, log.document("done", folder.written), poses, notes=log.notes, seconds=log.seconds
    )


def identify_tables(
    tables: Sequence[str | Path],
    model: str | Path,
    out: str | Path | None = None,
    settings: RunSettings | None = None,
    *,
    force: bool = False,
    progress: Progress | None = None,
) -> Outcome:
    """Identify a mechanism from tables of joint positions that share its parameters.

    Args:
        tables: ``poses.csv`` files or encoder logs.
        model: Mechanism file (MJCF, URDF) or a bundled name.
        out: Folder for the results; None writes nothing.
        settings: What to do; those of the clip do not matter.
        force: Replace a run that is already in ``out``.
        progress: Called with the steps done.

    Raises:
        MechanismError: the model, or a parameter named in ``fix`` or ``free``, cannot be used.
        VideoError: a table cannot be used.
        SettingsError: a setting or the folder cannot be used.
    """
    settings = settings or RunSettings()
    mechanism = chosen(model, settings, camera=False)
    records = [read_poses(table, mechanism) for table in tables]
    names = [Path(table).name for table in tables]
    inputs = {"model": model, **{f"poses {i + 1}": table for i, table in enumerate(tables)}}
    log = RunLog("identify", inputs, settings)
    folder = None if out is None else RunFolder(out, force=force, inputs=(model, *tables))
    with recorded(folder, log):
        with log.stage("identify"):
            fit = identify(records, mechanism, settings.identify, progress=progress)
        traces = []
        if fit.starts:
            traces = [trace_of(fit, record, name=names[i], record=i) for i, record in enumerate(records)]
        page = Page(", ".join(names), f"Joint positions with the model {mechanism.name}.", log=log)
        if folder is None:
            document = result_document(fit, traces)
        else:
            document = write_results(folder, fit, traces, page)
    return Outcome(
        None if folder is None else folder.path, document, records[0], fit, traces, (), log.seconds
    )


def opened(clip: str | Path, model: str | Path, settings: RunSettings) -> tuple[Mechanism, Video]:
    """Load the mechanism with the user's choices and open the clip.

    Args:
        clip: Video file or folder of pictures.
        model: Mechanism file or bundled name.
        settings: The user's choices.
    """
    mechanism = chosen(model, settings)
    video = read(clip, rate=settings.rate)
    if not mechanism.plan.drawn:
        raise MechanismError(
            f"mechanism '{mechanism.name}': expected a moving body with a geom that a clip can show, got "
            "none; add its shape."
        )
    if settings.background is not None and not Path(settings.background).is_file():
        raise SettingsError(
            f"background '{settings.background}': expected a picture file, found none; check the path."
        )
    return mechanism, video


def chosen(model: str | Path, settings: RunSettings, *, camera: bool = True) -> Mechanism:
    """Load a mechanism with the user's choices; those of the camera are only checked, for ``locate``.

    Args:
        model: Mechanism file or bundled name.
        settings: The user's choices.
        camera: False refuses parameters of the camera, where there is none.

    Raises:
        MechanismError: the model or a choice cannot be used.
        SettingsError: a choice of a camera parameter cannot be used.
    """
    from monodyn.mechanism import load

    if not str(model):
        raise MechanismError("model: expected a file or a bundled name, got an empty one; name one.")
    fix, free = settings.fix, settings.free
    for name in settings.bounds:
        if name.startswith("camera."):
            raise SettingsError(
                f"bounds of '{name}': expected a parameter of the mechanism; give the camera's with fix."
            )
    odd = [name for name in (*fix, *free) if name.startswith("camera.")]
    if odd and not camera:
        raise SettingsError(
            f"parameter '{odd[0]}': expected one of the mechanism's; tables of joint positions have no "
            "camera, leave it out."
        )
    check_camera(fix, free)
    torque = settings.identify.torque
    mechanism = load(model)
    if torque == "fourier":  # its parameters are there to be chosen; those of free torques are the record's
        low, high = settings.bounds.get("torque.period", (1.0, 1.0))
        period = min(max(1.0, low), high)
        mechanism = mechanism.with_torque(torque, terms=settings.identify.terms or USUAL_TERMS, period=period)
    for name in (*fix, *free, *settings.bounds):
        if torque != "fourier" and name not in mechanism.plan.index and "torque." in name:
            wanted = "cannot be chosen" if torque == "free" else "belongs to --identify.torque fourier"
            raise SettingsError(f"parameter '{name}': a torque over time {wanted}; add it or leave it out.")
    return mechanism.with_choices(
        fix={name: value for name, value in fix.items() if not name.startswith("camera.")},
        free=[name for name in free if not name.startswith("camera.")],
        bounds=settings.bounds,
    )


def see(
    folder: RunFolder,
    log: RunLog,
    video: Video,
    mechanism: Mechanism,
    settings: RunSettings,
    progress: Progress | None,
) -> tuple[Scene, Poses]:
    """Go from the clip to tracked poses, and write them.

    Args:
        folder: Takes ``poses.csv``.
        log: Takes the seconds of each stage and the notes.
        video: The clip.
        mechanism: The mechanism with the user's choices.
        settings: How.
        progress: Called with the frames done by each step.

    Returns:
        The scene, and the poses of the whole clip.
    """
    fix = {name: value for name, value in settings.fix.items() if name.startswith("camera.")}
    free = [name for name in settings.free if name.startswith("camera.")]
    with log.stage("segment"):
        masks = segment(video, settings.segment, background=settings.background, progress=progress)
    with log.stage("locate"):
        scene = locate(
            masks, mechanism, settings.locate, camera=settings.camera, fix=fix, free=free, progress=progress
        )
    with log.stage("track"):
        poses = track(scene.masks, scene, settings.track, progress=progress)
    log.notes += [*scene.advice, *video.notes, *_untracked(poses)]
    folder.write("poses.csv", lambda path: write_poses(poses, path))
    return scene, poses


def _untracked(poses: Poses) -> list[str]:
    """Say when a tenth of the frames or more was not measured."""
    seen, count = int(np.sum(poses.seen)), len(poses)
    if seen >= 0.9 * count:
        return []
    return [
        f"Only {seen} of {count} frames were tracked; a steadier background, another --segment.contrast "
        "or a better start (--fix) may help."
    ]


def _about(video: Video, mechanism: Mechanism) -> str:
    length = float(video.times[-1] - video.times[0])
    return (
        f"{video.count} frames of {video.width} × {video.height} px over {length:.2f} s, "
        f"with the model {mechanism.name}."
    )
