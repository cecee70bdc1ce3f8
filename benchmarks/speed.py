"""Print what Monodyn costs: ratios within one process, and a whole run from a cold one.

Run: ``python benchmarks/speed.py [--only NAME ...] [--against CHECKOUT] [--json FILE] [--gate]``. With
``MONODYN_DATA`` set the clip is ``rendered/double_a.mp4`` there, else the demo clip; pictures of a moving
camera are those of ``rendered/double_drift.mp4``.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import av
import numpy as np

import monodyn
from figures import Figure, command_line, finish, say, table
from monodyn.vision.clip.lens import lens_of
from monodyn.vision.locating.scene import Scene
from monodyn.vision.registration.keys import Registrar
from monodyn.vision.registration.register import camera_path, clean_scene, sampled_path
from monodyn.vision.track import Follower
from sizes import SIZES, SizedClip, sized

ROOT = Path(__file__).parents[1]
BASELINE = ROOT / "benchmarks" / "baseline" / "speed.json"
"""Figures of an earlier run on the bundled clip, with which those of this one are compared."""
FITTED = 40
"""Frames of the fit."""
HELD = 120
"""Frames that are held in memory to time coverage, following and registration alone."""
SAMPLED = 8
"""Every so many of them is a sample of the motion."""
MOVING = "double_drift"
"""Clip of ``MONODYN_DATA`` whose camera moves."""
COLOUR = "double_pendulum.webm"
"""Clip of ``MONODYN_DATA`` of 1280x1024 in colour."""
BEND = (-0.1, 0.02, 0.0, 0.0)
"""Coefficients of a lens."""
EASY = ("double_a", "single", "double_b", "triple", "bob", "cartpole")
"""Clips of ``MONODYN_DATA`` on which whole runs are compared; the first one is for the other figures."""


@dataclass(frozen=True)
class Clip:
    """What is measured on.

    Attributes:
        video: The video file.
        model: Its mechanism file.
    """

    video: Path
    model: Path


class Process(NamedTuple):
    """A process that has ended.

    Attributes:
        wall: Wall time [s].
        cpu: CPU time [s].
        peak: Peak memory [MB].
        code: Exit code.
    """

    wall: float
    cpu: float
    peak: float
    code: int


@dataclass(frozen=True, eq=False)
class Ready:
    """A clip with its scene, everything compiled.

    Attributes:
        video: The clip.
        scene: The mechanism before its camera.
        poses: The whole clip, tracked.
    """

    video: monodyn.Video
    scene: Scene
    poses: monodyn.Poses


def main() -> int:
    """Measure what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``, 2 when the clip is missing.
    """
    # on Linux a process begins with the peak memory of the one that started it: runs come first
    parts = {
        "run": running,
        "import": importing,
        "sizes": picturing,
        "track": tracking,
        "fit": fitting,
        "camera": registering,
    }
    parser = command_line(__doc__, tuple(parts))
    parser.add_argument("--repeats", type=int, default=7, metavar="N", help="repeats of everything (7)")
    parser.add_argument(
        "--against",
        type=Path,
        metavar="CHECKOUT",
        help="run another checkout in turn on the easy clips, and print the ratios alone",
    )
    options = parser.parse_args()
    data = os.environ.get("MONODYN_DATA")
    names = EASY if options.against is not None else EASY[:1]
    stems = (
        [Path(data) / "rendered" / name for name in names]
        if data
        else [ROOT / "src" / "monodyn" / "cli" / "clip" / "double"]
    )
    clips = [Clip(stem.with_suffix(".mp4"), stem.with_suffix(".xml")) for stem in stems]
    for file in (file for clip in clips for file in (clip.video, clip.model)):
        if not file.is_file():
            print(f"speed.py: expected {file}, found none; set MONODYN_DATA or unset it.", file=sys.stderr)
            return 2
    if options.against is not None:
        other = options.against.resolve()
        if not (other / "src" / "monodyn").is_dir():
            print(f"speed.py: --against: expected a checkout with src/monodyn, got {other}.", file=sys.stderr)
            return 2
        figures = []
        for clip in clips:
            say(f"{clip.video.name} ...")
            figures += compared(clip, other, max(options.repeats, 1))
        print(table(figures))
        return finish(figures, to=options.json, gate=options.gate)
    chosen, clip = [name for name in parts if name in (options.only or parts)], clips[0]
    figures = []
    ready = None
    for name in chosen:
        say(f"{name} ...")
        if name in ("track", "fit") and ready is None:
            ready = prepared(clip)
        figures += parts[name](ready if name in ("track", "fit") else clip, max(options.repeats, 1))
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate, baseline=BASELINE)


def prepared(clip: Clip) -> Ready:
    """Locate and track once, which compiles everything.

    Args:
        clip: The clip.

    Returns:
        The tracked clip.
    """
    video = monodyn.read(clip.video)
    scene = monodyn.locate(monodyn.segment(video), monodyn.load(clip.model))
    return Ready(video, scene, monodyn.track(scene.masks, scene))


def tracking(ready: Ready, repeats: int) -> list[Figure]:
    """Compare tracking with decoding alone, pass by pass in turn, and time its parts.

    Args:
        ready: The clip with its scene.
        repeats: Half of the passes of each.

    Returns:
        The ratio to decoding as ``Video.frames`` does it and to libav alone, and milliseconds a frame.
    """
    video, scene = ready.video, ready.scene
    jobs: dict[str, Callable[[], object]] = {
        "libav": lambda: _decode(video.path),
        "decode": lambda: sum(1 for _ in video.frames()),
        "track": lambda: monodyn.track(scene.masks, scene),
        "background": lambda: monodyn.segment(video),
    }
    seconds = _in_turn(jobs, 2 * repeats)
    frames = [frame for frame, _ in zip(video.frames(), range(HELD), strict=False)]
    masks = [scene.masks.of(frame) for frame in frames]
    parts = _in_turn(
        {
            "coverage": lambda: [scene.masks.of(frame) for frame in frames],
            "follow": lambda: _follow(scene, masks),
        },
        repeats,
    )
    case = f"{video.path.name}, {video.width}x{video.height}"
    whole = {name: 1e3 * values / video.count for name, values in seconds.items()}
    each = {name: 1e3 * values / len(frames) for name, values in parts.items()}
    ratio = float(np.median(seconds["track"] / seconds["decode"]))
    fastest = seconds["track"].min() / seconds["decode"].min()
    background = seconds["background"] / seconds["decode"]
    return [
        Figure(case, "tracking / decoding", ratio, "times", 1.3),
        Figure(case, "the same, fastest of each", float(fastest), "times"),
        Figure(
            case, "tracking / libav alone", float(np.median(seconds["track"] / seconds["libav"])), "times"
        ),
        Figure(case, "decode with libav alone", float(np.median(whole["libav"])), "ms a frame"),
        Figure(case, "decode", float(np.median(whole["decode"])), "ms a frame"),
        Figure(case, "track", float(np.median(whole["track"])), "ms a frame"),
        Figure(case, "background / decoding", float(np.median(background)), "times"),
        Figure(
            case, "the same, beyond its pass of decoding", float(np.median(background)) - 1.0, "times", 0.5
        ),
        Figure(case, "background", float(np.median(whole["background"])), "ms a frame"),
        Figure(case, "coverage alone", float(np.median(each["coverage"])), "ms a frame"),
        Figure(case, "follow alone", float(np.median(each["follow"])), "ms a frame"),
    ]


def picturing(clip: Clip, repeats: int) -> list[Figure]:
    """Compare tracking and the background with decoding in pictures of several sizes.

    Args:
        clip: The clip; that of a real pendulum in colour is looked for in a folder beside its own.
        repeats: Passes of each, at most three.

    Returns:
        Ratios to decoding, milliseconds a frame and memory by size, each in a process of its own.
    """
    real = clip.video.parent.parent / "real" / COLOUR
    clips = [*SIZES, *([SizedClip(COLOUR, "double", real, 3.0)] if real.is_file() else [])]
    return [figure for one in clips for figure in sized(one, min(repeats, 3))]


def registering(clip: Clip, repeats: int) -> list[Figure]:
    """Compare the registration of a moving camera's pictures, and a lens, with decoding.

    Args:
        clip: The clip; one of a moving camera beside it takes its place.
        repeats: Passes of each.

    Returns:
        The ratio to decoding, and milliseconds a frame of finding the camera, of putting the pictures in
        place, and of a lens.
    """
    moving = clip.video.with_stem(MOVING)
    video = monodyn.read(moving if moving.is_file() else clip.video)
    frames = [frame for frame, _ in zip(video.frames(), range(HELD), strict=False)]
    samples, size = frames[::SAMPLED], (video.width, video.height)
    known, path = sampled_path(samples, size, video.count), camera_path(video, samples)
    assert path is not None
    key, lens = clean_scene(samples, known).key, lens_of(BEND, float(video.width), *size)

    def found() -> None:
        registrar = Registrar(size, key)
        for frame in frames:
            registrar.add(frame, known.at(frame.index))

    seconds = _in_turn(
        {
            "decode": lambda: sum(1 for _ in video.frames(0, len(frames))),
            "found": found,
            # as they stream: none is kept
            "placed": lambda: sum(path.steady(frame) is not None for frame in frames),
            "lens": lambda: sum(lens.frame(frame) is not None for frame in frames),
        },
        repeats,
    )
    case = f"{video.path.name}, {video.width}x{video.height}"
    each = {name: 1e3 * float(np.median(values)) / len(frames) for name, values in seconds.items()}
    both = seconds["found"] + seconds["placed"]
    ratio = float(np.median(both / seconds["decode"]))
    return [
        Figure(case, "registration / decoding", ratio, "times"),
        Figure(case, "registration", 1e3 * float(np.median(both)) / len(frames), "ms a frame", 1.5),
        Figure(case, "of it to find the camera", each["found"], "ms a frame"),
        Figure(case, "of it to put pictures in place", each["placed"], "ms a frame"),
        Figure(case, "a lens made straight", each["lens"], "ms a frame"),
        Figure(case, "decode", each["decode"], "ms a frame"),
    ]


def fitting(ready: Ready, repeats: int) -> list[Figure]:
    """Time the fit of the first frames with one start, and a prediction as long.

    Args:
        ready: The tracked clip.
        repeats: Number of fits.

    Returns:
        The times of a fit and of a prediction.
    """
    poses, mechanism = ready.poses[:FITTED], ready.scene.mechanism
    settings = monodyn.IdentifySettings(starts=1)
    fit = monodyn.identify(poses, mechanism, settings)
    times = ready.video.times[FITTED : 2 * FITTED]
    monodyn.predict(fit, times=times)
    seconds = _in_turn(
        {
            "fit": lambda: monodyn.identify(poses, mechanism, settings),
            "predict": lambda: monodyn.predict(fit, times=times),
        },
        2 * repeats,
    )
    case = f"{FITTED} frames of {ready.video.path.name}"
    return [
        Figure(
            case, "all of identify, one start, compiled", 1e3 * float(np.median(seconds["fit"])), "ms", 33.0
        ),
        Figure(case, "the same, fastest", 1e3 * float(seconds["fit"].min()), "ms"),
        Figure(case, "prediction with its spread", 1e3 * float(np.median(seconds["predict"])), "ms"),
    ]


def running(clip: Clip, repeats: int) -> list[Figure]:
    """Time ``monodyn run`` in processes of its own, on a clip and on its first frames.

    Args:
        clip: The clip.
        repeats: Runs are repeated up to three times.

    Returns:
        Wall time, CPU time and peak memory of a run.
    """
    with tempfile.TemporaryDirectory() as folder:
        begin = _begin_of(clip.video, FITTED, Path(folder) / f"begin{clip.video.suffix}")
        return [*_runs(clip.video, clip, repeats, 3.0), *_runs(begin, clip, repeats, 2.0)]


def _begin_of(video: Path, frames: int, place: Path) -> Path:
    """Copy the first frames of a clip as they are encoded; return where they are."""
    with av.open(str(video)) as whole, av.open(str(place), "w") as begin:
        stream = whole.streams.video[0]
        copied = begin.add_stream_from_template(stream)
        for packet in islice(whole.demux(stream), frames):
            packet.stream = copied
            begin.mux(packet)
    return place


def _runs(video: Path, clip: Clip, repeats: int, wanted: float) -> list[Figure]:
    """Time runs on a clip with the model of another; the first only fills the compile cache."""
    seconds, busy, peaks = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        arguments = ["run", str(video), "--model", str(clip.model)]
        for i in range(1 + min(repeats, 3)):
            ended = _process([*monodyn_command(), *arguments, "--out", f"{folder}/{i}", "--quiet"])
            if i > 0:
                seconds.append(ended.wall)
                busy.append(ended.cpu)
                peaks.append(ended.peak)
    case = f"monodyn run {clip.video.name}, {monodyn.read(video).count} frames"
    return [
        Figure(case, "wall time, cold process, warm cache", float(np.median(seconds)), "s", wanted),
        Figure(case, "the same, fastest", float(np.min(seconds)), "s"),
        Figure(case, "CPU time", float(np.median(busy)), "s"),
        Figure(case, "peak memory", max(peaks), "MB", 400.0),
    ]


def compared(clip: Clip, other: Path, repeats: int) -> list[Figure]:
    """Time whole runs of this source and of another checkout's in turn, after one of each for the cache.

    Args:
        clip: The clip.
        other: Folder of the other checkout, whole.
        repeats: Runs of each.

    Returns:
        The ratios of wall and CPU time, and the seconds of both.

    Raises:
        SystemExit: One of them ended otherwise than the other, or failed.
    """
    sources = {"this": ROOT / "src", "other": other / "src"}
    found: dict[str, list[Process]] = {name: [] for name in sources}
    with tempfile.TemporaryDirectory() as folder:
        arguments = ["run", str(clip.video), "--model", str(clip.model), "--force", "--quiet"]
        for _ in range(1 + repeats):
            for name, source in sources.items():
                command = [*monodyn_command(), *arguments, "--out", f"{folder}/{name}"]
                found[name].append(_process(command, {"PYTHONPATH": str(source)}))
    codes = {name: {run.code for run in found[name]} for name in sources}
    if codes["this"] != codes["other"]:
        # a run that is refused early is no faster
        raise SystemExit(f"speed.py: {clip.video.name} ended with different exit codes: {codes}.")
    this, before = (np.array([run[:2] for run in found[name][1:]]) for name in ("this", "other"))
    ratio = np.median(this, axis=0) / np.median(before, axis=0)
    case = f"{clip.video.stem}, against {other.name}"
    return [
        Figure(case, "wall time, ratio of the medians", float(ratio[0]), "times", 1.1),
        Figure(case, "CPU time, ratio of the medians", float(ratio[1]), "times"),
        Figure(case, "wall time of this one", float(np.median(this[:, 0])), "s"),
        Figure(case, "wall time of the other", float(np.median(before[:, 0])), "s"),
    ]


def importing(_: Clip, repeats: int) -> list[Figure]:
    """Time ``import monodyn``, and commands that compute nothing, in processes of their own.

    Args:
        repeats: Number of processes.

    Returns:
        The time of an import, and of each command.
    """
    code = "import time; t = time.perf_counter(); import monodyn; print(time.perf_counter() - t)"
    # the first ones compile
    _process([*monodyn_command(), "models"])
    found = [
        float(
            subprocess.run(
                [sys.executable, "-c", code], check=True, capture_output=True, text=True, env=as_installed()
            ).stdout
        )
        for _ in range(repeats)
    ]
    figures = [Figure("import monodyn", "median", float(np.median(found)), "s", 0.3)]
    for words in ("--help", "run --help", "models"):
        walls = [_process([*monodyn_command(), *words.split()]).wall for _ in range(repeats)]
        figures.append(Figure(f"monodyn {words}", "median", float(np.median(walls)), "s", 0.3))
    return figures


def _in_turn(jobs: dict[str, Callable[[], object]], repeats: int) -> dict[str, np.ndarray]:
    """Run the jobs in turn, so that what slows the machine down slows all of them; seconds, (repeat,)."""
    seconds = {name: np.zeros(repeats) for name in jobs}
    for i in range(repeats):
        for name, job in jobs.items():
            began = time.perf_counter()
            job()
            seconds[name][i] = time.perf_counter() - began
    return seconds


def _decode(path: Path) -> int:
    """Decode a clip with libav, pictures not looked at."""
    import av

    with av.open(str(path)) as container:
        container.streams.video[0].thread_type = "AUTO"
        return sum(1 for _ in container.decode(video=0))


def _follow(scene: Scene, masks: list[monodyn.Mask]) -> None:
    follower = Follower(scene, monodyn.TrackSettings())
    for mask in masks:
        follower.step(mask)


def monodyn_command() -> list[str]:
    """Return the command of this interpreter's monodyn."""
    return [sys.executable, "-c", "import sys; from monodyn.cli import main; sys.exit(main())"]


def as_installed() -> dict[str, str]:
    """Return the environment in which a process finds its modules compiled to bytecode, as once installed."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def _process(command: list[str], more: dict[str, str] | None = None) -> Process:
    """Run a command to its end, with further variables of its environment."""
    began = time.perf_counter()
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, env={**as_installed(), **(more or {})})
    _, status, usage = os.wait4(child.pid, 0)
    wall = time.perf_counter() - began
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode not in (0, 1):
        raise SystemExit(f"speed.py: monodyn run ended with exit code {child.returncode}.")
    kilobytes = usage.ru_maxrss / (1024.0 if sys.platform == "darwin" else 1.0)
    return Process(wall, usage.ru_utime + usage.ru_stime, kilobytes / 1024.0, child.returncode)


if __name__ == "__main__":
    raise SystemExit(main())
