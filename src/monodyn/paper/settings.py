"""Settings that only the published method has, in addition to those of each stage."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal, TypeVar

from monodyn.choices import check_choice
from monodyn.errors import SettingsError
from monodyn.estimation.settings import IdentifySettings
from monodyn.vision.settings import LocateSettings, TrackSettings

PAPER_GAINS = (0.4, 0.1, 0.05)
"""Gains of the filter in the paper's Figure 3."""

USUAL_MOVE_SHARE = 0.1
"""Move limits to either side, as a share of a joint's range, where the user does not say."""


@dataclass(frozen=True)
class PaperLocateSettings(LocateSettings):
    """How camera, sizes and first pose are found, with the options of the published method.

    Attributes:
        start: Where the search of the method ``paper`` starts: ``spread``: poses all over the joint ranges;
            ``evolution``: the ends of one, which the paper proposes for complicated mechanisms.
        framework: The order of the paper's Figure 2: ``strict``: camera and pose in turn until neither gains,
            then the aspect ratios; ``interleaved``: ours, in which every trial has its own camera.
        level: Threshold of the silhouettes of the method ``paper`` [grey levels]; 0 takes Otsu's.
    """

    start: Literal["spread", "evolution"] = "spread"
    framework: Literal["strict", "interleaved"] = "strict"
    level: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_choice("locate.start", self.start, ("spread", "evolution"))
        if self.method == "fast" and self.start != "spread":
            raise SettingsError(
                f"locate.start: expected 'spread' with the fast method, got '{self.start}'; it belongs to "
                "locate.method paper."
            )
        check_choice("locate.framework", self.framework, ("strict", "interleaved"))
        if self.method == "fast" and self.framework != "strict":
            raise SettingsError(
                f"locate.framework: expected 'strict' with the fast method, got '{self.framework}'; it "
                "belongs to locate.method paper."
            )
        if self.method == "fast" and self.level != 0.0:
            raise SettingsError(
                f"locate.level: expected 0 with the fast method, got {self.level:g}; it belongs to "
                "locate.method paper."
            )
        if not 0.0 <= self.level < 255.0:
            raise SettingsError(f"locate.level: expected 0 to 255 grey levels, got {self.level:g}.")


@dataclass(frozen=True)
class PaperTrackSettings(TrackSettings):
    """How the mechanism is followed, with the options of the published method.

    Attributes:
        move_share: Move limits of the method ``paper`` as a fraction of each joint's range, to either side; a
            hinge without limits has a range of one turn.
        adaptive: Have the move limits of the method ``paper`` follow the joints' velocity, narrow where they
            are slow; without it they are a fixed share of the range about the last pose.
    """

    move_share: float = USUAL_MOVE_SHARE
    adaptive: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.method == "fast" and (self.move_share != USUAL_MOVE_SHARE or not self.adaptive):
            raise SettingsError(
                "track.move_share, track.adaptive: expected --track.method paper with them, got the method "
                "'fast'; choose that method, or leave the move limits out."
            )
        if not 1e-3 <= self.move_share <= 0.5:
            raise SettingsError(f"track.move_share: expected 0.001 to 0.5, got {self.move_share}.")


@dataclass(frozen=True)
class PaperIdentifySettings(IdentifySettings):
    """How a mechanism is identified, with the options of the published method.

    Attributes:
        gains: Gains alpha, beta, gamma of the filter of the method ``paper``, eq. (7).
        states: What the method ``paper`` compares the simulated states with: ``measured``: the poses as they
            are; ``filtered``: those of its filter.
        rates: Have the method ``paper`` compare rates as well as angles, as its discussion proposes, weighted
            with the tracker's covariance.
        filter: How the method ``paper`` reads eq. (6): ``printed``: the acceleration takes gamma / T^2 of
            what was not predicted; ``consistent``: gamma / (2 T^2), to which the bound of eq. (7) belongs.
        begin: Where the search of the method ``paper`` begins, which the paper leaves open: ``matched``: at
            start values matched to the accelerations of the poses (ours); ``given``: at those of file and
            picture, as they are.
    """

    gains: tuple[float, float, float] = PAPER_GAINS
    states: Literal["measured", "filtered"] = "measured"
    rates: bool = False
    filter: Literal["printed", "consistent"] = "printed"
    begin: Literal["matched", "given"] = "matched"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.method == "paper" and self.torque == "auto":
            # the paper chooses its cases by hand; the first one is what acts where nothing else is said
            object.__setattr__(self, "torque", "friction")
        check_choice("identify.states", self.states, ("measured", "filtered"))
        check_choice("identify.filter", self.filter, ("printed", "consistent"))
        check_choice("identify.begin", self.begin, ("matched", "given"))
        if self.method == "fast":
            for name, given, usual in (("filter", self.filter, "printed"), ("begin", self.begin, "matched")):
                if given != usual:
                    raise SettingsError(
                        f"identify.{name}: expected '{usual}' with the fast method, got '{given}'; it "
                        "belongs to identify.method paper."
                    )
        if self.method == "fast" and (self.rates or self.states == "filtered"):
            raise SettingsError(
                "identify.rates, identify.states: expected --identify.method paper with them, got the method "
                "'fast'; choose that method, or leave them out."
            )
        if tuple(self.gains) != PAPER_GAINS:
            if self.method == "fast":
                raise SettingsError(
                    "identify.gains: expected --identify.method paper with them, got the method 'fast'; "
                    "choose that method, or leave the gains out."
                )
            # checked here, so that gains out of range are refused before a clip is read
            from monodyn.paper.filter import Gains

            Gains.of(self.gains)


SETTINGS: dict[str, type] = {
    "locate": PaperLocateSettings,
    "track": PaperTrackSettings,
    "identify": PaperIdentifySettings,
}
"""The settings class of each stage with more to set than the default method has."""

Published = TypeVar("Published", PaperLocateSettings, PaperTrackSettings, PaperIdentifySettings)


def published(settings: LocateSettings | TrackSettings | IdentifySettings, of: type[Published]) -> Published:
    """Return settings as the published method takes them, its own options at their defaults if not given.

    Args:
        settings: The settings of a stage.
        of: The class wanted.
    """
    if isinstance(settings, of):
        return settings
    return of(**{field.name: getattr(settings, field.name) for field in fields(settings)})
