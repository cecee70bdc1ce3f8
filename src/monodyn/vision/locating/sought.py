"""What is to be located: masks, mechanism, what is known of the camera; and what of it the pictures show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from monodyn.mechanism import Mechanism
from monodyn.types import Camera, Progress
from monodyn.vision.drawing.camera import X, with_values
from monodyn.vision.drawing.rig import SHOWN_KINDS, longest_reach, rig_of, root_slides
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.locating.coarse import variables_of
from monodyn.vision.locating.grow import SceneStart
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.locating.unit import scaled
from monodyn.vision.locating.variables import SIDES, SceneVariables
from monodyn.vision.settings import LocateSettings

STEPS = 10
"""Steps that the search reports."""


@dataclass(frozen=True, eq=False)
class Sought:
    """What is to be located.

    Attributes:
        masks: The soft foreground of the clip.
        mechanism: Topology, shape kinds and start sizes; its fixed parameters stay as they are.
        settings: How the search goes.
        fix: Values of ``camera.*`` parameters that must stay.
        free: ``camera.*`` parameters to estimate in addition to x, y and depth.
        progress: Called as the steps go.
        guess: What the global search found in other frames of the same scene; None searches.
    """

    masks: Masks
    mechanism: Mechanism
    settings: LocateSettings
    fix: Mapping[str, float]
    free: Sequence[str]
    progress: Progress
    guess: SceneGuess | None = None

    def step(self, done: int) -> None:
        """Say that so many of the ``STEPS`` of the search are done.

        Args:
            done: How many.
        """
        self.progress("locate", done, STEPS)

    @property
    def start_camera(self) -> Camera:
        """The camera that the search starts from."""
        video = self.masks.video
        focal = self.settings.focal or float(max(video.width, video.height))
        return with_values(Camera(video.width, video.height, focal), dict(self.fix))

    @property
    def pinned(self) -> frozenset[str]:
        """Parameters that may not change."""
        held = [p for p in self.mechanism.parameters if not p.free and not p.follows]
        # thicknesses of bodies of given mass are held in an identification, but nobody measured them
        told = [p.name for p in held if p.kind != "thickness" or p.name in self.mechanism.chosen]
        return frozenset([*self.fix, *told])

    @property
    def unit(self) -> float:
        """Units in which it is searched per metre of its file."""
        if "camera.depth" in self.fix:
            return 1.0 / self.start_camera.depth
        return 1.0 / longest_reach(rig_of(self.mechanism, self.start_camera))

    @property
    def start(self) -> SceneStart:
        """Mechanism and camera that the search starts from, in units of the distance from the camera."""
        camera, factor = self.start_camera, self.unit
        camera = replace(camera, x=camera.x * factor, y=camera.y * factor, depth=1.0)
        # without a scale a place in metres says nothing of where things are in the picture
        open_places = set() if "camera.depth" in self.fix else {"camera.x", "camera.y"}
        return SceneStart(scaled(self.mechanism, factor), camera, self.pinned - open_places)


def whole_variables(
    sought: Sought, guess: SceneGuess, start: SceneStart, names: Sequence[str]
) -> SceneVariables:
    """Return what is refined of a guess on whole pictures, before a camera that may come to be turned.

    Args:
        sought: The mechanism, and what is known of the camera.
        guess: Where the refinement starts.
        start: The mechanism of the file, in the same unit.
        names: The parameters that the pictures determine.

    Returns:
        The variables.
    """
    # a place of the camera that the user gave is that of the camera itself
    given = {"camera.x", "camera.y", "camera.depth"} & {*sought.fix}
    variables = variables_of(guess, start, names)
    return replace(variables, focal=start.camera.focal, about_origin=not given)


def refined_names(sought: Sought) -> list[str]:
    """List the parameters that the pictures determine.

    Args:
        sought: The mechanism, and what is known of the camera.

    Returns:
        Their names.
    """
    mechanism = sought.mechanism
    shown = [p for p in mechanism.parameters if p.kind in (*SHOWN_KINDS, SIDES) and not p.follows]
    names = [p.name for p in shown if p.name not in sought.pinned]
    # where a slide of the root is zero is a matter of choice: the camera's place is held and fixes it
    held = {"camera.x" if column == X else "camera.y" for _, column in root_slides(mechanism)}
    cameras = [name for name in ("camera.x", "camera.y", "camera.depth") if name not in held]
    return names + [name for name in cameras if name not in sought.fix]
