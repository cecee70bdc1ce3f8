"""A clip of a planar mechanism in, a simulator of it out.

The public names are loaded when they are first used, so that ``import monodyn`` costs next to nothing:

    mechanism = monodyn.load("double.xml")                    # MJCF, URDF or a bundled name
    video = monodyn.read("clip.mp4")
    masks = monodyn.segment(video)                            # streamed: foreground coverage per frame
    scene = monodyn.locate(masks, mechanism)                  # camera, sizes, initial pose
    poses = monodyn.track(masks, scene)                        # joint positions and covariance per frame
    fit = monodyn.identify(poses, scene.mechanism).check()    # parameters and covariance, or advice
    future = monodyn.predict(fit, until=10.0)
    monodyn.report(fit, future, to="run/")
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from monodyn.choices import Tolerance as Tolerance
    from monodyn.errors import FitError as FitError
    from monodyn.errors import MechanismError as MechanismError
    from monodyn.errors import MonodynError as MonodynError
    from monodyn.errors import SettingsError as SettingsError
    from monodyn.errors import VideoError as VideoError
    from monodyn.estimation.fit import Fit as Fit
    from monodyn.estimation.record.logs import read_torques as read_torques
    from monodyn.estimation.record.tables import read_poses as read_poses
    from monodyn.estimation.record.tables import write_poses as write_poses
    from monodyn.estimation.settings import IdentifySettings as IdentifySettings
    from monodyn.live.settings import LiveSettings as LiveSettings
    from monodyn.live.sources import open_source as open_source
    from monodyn.live.step import Step as Step
    from monodyn.live.stream import stream as stream
    from monodyn.mechanism import Mechanism as Mechanism
    from monodyn.mechanism import load as load
    from monodyn.mechanism import write_mjcf as write_mjcf
    from monodyn.mechanism import write_urdf as write_urdf
    from monodyn.pipeline import run as run
    from monodyn.reported import report as report
    from monodyn.results.closed import closed_loop as closed_loop
    from monodyn.results.draws import drawn as drawn
    from monodyn.results.experiment import next_motion as next_motion
    from monodyn.results.fill import States as States
    from monodyn.results.fill import fill as fill
    from monodyn.results.horizon import horizon as horizon
    from monodyn.results.linear import linearize as linearize
    from monodyn.results.opened import open_run as open_run
    from monodyn.results.opened import remembered as remembered
    from monodyn.results.predict import Prediction as Prediction
    from monodyn.results.predict import predict as predict
    from monodyn.results.regulator import Allowed as Allowed
    from monodyn.results.regulator import lqr as lqr
    from monodyn.results.restart import restart as restart
    from monodyn.results.smoother import smooth as smooth
    from monodyn.results.swing import swing_up as swing_up
    from monodyn.settings import RunSettings as RunSettings
    from monodyn.stages import identify as identify
    from monodyn.stages import locate as locate
    from monodyn.stages import segment as segment
    from monodyn.stages import track as track
    from monodyn.types import Camera as Camera
    from monodyn.types import Frame as Frame
    from monodyn.types import Mask as Mask
    from monodyn.types import Poses as Poses
    from monodyn.types import TorqueLog as TorqueLog
    from monodyn.vision.clip.video import Video as Video
    from monodyn.vision.clip.video import read as read
    from monodyn.vision.dots.find import find_dots as find_dots
    from monodyn.vision.foreground.given import read_masks as read_masks
    from monodyn.vision.locating.scene import Scene as Scene
    from monodyn.vision.points.read import read_points as read_points
    from monodyn.vision.points.scene import PointScene as PointScene
    from monodyn.vision.points.tracks import PointTracks as PointTracks
    from monodyn.vision.settings import CameraSettings as CameraSettings
    from monodyn.vision.settings import LocateSettings as LocateSettings
    from monodyn.vision.settings import SegmentSettings as SegmentSettings
    from monodyn.vision.settings import TrackSettings as TrackSettings

_HOMES = {
    "errors": ("FitError", "MechanismError", "MonodynError", "SettingsError", "VideoError"),
    "choices": ("Tolerance",),
    "types": ("Camera", "Frame", "Mask", "Poses", "TorqueLog"),
    "live.settings": ("LiveSettings",),
    "live.sources": ("open_source",),
    "live.step": ("Step",),
    "live.stream": ("stream",),
    "mechanism": ("Mechanism", "load", "write_mjcf", "write_urdf"),
    "vision.clip.video": ("Video", "read"),
    "vision.dots.find": ("find_dots",),
    "vision.foreground.given": ("read_masks",),
    "vision.locating.scene": ("Scene",),
    "vision.points.read": ("read_points",),
    "vision.points.scene": ("PointScene",),
    "vision.points.tracks": ("PointTracks",),
    "vision.settings": ("CameraSettings", "LocateSettings", "SegmentSettings", "TrackSettings"),
    "estimation.fit": ("Fit",),
    "estimation.record.logs": ("read_torques",),
    "estimation.record.tables": ("read_poses", "write_poses"),
    "estimation.settings": ("IdentifySettings",),
    "stages": ("identify", "locate", "segment", "track"),
    "results.opened": ("open_run", "remembered"),
    "results.predict": ("Prediction", "predict"),
    "results.draws": ("drawn",),
    "results.experiment": ("next_motion",),
    "results.fill": ("States", "fill"),
    "results.horizon": ("horizon",),
    "results.closed": ("closed_loop",),
    "results.linear": ("linearize",),
    "results.regulator": ("Allowed", "lqr"),
    "results.swing": ("swing_up",),
    "results.restart": ("restart",),
    "results.smoother": ("smooth",),
    "settings": ("RunSettings",),
    "pipeline": ("run",),
    "reported": ("report",),
}
"""Public names by the module that they are loaded from."""

__all__ = ["__version__", *sorted(name for names in _HOMES.values() for name in names)]


def __getattr__(name: str) -> object:
    """Load a public name from the module it lives in."""
    if name == "__version__":
        from importlib.metadata import version

        return version("monodyn")
    for home, names in _HOMES.items():
        if name in names:
            from importlib import import_module
            from inspect import isfunction

            value = getattr(import_module(f"monodyn.{home}"), name)
            if isfunction(value):
                from monodyn.typed import checked

                value = checked(value)
            globals()[name] = value
            return value
    raise AttributeError(f"module 'monodyn' has no attribute '{name}'; public names: {', '.join(__all__)}.")


def __dir__() -> list[str]:
    """List the public names."""
    return list(__all__)
