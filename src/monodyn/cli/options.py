"""The commands: what each takes in addition to the settings of a run, and what it does.

``table`` makes the options of a command from the fields of its class here and from those of `RunSettings`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from monodyn.cli.controlled import ControlOptions
from monodyn.cli.demo import DemoOptions, ModelsOptions
from monodyn.cli.predicted import PredictOptions
from monodyn.cli.reproduced import ReproduceOptions
from monodyn.cli.shared import ResultOptions
from monodyn.cli.warming import WarmOptions
from monodyn.errors import SettingsError
from monodyn.live.settings import LiveSettings
from monodyn.numbers import is_whole
from monodyn.settings import RunSettings

if TYPE_CHECKING:
    from monodyn.pipeline import Outcome

CLIP: Any = {"metavar": "CLIP", "word": True}
FOLDER: Any = {"metavar": "DIR"}
MODEL: Any = {"metavar": "MODEL", "file": True}
Shell = Literal["bash", "zsh", "fish"]
TAKEN: Any = {"hidden": True}
"""What is known of fields beyond their types; a hidden one is no option."""


@dataclass(frozen=True, kw_only=True)
class CommonOptions(ResultOptions):
    """What every command that takes settings has in common.

    Attributes:
        settings: The settings of the run.
        model: Mechanism file (MJCF, URDF), bundled name (see monodyn models), or folder of a run that goes on
            with its mechanism; ``auto`` tries the bundled ones and takes the one that the evidence prefers.
    """

    settings: RunSettings = field(default_factory=RunSettings, metadata=TAKEN)
    model: str = field(default="auto", metadata=MODEL)

    def show(self, outcome: Outcome) -> int:
        """Return the exit code after what was found has been printed.

        Args:
            outcome: What was found.
        """
        from monodyn.cli.show import show

        return show(outcome, as_json=self.json, quiet=self.quiet)


def clip_of(clip: Path | None, settings: RunSettings) -> Path | None:
    """Return the clip that the user named.

    Args:
        clip: The clip.
        settings: The settings, which may name points or masks in its place.

    Raises:
        SettingsError: nothing is named.
    """
    if clip is None and settings.points is None and settings.masks is None:
        raise SettingsError(
            "clip: expected CLIP, or --points FILE or --masks MASKS in its place, got none; name one."
        )
    return clip


@dataclass(frozen=True, kw_only=True)
class ClipOptions(CommonOptions):
    """What the commands that go through a clip have in common.

    Attributes:
        clip: Video file, or folder of numbered pictures. Next to --points or --masks it gives time stamps,
            size and overlay, and may be left out.
        out: Folder for the results.
    """

    clip: Path | None = field(default=None, metadata=CLIP)
    out: Path = field(metadata=FOLDER)

    def go(self) -> int:
        """Return the exit code after running the command."""
        clip = clip_of(self.clip, self.settings)
        from monodyn import pipeline

        work = pipeline.track_clip if isinstance(self, TrackOptions) else pipeline.run
        with self.progress() as progress:
            outcome = work(clip, self.model, self.out, self.settings, force=self.force, progress=progress)
        return self.show(outcome)


class RunOptions(ClipOptions):
    """Track a clip, identify the mechanism on some of its frames, predict the others, write the run folder.

    Its options are those of every command that goes through a clip.
    """


class TrackOptions(ClipOptions):
    """Track a clip and write poses.csv; slides are in the start scale of the model."""


@dataclass(frozen=True, kw_only=True)
class IdentifyOptions(CommonOptions):
    """Identify a mechanism from tables of joint positions; several tables share its parameters.

    Attributes:
        poses: Tables with columns time [s] and one per joint [rad or m]: poses.csv of a run, or encoder logs.
        out: Folder for the results; nothing is written when left out.
    """

    poses: tuple[Path, ...] = field(default=(), metadata={"metavar": "POSES.csv ...", "word": True})
    out: Path | None = field(default=None, metadata=FOLDER)

    def go(self) -> int:
        """Return the exit code after running the command.

        Raises:
            SettingsError: there is no table.
        """
        if not self.poses:
            raise SettingsError(
                "identify: expected at least one table of joint positions, got none; name a poses.csv."
            )
        from monodyn.pipeline import identify_tables

        with self.progress() as progress:
            outcome = identify_tables(
                self.poses, self.model, self.out, self.settings, force=self.force, progress=progress
            )
        return self.show(outcome)


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
        force: Replace the results that are already in DIR, and lines that are in FILE.
        live: How the stream is read and followed.
    """

    source: str = field(metadata={"metavar": "SOURCE", "word": True, "file": True})
    model: str = field(metadata=MODEL)
    out: Path | None = field(default=None, metadata=FOLDER)
    ndjson: str | None = field(default=None, metadata={"metavar": "FILE", "file": True})
    view: str | None = field(default=None, metadata={"metavar": "[HOST:]PORT"})
    live: LiveSettings = field(default_factory=LiveSettings, metadata=TAKEN)

    @property
    def name(self) -> str:
        """What the source is called before it is opened."""
        address = "://" in self.source or self.source == "-" or is_whole(self.source)
        return self.source if address else Path(self.source).name

    def go(self) -> int:
        """Return the exit code after running the command."""
        from monodyn.cli.live import go_live

        return go_live(self)


@dataclass(frozen=True)
class CompletionOptions:
    """Print a script by which a shell completes command lines.

    Attributes:
        shell: The shell: ``bash``, ``zsh`` or ``fish``.
    """

    shell: Shell = field(metadata={"metavar": "bash|zsh|fish", "word": True})


@dataclass(frozen=True)
class FileOptions:
    """What a command takes whose options may come from a file.

    Attributes:
        config: Take options from a TOML file, such as the run.toml that every run writes: NAME = VALUE by the
            names of options, without dashes. Options on the command line win. Paths in the file start at its
            folder.
    """

    config: Path | None = None


class Command(NamedTuple):
    """One command.

    Attributes:
        options: The dataclass of the options that it states itself.
        example: A command line that shows its use.
        people: Names of the options that most people need, the first ones first, at most ten next to the
            words; the others are listed by ``--help-all`` alone. All of them where it is empty.
        file: Whether its options may come from a file.
    """

    options: type[Any]
    example: str
    people: str = ""
    file: bool = True


COMMANDS: dict[str, Command] = {
    "run": Command(
        RunOptions,
        "monodyn run clip.mp4 --model double.xml --out run --fit-frames 0:120",
        "clip out model fit-frames until fix free roi points config force",
    ),
    "live": Command(
        LiveOptions,
        "monodyn live 0 --model double.xml --view 8000 --out run",
        "source model out view ndjson live.pace live.ahead fix free config force",
    ),
    "track": Command(
        TrackOptions,
        "monodyn track clip.mp4 --model double.xml --out run",
        "clip out model roi time-range fix free points masks config force",
    ),
    "identify": Command(
        IdentifyOptions,
        "monodyn identify run/poses.csv --model run --out fit",
        "poses model out fit-frames until fix free torques identify.torque config force",
    ),
    "predict": Command(
        PredictOptions,
        "monodyn predict run --from joint1=0.5,joint2=0 --until 5 --out ahead",
        "run from rates at until fix out film config force",
    ),
    "control": Command(
        ControlOptions,
        "monodyn control run --at joint1=1.5708 --actuated slide --out balance",
        "run at actuated out swing start limit within rate config force",
    ),
    "demo": Command(DemoOptions, "monodyn demo --out demo-run", file=False),
    "warm": Command(WarmOptions, "monodyn warm", file=False),
    "models": Command(ModelsOptions, "monodyn models", file=False),
    "completion": Command(CompletionOptions, "monodyn completion bash", file=False),
    "reproduce": Command(ReproduceOptions, "monodyn reproduce --out experiment"),
}
"""The commands by name."""
