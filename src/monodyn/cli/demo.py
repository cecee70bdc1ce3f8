"""``monodyn demo``: the main job on the clip that is installed with the program; ``monodyn warm``: the same
where nobody looks, so that what an ordinary clip needs is compiled; ``monodyn models``: the mechanisms that
are installed with it."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from monodyn.cli.shared import QuietOptions, ResultOptions

if TYPE_CHECKING:
    from monodyn.types import Progress

CLIP = Path(__file__).parent / "clip" / "double.mp4"
"""A double pendulum before a wall, with ``double.xml`` and the truth in ``double.json`` beside it."""
MODEL = CLIP.with_suffix(".xml")


@dataclass(frozen=True, kw_only=True)
class DemoOptions(ResultOptions):
    """Run the clip of a double pendulum that is installed with the program, as ``monodyn run`` does.

    Attributes:
        out: Folder for the results.
    """

    out: Path = field(default=Path("demo-run"), metadata={"metavar": "DIR"})

    def go(self) -> int:
        """Return the exit code after running the command."""
        from monodyn import pipeline
        from monodyn.cli.show import show

        with self.progress() as progress:
            outcome = pipeline.run(CLIP, MODEL, self.out, force=self.force, progress=progress)
        return show(outcome, as_json=self.json, quiet=self.quiet)


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


@dataclass(frozen=True)
class ModelsOptions:
    """List the bundled mechanisms with their joints and sizes.

    Attributes:
        json: Print the list as JSON.
    """

    json: bool = False

    def go(self) -> int:
        """Return the exit code after running the command."""
        from monodyn.cli.show import show_models

        return show_models(as_json=self.json)


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
