"""What a run does: the settings of every stage in one place, so that the command line needs nothing else."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Literal

from monodyn.errors import SettingsError
from monodyn.estimation.settings import IdentifySettings
from monodyn.vision.clip.video import RATES
from monodyn.vision.settings import CameraSettings, LocateSettings, SegmentSettings, TrackSettings


@dataclass(frozen=True)
class RunSettings:
    """What a run does.

    Attributes:
        fit_frames: First frame of the fit and the one after its last; None fits all but the last quarter.
        until: End of the prediction [s]; None predicts to the end of the clip.
        fix: Parameter values that are known and not estimated.
        free: Parameters to estimate that are not by default.
        bounds: Lower and upper bounds by parameter.
        background: Picture of the scene without the mechanism.
        rate: Frames a second [Hz] in place of the clip's time stamps.
        seed: Seed of every random start; it takes the place of those of the stages.
        method: ``fast``, or ``paper`` for the method of 2012 as published; a stage may have its own.
        segment: How the foreground is found.
        camera: How the camera is found.
        locate: How camera, sizes and initial pose are found.
        track: How the mechanism is followed.
        identify: How the dynamics are identified.
    """

    fit_frames: tuple[int, int | None] | None = None
    until: float | None = None
    fix: Mapping[str, float] = field(default_factory=dict)
    free: Sequence[str] = ()
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    background: Path | None = None
    rate: float | None = None
    seed: int = 0
    method: Literal["fast", "paper"] = "fast"
    segment: SegmentSettings = field(default_factory=SegmentSettings)
    camera: CameraSettings = field(default_factory=CameraSettings)
    locate: LocateSettings = field(default_factory=LocateSettings)
    track: TrackSettings = field(default_factory=TrackSettings)
    identify: IdentifySettings = field(default_factory=IdentifySettings)

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise SettingsError(f"seed: expected 0 or more, got {self.seed}; give a whole number.")
        for name in ("locate", "identify"):
            object.__setattr__(self, name, replace(getattr(self, name), seed=self.seed))
        if self.method not in ("fast", "paper"):
            raise SettingsError(f"method: expected 'fast' or 'paper', got '{self.method}'.")
        for name in ("camera", "locate", "track", "identify"):
            stage = getattr(self, name)
            if stage.method is None:
                object.__setattr__(self, name, replace(stage, method=self.method))
        if self.rate is not None and not RATES[0] <= self.rate <= RATES[1]:
            raise SettingsError(
                f"rate: expected {RATES[0]:g} to {RATES[1]:g} Hz, got {self.rate:g}; "
                "give the true frames a second."
            )
        for stage in ("segment", "camera", "locate", "track", "identify"):
            for name, value in asdict(getattr(self, stage)).items():
                if isinstance(value, float) and not math.isfinite(value):
                    raise SettingsError(
                        f"{stage}.{name}: expected a finite number, got {value}; "
                        "leave it out for the usual one."
                    )


def settings_classes() -> dict[str, type]:
    """Return the settings class of each stage, with what every installed method can be told."""
    classes: dict[str, type] = {
        "segment": SegmentSettings,
        "camera": CameraSettings,
        "locate": LocateSettings,
        "track": TrackSettings,
        "identify": IdentifySettings,
    }
    try:
        from monodyn.paper.settings import SETTINGS
    except ImportError:  # a program without the published method
        return classes
    return classes | SETTINGS
