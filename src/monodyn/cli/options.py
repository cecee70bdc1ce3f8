"""The options of each command, made from the settings of a run.

A command states its inputs, what it prints, and the settings of `RunSettings` that it does not take; it takes
all others. A new field of `RunSettings`, or of a stage's settings, is an option of every command that
takes them, with its help text and its default, without a line here.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import Field, dataclass, field, fields, make_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, get_type_hints

from tyro import conf

from monodyn.cli.completion import Shell, completion
from monodyn.cli.controlled import ControlOptions
from monodyn.cli.demo import DemoOptions, ModelsOptions, WarmOptions
from monodyn.cli.forms import FORMS
from monodyn.cli.predicted import PredictOptions
from monodyn.cli.reproduced import ReproduceOptions
from monodyn.errors import SettingsError
from monodyn.live.settings import LiveSettings
from monodyn.settings import SHARED, RunSettings, settings_classes

if TYPE_CHECKING:
    from monodyn.pipeline import Outcome
    from monodyn.types import Progress

Word = Annotated[conf.Positional[Path | None], conf.arg(metavar="CLIP")]
Clip = Annotated[Path | None, conf.arg(metavar="CLIP")]
Tables = Annotated[conf.Positional[tuple[Path, ...]], conf.arg(metavar="POSES.csv ...")]
Model = Annotated[str, conf.arg(metavar="MODEL")]
Origin = Annotated[conf.Positional[str], conf.arg(metavar="SOURCE")]
Lines = Annotated[str | None, conf.arg(metavar="FILE")]
Where = Annotated[str | None, conf.arg(metavar="[HOST:]PORT")]
Folder = Annotated[Path, conf.arg(metavar="DIR")]
MaybeFolder = Annotated[Path | None, conf.arg(metavar="DIR")]


@dataclass(frozen=True, kw_only=True)
class CommonOptions:
    """What every command that takes settings has in common.

    Attributes:
        model: Mechanism file (MJCF, URDF), bundled name (see monodyn models), or folder of a run that goes on
            with its mechanism; auto tries the bundled ones and takes the one that the evidence prefers.
        force: Replace a run that is already in DIR.
        quiet: No progress, no table.
        json: The result as JSON on the standard output.
    """

    model: Model = "auto"
    force: bool = False
    quiet: bool = False
    json: bool = False

    def settings(self) -> RunSettings:
        """Return the settings of a run that the options stand for.

        Raises:
            SettingsError: an option cannot be read, or has a value that the settings refuse.
        """
        # a command that does not take a setting has no attribute for it, and the run its usual value
        given = {}
        for name, kind in get_type_hints(RunSettings).items():
            if hasattr(self, name):
                value = getattr(self, name)
                given[name] = FORMS[kind].read(option_name(name), value) if kind in FORMS else value
        return RunSettings(**given)

    @contextmanager
    def progress(self) -> Iterator[Progress | None]:
        """Yield what shows progress on the error stream while the block runs, or None with ``--quiet``."""
        from monodyn.cli.show import progress_on

        with progress_on(sys.stderr, quiet=self.quiet) as progress:
            yield progress

    def show(self, outcome: Outcome) -> int:
        """Return the exit code after what was found has been printed.

        Args:
            outcome: What was found.
        """
        from monodyn.cli.show import show

        return show(outcome, as_json=self.json, quiet=self.quiet)


def option_name(setting: str) -> str:
    """Return what the option for a setting of the whole run is called.

    Args:
        setting: Name of the field.
    """
    metadata = {field.name: field.metadata for field in fields(RunSettings)}[setting]
    return metadata.get("name", setting.replace("_", "-"))


def one_clip(word: Path | None, option: Path | None, settings: RunSettings) -> Path | None:
    """Return the clip that the user named, in either way.

    Args:
        word: The word without an option.
        option: The value of ``--clip``.
        settings: The settings, which may name points or masks in its place.

    Raises:
        SettingsError: it is named twice, or nothing is named.
    """
    if word is not None and option is not None:
        raise SettingsError(f"clip: expected one clip, got '{word}' and --clip {option}; leave one out.")
    if word is None and option is None and settings.points is None and settings.masks is None:
        raise SettingsError(
            "clip: expected CLIP, or --points FILE or --masks MASKS in its place, got none; name one."
        )
    return word or option


@dataclass(frozen=True, kw_only=True)
class RunOptions(CommonOptions):
    """Track a clip, identify the mechanism on some of its frames, predict the others, write the run folder.

    Attributes:
        word: Video file, or folder of numbered pictures.
        clip: The same by name; next to --points or --masks it gives time stamps, size and overlay.
        out: Folder for the results.
    """

    out: Folder
    word: Word = None
    clip: Clip = None

    def go(self) -> int:
        """Return the exit code after running the command."""
        settings = self.settings()
        clip = one_clip(self.word, self.clip, settings)
        from monodyn.pipeline import run

        with self.progress() as progress:
            outcome = run(clip, self.model, self.out, settings, force=self.force, progress=progress)
        return self.show(outcome)


@dataclass(frozen=True, kw_only=True)
class TrackOptions(CommonOptions):
    """Track a clip and write poses.csv; slides are in the start scale of the model.

    Attributes:
        word: Video file, or folder of numbered pictures.
        clip: The same by name; next to --points or --masks it gives time stamps, size and overlay.
        out: Folder for the results.
    """

    out: Folder
    word: Word = None
    clip: Clip = None

    def go(self) -> int:
        """Return the exit code after running the command."""
        settings = self.settings()
        clip = one_clip(self.word, self.clip, settings)
        from monodyn.pipeline import track_clip

        with self.progress() as progress:
            outcome = track_clip(clip, self.model, self.out, settings, force=self.force, progress=progress)
        return self.show(outcome)


@dataclass(frozen=True, kw_only=True)
class IdentifyOptions(CommonOptions):
    """Identify a mechanism from tables of joint positions; several tables share its parameters.

    Attributes:
        poses: Tables with columns time [s] and one per joint [rad or m]: poses.csv of a run, or encoder logs.
        out: Folder for the results; nothing is written when left out.
    """

    poses: Tables
    out: MaybeFolder = None

    def go(self) -> int:
        """Return the exit code after running the command.

        Raises:
            SettingsError: there is no table.
        """
        if not self.poses:
            raise SettingsError(
                "identify: expected at least one table of joint positions, got none; name a poses.csv."
            )
        settings = self.settings()
        from monodyn.pipeline import identify_tables

        with self.progress() as progress:
            outcome = identify_tables(
                self.poses, self.model, self.out, settings, force=self.force, progress=progress
            )
        return self.show(outcome)


def _live_group() -> type[Any]:
    """Return the settings of a stream as a group of options, each in the form of its type."""
    hints, made = get_type_hints(LiveSettings), []
    for setting in fields(LiveSettings):
        kind, usual = _option(setting, hints[setting.name])
        short = (f"--{setting.name}",) if setting.name in SHORT else ()
        made.append((setting.name, Annotated[kind, conf.arg(aliases=short)] if short else kind, usual))
    return make_dataclass("Live", made, frozen=True, namespace={"__doc__": LiveSettings.__doc__})


SHORT = ("pace", "ahead")
"""Settings of a stream that have a short name, too: ``--pace`` for ``--live.pace``."""


@dataclass(frozen=True, kw_only=True)
class LiveOptions(CommonOptions):
    """Follow and identify a mechanism while a camera, a stream or a clip plays.

    Attributes:
        source: Number of a camera, address of a stream, video file or folder of pictures, or - for raw frames
            on the standard input (with --live.size).
        model: Mechanism file (MJCF, URDF), bundled name (see monodyn models), or folder of a run that goes on
            with its mechanism.
        out: Folder for the results, written when the stream ends or at Ctrl-C; nothing is written when left
            out.
        ndjson: One JSON object a frame, in a file, or with - on the standard output.
        view: Serve a page with the stream, the mechanism drawn over it, at this port of this machine (needs
            monodyn[live]); with HOST: to other machines, too.
        force: Replace a run that is already in DIR, and FILE.
        quiet: Show nothing, no table.
        json: The result as JSON on the standard output.
        live: How the stream is read and followed.
    """

    source: Origin
    model: Model = field()
    out: MaybeFolder = None
    ndjson: Lines = None
    view: Where = None
    live: Any = None

    @property
    def name(self) -> str:
        """What the source is called before it is opened."""
        address = "://" in self.source or self.source == "-" or self.source.isdigit()
        return self.source if address else Path(self.source).name

    def live_settings(self) -> LiveSettings:
        """Return the settings of the stream that the options stand for.

        Raises:
            SettingsError: an option cannot be read, or has a value that the settings refuse.
        """
        given = {}
        for name, kind in get_type_hints(LiveSettings).items():
            value = getattr(self.live, name)
            given[name] = FORMS[kind].read(f"live.{name}", value) if kind in FORMS else value
        return LiveSettings(**given)

    def go(self) -> int:
        """Return the exit code after running the command."""
        from monodyn.cli.live import go_live

        return go_live(self)


@dataclass(frozen=True)
class CompletionOptions:
    """Print a script by which a shell completes command lines.

    Attributes:
        shell: The shell.
    """

    shell: conf.Positional[Shell]

    def go(self) -> int:
        """Return the exit code after running the command."""
        print(completion(self.shell, {name: options_class(it) for name, it in COMMANDS.items()}), end="")
        return 0


class Command(NamedTuple):
    """One command.

    Attributes:
        options: The dataclass of the options that it states itself.
        example: A command line that shows its use.
        without: Settings of a run that it does not take.
    """

    options: type[Any]
    example: str
    without: Collection[str] = ()


_OF_CLIP = (
    "roi",
    "time_range",
    "background",
    "masks",
    "points",
    "points_map",
    "points_size",
    "points_axis",
    "distortion",
    "rate",
    "segment",
    "camera",
    "locate",
    "track",
)
"""Settings that a table of joint positions has no use for."""

COMMANDS: dict[str, Command] = {
    "run": Command(RunOptions, "monodyn run clip.mp4 --model double.xml --out run --fit-frames 0:120"),
    "live": Command(
        LiveOptions,
        "monodyn live 0 --model double.xml --view 8000 --out run",
        without=(
            "fit_frames",
            "time_range",
            "until",
            "tolerance",
            "masks",
            "points",
            "points_map",
            "points_size",
            "points_axis",
            "distortion",
            "torques",
            "ensemble",
            "uncertainty",
            "method",
        ),
    ),
    "track": Command(
        TrackOptions,
        "monodyn track clip.mp4 --model double.xml --out run",
        without=(
            "fit_frames",
            "until",
            "tolerance",
            "ensemble",
            "bounds",
            "torques",
            "uncertainty",
            "identify",
        ),
    ),
    "identify": Command(
        IdentifyOptions, "monodyn identify run/poses.csv --model run --out fit", without=_OF_CLIP
    ),
    "predict": Command(
        PredictOptions, "monodyn predict run --from joint1=0.5,joint2=0 --until 5 --out ahead"
    ),
    "control": Command(
        ControlOptions, "monodyn control run --at joint1=1.5708 --actuated slide --out balance"
    ),
    "demo": Command(DemoOptions, "monodyn demo --out demo-run"),
    "warm": Command(WarmOptions, "monodyn warm"),
    "models": Command(ModelsOptions, "monodyn models"),
    "completion": Command(CompletionOptions, "monodyn completion bash"),
    "reproduce": Command(ReproduceOptions, "monodyn reproduce --out experiment"),
}
"""The commands by name."""


def options_class(command: Command) -> type[Any]:
    """Return the options of a command: its own, and those of the settings that it takes.

    Args:
        command: The command.
    """
    if not issubclass(command.options, CommonOptions):
        return command.options
    taken = [setting for setting in fields(RunSettings) if setting.name not in command.without]
    # the classes are looked up at each call, because they depend on which methods are installed
    hints, stages = get_type_hints(RunSettings), settings_classes()
    made = []
    if issubclass(command.options, LiveOptions):
        group = _live_group()
        made.append(("live", group, field(default_factory=group)))
    for setting in taken:
        kind = hints[setting.name]
        if setting.name in stages:
            # a nested class becomes a group of options: --track.reach and the others
            chosen = _without_shared(stages[setting.name])
            made.append((setting.name, chosen, field(default_factory=chosen)))
        else:
            made.append((setting.name, *_option(setting, kind)))
    return make_dataclass(
        command.options.__name__,
        made,
        bases=(command.options,),
        frozen=True,
        kw_only=True,
        namespace={"__doc__": _help(command.options)},
    )


def _option(setting: Field[Any], kind: Any) -> tuple[Any, Any]:
    """Return type and default of the option for a setting of the whole run."""
    metavar, usual = setting.metadata.get("metavar"), setting.default
    # the default in the form of words; its own value comes back when the words are read
    if kind in FORMS:
        form = FORMS[kind]
        kind, usual, metavar = form.words, form.usual, form.metavar
    named = {"name": setting.metadata["name"]} if "name" in setting.metadata else {}
    if metavar is not None:
        named["metavar"] = metavar
    return (Annotated[kind, conf.arg(**named)] if named else kind), usual


def _without_shared(stage: type[Any]) -> type[Any]:
    """Return a stage's settings class whose shared fields are no options: the run has one of each."""
    hidden = [
        (setting.name, Annotated[Any, conf.Fixed, conf.Suppress], setting.default)
        for setting in fields(stage)
        if setting.name in SHARED
    ]
    if not hidden:
        return stage
    # the field stays, so that the stage is built as ever; only the command line does not see it
    namespace = {"__doc__": stage.__doc__}
    return make_dataclass(stage.__name__, hidden, bases=(stage,), frozen=True, namespace=namespace)


def _help(options: type[Any]) -> str:
    """Return the docstring of a command's options with the lines of the settings: the help texts."""
    # tyro takes the help of an option from its line under Attributes of the class
    own, settings = inspect.cleandoc(options.__doc__ or ""), inspect.cleandoc(RunSettings.__doc__ or "")
    return f"{own}\n{settings.partition('Attributes:')[2].strip(chr(10))}\n"
