"""What is left of a stream that has ended."""

from __future__ import annotations

from collections.abc import Sequence

from monodyn.job import Outcome
from monodyn.live.step import Step
from monodyn.live.stream import Session
from monodyn.results.findings import Findings, fit_document
from monodyn.results.folder import RunFolder


def ended(session: Session, last: Step, folder: RunFolder | None, notes: Sequence[str]) -> Outcome | None:
    """Return what a stream has shown, and write it.

    Args:
        session: The stream, which gives no more frames.
        last: What was known at its last frame.
        folder: Takes the files; None writes none.
        notes: What people should know, in sentences.

    Returns:
        What was found; None where nothing was identified.
    """
    fit, poses = last.fit, session.identifier.record.whole
    if fit is None or poses is None:
        return None
    found = () if session.found is None else session.found.notes
    findings = Findings(fit, notes=[*found, *session.source.remarks, *notes])
    path = None if folder is None else folder.path
    return Outcome(path, fit_document(findings), poses, fit, (), findings.notes)
