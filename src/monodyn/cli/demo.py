"""``monodyn demo``: the main job on the clip that is installed with the program; ``monodyn models``: the
mechanisms that are installed with it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from monodyn.cli.shared import ResultOptions

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
