"""The composition: a clip and a mechanism file in, a run folder out.

Everything that can be refused is refused before anything is written.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from monodyn import checks, inputs
from monodyn.blur import blurred, check_exposure, follow_exposed, unsettled
from monodyn.choices import AUTO
from monodyn.choose import ball_alone, candidates, choose, nearest
from monodyn.doubtful import doubtful_sight, likely_sight, unshown_parts
from monodyn.errors import VideoError
from monodyn.estimation.fit import Doubt, Fit, Grade
from monodyn.estimation.record.held import held_note
from monodyn.estimation.record.tables import read_poses
from monodyn.estimation.record.units import wrong_units
from monodyn.inputs import opened
from monodyn.job import Job, Outcome, Tracked, shown_if_refused
from monodyn.kept import kept_doubts
from monodyn.mechanism.dots import chosen_bodies, mass_notes, shows_dots
from monodyn.redrawn import redrawn
from monodyn.results.filmed import filmed_of
from monodyn.results.findings import NO_PICTURE, Findings, fit_document
from monodyn.results.folder import RunFolder
from monodyn.results.heldout import heldout_doubts, predicted_trace
from monodyn.results.log import RunLog, recorded
from monodyn.results.opened import judged_before, known_before, origins
from monodyn.results.report import write_results
from monodyn.results.sight import Sight
from monodyn.settings import RunSettings
from monodyn.settings_file import run_toml
from monodyn.stages import identify, locate, segment, track_freely
from monodyn.tabled import Tabled, best_fit, tabled
from monodyn.turns import with_right_turns
from monodyn.types import Poses, Progress
from monodyn.vision.clip.video import Video
from monodyn.vision.dots.find import find_dots
from monodyn.vision.foreground.given import given_masks
from monodyn.vision.foreground.mask_files import OpenedMasks
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.foreground.thumbnails import Window
from monodyn.vision.locating.scene import Scene
from monodyn.vision.points.scene import PointScene
from monodyn.vision.points.tracks import PointTracks

if TYPE_CHECKING:
    from monodyn.mechanism import Mechanism


def run(
    clip: str | Path | None,
    model: str | Path,
    out: str | Path,
    settings: RunSettings | None = None,
    *,
    force: bool = False,
    progress: Progress | None = None,
) -> Outcome:
    """Track a clip, identify on some of its frames, predict the others, write the run folder.

    Args:
        clip: Video file or folder of pictures; None where ``settings.points`` or ``masks`` take its place.
        model: Mechanism file (MJCF, URDF), a bundled name, or ``auto`` for the one that the evidence prefers.
        out: The run folder.
        settings: What to do.
        force: Replace a run that is already in ``out``.
        progress: Called with the frames done by each step.

    Returns:
        What was found; ``fit.status`` states whether the fit can be trusted.

    Example:
        >>> monodyn.run("clip.mp4", "double.xml", "run")  # doctest: +SKIP
    """
    settings = settings or RunSettings()
    models = candidates(settings) if str(model) == AUTO else {}
    video, given, mechanism = opened(clip, next(iter(models), model), settings)
    wanted = checks.fitted_range(settings.fit_frames, video.count)
    checks.prediction_times(video.times, wanted[1], settings.until)
    torques = inputs.clip_torques(settings, mechanism, video.times, wanted)
    files = inputs.input_files(clip, model, settings)
    written = run_toml("run", {"clip": clip, "model": model}, settings)
    log = RunLog("run", files, settings, written)
    folder = RunFolder(out, force=force, inputs=(*files.values(), *origins(model), settings.background))
    sight = Sight(video, fit_frames=wanted, tracks=given if isinstance(given, PointTracks) else None)
    job = Job(settings, log, folder, progress, sight, given if isinstance(given, OpenedMasks) else None)
    with recorded(folder, log), shown_if_refused(job):
        mechanism = _chosen(job, video, models) if models else mechanism
        found = locate_and_track(job, video, mechanism)
        found = found._replace(poses=replace(found.poses, torques=torques))
        return concluded(job, found, mechanism, model, folder)


def concluded(
    job: Job, tracked: Tracked, mechanism: Mechanism, model: str | Path, folder: RunFolder,
    verdict: Grade | None = None,
) -> Outcome:  # fmt: skip
    """Identify on some frames of a tracked clip, predict the others, write the run folder.

    Args:
        job: The run; its sight has the clip and the frames that are wanted for the fit.
        tracked: What was seen in the clip.
        mechanism: The mechanism with the user's choices.
        model: Where it was loaded from, or ``auto``.
        folder: Takes the files.
        verdict: The last one of a stream while it went on; None where there was none.

    Returns:
        What was found.
    """
    settings, log, sight = job.settings, job.log, job.sight
    assert sight is not None
    assert sight.fit_frames is not None
    (scene, poses, span), video = tracked, sight.video
    frames = checks.free_range(settings.fit_frames, sight.fit_frames, span)
    # the motion may have shown that the stamps are not the times
    stamps = video.timed(poses.frame, poses.time).times
    if settings.fit_frames is None:
        frames, said = inputs.frames_with_torques(poses.torques, stamps, frames)
        log.notes += said
    else:
        inputs.check_torques(poses.torques, stamps, frames)
    sight.fit_frames = frames
    times = checks.prediction_times(stamps, frames[1], settings.until)
    # the fit must not see the frames that it will be compared with
    first, stop = np.searchsorted(poses.frame, frames).tolist()
    checks.check_tracked(poses[first:stop], video, log.notes)
    with log.stage("identify"):
        fit, poses = _identified(job, sight, scene, poses, (first, stop), mechanism)
    with log.stage("predict"):
        traces = predicted_trace(fit, poses, times, video.path.name)
        fit = fit.doubted(heldout_doubts(fit, traces))
        fit = redrawn(fit, scene, poses)
    log.notes += [
        *checks.after_refusal(fit, sight, compared=bool(log.comparison)),
        *nearest(fit, log.comparison),
        *known_before(model, fit),
        *judged_before(verdict, fit, frames),
    ]
    # only the fit has the metric scale: the poses are written again with their slides in metres
    filmed = filmed_of(fit, scene, poses, sight)
    findings = Findings(
        fit, traces, sight.name, _about(video, mechanism), log.notes,
        record=filmed.tracked, filmed=filmed, fit_frames=frames, log=log,
        tolerance=settings.tolerance, drawn=settings.ensemble,
    )  # fmt: skip
    with log.stage("results"):
        document = write_results(folder, findings, progress=job.progress)
    return job.outcome(document, filmed.tracked, findings)


def _identified(
    job: Job,
    sight: Sight,
    scene: Scene | PointScene,
    poses: Poses,
    rows: tuple[int, int],
    mechanism: Mechanism,
) -> tuple[Fit, Poses]:
    """Identify from some rows of a tracked clip; return the fit with what speaks against it but for the rows
    after these, and the poses with the turns that the dynamics make out."""
    settings, log, progress = job.settings.identify, job.log, job.progress
    bodies = chosen_bodies(mechanism, settings.bodies)
    why = doubtful_sight(sight, poses[slice(*rows)], uniform=bodies == "uniform")
    if why:
        # no number of starts finds the mechanism in poses that are not its own
        settings = replace(settings, starts=1, uncertainty="linear")
    poses, unsure = with_right_turns(poses, rows, scene.mechanism, settings, progress)
    fit = identify(poses[slice(*rows)], scene.mechanism, settings, progress=progress)
    why = why or (None if fit.ok else likely_sight(sight))
    uniform = not any(p.kind == "inertia" and p.free for p in fit.mechanism.parameters)
    log.notes += [*mass_notes(mechanism, "uniform" if uniform else "free"), *unsure]
    if why:
        # a motion may be followed in the wrong place: then no advice on the model helps
        return replace(fit, doubts=(), advice=()).doubted([Doubt("refused", why)]), poses
    if not fit.ok:
        return fit, poses
    unsaid = [sight.unsettled, sight.scene and unshown_parts(mechanism, sight.scene.mechanism)]
    kept = kept_doubts(fit, [poses], scene.mechanism, settings, progress)
    return fit.doubted([*(Doubt("approximate", said) for said in unsaid if said), *kept]), poses


def track_clip(
    clip: str | Path | None,
    model: str | Path,
    out: str | Path,
    settings: RunSettings | None = None,
    *,
    force: bool = False,
    progress: Progress | None = None,
) -> Outcome:
    """Track a clip; write ``poses.csv``, the overlay and the diagnosis.

    Slides are in the start scale of the model.

    Args:
        clip: Video file or folder of pictures; None where ``settings.points`` or ``masks`` take its place.
        model: Mechanism file (MJCF, URDF), a bundled name, or ``auto`` for the one that the evidence prefers.
        out: The run folder.
        settings: What to do.
        force: Replace a run that is already in ``out``.
        progress: Called with the frames done by each step.

    Returns:
        The tracked clip.
    """
    settings = settings or RunSettings()
    models = candidates(settings) if str(model) == AUTO else {}
    video, given, mechanism = opened(clip, next(iter(models), model), settings)
    files = inputs.input_files(clip, model, settings)
    written = run_toml("track", {"clip": clip, "model": model}, settings)
    log = RunLog("track", files, settings, written)
    folder = RunFolder(out, force=force, inputs=(*files.values(), *origins(model), settings.background))
    sight = Sight(video, tracks=given if isinstance(given, PointTracks) else None)
    job = Job(settings, log, folder, progress, sight, given if isinstance(given, OpenedMasks) else None)
    with recorded(folder, log), shown_if_refused(job):
        # a table without a pose is written all the same: it shows in which frames the search ended
        mechanism = _chosen(job, video, models) if models else mechanism
        _, poses, _ = locate_and_track(job, video, mechanism)
        log.notes += [sight.unsettled] if sight.unsettled else []
        share = f"{checks.tracked_share(poses, f'{len(poses)} frames')}."
        with log.stage("results"):
            job.show_sight(" ".join([share, *log.notes]), None if np.any(poses.seen) else "refused")
    checks.check_tracked(poses, video, log.notes)
    return job.outcome(log.document("done", folder.written), poses)


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
        model: Mechanism file (MJCF, URDF), a bundled name, or ``auto`` for the one that the evidence prefers.
        out: Folder for the results; None writes nothing.
        settings: What to do; those of the clip do not matter.
        force: Replace a run that is already in ``out``.
        progress: Called with the steps done.

    Returns:
        What was found; ``fit.status`` states whether the fit can be trusted.

    Raises:
        VideoError: the tables are in other units than radians and seconds.
    """
    settings = settings or RunSettings()
    names = [Path(table).name for table in tables]
    # all tables are read before the folder is made
    if str(model) == AUTO:
        tried = tabled(tables, settings)
    else:
        mechanism = checks.chosen_mechanism(model, settings, camera=False)
        tried = [Tabled(str(model), mechanism, [read_poses(table, mechanism) for table in tables])]
    wrong = [wrong_units(one.records, one.mechanism) for one in tried]
    if all(wrong):
        raise VideoError(f"{', '.join(names[:3])}: {wrong[0]}")
    tried = [replace(one, records=inputs.with_torques(one.records, one.mechanism, settings)) for one in tried]
    rows = [checks.fitted_part(record, settings.fit_frames, name)
            for record, name in zip(tried[0].records, names, strict=True)]  # fmt: skip
    times = [checks.prediction_times(record.time, stop, settings.until)
             for record, (_, stop) in zip(tried[0].records, rows, strict=True)]  # fmt: skip
    tried = [replace(one, rows=rows) for one in tried]
    measured = {f"poses {i + 1}": table for i, table in enumerate(tables)}
    files = {"model": model, **measured, **inputs.torque_files(settings)}
    written = run_toml("identify", {"poses": tables, "model": model}, settings)
    log = RunLog("identify", files, settings, written)
    spared = (*files.values(), *origins(model))
    folder = None if out is None else RunFolder(out, force=force, inputs=spared)
    job = Job(settings, log, folder, progress)
    with recorded(folder, log):
        with log.stage("identify"):
            right = [one for one, found in zip(tried, wrong, strict=True) if not found]
            best, fit, comparison = best_fit(right, settings, progress)
        if str(model) == AUTO:
            log.chose(comparison)
            log.notes += nearest(fit, comparison)
        log.notes += known_before(model, fit)
        records, mechanism, traces = best.records, best.mechanism, []
        for record, name in zip(records, names, strict=True):
            log.notes += held_note(record, name)
        log.notes.append(NO_PICTURE)
        if fit.starts:
            for i, record in enumerate(records):
                traces += predicted_trace(fit, record, times[i], names[i], record=i)
        fit = fit.doubted(heldout_doubts(fit, traces))
        about = f"Joint positions with the model {mechanism.name}."
        findings = Findings(
            fit, traces, ", ".join(names), about, log.notes,
            log=log, tolerance=settings.tolerance, drawn=settings.ensemble,
        )  # fmt: skip
        document = fit_document(findings) if folder is None else write_results(folder, findings)
    return job.outcome(document, records[0], findings)


def _chosen(job: Job, video: Video, models: dict[str, Mechanism]) -> Mechanism:
    """Return the bundled mechanism that the clip shows, and note the comparison."""
    sight = job.sight or Sight(video)
    masks = _segmented(job, sight, next(iter(models.values())))
    with job.log.stage("choose"):
        mechanism, comparison = choose(job, masks, models)
    job.log.chose(comparison)
    return mechanism


def locate_and_track(job: Job, video: Video, mechanism: Mechanism) -> Tracked:
    """Go from the clip, or from tracked points, to poses, and write them.

    Args:
        job: The run; its log takes the notes on clip, camera and tracking.
        video: The clip.
        mechanism: The mechanism with the user's choices.

    Returns:
        What was seen in the clip.
    """
    sight = job.sight or Sight(video)
    if sight.tracks is not None:
        return _locate_and_track_points(job, sight, sight.tracks, mechanism)
    settings, log, progress = job.settings, job.log, job.progress
    fix, free = checks.camera_choices(settings)
    masks = _segmented(job, sight, mechanism) if sight.masks is None else sight.masks
    if shows_dots(mechanism):
        with log.stage("dots"):
            sight.tracks = find_dots(
                masks, mechanism, focal=settings.locate.focal, fix=fix, progress=progress
            )
        return _locate_and_track_points(job, sight, sight.tracks, mechanism)
    with log.stage("locate"):
        scene = locate(
            masks, mechanism, settings.locate, camera=settings.camera, fix=fix, free=free, progress=progress
        )
    sight.scene = scene
    with log.stage("track"):
        # the scene's masks, not the first ones: their colours were measured on the located mechanism
        found = scene, *track_freely(scene.masks, scene, settings.track, progress=progress)
        exposed = follow_exposed(found, mechanism, settings, progress)
    scene, poses, span, _ = exposed
    sight.scene, sight.unsettled = scene, unsettled(exposed)
    sight.poses, sight.free_frames = poses, span[:2]
    moving = poses[slice(*np.searchsorted(poses.frame, span[:2]))]
    repeats = int(np.sum(np.isin(scene.masks.video.repeats.frames, moving.frame)))
    others = checks.left_out(scene.masks.background, given=settings.segment.roi is not None)
    notes = _clip_notes(video, None if job.masks is None else scene.masks.video)
    notes = [*notes, *blurred(exposed, settings.camera), *span.notes, *checks.untracked(moving, repeats)]
    instead = [] if log.comparison else ball_alone(job, masks, mechanism, moving)
    log.notes += [*instead, *scene.advice, *others, *notes]
    log.free_frames, by = span[:2], video.shrink
    # in pixels of the file, as --roi takes it
    log.region = Window(*(by * side for side in scene.masks.background.window))
    job.write_poses(poses, scene.mechanism)
    return Tracked(scene, poses, span)


def _segmented(job: Job, sight: Sight, mechanism: Mechanism) -> Masks:
    """Return the foreground of the clip, and show it to the sight."""
    settings = job.settings
    with job.log.stage("segment"):
        if job.masks is None:
            masks = segment(
                sight.video, settings.segment, background=settings.background, progress=job.progress
            )
            # before a moving camera the clip goes on as one that stands still
            sight.video = masks.video
            job.write_camera(masks.video, masks.video.camera_path)
            check_exposure(masks.video, settings.camera)
        else:
            masks = given_masks(job.masks, mechanism, settings.segment, job.progress)
    sight.masks = masks
    return masks


def _locate_and_track_points(job: Job, sight: Sight, tracks: PointTracks, mechanism: Mechanism) -> Tracked:
    """Go from tracked points to poses, and write them."""
    settings, log, progress = job.settings, job.log, job.progress
    fix, free = checks.camera_choices(settings)
    with log.stage("locate"):
        scene = locate(
            tracks, mechanism, settings.locate, camera=settings.camera, fix=fix, free=free,
            mapped=settings.points_map, progress=progress,
        )  # fmt: skip
    sight.points = scene
    job.write_camera(sight.video, scene.camera_path(sight.video.count))
    with log.stage("track"):
        poses, span = track_freely(tracks, scene, settings.track, span=settings.time_range, progress=progress)
    sight.poses, sight.free_frames = poses, span[:2]
    moving = poses[slice(*np.searchsorted(poses.frame, span[:2]))]
    notes = _clip_notes(sight.video, tracks.clip)
    log.notes += [*tracks.notes, *scene.advice, *notes, *span.notes, *checks.unshown(moving)]
    log.free_frames = span[:2]
    job.write_poses(poses, scene.mechanism)
    return Tracked(scene, poses, span)


def _clip_notes(video: Video, masks: Video | None) -> list[str]:
    """Return the notes of a clip and of the masks of it, a clip of their own, each once."""
    return list(dict.fromkeys([*video.notes, *(() if masks is None else masks.notes)]))


def _about(video: Video, mechanism: Mechanism) -> str:
    length = float(video.times[-1] - video.times[0])
    return (
        f"{video.count} frames of {video.width} × {video.height} px over {length:.2f} s, "
        f"with the model {mechanism.name}."
    )
