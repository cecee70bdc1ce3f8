"""The files that follow from a fit: ``fit.json``, tables, the identified mechanism and the report page."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from monodyn.cores import beside
from monodyn.estimation.record.tables import write_poses
from monodyn.mechanism.urdf import NOT_IN_URDF
from monodyn.results import export
from monodyn.results.diagnosis import jpeg, write_diagnosis
from monodyn.results.filmed import write_film
from monodyn.results.findings import Findings, fit_document
from monodyn.results.folder import RunFolder
from monodyn.results.gaps import unfollowed
from monodyn.results.heldout import excluded, excluded_note
from monodyn.results.intact import digest, sealed
from monodyn.results.models import write_models
from monodyn.results.next_steps import next_steps
from monodyn.results.page import REPORT, page_text, template
from monodyn.results.run_toml import RUN_TOML
from monodyn.results.torques import torque_course
from monodyn.types import Progress

if TYPE_CHECKING:
    from monodyn.mechanism import Mechanism

NOT_IN_MUJOCO = (".air", ".lead")
"""Ends of the names of parameters that ``model.xml`` has as numbers alone, which do not act."""


def write_results(
    folder: RunFolder, findings: Findings, *, progress: Progress | None = None
) -> dict[str, Any]:
    """Write all files that follow from a fit; the film, which takes longest, beside the others.

    Where nothing was identified the tables hold their header alone and the overlay what was tracked.

    Args:
        folder: Where to.
        findings: The fit, its records and what else is reported about it.
        progress: Called with the number of frames drawn.

    Returns:
        The content of ``fit.json``.
    """
    fit, traces, record = findings.fit, findings.traces, findings.record
    wrong = [excluded(fit, trace) for trace in traces]
    # before the documents are made, because fit.json and the page both carry the notes
    motions = findings.motions
    said = [*_excluded_notes(findings, wrong), *unfollowed(traces, motions), *lost_in_urdf(fit.mechanism)]
    findings = findings.noted(said)
    if record is not None:
        marks, shared = (wrong[0], traces[0].shared) if wrong else (None, None)
        folder.write("poses.csv", lambda path: write_poses(record, path, marks, shared))
    filmed = findings.filmed
    if filmed is not None and filmed.camera_path is not None:
        folder.write_text("camera.csv", export.camera_table(filmed.video.times, filmed.camera_path))
    if filmed is not None and filmed.sight is not None and findings.frames is not None:
        filmed.sight.fit_frames = (findings.frames[0], findings.frames[1])
    # what takes longest comes first, so that both threads end at about the same time
    parts: dict[str, Callable[[], Any]] = {
        "steps": partial(next_steps, findings),
        "document": partial(_write_documents, folder, findings),
        "diagnosis": partial(_write_diagnosis, folder, findings),
        # compiled here, where two work, and not below
        "template": partial(template, *REPORT),
    }
    waiting, made = deque(parts), {}

    def make_rest(go_on: Callable[[], None] = lambda: None) -> None:
        """Make the parts that nobody makes yet."""
        while True:
            go_on()
            try:
                name = waiting.popleft()
            except IndexError:
                return
            made[name] = parts[name]()

    def film(go_on: Callable[[], None]) -> bytes:
        drawn = _filmed(folder, findings, progress, go_on)
        # where there is none, or a short one, two threads make the rest
        make_rest(go_on)
        return drawn

    with beside(film) as drawn:
        make_rest()
        poster = drawn()
    # what is written after the page is in the folder, too, when it is read
    log = findings.log
    logs = [] if log is None else [*([RUN_TOML] if log.run_toml else []), "run.json"]
    shown = (folder.stage / "overlay.mp4", poster) if poster else None
    page = page_text(findings, shown, made["diagnosis"], [*folder.written, *logs], made["steps"])
    folder.write_text("report.html", page)
    return made["document"]


def _filmed(
    folder: RunFolder, findings: Findings, progress: Progress | None, go_on: Callable[[], None]
) -> bytes:
    """Write the film of a clip; return one of its pictures, nothing where there is no film."""
    filmed = findings.filmed
    if filmed is None or not (filmed.sight is None or filmed.sight.filmed):
        return b""

    def drawn(step: str, done: int, total: int | None) -> None:
        go_on()
        if progress is not None:
            progress(step, done, total)

    # without a motion to draw no frame is a fitted one
    frames, motion = findings.frames or (0, 0), next(iter(findings.motions), None)
    return write_film(folder, findings.fit, filmed, frames, drawn, motion)


def _write_documents(folder: RunFolder, findings: Findings) -> dict[str, Any]:
    """Write the models, what was identified and the tables; return the content of ``fit.json``."""
    fit, traces = findings.fit, findings.traces
    write_models(folder, findings)
    # so that a file that was changed by hand is told from the one that was written
    document = sealed({**fit_document(findings), "model_sha256": digest(folder.stage / "model.xml")})
    folder.write_text("fit.json", export.json_text(document))
    joints = [joint.name for joint in fit.mechanism.joints]
    moved = [replace(one, states=motion) for one, motion in zip(traces, findings.motions, strict=True)]
    folder.write_text("states.csv", export.states_table(joints, moved))
    folder.write_text("prediction.csv", export.prediction_table(joints, traces))
    if any(trace.torques is not None for trace in traces):
        courses = [torque_course(fit, trace.all_times, record=k) for k, trace in enumerate(traces)]
        folder.write_text("torques.csv", export.torque_table(joints, traces, courses))
    return document


def _excluded_notes(findings: Findings, wrong: Sequence[np.ndarray]) -> list[str]:
    """Return the notes on the poses that are excluded of each record, bool (frame, dof) each."""
    several, said = len(findings.traces) > 1, []
    for trace, found in zip(findings.traces, wrong, strict=True):
        name = trace.name if several else ""
        said += excluded_note(found, trace.poses, name, marked=findings.record is not None)
    return said


def _write_diagnosis(folder: RunFolder, findings: Findings) -> bytes | None:
    """Write the diagnosis; return it as a JPEG file for the report of a fit that is not to be trusted."""
    sight = None if findings.filmed is None else findings.filmed.sight
    if sight is None:
        return None
    page = write_diagnosis(folder, sight)
    return None if page is None or findings.fit.ok else jpeg(page)


def lost_in_urdf(mechanism: Mechanism) -> list[str]:
    """Return a note on what ``model.urdf`` cannot hold, or neither file so that it acts; none without it.

    Args:
        mechanism: The mechanism that is written.
    """
    lost = [row.name for row in mechanism.parameters if row.kind in NOT_IN_URDF and row.value != 0.0]
    if not lost:
        return []
    # numbers beside the model, on which MuJoCo does not act
    inert = [name for name in lost if name.endswith(NOT_IN_MUJOCO)]
    if not inert:
        instead = "simulate model.xml instead."
    else:
        instead = (
            f"nor does {', '.join(inert)} act in MuJoCo, where model.xml has it as a number alone: monodyn "
            "predict has the motion with all of them."
        )
    return [f"URDF has no place for {', '.join(lost)}, which model.urdf leaves out; {instead}"]
