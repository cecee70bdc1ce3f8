"""A fit of a program of one's own in, the run folder that the command line would have written of it out.

Every record is set next to its motion, and the frames that the fit did not see judge it, as they do there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from monodyn.doubtful import unmeasured_joints
from monodyn.errors import SettingsError
from monodyn.estimation.fit import PAYS, Doubt, Fit
from monodyn.kept import kept_doubts
from monodyn.markup import counted
from monodyn.mechanism.tree import BRAKES
from monodyn.redrawn import redrawn
from monodyn.results.filmed import filmed_of
from monodyn.results.findings import NO_PICTURE, Findings
from monodyn.results.folder import RunFolder
from monodyn.results.heldout import heldout_doubts
from monodyn.results.log import RunLog, recorded
from monodyn.results.predict import Prediction, predict
from monodyn.results.report import write_results
from monodyn.results.trace import Trace, fitted_poses, fitted_rows, trace_of
from monodyn.settings import RunSettings
from monodyn.types import Poses, Progress
from monodyn.vision.clip.video import Video
from monodyn.vision.locating.scene import Scene
from monodyn.vision.points.scene import PointScene


def report(
    fit: Fit,
    future: Prediction | Sequence[Prediction | None] | None = None,
    *,
    to: str | Path,
    poses: Poses | Sequence[Poses] | None = None,
    scene: Scene | PointScene | None = None,
    settings: RunSettings | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Write the results of a fit into a folder: tables, the identified mechanism, the report page.

    The grade in the files contains what the frames after the fitted ones say, or, where hardly any are left,
    the last fifth, predicted by a fit to the rest: one more identification. There is no ``run.toml`` in the
    folder: no command makes the fit of a program again.

    Args:
        fit: The fit.
        future: Its prediction, from ``predict``, or one for each record; where it is left out the rows of
            ``poses`` after the fitted ones are predicted.
        to: The folder; it may not hold a run yet.
        poses: The whole record to compare with, written as ``poses.csv`` where it is one, or one for each
            that was fitted, in their order; the fitted frames alone when it is left out.
        scene: Where the mechanism is in the picture, from ``locate``; adds the overlay and the pictures.
        settings: ``tolerance`` of the prediction, number of models of the ``ensemble``, and in ``identify``
            how the fit was made; those of other stages do not matter.
        force: Replace a run that is already there.
        progress: Called with the number of frames drawn.

    Returns:
        The report page.

    Raises:
        SettingsError: The number of records, or of predictions, is not that of the fit, or the fit was read
            back; from deeper down: the folder holds a run.
        VideoError: From ``fitted_rows``: a record is not the one that was fitted.

    Example:
        >>> monodyn.report(fit, future, to="run/")  # doctest: +SKIP
    """
    settings = settings or RunSettings()
    video, count = None if scene is None else scene.video, len(fit.starts)
    whole = [] if poses is None else [poses] if isinstance(poses, Poses) else list(poses)
    if count and not fit.residual:
        raise SettingsError(
            "report: expected a fit with its residuals, got one that was read back from a run folder, which "
            "does not keep them; copy that folder, or identify the record again."
        )
    if whole and count:
        _check_count("poses", "record", len(whole), count)
    log = _log(fit, video, settings)
    folder = RunFolder(to, force=force, inputs=[source["name"] for source in log.inputs.values()])
    with recorded(folder, log):
        # where nothing was identified there is no motion to set a record next to
        records = (whole or [fitted_poses(fit, video, record=k) for k in range(count)])[:count]
        traces = [
            trace_of(fit, record, ahead, name=f"record {k}" if count > 1 else "", record=k)
            for k, (record, ahead) in enumerate(zip(records, _futures(fit, future, records), strict=True))
        ]
        fit = _judged(fit, whole, traces, settings, progress)
        if scene is not None and records:
            fit = redrawn(fit, scene, records[0])
        shown = [trace.poses for trace in traces] or whole
        findings = Findings(
            fit,
            traces,
            title=fit.mechanism.name if video is None else video.path.name,
            subtitle=f"Mechanism {fit.mechanism.name} with {counted(len(fit.mechanism.joints), 'joint')}.",
            notes=[NO_PICTURE] if scene is None else [],
            record=shown[0] if len(whole) == 1 else None,
            log=log,
            filmed=None if scene is None or not shown else filmed_of(fit, scene, shown[0]),
            tolerance=settings.tolerance,
            drawn=settings.ensemble,
        )
        write_results(folder, findings, progress=progress)
    return folder.path / "report.html"


def _check_count(where: str, what: str, got: int, count: int) -> None:
    """Refuse another number of records, or of predictions, than that of the fit."""
    if got != count:
        raise SettingsError(
            f"{where}: expected one {what} for each of the {count} that were fitted, got {got}; pass them in "
            "the order of the records."
        )


def _futures(
    fit: Fit, future: Prediction | Sequence[Prediction | None] | None, records: Sequence[Poses]
) -> list[Prediction | None]:
    """Return the prediction of each record: the given one, or of the rows after its fitted ones."""
    if isinstance(future, Sequence):
        _check_count("future", "prediction", len(future), len(records))
        given = list(future)
    else:
        given = [future, *[None] * len(records)][: len(records)]
    found = []
    for k, (one, record) in enumerate(zip(given, records, strict=True)):
        after = record.time[fitted_rows(fit, record, k)[1] :]
        found.append(predict(fit, times=after, record=k) if one is None and len(after) else one)
    return found


def _judged(
    fit: Fit,
    whole: Sequence[Poses],
    traces: Sequence[Trace],
    settings: RunSettings,
    progress: Progress | None,
) -> Fit:
    """Return the fit with what the rows that it did not see say against it, but for what has been said."""
    if not (fit.ok and traces):
        return fit
    doubts = []
    if whole:
        hardly = unmeasured_joints([trace.poses[slice(*trace.rows)] for trace in traces])
        doubts += [Doubt("approximate", hardly)] if hardly else []
        # the torques of the whole record are not those of its beginning
        mechanism = fit.mechanism if fit.torque == "known" else fit.mechanism.with_torque("friction")
        doubts += kept_doubts(fit, whole, mechanism, settings.identify, progress)
    doubts += heldout_doubts(fit, traces)
    return fit.doubted([doubt for doubt in doubts if doubt not in fit.doubts])


def _log(fit: Fit, video: Video | None, settings: RunSettings) -> RunLog:
    """Return what a later command needs to know: the file of the mechanism, the clip, what was chosen."""
    mechanism = fit.mechanism
    inputs = {"model": mechanism.source} | ({} if video is None else {"clip": video.path})
    chosen = [p for p in mechanism.parameters if p.name in mechanism.chosen]
    # free torques contain the friction, and what pays is freed by what the record shows
    held = BRAKES if fit.torque == "free" else ()
    fix = {p.name: p.value for p in chosen if not p.free and not (p.kind in held and p.value == 0.0)}
    free = [p.name for p in chosen if p.free and p.kind not in PAYS]
    settings = replace(
        settings,
        fix={**fix, **settings.fix},
        free=tuple(dict.fromkeys((*settings.free, *free))),
    )
    log = RunLog("report", inputs, settings)
    log.seconds["identify"] = fit.seconds
    return log
