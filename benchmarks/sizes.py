"""What decoding, background and tracking of a clip cost by the size of its pictures, side by side.

Run for one clip: ``python benchmarks/sizes.py CLIP MODEL REPEATS``, which prints a JSON object; ``speed.py``
does so for every size, each in a process of its own, so that peak memory is that of the size.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import monodyn
from figures import Figure, say
from monodyn.reproduce.clip import ClipSettings, make_clip

FRAMES, FRAMES_4K = 300, 90
"""Frames of a clip that is made: ten seconds, but for 4K, of which every frame costs the same."""
PHONE = 22
"""Constant rate factor at which 4K takes what a phone films it at, 40 Mbit/s; that of the smaller clips (18)
makes 240 Mbit/s of their noise, and two cores decode that at 20 frames a second."""
VERSION = 2
"""To be raised with each change of the clips."""


@dataclass(frozen=True)
class SizedClip:
    """A clip whose pictures have a size of their own.

    Attributes:
        name: Its name in the table.
        model: The mechanism.
        file: The clip.
        limit: Target of decoding and tracking [ms a frame]; None where the ratio to decoding has one.
        memory: Target of the peak memory [MB], or None.
        size: Width and height of a clip that is made when it is not there [px], or None.
        frames: Its frames.
        quality: Its constant rate factor of H.264.
    """

    name: str
    model: str
    file: Path
    limit: float | None = None
    memory: float | None = None
    size: tuple[int, int] | None = None
    frames: int = FRAMES
    quality: int = ClipSettings.quality

    def made(self) -> Path:
        """Return the clip, made on first use."""
        if self.size is not None and not self.file.exists():
            say(f"making {self.name} ...")
            self.file.parent.mkdir(parents=True, exist_ok=True)
            width, height = self.size
            usual = ClipSettings()
            camera = replace(usual.camera, width=width, height=height, focal=700.0 * height / 480)
            part = self.file.with_suffix(".part.mp4")
            settings = replace(usual, camera=camera, frames=self.frames, quality=self.quality)
            # on Linux a process begins with the peak memory of the one that started it: this one stays small
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as another:
                another.submit(make_clip, part, settings).result()
            part.rename(self.file)
        return self.file


def _drawn(width: int, height: int) -> SizedClip:
    """Return a clip of the experiment of 2012 in pictures of a size."""
    home = Path(tempfile.gettempdir()) / "monodyn-clips"
    file = home / f"sizes-{VERSION}-{width}x{height}.mp4"
    return SizedClip(f"{width}x{height}, drawn", "double", file, size=(width, height))


SIZES = (
    _drawn(720, 480),
    _drawn(1280, 720),
    replace(_drawn(3840, 2160), limit=25.0, memory=1000.0, frames=FRAMES_4K, quality=PHONE),
)
"""Clips that are made."""


def sized(clip: SizedClip, repeats: int) -> list[Figure]:
    """Measure one clip in a process of its own.

    Args:
        clip: The clip.
        repeats: Passes of each job.

    Returns:
        Ratios to decoding, milliseconds a frame and memory.
    """
    command = [sys.executable, __file__, str(clip.made()), clip.model, str(repeats)]
    ended = subprocess.run(command, check=True, capture_output=True, text=True)
    found = json.loads(ended.stdout.splitlines()[-1])
    ratio = 1.3 if clip.limit is None else None
    half = 0.5 if clip.limit is None else None
    return [
        Figure(clip.name, "tracking / decoding", found["track"] / found["decode"], "times", ratio),
        Figure(clip.name, "the same, CPU time", found["track_cpu"] / found["decode_cpu"], "times"),
        Figure(clip.name, "background / decoding", found["background"] / found["decode"], "times"),
        Figure(
            clip.name,
            "the same, beyond its pass of decoding",
            found["background"] / found["decode"] - 1.0,
            "times",
            half,
        ),
        Figure(clip.name, "decode", found["decode"], "ms a frame"),
        Figure(clip.name, "track, decoding included", found["track"], "ms a frame", clip.limit),
        Figure(clip.name, "seen", found["seen"], "%"),
        Figure(clip.name, "peak memory", found["memory"], "MB", clip.memory),
    ]


def measured(file: Path, model: str, repeats: int) -> dict[str, float]:
    """Locate, track and measure a clip in this process.

    Args:
        file: The clip.
        model: Its mechanism.
        repeats: Passes of each job, in turn.

    Returns:
        Wall and CPU time by job [ms a frame], share of frames seen [%] and peak memory [MB].
    """
    video = monodyn.read(file)
    scene = monodyn.locate(monodyn.segment(video), monodyn.load(model))
    poses = monodyn.track(scene.masks, scene)
    jobs = {
        "decode": lambda: sum(1 for _ in video.frames()),
        "track": lambda: monodyn.track(scene.masks, scene),
        "background": lambda: monodyn.segment(video),
    }
    wall: dict[str, list[float]] = {name: [] for name in jobs}
    busy: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(repeats):
        for name, job in jobs.items():
            began, cpu = time.perf_counter(), time.process_time()
            job()
            wall[name].append(time.perf_counter() - began)
            busy[name].append(time.process_time() - cpu)
    each = 1e3 / video.count
    found = {name: each * float(np.median(values)) for name, values in wall.items()}
    found |= {f"{name}_cpu": each * float(np.median(values)) for name, values in busy.items()}
    kilobytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024 if sys.platform == "darwin" else 1)
    return found | {"seen": 100.0 * float(poses.seen.mean()), "memory": kilobytes / 1024}


if __name__ == "__main__":
    print(json.dumps(measured(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]))))
