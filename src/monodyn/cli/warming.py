"""``monodyn warm``, and what is compiled at first use, in two processes.

One of them sees and then identifies, the other one begins with that. The compiler uses one core and keeps
what it has compiled in files, so that the first process finds there what the second one compiled meanwhile:
they share the time about evenly.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from monodyn.cli.demo import CLIP, MODEL
from monodyn.cli.shared import QuietOptions

if TYPE_CHECKING:
    from monodyn.job import Outcome
    from monodyn.types import Progress

NOISE = 1e-3
"""Standard deviation of the positions that are identified [rad]."""
FITTED = 100
"""Frames of the demo clip that are identified; the others are predicted."""


@dataclass(frozen=True, kw_only=True)
class WarmOptions(QuietOptions):
    """Compile what ordinary runs and streams need, once after installing; what is compiled is only loaded."""

    def go(self) -> int:
        """Return the exit code after running the command."""
        began = time.perf_counter()
        with self.progress() as progress:
            warm(progress)
        if not self.quiet:
            print(
                f"Runs and streams are compiled ({time.perf_counter() - began:.0f} s); what only a moving "
                "camera, motion blur or the published method needs still is at first use."
            )
        return 0


@contextmanager
def compiling_beside() -> Iterator[None]:
    """Compile what identification needs in a process of its own while the block goes on."""
    import subprocess

    # the folder is this process's: the other one may be killed
    with (
        tempfile.TemporaryDirectory(prefix="monodyn-") as folder,
        subprocess.Popen(
            [sys.executable, "-m", __name__, folder],
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        ) as child,
    ):  # fmt: skip
        try:
            yield
        finally:
            child.kill()


def warm(progress: Progress | None = None) -> None:
    """Go through a run and a stream of the demo clip, whose compiled functions stay in numba's cache.

    Args:
        progress: Called with the frames done by each step.
    """
    from monodyn import open_source, pipeline, stream

    with tempfile.TemporaryDirectory(prefix="monodyn-") as folder:
        pipeline.run(CLIP, MODEL, Path(folder) / "run", progress=progress)
    for done, _ in enumerate(stream(open_source(CLIP), MODEL), 1):
        if progress is not None:
            progress("live", done, None)


def identify_demo(folder: Path) -> Outcome:
    """Go through the identification of the demo clip's true positions, with noise.

    Args:
        folder: Takes the files.

    Returns:
        What was found.
    """
    import numpy as np

    from monodyn import load, pipeline, write_poses
    from monodyn.settings import RunSettings
    from monodyn.types import Poses

    truth, joints = json.loads(CLIP.with_suffix(".json").read_text(encoding="utf-8")), load(MODEL).joints
    time, position = np.array(truth["times"]), np.array(truth["q"])
    frames, dofs = position.shape
    noisy = position + np.random.default_rng(1).normal(scale=NOISE, size=position.shape)
    covariance = np.tile(NOISE**2 * np.eye(dofs), (frames, 1, 1))
    poses = Poses(
        tuple(joint.name for joint in joints),
        np.arange(frames),
        time,
        noisy,
        covariance,
        np.ones(frames, bool),
    )
    table = folder / "poses.csv"
    write_poses(poses, table)
    settings = RunSettings(fit_frames=(0, FITTED))
    return pipeline.identify_tables([table], MODEL, folder / "run", settings)


def _end_with_parent() -> None:
    """End the process when the one that began it is gone: its end of the pipe is closed then."""
    sys.stdin.read()
    os._exit(0)


if __name__ == "__main__":
    threading.Thread(target=_end_with_parent, daemon=True).start()
    identify_demo(Path(sys.argv[1]))
