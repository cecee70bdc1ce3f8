"""The whole experiment: from clips, given or made, to poses and fits by both methods, and to one page."""

from __future__ import annotations

import shutil
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from monodyn.errors import SettingsError
from monodyn.reproduce.cases import Case
from monodyn.reproduce.claims import Claim, claims
from monodyn.reproduce.clip import ClipSettings, film, simulated, truth_document
from monodyn.reproduce.figures import (
    Column,
    Figure,
    case_figure,
    frames_figure,
    periods_figure,
    poses_figure,
)
from monodyn.reproduce.given import GivenClip, given_truth
from monodyn.reproduce.page import PageContent, page_text, picture_rows
from monodyn.reproduce.pendulums import drawn_clip
from monodyn.reproduce.plans import FILTERED, Design
from monodyn.reproduce.repetition import START, Repetition, Trying, each, tried
from monodyn.reproduce.tables import WORDS, csv_text, document, main_cases
from monodyn.reproduce.truth import Truth
from monodyn.reproduce.units import units_of
from monodyn.reproduce.vision import BOTH_METHODS, TITLES
from monodyn.reproduce.vision_figures import filtered_states, history_figure, starts_figure, states_figure
from monodyn.results.export import json_text
from monodyn.results.folder import FolderKind, RunFolder
from monodyn.results.log import versions
from monodyn.results.run_toml import RUN_TOML, command_toml
from monodyn.typed import check_fields
from monodyn.types import Frame, Progress
from monodyn.vision.clip.video import Video, read

EXPERIMENT_FILES = (
    "clip.mp4", "truth.json", "start.xml", "table.csv", "reproduce.json", "reproduce.html", RUN_TOML,
)  # fmt: skip
"""Names of the files of an experiment."""
EXPERIMENT = FolderKind("experiment", EXPERIMENT_FILES, whole=True)
MOST_SEEDS = 20
"""Pendulums of one experiment at most."""
FEWER_STARTS = 5
"""Drawn start values with every pendulum but the first."""
SHOWN_FRAMES = 4
"""Number of frames whose pictures are shown."""
CAPTIONS = {
    "6": "As Figure 7, but fitted to the filtered states, which are shown in place of the poses, in both "
    "readings of the filter. The default method does not filter.",
    "I": "The form of the friction torque is known. The frames after the shaded ones are predicted.",
    "II": "The torque of each joint is a Fourier series, whose period is estimated from the poses of the "
    "fitted frames alone. Published form: the series alone; the default method's: with friction in addition "
    "to it.",
    "III": "One torque for each joint and time stamp. After the fitted frames none acts, because nothing "
    "determines it there. Published form: the torques alone; the default method's: with friction in "
    "addition to them.",
}


@dataclass(frozen=True)
class ReproduceSettings:
    """What the experiment does.

    Attributes:
        clip: What the clip shows, when it is made.
        design: What is fitted.
        seeds: Pendulums: the usual one, then drawn ones; a given clip is one.
        processes: Processes that work side by side.
    """

    clip: ClipSettings = field(default_factory=ClipSettings)
    design: Design = field(default_factory=Design)
    seeds: int = 1
    processes: int = 1

    def __post_init__(self) -> None:
        check_fields(self, "reproduce")
        if not 1 <= self.seeds <= MOST_SEEDS:
            raise SettingsError(f"seeds: expected 1 to {MOST_SEEDS}, got {self.seeds}; give another number.")


@dataclass(frozen=True, eq=False)
class Experiment:
    """What came out.

    Attributes:
        folder: Where the files are.
        repetitions: The experiment with each pendulum.
        claims: The claims with their verdicts.
        seconds: Wall time [s].
        notes: What one should know about the folder, in sentences.
    """

    folder: Path
    repetitions: Sequence[Repetition]
    claims: Sequence[Claim]
    seconds: float
    notes: Sequence[str] = ()


def reproduce(
    out: str | Path,
    settings: ReproduceSettings | None = None,
    *,
    given: GivenClip | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Experiment:
    """Repeat the experiment of the 2012 paper with the published and with the default method.

    Writes ``reproduce.html``, ``reproduce.json``, ``table.csv`` and ``run.toml``; where the clip is made
    also ``clip.mp4``, ``truth.json`` and ``start.xml``, the mechanism file that the methods are given.

    Args:
        out: The folder.
        settings: What the clip shows and what is fitted.
        given: A clip in place of the made ones.
        force: Replace an experiment that is already in ``out``.
        progress: Called with the steps done.

    Returns:
        What came out; what failed stands in the table with its status.

    Raises:
        SettingsError: the folder cannot be used.
        MechanismError: the model of a given clip cannot be used.
        VideoError: a given clip or its truth cannot be used.

    Example:
        >>> reproduce("experiment")  # doctest: +SKIP
    """
    settings, began = settings or ReproduceSettings(), time.perf_counter()
    inputs = () if given is None else (given.clip, given.model, given.truth)
    folder = RunFolder(out, force=force, inputs=inputs, kind=EXPERIMENT)
    with folder.filling(), TemporaryDirectory() as spare:
        if given is None:
            made = _made(folder, Path(spare), settings, progress)
        else:
            made = [(Path(given.clip), given.model, None, given_truth(given))]
        found = _repeated(made, settings, progress)
        judged = claims([repetition.evidence for repetition in found])
        whole = Experiment(folder.path, found, judged, time.perf_counter() - began, folder.notes)
        _write_run_toml(folder, settings, given)
        _write(folder, whole, settings)
    return whole


def _write_run_toml(folder: RunFolder, settings: ReproduceSettings, given: GivenClip | None) -> None:
    """Write ``run.toml``, unless a program chose what the command has no options for."""
    seed = settings.clip.seed
    if (settings.clip, settings.design) != (ClipSettings(seed=seed), Design(seed=seed)):
        return
    files = {} if given is None else {"clip": given.clip, "model": given.model, "truth": given.truth}
    counted = {"seeds": settings.seeds} if given is None else {}
    folder.write_text(RUN_TOML, command_toml("reproduce", {**files, "seed": seed, **counted}))


Made = tuple[Path, str | Path, ClipSettings | None, Truth | None]
"""A clip, the model that the methods are given, how the clip was made and its truth."""


def _made(
    folder: RunFolder, spare: Path, settings: ReproduceSettings, progress: Progress | None
) -> list[Made]:
    """Make the clips; that of the first pendulum, its truth and the mechanism file belong to the folder."""
    chosen = [drawn_clip(settings.clip, number) for number in range(settings.seeds)]
    truths = [simulated(clip) for clip in chosen]
    folder.write_text("truth.json", json_text(truth_document(truths[0], chosen[0])))
    folder.write_text("start.xml", START)
    paths = [spare / f"clip{number}.mp4" for number in range(settings.seeds)]
    jobs = [Filming(path, truth, clip) for path, truth, clip in zip(paths, truths, chosen, strict=True)]
    list(each(filmed, jobs, settings.processes, progress))
    folder.write("clip.mp4", lambda path: shutil.copyfile(paths[0], path) and None)
    paths[0] = folder.stage / "clip.mp4"
    model = folder.stage / "start.xml"
    return [(path, model, clip, truth) for path, clip, truth in zip(paths, chosen, truths, strict=True)]


@dataclass(frozen=True, eq=False)
class Filming:
    """A clip to be made.

    Attributes:
        path: The film to write.
        truth: The motion.
        settings: What it shows.
    """

    path: Path
    truth: Truth
    settings: ClipSettings


def filmed(job: Filming, progress: Progress | None = None) -> None:
    """Paint and encode a clip.

    Args:
        job: Which.
        progress: Called with the frames painted.
    """
    film(job.path, job.truth, job.settings, progress=progress)


def _repeated(
    made: Sequence[Made], settings: ReproduceSettings, progress: Progress | None
) -> list[Repetition]:
    """Try both methods on every clip, in several processes where there are several pendulums."""
    todo: list[Trying] = []
    # a single pendulum stays in this process, where the progress of its steps can be shown
    processes = settings.processes if len(made) > 1 else 1
    for number, (clip, model, _, truth) in enumerate(made):
        # published fits of torques over time take most of the time: both ways with the first pendulum alone
        fewer = replace(settings.design, starts=min(FEWER_STARTS, settings.design.starts), both_ways=False)
        design = fewer if number else settings.design
        todo += [Trying(method, clip, model, truth, design, processes) for method in BOTH_METHODS]
    # what takes longer comes first, so that no process is left with it at the end
    todo.sort(key=lambda trying: BOTH_METHODS.index(trying.method))
    found = list(each(tried, todo, processes, progress))
    pairs = [found[i :: len(made)] for i in range(len(made))]
    return [
        Repetition(_name(number, clip, own), clip, own, truth, dict(zip(BOTH_METHODS, pair, strict=True)))
        for number, ((clip, _, own, truth), pair) in enumerate(zip(made, pairs, strict=True))
    ]


def _name(number: int, clip: Path, settings: ClipSettings | None) -> str:
    """Return what a pendulum is called: sizes of a drawn one, the file of a given clip."""
    if settings is None:
        return clip.name
    rods = settings.pendulum
    sizes = " and ".join(f"{1e3 * length:.0f} mm" for length in rods.length)
    return f"pendulum {number}{', the usual one' if number == 0 else ''}: {sizes}"


def _write(folder: RunFolder, whole: Experiment, settings: ReproduceSettings) -> None:
    """Write the table, the document and the page."""
    first = whole.repetitions[0]
    folder.write_text("table.csv", csv_text(whole.repetitions))
    head = {
        "clip": first.clip.name,
        "truth": first.truth is not None,
        "seconds": round(whole.seconds, 2),
        "settings": asdict(settings),
        "versions": versions(),
    }
    folder.write_text("reproduce.json", json_text({**head, **document(whole.repetitions, whole.claims)}))
    folder.write_text("reproduce.html", page_text(_content(whole)))


def _content(whole: Experiment) -> PageContent:
    """Collect what the page shows."""
    first = whole.repetitions[0]
    video = read(first.clip)
    design, length = first.evidence["paper"].design, float(video.times[-1] - video.times[0])
    count = len(whole.repetitions)
    what = (
        f"aluminium double pendulum{'s' * (count > 1)} of known truth, made by MuJoCo"
        if first.settings is not None
        else f"the clip {first.clip.name}"
    )
    subtitle = (
        f"{f'{count} clips of ' if count > 1 else ''}{video.count} frames of {video.width} × "
        f"{video.height} px "
        f"over {length:.2f} s: {what}. Frames 0 to {design.frames - 1} are fitted, the next {design.ahead} "
        "predicted, by the published and by the default method."
    )
    if count > 1:
        subtitle += " Figures show pendulum 0 where they do not name others; tables and verdicts all."
    stated = {"time": f"{whole.seconds:.1f} s for everything", "clip": first.clip.name, **versions()}
    for repetition in whole.repetitions:
        if repetition.settings is not None:
            values = asdict(repetition.settings.pendulum).items()
            stated[repetition.name] = ", ".join(f"{name} {_shown(value)}" for name, value in values)
    seen = {method: first.evidence[method].seen for method in BOTH_METHODS}
    pictures = picture_rows(_frames(video, design.frames), seen)
    return PageContent(
        subtitle, whole.repetitions, whole.claims, figures(whole.repetitions), pictures, stated
    )


def _shown(value: float | tuple[float, ...]) -> str:
    """Write a number or several with four digits."""
    return " and ".join(f"{v:.4g}" for v in (value if isinstance(value, tuple) else (value,)))


def _frames(video: Video, stop: int) -> list[Frame]:
    """Return a few frames spread over the fitted ones."""
    # decoding stops after the last one: the rest of the clip is not shown
    wanted = {round(i * (stop - 1) / (SHOWN_FRAMES - 1)) for i in range(SHOWN_FRAMES)}
    found = []
    for frame in video.frames():
        if frame.index in wanted:
            found.append(frame)
        if frame.index >= stop:
            break
    return found


def figures(repetitions: Sequence[Repetition]) -> list[Figure]:
    """Return the counterparts of the paper's figures: of the first pendulum, or of all compared.

    Args:
        repetitions: The experiment with each pendulum.
    """
    first = repetitions[0]
    evidence = first.evidence
    found: list[Figure | None] = [history_figure(evidence["paper"].seen.frameworks)]
    shown = next((evidence[m] for m in BOTH_METHODS if evidence[m].seen.poses is not None), None)
    if shown is not None:
        found.append(states_figure(shown, first.truth))
    found += [starts_figure(repetitions), *_case_figures(first), frames_figure(evidence)]
    found.append(periods_figure(repetitions))
    if first.truth is not None:
        found.append(poses_figure(evidence))
    return [figure for figure in found if figure is not None]


def _case_figures(first: Repetition) -> list[Figure]:
    """Return Figures 6 to 9."""
    published = first.evidence["paper"]
    units, design = units_of(published.seen.joints), published.design
    columns = []
    for compared, reading in FILTERED.items():
        case = published.case(compared=compared)
        if case is not None:
            states = filtered_states(published.seen, design, compared).position
            columns.append(Column(f"published, {reading}", case, states))
    title = "Figure 6: Case I with filtered states"
    found = [case_figure(title, CAPTIONS["6"], columns, units, design)]
    for title, name in (
        ("Figure 7: Case I, friction", "I"),
        ("Figure 8: Case II, Fourier series", "II"),
        ("Figure 9: Case III, free torque", "III"),
    ):
        made = [case for case in main_cases(first) if case.plan.case == name and case.motion is not None]
        columns = [Column(_column(case), case) for case in made if case.plan.compared == "measured"]
        found.append(case_figure(title, CAPTIONS[name], columns, units, design))
    return found


def _column(case: Case) -> str:
    """Return the heading of a fit's column."""
    way = f", {WORDS[case.plan.series]}" if case.plan.series else ""
    return f"{TITLES[case.plan.method]}{way}"
