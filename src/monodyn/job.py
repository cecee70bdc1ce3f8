"""One run while it goes on, and what comes of it: where files, notes and pictures go."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from monodyn.errors import FitError, MonodynError, VideoError
from monodyn.estimation.fit import Fit, Grade
from monodyn.estimation.record.tables import write_poses
from monodyn.mechanism import Mechanism
from monodyn.results.diagnosis import write_diagnosis
from monodyn.results.export import camera_table
from monodyn.results.filmed import write_sight_film
from monodyn.results.findings import Findings
from monodyn.results.folder import RunFolder
from monodyn.results.log import RunLog
from monodyn.results.sight import Sight
from monodyn.results.trace import Trace, shared_errors
from monodyn.settings import RunSettings
from monodyn.types import Poses, Progress
from monodyn.vision.clip.steady import CameraPath
from monodyn.vision.clip.video import Video
from monodyn.vision.foreground.mask_files import OpenedMasks
from monodyn.vision.locating.scene import Scene
from monodyn.vision.points.scene import PointScene
from monodyn.vision.release import FreeSpan


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a run found.

    Attributes:
        folder: The run folder, or None when nothing was written.
        document: The content of ``fit.json``, or of ``run.json`` where nothing was fitted.
        poses: The tracked clip, or the first record.
        fit: The fit, or None where nothing was fitted.
        traces: The records next to their motion.
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


class Tracked(NamedTuple):
    """What was seen in a clip.

    Attributes:
        scene: Mechanism and camera.
        poses: The poses of the whole clip.
        span: The frames in which the mechanism moves freely.
    """

    scene: Scene | PointScene
    poses: Poses
    span: FreeSpan


@dataclass(frozen=True, eq=False)
class Job:
    """One run while it goes on.

    Attributes:
        settings: What to do.
        log: Takes the seconds of each stage and the notes.
        folder: Takes the files; None writes none.
        progress: Called with the frames done by each step.
        sight: What has been seen of the clip so far; None where there is no clip.
        masks: Masks that another tool made, in place of a segmentation, or None.
    """

    settings: RunSettings
    log: RunLog
    folder: RunFolder | None
    progress: Progress | None
    sight: Sight | None = None
    masks: OpenedMasks | None = None

    def write_poses(self, poses: Poses, mechanism: Mechanism) -> None:
        """Write ``poses.csv`` as soon as there are poses, so that an interrupted run has them.

        Args:
            poses: The tracked clip.
            mechanism: The mechanism as it was located.
        """
        if self.folder is not None:
            shared = shared_errors(poses, mechanism)
            self.folder.write("poses.csv", lambda path: write_poses(poses, path, shared=shared))

    def write_camera(self, video: Video, path: CameraPath | None) -> None:
        """Write ``camera.csv`` where the camera moves.

        Args:
            video: The clip.
            path: The way of the camera, or None.
        """
        if self.folder is not None and path is not None:
            self.folder.write_text("camera.csv", camera_table(video.times, path))

    def show_sight(self, status: str, grade: Grade | None) -> None:
        """Write ``diagnosis.png`` and ``overlay.mp4`` of a run that has no fit.

        Args:
            status: What came of it, a sentence.
            grade: How far that can be relied on; None where nothing was to be identified.
        """
        if self.folder is None or self.sight is None:
            return
        self.sight.status, self.sight.grade = status, grade
        # a clip without pictures leaves nothing
        if write_diagnosis(self.folder, self.sight) is not None:
            write_sight_film(self.folder, self.sight, self.progress)

    def outcome(self, document: dict[str, Any], poses: Poses, findings: Findings | None = None) -> Outcome:
        """Return what the run found.

        Args:
            document: The content of ``fit.json``, or of ``run.json`` where nothing was fitted.
            poses: The tracked clip, or the first record.
            findings: The fit and its records, or None where nothing was fitted.
        """
        path = None if self.folder is None else self.folder.path
        fit, traces = (None, ()) if findings is None else (findings.fit, findings.traces)
        return Outcome(path, document, poses, fit, traces, self.log.notes, self.log.seconds)


@contextmanager
def shown_if_refused(job: Job) -> Iterator[None]:
    """Leave the pictures of what was seen where the block refuses the clip.

    Args:
        job: The run.
    """
    try:
        yield
    except (VideoError, FitError) as error:
        # what cannot be written must not hide why the run was refused
        with job.log.stage("results"), suppress(MonodynError):
            job.show_sight(str(error), "refused")
        raise
