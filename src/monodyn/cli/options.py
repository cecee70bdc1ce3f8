"""The options of each command as a frozen dataclass, and the command line into one of them."""

from __future__ import annotations

import contextlib
import io
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro import conf

from monodyn.cli.reproduced import ReproduceOptions
from monodyn.errors import SettingsError
from monodyn.settings import settings_classes
from monodyn.vision.settings import CameraSettings, SegmentSettings

_CLASSES = settings_classes()
LocateSettings, TrackSettings, IdentifySettings = (_CLASSES[name] for name in ("locate", "track", "identify"))

Words = conf.UseAppendAction[tuple[tuple[str, ...], ...]]
Clip = Annotated[conf.Positional[Path], conf.arg(metavar="CLIP")]
Model = Annotated[str, conf.arg(metavar="MODEL")]
Folder = Annotated[Path, conf.arg(metavar="DIR")]
Values = Annotated[Words, conf.arg(metavar="NAME=VALUE ...")]
Names = Annotated[Words, conf.arg(metavar="NAME ...")]
Limits = Annotated[Words, conf.arg(metavar="NAME=LOW:HIGH ...")]
Range = Annotated[str | None, conf.arg(metavar="A:B")]
Seconds = Annotated[float | None, conf.arg(metavar="S")]
Rate = Annotated[float | None, conf.arg(metavar="HZ")]
Picture = Annotated[Path | None, conf.arg(metavar="PICTURE")]


@dataclass(frozen=True)
class LocateChoices(LocateSettings):
    """How camera, sizes and first pose are found; the one seed of a command is ``--seed``."""

    seed: Annotated[int, conf.Fixed, conf.Suppress] = 0


@dataclass(frozen=True)
class IdentifyChoices(IdentifySettings):
    """How the dynamics are identified; the one seed of a command is ``--seed``."""

    seed: Annotated[int, conf.Fixed, conf.Suppress] = 0


@dataclass(frozen=True)
class RunOptions:
    """Track a clip, identify the mechanism on some of its frames, predict the others, write the run folder.

    Attributes:
        clip: Video file, or folder of numbered pictures.
        model: Mechanism file (MJCF, URDF) or bundled name (see monodyn models).
        out: Folder for the results.
        fit_frames: Frames to fit, A to B-1; all but the last quarter when left out.
        until: End of the prediction [s]; the end of the clip when left out.
        fix: Parameters that are known, e.g. gravity=9.81 or camera.roll=0.
        free: Parameters to estimate that are not by default, e.g. camera.focal.
        bounds: Bounds of parameters, e.g. link1.length=0.1:0.3.
        force: Replace a run that is already in DIR.
        quiet: No progress, no table.
        json: The result as JSON on the standard output.
        background: Picture of the scene without the mechanism.
        rate: Frames a second [Hz] in place of the time stamps of the clip.
        seed: Seed of every random start.
        method: fast, or paper for the method of 2012 as published; a stage may have its own.
        segment: How the foreground is found.
        camera: How the camera is found.
        locate: How camera, sizes and initial pose are found.
        track: How the mechanism is followed.
        identify: How the dynamics are identified.
    """

    clip: Clip
    model: Model
    out: Folder
    fit_frames: Range = None
    until: Seconds = None
    fix: Values = ()
    free: Names = ()
    bounds: Limits = ()
    force: bool = False
    quiet: bool = False
    json: bool = False
    background: Picture = None
    rate: Rate = None
    seed: int = 0
    method: Literal["fast", "paper"] = "fast"
    segment: SegmentSettings = field(default_factory=SegmentSettings)
    camera: CameraSettings = field(default_factory=CameraSettings)
    locate: LocateChoices = field(default_factory=LocateChoices)
    track: TrackSettings = field(default_factory=TrackSettings)
    identify: IdentifyChoices = field(default_factory=IdentifyChoices)

    def go(self) -> int:
        """Run the command; return the exit code."""
        frames, fix, free = frame_range(self.fit_frames), values(self.fix), names(self.free)
        limits = intervals(self.bounds)
        from monodyn.cli.show import progress_on, show
        from monodyn.pipeline import RunSettings, run

        settings = RunSettings(
            frames, self.until, fix, free, limits, self.background, self.rate, self.seed,
            self.method, self.segment, self.camera, self.locate, self.track, self.identify,
        )  # fmt: skip
        with progress_on(sys.stderr, quiet=self.quiet) as progress:
            outcome = run(self.clip, self.model, self.out, settings, force=self.force, progress=progress)
        return show(outcome, as_json=self.json, quiet=self.quiet)


@dataclass(frozen=True)
class TrackOptions:
    """Track a clip and write poses.csv; slides are in the start scale of the model.

    Attributes:
        clip: Video file, or folder of numbered pictures.
        model: Mechanism file (MJCF, URDF) or bundled name (see monodyn models).
        out: Folder for the results.
        fix: Parameters that are known, e.g. camera.roll=0.
        free: Parameters to estimate that are not by default, e.g. camera.focal.
        force: Replace a run that is already in DIR.
        quiet: No progress, no table.
        json: The result as JSON on the standard output.
        background: Picture of the scene without the mechanism.
        rate: Frames a second [Hz] in place of the time stamps of the clip.
        seed: Seed of every random start.
        method: fast, or paper for the method of 2012 as published; a stage may have its own.
        segment: How the foreground is found.
        camera: How the camera is found.
        locate: How camera, sizes and initial pose are found.
        track: How the mechanism is followed.
    """

    clip: Clip
    model: Model
    out: Folder
    fix: Values = ()
    free: Names = ()
    force: bool = False
    quiet: bool = False
    json: bool = False
    background: Picture = None
    rate: Rate = None
    seed: int = 0
    method: Literal["fast", "paper"] = "fast"
    segment: SegmentSettings = field(default_factory=SegmentSettings)
    camera: CameraSettings = field(default_factory=CameraSettings)
    locate: LocateChoices = field(default_factory=LocateChoices)
    track: TrackSettings = field(default_factory=TrackSettings)

    def go(self) -> int:
        """Run the command; return the exit code."""
        fix, free = values(self.fix), names(self.free)
        from monodyn.cli.show import progress_on, show
        from monodyn.pipeline import RunSettings, track_clip

        settings = RunSettings(
            None, None, fix, free, {}, self.background, self.rate, self.seed,
            self.method, self.segment, self.camera, self.locate, self.track,
        )  # fmt: skip
        with progress_on(sys.stderr, quiet=self.quiet) as progress:
            outcome = track_clip(
                self.clip, self.model, self.out, settings, force=self.force, progress=progress
            )
        return show(outcome, as_json=self.json, quiet=self.quiet)


@dataclass(frozen=True)
class IdentifyOptions:
    """Identify a mechanism from tables of joint positions; several tables share its parameters.

    Attributes:
        poses: Tables with columns time [s] and one per joint [rad or m]: poses.csv of a run, or encoder logs.
        model: Mechanism file (MJCF, URDF) or bundled name (see monodyn models).
        out: Folder for the results; nothing is written when left out.
        fix: Parameters that are known, e.g. link1.length=0.2.
        free: Parameters to estimate that are not by default, e.g. gravity.
        bounds: Bounds of parameters, e.g. link1.length=0.1:0.3.
        force: Replace a run that is already in DIR.
        quiet: No progress, no table.
        json: The result as JSON on the standard output.
        seed: Seed of every random start.
        method: fast, or paper for the method of 2012 as published.
        identify: How the dynamics are identified.
    """

    poses: Annotated[conf.Positional[tuple[Path, ...]], conf.arg(metavar="POSES.csv ...")]
    model: Model
    out: Annotated[Path | None, conf.arg(metavar="DIR")] = None
    fix: Values = ()
    free: Names = ()
    bounds: Limits = ()
    force: bool = False
    quiet: bool = False
    json: bool = False
    seed: int = 0
    method: Literal["fast", "paper"] = "fast"
    identify: IdentifyChoices = field(default_factory=IdentifyChoices)

    def go(self) -> int:
        """Run the command; return the exit code."""
        if not self.poses:
            raise SettingsError(
                "identify: expected at least one table of joint positions, got none; name a poses.csv."
            )
        fix, free, limits = values(self.fix), names(self.free), intervals(self.bounds)
        from monodyn.cli.show import progress_on, show
        from monodyn.pipeline import RunSettings, identify_tables

        settings = RunSettings(
            fix=fix, free=free, bounds=limits, seed=self.seed, method=self.method, identify=self.identify
        )
        with progress_on(sys.stderr, quiet=self.quiet) as progress:
            outcome = identify_tables(
                self.poses, self.model, self.out, settings, force=self.force, progress=progress
            )
        return show(outcome, as_json=self.json, quiet=self.quiet)


@dataclass(frozen=True)
class ModelsOptions:
    """List the bundled mechanisms with their joints and sizes.

    Attributes:
        json: The list as JSON.
    """

    json: bool = False

    def go(self) -> int:
        """Run the command; return the exit code."""
        from monodyn.cli.show import show_models

        return show_models(as_json=self.json)


COMMANDS: dict[str, tuple[type[Any], str]] = {
    "run": (RunOptions, "monodyn run clip.mp4 --model double.xml --out run --fit-frames 0:120"),
    "track": (TrackOptions, "monodyn track clip.mp4 --model double.xml --out run"),
    "identify": (IdentifyOptions, "monodyn identify run/poses.csv --model run/model.xml --out fit"),
    "models": (ModelsOptions, "monodyn models"),
    "reproduce": (ReproduceOptions, "monodyn reproduce --out experiment"),
}
"""Options and an example of each command."""


def parsed(command: str, words: Sequence[str]) -> Any:
    """Read the words after a command.

    Args:
        command: One of ``COMMANDS``.
        words: The words.

    Returns:
        The options, or an exit code when help was asked for.

    Raises:
        SettingsError: an option is unknown, missing or has a value that it cannot take.
    """
    import tyro

    for before, word in zip(["", *words], words, strict=False):
        name = before if word == "" else word.removesuffix("=")
        if name in ("--out", "--model", "--background") and (word == "" or word.endswith("=")):
            raise SettingsError(f"{command}: {name}: expected a name, got an empty one; give one.")
    options, example = COMMANDS[command]
    about = f"{(options.__doc__ or '').split(chr(10))[0]}\n\nExample: {example}"
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            return tyro.cli(
                options,
                prog=f"monodyn {command}",
                description=about,
                args=list(words),
                config=(conf.FlagCreatePairsOff,),
            )
    except SystemExit as stop:
        if not stop.code:
            return 0
        raise SettingsError(_one_line(complaint.getvalue(), command, list(words))) from None


def _one_line(complaint: str, command: str, words: list[str]) -> str:
    """Bring a boxed complaint about the command line into one sentence."""
    text = re.sub(r"[\u2500-\u257f]|-{4,}", " ", complaint)
    text = " ".join(text.split())
    text = re.split(r"For full helptext|Argument helptext|Got errors|Perhaps you meant", text)[0].strip()
    see = f"see monodyn {command} --help."
    if text.startswith("Required options"):
        wanted = [
            name for name in ("CLIP", "POSES.csv", "--model", "--out") if re.search(rf"(^|\s){name}\b", text)
        ]
        return f"{command}: expected {', '.join(wanted)}, got {' '.join(words) or 'nothing'}; {see}"
    if text.startswith("Unrecognized"):
        odd = re.sub(r"^.*?Unrecognized options:\s*", "", text)
        return f"{command}: expected known options, got {odd.split('. ')[0].strip()}; {see}"
    choice = re.search(r"invalid choice '(.*?)' for argument '(.*?)'. Expected one of \((.*?)\)", text)
    if choice:
        return f"{command}: {choice[2]}: expected {choice[3]}, got '{choice[1]}'; {see}"
    value = re.search(r"Error parsing (\S+): .*?from \['?(.*?)'?\]", text)
    if value:
        return f"{command}: {value[1]}: expected another kind of value, got '{value[2]}'; {see}"
    return f"{command}: {text.rstrip('.')}; {see}"


def frame_range(text: str | None) -> tuple[int, int | None] | None:
    """Read ``A:B``; either end may be left out.

    Args:
        text: What the user wrote, or None.

    Raises:
        SettingsError: it is not two whole numbers with a colon between them.
    """
    if text is None:
        return None
    match = re.fullmatch(r"(\d*):(\d*)", text.strip())
    if not match:
        raise SettingsError(f"fit-frames: expected A:B with whole frame numbers, got '{text}'; e.g. 0:120.")
    return int(match[1] or 0), int(match[2]) if match[2] else None


def values(words: Sequence[Sequence[str]]) -> dict[str, float]:
    """Read ``NAME=VALUE`` words.

    Args:
        words: What the user wrote, by option.

    Raises:
        SettingsError: a word is not a name and a number, or a name comes twice.
    """
    found: dict[str, float] = {}
    for word in (word for group in words for word in group):
        name, _, text = word.partition("=")
        try:
            value = float(text)
        except ValueError:
            raise SettingsError(
                f"fix: expected NAME=VALUE with a number, got '{word}'; e.g. gravity=9.81."
            ) from None
        if name in found:
            raise SettingsError(f"fix: expected each name once, got '{name}' twice; keep one of them.")
        found[name] = value
    return found


def intervals(words: Sequence[Sequence[str]]) -> dict[str, tuple[float, float]]:
    """Read ``NAME=LOW:HIGH`` words.

    Args:
        words: What the user wrote, by option.

    Raises:
        SettingsError: a word is not a name and two numbers, or a name comes twice.
    """
    found: dict[str, tuple[float, float]] = {}
    for word in (word for group in words for word in group):
        name, _, text = word.partition("=")
        low, _, high = text.partition(":")
        try:
            ends = float(low), float(high)
        except ValueError:
            raise SettingsError(
                f"bounds: expected NAME=LOW:HIGH with two numbers, got '{word}'; e.g. link1.length=0.1:0.3."
            ) from None
        if name in found:
            raise SettingsError(f"bounds: expected each name once, got '{name}' twice; keep one of them.")
        found[name] = ends
    return found


def names(words: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return the names of repeated options in order.

    Args:
        words: What the user wrote, by option.
    """
    return tuple(word for group in words for word in group)
