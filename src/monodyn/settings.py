"""What a run does: the settings of every stage in one place, so that the command line needs nothing else.

A setting is written once, as a field of a stage's settings or of `RunSettings`: its help text is the field's
line under ``Attributes``, and the command line, ``run.json`` and the report take it from here. Nothing here
imports more than settings.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any, get_args

from monodyn.choices import METHOD_NAMES, MOST_DRAWN, Method, Tolerance, check_choice, check_whole
from monodyn.errors import SettingsError
from monodyn.estimation.settings import IdentifySettings, Uncertainty, check_known
from monodyn.typed import check_fields
from monodyn.vision.settings import (
    LEAST_SIDE,
    MOST_SIDE,
    RATES,
    Axis,
    CameraSettings,
    LocateSettings,
    SegmentSettings,
    TrackSettings,
)

STAGES: dict[str, type] = {
    "segment": SegmentSettings,
    "camera": CameraSettings,
    "locate": LocateSettings,
    "track": TrackSettings,
    "identify": IdentifySettings,
}
"""The settings class of each stage without those of the published method."""

COEFFICIENTS = (4, 5)
"""How many numbers say how a lens bends the picture."""
SHARED = ("seed", "roi", "time_range", "uncertainty")
"""Settings of a stage that always take the value of the whole run."""

_OF_CLIP = (
    "roi", "time_range", "background", "masks", "points", "points_map", "points_size", "points_axis",
    "distortion", "rate", "whole", "segment", "camera", "locate", "track",
)  # fmt: skip
UNUSED: dict[str, tuple[str, ...]] = {
    "run": (),
    "live": (
        "fit_frames", "time_range", "until", "tolerance", "masks", "points", "points_map", "points_size",
        "points_axis", "distortion", "torques", "ensemble", "uncertainty", "method",
    ),
    "track": (
        "fit_frames", "until", "tolerance", "ensemble", "bounds", "torques", "uncertainty", "identify",
    ),
    "identify": _OF_CLIP,
}  # fmt: skip
"""Settings that a command has no use for, by command."""


@contextmanager
def published_method() -> Iterator[None]:
    """Import the published method inside; where it is not installed, raise an error of one sentence.

    Raises:
        SettingsError: the published method is not installed, or scipy, whose searches it takes.
    """
    try:
        yield
        import_module("scipy")
    except ModuleNotFoundError as error:
        if error.name == "scipy":
            raise SettingsError(
                "method 'paper': expected the package scipy, which is not installed; install it with "
                "pip install 'monodyn[paper]'."
            ) from None
        if not _is_published(error):
            raise
        raise SettingsError(
            "method 'paper': the published method is not part of this installation; use the method 'fast'."
        ) from error


def settings_classes() -> dict[str, type]:
    """Return the settings class of each stage, with the settings of every installed method."""
    try:
        from monodyn.paper.settings import SETTINGS
    except ModuleNotFoundError as error:
        if not _is_published(error):
            raise
        return dict(STAGES)
    return STAGES | SETTINGS


def _is_published(error: ModuleNotFoundError) -> bool:
    """Return whether it is the published method that is missing."""
    # any other missing module is an error of the installation, not a program without that method
    return (error.name or "").startswith("monodyn.paper")


@dataclass(frozen=True)
class RunSettings:
    """What a run does.

    Attributes:
        fit_frames: Frames to fit, A to B-1, of a clip or of every table; when left out all of a table, and
            all but the last quarter of a clip.
        roi: Part of the picture that shows the mechanism, e.g. 120,0,480,360: column and row of its upper
            left corner, width and height [px]; found when left out.
        time_range: Begin and end [s] of the frames in which the mechanism moves freely, e.g. 1.3:6; found
            when left out.
        until: End of the prediction [s]; the end of the clip, or of the table, when left out.
        tolerance: How far off a prediction may be, of a hinge and of a slide, e.g. 5deg,2cm; how long it
            stays within is said.
        fix: Parameters that are known, named after their body or joint, e.g. link1.length=0.2, gravity=9.81,
            or camera.roll=0 of a clip.
        free: Parameters to estimate that are not by default, e.g. joint1.drag, gravity, or camera.focal of a
            clip.
        bounds: Lower and upper bounds of parameters, e.g. link1.length=0.1:0.3.
        background: Picture of the scene without the mechanism.
        masks: Masks that another tool made, in place of the clip's pictures: a folder of numbered pictures, a
            film or an NPZ file; binary or soft, or with a label for each body.
        points: Points that another tool tracked, in place of the clip's pictures: DeepLabCut (CSV, HDF5),
            SLEAP analysis HDF5, Tracker or Kinovea text, or frame,NAME_x,NAME_y[,NAME_p].
        points_map: What points are whose names are no joint, body (its far end) or site, e.g. knee=joint2,
            wrist=link2.marker for anywhere on a body, wall=world for what does not move, nose=none.
        points_size: Width and height of the picture that the points are in [px], e.g. 1280,720; the clip's,
            or as far as the points reach, when left out.
        points_axis: Where the second coordinate of the points goes: ``down`` or ``up`` in the picture;
            ``auto``: as their tool has it.
        distortion: Coefficients by which the lens bends the picture, in the order and meaning of OpenCV, e.g.
            -0.28,0.09,0,0. They belong to a focal length, which --locate.focal has to give, in pixels of this
            clip, with the principal point in its middle. Pictures and points are put straight before anything
            else looks at them.
        torques: Log of known torques [N m, a slide's N] by time [s] on the clock of the record, columns time
            and <joint> or <joint>_torque; linear in between; of several tables one each, in their order.
            Masses and friction are absolute with it. How much later they act is estimated, or given with
            --fix torque.lag=SECONDS.
        ensemble: Models that are drawn from what the data allow and written as ensemble_00.xml, ..., for
            robust control and randomised training; up to 100.
        rate: Frames a second [Hz] in place of the time stamps of the clip.
        whole: Look at all pixels of pictures of more than 6 million, with four times the memory and time;
            else they are reduced, of 4K to half its sides. They are whole, too, where anything is given in
            pixels of the clip, such as roi, camera.focal, a background, points or masks.
        seed: Seed of every random start; it replaces the seeds of the stages.
        uncertainty: Where intervals come from: ``linear``: the covariance at the optimum, or where sizes are
            assumed, draws in the inertias in which the motion is linear; ``profile``: how the cost rises to
            either side of the optimum; ``bootstrap``: 200 fits of records with other noise.
        method: ``fast``: ours; ``paper``: that of 2012 as published. A stage may have its own.
        segment: How the foreground is found.
        camera: How the camera is found.
        locate: How camera, sizes and initial pose are found.
        track: How the mechanism is followed.
        identify: How the dynamics are identified.
    """

    fit_frames: tuple[int, int | None] | None = None
    roi: tuple[int, int, int, int] | None = None
    time_range: tuple[float, float | None] | None = None
    until: float | None = field(default=None, metadata={"metavar": "S"})
    tolerance: Tolerance = field(default_factory=Tolerance)
    fix: Mapping[str, float] = field(default_factory=dict)
    free: Sequence[str] = ()
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    background: Path | None = field(default=None, metadata={"metavar": "PICTURE"})
    masks: Path | None = field(default=None, metadata={"metavar": "MASKS"})
    points: Path | None = field(default=None, metadata={"metavar": "FILE"})
    points_map: Mapping[str, str] = field(default_factory=dict, metadata={"name": "points.map"})
    points_size: tuple[int, int] | None = field(default=None, metadata={"name": "points.size"})
    points_axis: Axis = field(default="auto", metadata={"name": "points.axis"})
    distortion: tuple[float, ...] | None = field(default=None, metadata={"name": "camera.distortion"})
    torques: tuple[Path, ...] = ()
    ensemble: int = 0
    rate: float | None = field(default=None, metadata={"metavar": "HZ"})
    whole: bool = False
    seed: int = 0
    uncertainty: Uncertainty = "linear"
    method: Method = "fast"
    segment: SegmentSettings = field(default_factory=SegmentSettings)
    camera: CameraSettings = field(default_factory=CameraSettings)
    locate: LocateSettings = field(default_factory=LocateSettings)
    track: TrackSettings = field(default_factory=TrackSettings)
    identify: IdentifySettings = field(default_factory=IdentifySettings)

    def __post_init__(self) -> None:
        check_fields(self, "settings")
        check_whole("seed", self.seed)
        if not 0 <= self.ensemble <= MOST_DRAWN:
            raise SettingsError(
                f"ensemble: expected 0 to {MOST_DRAWN} models, got {self.ensemble}; give a number in between."
            )
        if self.fit_frames is not None and min(end for end in self.fit_frames if end is not None) < 0:
            ends = ":".join("" if end is None else str(end) for end in self.fit_frames)
            raise SettingsError(
                f"fit-frames: expected A:B with frames from 0 on, got {ends}; count from the first frame."
            )
        # every range is checked here or in the class of the stage, before the first frame is decoded
        check_choice("method", self.method, METHOD_NAMES)
        check_choice("points.axis", self.points_axis, get_args(Axis))
        if self.masks is not None and self.points is not None:
            raise SettingsError("masks: expected masks or points, got both; leave one out.")
        if self.points is None and (self.points_map or self.points_size or self.points_axis != "auto"):
            raise SettingsError(
                "points.map, points.size, points.axis: expected --points FILE with them, got none; name the "
                "file, or leave them out."
            )
        size = self.points_size
        if size is not None and not LEAST_SIDE <= min(size) <= max(size) <= MOST_SIDE:
            raise SettingsError(
                f"points.size: expected W,H of {LEAST_SIDE} to {MOST_SIDE} px, got {size[0]},{size[1]}; give "
                "width and height of the picture."
            )
        bends = self.distortion
        if bends is not None and not (len(bends) in COEFFICIENTS and all(map(math.isfinite, bends))):
            raise SettingsError(
                "camera.distortion: expected K1,K2,P1,P2[,K3] in the order of OpenCV, got "
                f"{','.join(f'{bend:g}' for bend in bends)}; give four or five numbers."
            )
        if self.rate is not None and not RATES[0] <= self.rate <= RATES[1]:
            raise SettingsError(
                f"rate: expected {RATES[0]:g} to {RATES[1]:g} Hz, got {self.rate:g}; "
                "give the true frames a second."
            )
        for stage, kind in settings_classes().items():
            object.__setattr__(self, stage, self._stage(stage, kind))
        if self.torques:
            check_known(self.identify)
        if self.uncertainty != "linear" and self.identify.method == "paper":
            raise SettingsError(
                f"uncertainty: expected linear with the published method, got {self.uncertainty}; leave it "
                "out."
            )
        published = "paper" in (self.camera.method, self.locate.method, self.track.method)
        if (self.camera.exposure or self.camera.readout) and (published or self.points is not None):
            got = "a stage by the published method" if published else "--points"
            raise SettingsError(
                f"camera.exposure, camera.readout: expected pictures and the method 'fast', got {got}, which "
                "knows neither; leave them out."
            )

    @property
    def in_pixels(self) -> bool:
        """Whether pictures are to be whole, as is asked for or as something is given in their pixels."""
        given = (self.roi, self.background, self.masks, self.points, self.distortion)
        focal = self.locate.focal or "camera.focal" in self.fix
        return self.whole or bool(focal) or any(one is not None for one in given)

    def _stage(self, stage: str, kind: Any) -> Any:
        """Return the settings of a stage with what it takes from the run, as an instance of ``kind``."""
        settings = getattr(self, stage)
        if settings.method is None:
            # the foreground has one method only: a run as published has nothing to choose there
            settings = replace(settings, method="fast" if stage == "segment" else self.method)
        if settings.method == "paper":
            with published_method():
                from monodyn.paper.settings import published
            settings = published(settings, kind)
        # a run records the settings of every installed method, even where only those of ours were given
        elif not isinstance(settings, kind):
            from monodyn.paper.settings import published

            settings = published(settings, kind)
        return replace(settings, **{name: getattr(self, name) for name in SHARED if hasattr(settings, name)})
