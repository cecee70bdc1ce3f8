"""The files that follow from a fit: ``fit.json``, tables, the identified mechanism and the report page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from monodyn.errors import VideoError
from monodyn.estimation.record.tables import write_poses
from monodyn.results.export import (
    Trace,
    fit_document,
    json_text,
    prediction_table,
    states_table,
    torque_table,
)
from monodyn.results.folder import RunFolder
from monodyn.results.overlay import Motion, write_overlay
from monodyn.results.page import Page, page_text
from monodyn.types import Camera, Poses, Progress

if TYPE_CHECKING:
    from monodyn.estimation.fit import Fit
    from monodyn.mechanism import Mechanism
    from monodyn.results.predict import Prediction
    from monodyn.vision.clip.video import Video


@dataclass(frozen=True, eq=False)
class View:
    """The clip a fit comes from and its camera, for drawing.

    Attributes:
        video: The clip.
        mechanism: The identified mechanism, or the located one where nothing was identified.
        camera: Camera in the mechanism's scale.
        tracked: Measured joint positions in the mechanism's scale.
        camera_std: Standard deviations of the estimated camera parameters by name.
    """

    video: Video
    mechanism: Mechanism
    camera: Camera
    tracked: Poses
    camera_std: Mapping[str, float] = field(default_factory=dict)


def report(
    fit: Fit,
    future: Prediction | None = None,
    *,
    to: str | Path,
    poses: Poses | None = None,
    scene: Any = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Write what a fit says into a folder: tables, the identified mechanism, the report page.

    Args:
        fit: The fit.
        future: Its prediction, from ``predict``.
        to: The folder; it may not hold a run yet.
        poses: The whole record to compare with, written as ``poses.csv``; the fitted frames alone when it
            is left out.
        scene: Where the mechanism is in the picture, from ``locate``; adds the overlay and the pictures.
        force: Replace a run that is already there.
        progress: Called with the number of frames drawn.

    Returns:
        The report page.

    Raises:
        SettingsError: the folder is a file, holds a run, or cannot be written.

    Example:
        >>> monodyn.report(fit, future, to="run/")  # doctest: +SKIP
    """
    if poses is not None:
        trace = trace_of(fit, poses, future)
    else:
        trace = fitted_trace(fit, future, None if scene is None else scene.masks.video)
    view = None if scene is None else view_of(fit, scene, trace.poses)
    folder = RunFolder(to, force=force)
    title = fit.mechanism.name if view is None else view.video.path.name
    if poses is not None:
        folder.write("poses.csv", lambda path: write_poses(trace.poses, path))
    write_results(folder, fit, [trace], Page(title, _subtitle(fit)), view=view, progress=progress)
    folder.finish()
    return folder.path / "report.html"


def write_results(
    folder: RunFolder,
    fit: Fit,
    traces: Sequence[Trace],
    page: Page,
    *,
    view: View | None = None,
    fit_frames: tuple[int, int] | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Write all files that follow from a fit, the ones that cost least first.

    Where nothing was identified the tables hold their header alone and the overlay what was tracked.

    Args:
        folder: Where to.
        fit: The fit.
        traces: The records beside their motion; none where nothing was identified.
        page: What the report says beside the fit.
        view: Clip and camera; None for encoder records.
        fit_frames: Frames that were fitted, for ``fit.json``; None takes them from the first record.
        progress: Called with the number of frames drawn.

    Returns:
        The content of ``fit.json``.

    Raises:
        SettingsError: a file cannot be written.
    """
    page = replace(page, notes=(*page.notes, *lost_in_urdf(fit.mechanism)))
    document = result_document(fit, traces, page.notes, view, fit_frames)
    folder.write_text("fit.json", json_text(document))
    write_models(folder, fit.mechanism)
    joints = [joint.name for joint in fit.mechanism.joints]
    folder.write_text("states.csv", states_table(joints, traces))
    folder.write_text("prediction.csv", prediction_table(joints, traces[0] if traces else None))
    if traces and traces[0].torques is not None:
        folder.write_text("torques.csv", torque_table(joints, traces[0]))
    if view is not None:
        pictures = _film(folder, fit, traces, view, document["fit_frames"], progress)
        page = replace(page, camera=view.camera, pictures=pictures)
    folder.write_text("report.html", page_text(fit, traces, page))
    return document


def result_document(
    fit: Fit,
    traces: Sequence[Trace],
    notes: Sequence[str] = (),
    view: View | None = None,
    fit_frames: tuple[int, int] | None = None,
) -> dict[str, Any]:
    """Return the content of ``fit.json`` with the notes after the fit's own advice.

    Args:
        fit: The fit.
        traces: The records beside their motion.
        notes: Sentences about clip, camera and tracking.
        view: Clip and camera; None for encoder records.
        fit_frames: Frames that were fitted; None takes them from the first record.
    """
    document = fit_document(
        fit,
        traces=traces,
        camera=None if view is None else view.camera,
        camera_std=None if view is None else view.camera_std,
    )
    document["advice"] += list(notes)
    if fit_frames is not None:
        document["fit_frames"] = list(fit_frames)
    return document


def write_models(folder: RunFolder, mechanism: Mechanism) -> None:
    """Write the identified mechanism as ``model.xml`` and ``model.urdf``.

    Args:
        folder: Where to.
        mechanism: The mechanism.
    """
    from monodyn.mechanism import write_mjcf, write_urdf

    folder.write("model.xml", lambda path: write_mjcf(mechanism, path))
    folder.write("model.urdf", lambda path: write_urdf(mechanism, path))


def lost_in_urdf(mechanism: Mechanism) -> list[str]:
    """Say which springs and rotor inertias ``model.urdf`` cannot hold; nothing where there are none.

    Args:
        mechanism: The mechanism that is written.
    """
    values = mechanism.values
    lost = [
        name
        for joint in mechanism.joints
        for name in (f"{joint.name}.stiffness", f"{joint.name}.armature")
        if values.get(name, 0.0) != 0.0
    ]
    if not lost:
        return []
    return [f"URDF has no place for {', '.join(lost)}: model.urdf moves without; simulate model.xml instead."]


def _film(
    folder: RunFolder,
    fit: Fit,
    traces: Sequence[Trace],
    view: View,
    frames: Sequence[int],
    progress: Progress | None,
) -> list[tuple[bytes, str]]:
    """Write ``overlay.mp4``; return pictures of its first, middle and last frame.

    A refused fit is not drawn: then the film shows the tracked poses alone.
    """
    from monodyn.results.fill import fill

    position = np.full((view.video.count, len(fit.mechanism.joints)), np.nan)
    if traces and fit.ok:
        position = fill(fit, view.video.times).position
    motion = Motion(view.mechanism, view.camera, position, (frames[0], frames[1]), view.tracked)
    pictures: list[tuple[bytes, str]] = []
    folder.write(
        "overlay.mp4",
        lambda path: pictures.extend(write_overlay(path, view.video, motion, progress=progress)),
    )
    return pictures


def trace_of(
    fit: Fit, poses: Poses, future: Prediction | None = None, *, name: str = "", record: int = 0
) -> Trace:
    """Put a record beside its motion under the identified dynamics.

    Args:
        fit: The fit.
        poses: The whole record; the fitted rows are found by their times.
        future: Its prediction.
        name: What to call the record.
        record: Number of the record within the fit.

    Returns:
        The trace, slides in metres of the identified scale.

    Raises:
        VideoError: the record is not the one that was fitted.
    """
    from monodyn.results.fill import fill
    from monodyn.results.torques import torques

    fitted = fit.time[record]
    first = int(np.searchsorted(poses.time, fitted[0] - 1e-9))
    stop = first + len(fitted)
    if stop > len(poses) or not np.allclose(poses.time[first:stop], fitted, rtol=0.0, atol=1e-9):
        raise VideoError(
            "poses: expected the record that was fitted, got other time stamps; pass the same record."
        )
    record_poses = metric(poses, fit.mechanism, fit.scale)
    numbers = None
    if future is not None:
        numbers = frame_numbers(future.time, poses.time, poses.frame)
    acting = torques(fit, poses.time) if fit.torque != "friction" else None
    states = fill(fit, poses.time, record=record)
    return Trace(name, record_poses, states, (first, stop), future, numbers, acting)


def fitted_trace(fit: Fit, future: Prediction | None = None, video: Video | None = None) -> Trace:
    """Put the fitted frames of the first record beside their motion, from the residual that the fit keeps.

    Args:
        fit: The fit.
        future: Its prediction.
        video: The clip the record is from, which knows its frame numbers; without it they are those of a
            clip that starts at 0 s where the stamps are those of one, else they count from 0.
    """
    from monodyn.results.fill import fill

    time, residual = fit.time[0], fit.residual[0]
    position = fill(fit, time).position + residual
    joints = tuple(joint.name for joint in fit.mechanism.joints)
    count, dofs = residual.shape
    seen = np.asarray(np.isfinite(residual).any(axis=1))
    numbers = counted(time) if video is None else frame_numbers(time, video.times, np.arange(video.count))
    poses = Poses(joints, numbers, time, position, np.zeros((count, dofs, dofs)), seen)
    return trace_of(fit, poses, future)


def counted(times: np.ndarray) -> np.ndarray:
    """Return the frame numbers of a record whose numbers are not known, int (frame,).

    Args:
        times: Time stamps [s]; where they are evenly spaced and 0 s is one of the places, frame 0 is there.
    """
    count = len(times)
    rows = np.arange(count)
    if count < 2:
        return rows
    places = times * ((count - 1) / (times[-1] - times[0]))
    first = int(np.round(places[0]))
    # stamps in whole milliseconds are off by 1 part in 20 of a frame at 100 Hz
    even = first >= 0 and np.abs(places - first - rows).max() < 0.1
    return rows + first if even else rows


def frame_numbers(times: np.ndarray, known: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Return frame numbers of time stamps: those of a record, counted on after its end.

    Args:
        times: Time stamps [s], (frame,).
        known: Time stamps of the record [s].
        numbers: Its frame numbers.
    """
    step = float(np.median(np.diff(known))) if len(known) > 1 else 1.0
    count = np.interp(times, known, numbers)
    beyond = np.maximum(times - known[-1], 0.0) / step
    return np.round(count + beyond).astype(np.int64)


def metric(poses: Poses, mechanism: Mechanism, scale: float) -> Poses:
    """Return a record with its slides in metres of the identified scale.

    Args:
        poses: The record.
        mechanism: The mechanism.
        scale: Metres per unit of the start scale.
    """
    if poses.metric:
        return poses
    factor = np.array([scale if joint.kind == "slide" else 1.0 for joint in mechanism.joints])
    return replace(
        poses,
        position=poses.position * factor,
        covariance=poses.covariance * np.outer(factor, factor),
        metric=True,
    )


def view_of(fit: Fit, scene: Any, poses: Poses) -> View:
    """Return clip, mechanism and camera of a scene in metres of the identified scale.

    Args:
        fit: The fit.
        scene: The scene, from ``locate``.
        poses: The tracked clip.
    """
    camera, scale = scene.camera, fit.scale
    camera = replace(camera, x=camera.x * scale, y=camera.y * scale, depth=camera.depth * scale)
    lengths = ("camera.x", "camera.y", "camera.depth")
    # beside free torques the common scale is held, so nothing tells how far away the camera is
    unit = np.inf if fit.torque == "free" else scale
    std = {name: value * (unit if name in lengths else 1.0) for name, value in scene.camera_std.items()}
    mechanism = fit.mechanism if fit.starts else scene.mechanism
    return View(scene.masks.video, mechanism, camera, metric(poses, mechanism, scale), std)


def _subtitle(fit: Fit) -> str:
    count = len(fit.mechanism.joints)
    return f"Mechanism {fit.mechanism.name} with {count} joint{'s' if count > 1 else ''}."
