"""A stream from its first frame to the run folder that it leaves: ``monodyn live``."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from monodyn.checks import drawn_mechanism
from monodyn.errors import FitError
from monodyn.inputs import input_files
from monodyn.job import Job, Outcome, Tracked
from monodyn.live.begin import on_clip
from monodyn.live.identifier import Why
from monodyn.live.missed import cut_with_all, followed_later
from monodyn.live.recorder import Recorder
from monodyn.live.settings import LiveSettings
from monodyn.live.sources import Pictures, open_source
from monodyn.live.step import Step
from monodyn.live.stream import Session
from monodyn.mechanism.turning import unwound
from monodyn.pipeline import concluded
from monodyn.results.folder import RECORDING, RunFolder
from monodyn.results.log import RunLog, recorded
from monodyn.results.opened import origins
from monodyn.results.sight import Sight
from monodyn.settings import RunSettings
from monodyn.settings_file import run_toml
from monodyn.types import Poses, Progress
from monodyn.vision.clip.video import Video, read
from monodyn.vision.release import FreeSpan

CLIP = "clip.mp4"
"""What a stream is recorded as in the end."""
BEFORE: dict[Why, str] = {
    "another motion": "what came before is another motion.",
    "stamps": "the time stamps jump there, and no motion goes on across that.",
    "unseen": "the mechanism was out of sight before.",
    "searching": "those before were not followed, as the search for the mechanism took so long.",
    "too fast": "those before were not followed, as they came faster than that.",
}
"""Why earlier frames are not fitted, by why the motion is cut."""


def follow(
    source: int | str | Path | Pictures,
    model: str | Path,
    out: str | Path | None = None,
    live: LiveSettings | None = None,
    settings: RunSettings | None = None,
    *,
    shown: Callable[[Session, Step], None] | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Outcome | None:
    """Follow a stream until it ends, then write the run folder.

    A source that is no file is recorded, as ``clip.mp4`` of the run folder.

    Args:
        source: As for ``stream``.
        model: Mechanism file or bundled name.
        out: The run folder; None writes nothing.
        live: How the stream is read and followed.
        settings: How each stage goes.
        shown: Called with each step; may end the stream with ``Session.stop``.
        force: Replace a run that is already in ``out``.
        progress: Called with the steps done once the stream has ended.

    Returns:
        What was found; None where nothing was to be written.

    Raises:
        FitError: the stream ended before the mechanism was found.
    """
    live, settings = live or LiveSettings(), settings or RunSettings()
    mechanism = drawn_mechanism(model, settings)
    opened = open_source(source, live, rate=settings.rate, whole=settings.in_pixels)
    clip = None if opened.video is None else opened.video.path
    if out is None:
        with Session(opened, mechanism, live, settings) as session:
            _go(session, shown, None)
        return None
    inputs = input_files(clip, model, settings)
    # pictures of a program are no source of a command
    written = ""
    if isinstance(source, (int, str, Path)):
        written = run_toml("live", {"source": source, "model": model}, settings, live)
    log = RunLog("live", inputs, settings, written)
    folder = RunFolder(out, force=force, inputs=(*inputs.values(), *origins(model), settings.background))
    with recorded(folder, log):
        with log.stage("live"), Session(opened, mechanism, live, settings) as session:
            video = _watched(session, shown, folder)
        log.notes += [*opened.remarks, *session.notes]
        found = session.found
        if found is None:
            raise FitError(
                f"{opened.name}: the mechanism was not found before the stream ended: {session.said}"
            )
        log.notes += found.notes
        scene = on_clip(found.scene, video)
        poses, span = _tracked(session, video, live, settings, progress)
        log.notes += span.notes
        sight = Sight(video, masks=scene.masks, scene=scene, poses=poses, fit_frames=span[:2])
        sight.free_frames = log.free_frames = span[:2]
        job = Job(settings, log, folder, progress, sight)
        job.write_poses(poses, scene.mechanism)
        verdict = None if session.last is None else session.last.verdict
        return concluded(job, Tracked(scene, poses, span), mechanism, model, folder, verdict)


def _go(session: Session, shown: Callable[[Session, Step], None] | None, recorder: Recorder | None) -> None:
    """Go through the steps of a stream."""
    for step in session.steps():
        if recorder is not None:
            recorder.take(step.frame)
        if shown is not None:
            shown(session, step)


def _watched(session: Session, shown: Callable[[Session, Step], None] | None, folder: RunFolder) -> Video:
    """Follow a stream to its end; return its clip, recorded where it is none itself."""
    if session.source.video is not None:
        _go(session, shown, None)
        return session.source.video
    recording = folder.stage / RECORDING
    recorder = Recorder(recording)
    try:
        _go(session, shown, recorder)
    finally:
        # what was recorded is worth as much as what was found
        recorder.finish()
        if recorder.numbers:
            folder.write(CLIP, lambda part: os.replace(recording, part))
        recording.unlink(missing_ok=True)
    if recorder.left_out:
        session.notes.append(
            f"{recorder.left_out} frames came faster than they could be recorded; {CLIP} is without them."
        )
    session.recorded = recorder.numbers
    return read(folder.stage / CLIP)


def _tracked(
    session: Session, video: Video, live: LiveSettings, settings: RunSettings, progress: Progress | None
) -> tuple[Poses, FreeSpan]:
    """Return the poses of a stream by the frames of its clip, and the last stretch in which the mechanism
    moved freely."""
    found, record, cut = session.found, session.identifier.record.whole, session.identifier.cut
    assert found is not None
    assert record is not None
    if session.source.video is not None and session.last is not None:
        followed = record
        record = followed_later(found, record, video, session.last.index + 1, settings, progress)
        cut = cut_with_all(found, followed, record, cut, live, settings)
    numbers = record.frame if session.recorded is None else _numbered(record.frame, session.recorded)
    kept = numbers >= 0
    rows, count, dofs = numbers[kept], video.count, len(record.joints)
    position, covariance = np.full((count, dofs), np.nan), np.full((count, dofs, dofs), np.nan)
    joints, times = np.zeros((count, dofs), dtype=bool), video.times.copy()
    position[rows], covariance[rows] = record.position[kept], record.covariance[kept]
    joints[rows], times[rows] = record.measured[kept], record.time[kept]
    poses = Poses(
        record.joints, np.arange(count), times, position, covariance, np.asarray(joints.all(axis=1)),
        metric=False, joint_seen=joints, roll=record.roll,
    )  # fmt: skip
    poses = unwound(poses, np.array([joint.turns for joint in found.scene.mechanism.joints]))
    if found.scene.doubt is not None:
        poses = found.scene.doubt.with_shifts(poses, found.scene.mechanism.slides)
    seen = rows[record.time[kept] >= cut.time]
    first, last = (int(seen[0]), int(seen[-1])) if len(seen) else (int(rows[0]), int(rows[-1]))
    notes = []
    if first > int(rows[0]) and cut.why:
        notes.append(f"Fitted are the frames from {first} on: {BEFORE[cut.why]}")
    return poses, FreeSpan(first, last + 1, tuple(notes))


def _numbered(frames: np.ndarray, numbers: Mapping[int, int]) -> np.ndarray:
    """Return the numbers of frames of a stream in its recording, -1 for what is not in it, int (frame,)."""
    return np.array([numbers.get(frame, -1) for frame in frames.tolist()], dtype=int)
