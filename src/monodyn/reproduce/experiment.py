"""The whole experiment: from a clip, given or made, to poses and fits by both methods, and to one page."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from monodyn.errors import MechanismError, SettingsError, VideoError
from monodyn.mechanism import Mechanism, load
from monodyn.paper.filter import Gains
from monodyn.reproduce.cases import Case, Design, run_cases
from monodyn.reproduce.claims import Claim, Evidence, claims
from monodyn.reproduce.clip import ClipSettings, Truth, film, simulated, truth_document
from monodyn.reproduce.figures import (
    Figure,
    case_figure,
    frames_figure,
    history_figure,
    poses_figure,
    states_figure,
)
from monodyn.reproduce.page import PageContent, page_text, picture_rows
from monodyn.reproduce.tables import csv_text, document
from monodyn.reproduce.vision import BOTH_METHODS, Seen, aligned, see
from monodyn.results.export import json_text
from monodyn.results.folder import FolderKind, RunFolder
from monodyn.results.log import versions
from monodyn.stages import segment
from monodyn.types import Frame, Progress
from monodyn.vision.clip.video import Video, read

START = """<mujoco model="double">
  <!-- The topology of the clip. Every size is wrong on purpose: the methods find the true ones. -->
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body name="link1">
      <joint name="joint1" type="hinge" axis="0 -1 0" damping="0.001"/>
      <geom type="box" size="0.05 0.002 0.01" pos="0.05 0 0" density="2700"/>
      <body name="link2" pos="0.1 -0.006 0">
        <joint name="joint2" type="hinge" axis="0 -1 0" damping="0.001"/>
        <geom type="box" size="0.05 0.002 0.01" pos="0.05 0 0" density="2700"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
"""The mechanism file that both methods are given."""
EXPERIMENT_FILES = ("clip.mp4", "truth.json", "start.xml", "table.csv", "reproduce.json", "reproduce.html")
"""Names of the files of an experiment."""
EXPERIMENT = FolderKind("experiment", EXPERIMENT_FILES, whole=True)
SHOWN_FRAMES = 4
"""Number of frames whose pictures are shown."""
CAPTIONS = {
    "I": "The form of the friction torque is known. The frames after the shaded ones are predicted.",
    "filtered": "As Figure 7, but fitted to the filtered states; the default method does not filter.",
    "II": "The torque of each joint is a Fourier series. Its period is estimated from the poses beforehand: "
    "from those of the whole clip where the fitted frames are too few.",
    "III": "One torque for each joint and time stamp. After the fitted frames none acts, because nothing "
    "determines it there.",
}


@dataclass(frozen=True)
class ReproduceSettings:
    """What the experiment does.

    Attributes:
        clip: What the clip shows, when it is made.
        design: What is fitted.
    """

    clip: ClipSettings = field(default_factory=ClipSettings)
    design: Design = field(default_factory=Design)


@dataclass(frozen=True, eq=False)
class Experiment:
    """What came out.

    Attributes:
        folder: Where the files are.
        seen: What each method saw.
        cases: The fits.
        claims: The claims with their verdicts.
        joints: Joint names.
        seconds: Wall time [s].
    """

    folder: Path
    seen: Mapping[str, Seen]
    cases: Sequence[Case]
    claims: Sequence[Claim]
    joints: tuple[str, ...]
    seconds: float


def reproduce(
    out: str | Path,
    settings: ReproduceSettings | None = None,
    *,
    clip: str | Path | None = None,
    model: str | Path | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Experiment:
    """Repeat the experiment of the 2012 paper with the published and with the default method.

    Writes ``reproduce.html``, ``reproduce.json`` and ``table.csv``; where the clip is made also ``clip.mp4``,
    ``truth.json`` and ``start.xml``, the mechanism file that the methods are given.

    Args:
        out: The folder.
        settings: What the clip shows and what is fitted.
        clip: A clip of a pendulum in place of the made one; its truth is not known. None makes one.
        model: The mechanism in that clip.
        force: Replace an experiment that is already in ``out``.
        progress: Called with the steps done.

    Returns:
        What came out; what failed stands in the table with its status.

    Raises:
        SettingsError: only one of clip and model is given, or the folder cannot be used.
        MechanismError: the model cannot be used, or has joints other than hinges.
        VideoError: the clip cannot be used, or has too few frames.

    Example:
        >>> reproduce("experiment")  # doctest: +SKIP
    """
    settings, began = settings or ReproduceSettings(), time.perf_counter()
    if (clip is None) != (model is None):
        given, other = ("clip", "model") if model is None else ("model", "clip")
        raise SettingsError(
            f"reproduce: expected --clip and --model together, got --{given} alone; add --{other}."
        )
    folder, truth = RunFolder(out, force=force, inputs=(clip, model), kind=EXPERIMENT), None
    with folder.filling():
        if clip is None or model is None:
            clip, model, truth = _made(folder, settings.clip, progress)
        video, mechanism = opened(clip, model, settings.design)
        seen, cases = _run(video, mechanism, truth, settings.design, progress)
        joints = tuple(joint.name for joint in mechanism.joints)
        judged, seconds = claims(seen, cases, settings.design), time.perf_counter() - began
        made = Experiment(folder.path, seen, cases, judged, joints, seconds)
        _write(folder, made, video, truth, settings)
    return made


def _run(
    video: Video, mechanism: Mechanism, truth: Truth | None, design: Design, progress: Progress | None
) -> tuple[dict[str, Seen], list[Case]]:
    """Find poses and fits with both methods, from the same masks."""
    # the same foreground for both, so that they differ in nothing but the method
    masks, gains = segment(video, progress=progress), Gains.of(design.gains)
    seen = {method: see(method, masks, mechanism, truth, gains, progress) for method in BOTH_METHODS}
    return seen, run_cases(seen, truth, design, progress)


def _made(folder: RunFolder, settings: ClipSettings, progress: Progress | None) -> tuple[Path, Path, Truth]:
    """Make the clip, its truth and the mechanism file."""
    truth = simulated(settings)
    folder.write("clip.mp4", lambda path: film(path, truth, settings, progress=progress))
    folder.write_text("truth.json", json_text(truth_document(truth, settings)))
    folder.write_text("start.xml", START)
    return folder.stage / "clip.mp4", folder.stage / "start.xml", truth


def opened(clip: str | Path, model: str | Path, design: Design) -> tuple[Video, Mechanism]:
    """Return the opened clip and the mechanism.

    Args:
        clip: Video file or folder of pictures.
        model: Mechanism file or bundled name.
        design: Frames that are needed.

    Raises:
        MechanismError: the model cannot be used, or has joints other than hinges.
        VideoError: the clip cannot be used, or has too few frames.
    """
    mechanism, video = load(model), read(clip)
    other = [joint.name for joint in mechanism.joints if joint.kind != "hinge"]
    if other:
        raise MechanismError(
            f"mechanism '{mechanism.name}': expected hinges alone, got the slide '{other[0]}'; "
            "use monodyn run --method paper."
        )
    if video.count < design.frames + 1:
        raise VideoError(
            f"clip '{clip}': expected more than {design.frames} frames, got {video.count}; "
            "give a longer clip."
        )
    return video, mechanism


def _write(
    folder: RunFolder, made: Experiment, video: Video, truth: Truth | None, settings: ReproduceSettings
) -> None:
    """Write the table, the document and the page."""
    folder.write_text("table.csv", csv_text(made.cases, made.joints))
    found = document(made.seen, made.cases, made.claims, made.joints)
    head = {
        "clip": video.path.name,
        "truth": truth is not None,
        "seconds": round(made.seconds, 2),
        "settings": asdict(settings),
        "versions": versions(),
    }
    folder.write_text("reproduce.json", json_text({**head, **found}))
    folder.write_text("reproduce.html", page_text(_content(made, video, truth, settings)))


def _content(made: Experiment, video: Video, truth: Truth | None, settings: ReproduceSettings) -> PageContent:
    """Collect what the page shows."""
    design, length = settings.design, float(video.times[-1] - video.times[0])
    what = (
        "an aluminium double pendulum of known truth, made by MuJoCo"
        if truth
        else f"the clip {video.path.name}"
    )
    subtitle = (
        f"{video.count} frames of {video.width} × {video.height} px over {length:.2f} s: {what}. Frames 0 to "
        f"{design.frames - 1} are fitted, the next {design.ahead} predicted, by the published and by the "
        "default method."
    )
    stated = {
        "time": f"{made.seconds:.1f} s for everything",
        "clip": video.path.name,
        **versions(),
    }
    if truth is not None:
        stated["truth"] = ", ".join(f"{name} {value}" for name, value in asdict(truth.pendulum).items())
    shown = _frames(video, design.frames)
    return PageContent(
        subtitle,
        made.seen,
        made.cases,
        made.claims,
        figures(made.seen, made.cases, truth, design),
        picture_rows(shown, made.seen),
        made.joints,
        stated,
    )


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


def figures(
    seen: Mapping[str, Seen], cases: Sequence[Case], truth: Truth | None, design: Design
) -> list[Figure]:
    """Return the counterparts of the paper's figures.

    Args:
        seen: What each method saw.
        cases: The fits.
        truth: The true motion, or None.
        design: What was fitted.
    """
    evidence = {
        method: Evidence(seen[method], [c for c in cases if c.plan.method == method], design)
        for method in BOTH_METHODS
    }
    found: list[Figure | None] = [history_figure(seen["paper"])]
    filtering = next((seen[m] for m in BOTH_METHODS if seen[m].states is not None), None)
    if filtering is not None and filtering.poses is not None:
        true = None if truth is None else aligned(truth.position, filtering.poses.position)
        rates = None if truth is None else truth.velocity
        found.append(states_figure(filtering, true, rates, design))
    shown = (
        ("Figure 6: Case I with filtered states", "filtered", "I", "filtered"),
        ("Figure 7: Case I, friction", "I", "I", "measured"),
        ("Figure 8: Case II, Fourier series", "II", "II", "measured"),
        ("Figure 9: Case III, free torque", "III", "III", "measured"),
    )
    for title, caption, name, states in shown:
        fits: dict[str, Any] = {method: evidence[method].case(name, states) for method in BOTH_METHODS}
        found.append(case_figure(title, CAPTIONS[caption], fits, seen, design))
    found.append(frames_figure(evidence))
    if truth is not None:
        found.append(poses_figure(seen))
    return [figure for figure in found if figure is not None]
