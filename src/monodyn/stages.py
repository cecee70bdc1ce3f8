"""The stages from a clip to a fit: one table of methods each, the published method next to the default one.

A method is a function of its stage's signature; the settings of the stage name it. The published method is
loaded only when it is chosen, and the program runs without it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import overload

from monodyn.errors import SettingsError, VideoError
from monodyn.estimation.fit import Fit
from monodyn.estimation.identify import identify_jointly
from monodyn.estimation.settings import IdentifySettings, check_known
from monodyn.mechanism import Mechanism
from monodyn.mechanism.dots import as_rods, chosen_bodies
from monodyn.mechanism.upright import ROLL, by_roll, feels_roll, with_roll
from monodyn.names import known
from monodyn.settings import published_method
from monodyn.types import Poses, Progress
from monodyn.vision.clip.video import Video
from monodyn.vision.clock import at_true_times, with_time_noise
from monodyn.vision.drawing.camera import CAMERA_STD, PARAMETERS, check_value, check_view, value_of
from monodyn.vision.drawing.outline import check_told_apart
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.foreground.soft import soft_masks
from monodyn.vision.locating.locate import STEPS, Sought, find_scene
from monodyn.vision.locating.parallax import find_past_parallax
from monodyn.vision.locating.region import find_in_region
from monodyn.vision.locating.scene import Scene
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.points.follow import follow_points
from monodyn.vision.points.locate import locate_points
from monodyn.vision.points.scene import PointScene
from monodyn.vision.points.start import SoughtPoints
from monodyn.vision.points.tracks import PointTracks
from monodyn.vision.release import FreeSpan, blanked, free_span, span_of_poses
from monodyn.vision.settings import CameraSettings, LocateSettings, SegmentSettings, TrackSettings
from monodyn.vision.track import follow_clip

PLACE = ("camera.x", "camera.y", "camera.depth")
"""Camera parameters that every method estimates."""


def _locate_default(sought: Sought) -> Scene:
    """Locate on key frames, in the part of the picture that the mechanism explains best."""
    return find_past_parallax(sought, lambda tried: find_in_region(tried, find_scene))


def _camera_behind(sought: Sought) -> Scene:
    """Locate by the default method, then find the camera by eq. (1) and (2) of the 2012 paper."""
    with published_method():
        from monodyn.paper.locate import camera_behind
        from monodyn.paper.settings import PaperLocateSettings, published

    settings = published(sought.settings, PaperLocateSettings)
    return camera_behind(_locate_default(_squarely(sought)), sought.fix, level=settings.level)


def _squarely(sought: Sought) -> Sought:
    """Hold turns and focal length of the camera, which the published method takes as given, unless freed."""
    held = {name: value_of(sought.start_camera, name) for name in CAMERA_STD if name not in sought.free}
    return replace(sought, fix={**held, **sought.fix})


def _pose_before(sought: Sought) -> Scene:
    """Find pose and ratios by eq. (3) and (4) of the 2012 paper before the camera of the default method."""
    with published_method():
        from monodyn.paper.locate import pose_before
        from monodyn.paper.settings import PaperLocateSettings, published

    def report(step: str, done: int, total: int | None) -> None:
        sought.progress(step, done, STEPS + 1)

    settings = published(sought.settings, PaperLocateSettings)
    scene = pose_before(
        _locate_default(_squarely(replace(sought, progress=report))), sought.fix,
        level=settings.level, framework=settings.framework,
    )  # fmt: skip
    # the published search is one step more
    sought.progress("locate", STEPS + 1, STEPS + 1)
    return scene


def _locate_published(sought: Sought) -> Scene:
    """Find camera, pose and ratios by Fig. 2 of the 2012 paper."""
    with published_method():
        from monodyn.paper.locate import locate_published
        from monodyn.paper.settings import PaperLocateSettings, published
        from monodyn.paper.start_model import StartModel

    settings = published(sought.settings, PaperLocateSettings)
    model = StartModel(sought.mechanism, sought.start_camera, sought.fix)
    return locate_published(sought.masks, model, settings, progress=sought.progress)


def _track_published(
    masks: Masks, scene: Scene, settings: TrackSettings, progress: Progress | None = None
) -> Poses:
    """Minimize the mismatch of the silhouettes within move limits, eq. (5) of the 2012 paper."""
    with published_method():
        from monodyn.paper.settings import PaperTrackSettings, published
        from monodyn.paper.track import track_published

    return track_published(masks, scene, published(settings, PaperTrackSettings), progress)


def _identify_published(
    records: tuple[Poses, ...], mechanism: Mechanism, settings: IdentifySettings, progress: Progress | None
) -> Fit:
    """Identify by eq. (14) of the 2012 paper as published."""
    with published_method():
        from monodyn.paper.identify import identify_published
        from monodyn.paper.settings import PaperIdentifySettings, published

    # the published method takes gravity as the camera has it, and sizes and camera as they were found
    records = tuple(replace(record, roll=None, shifts=None) for record in records)
    mechanism = with_roll(mechanism, mechanism.values[ROLL], free=False)
    return identify_published(records, mechanism, published(settings, PaperIdentifySettings), progress)


SEGMENT_METHODS: dict[str, Callable[..., Masks]] = {"fast": soft_masks}
"""How the foreground is found: (video, settings, background, progress) to masks."""

LOCATE_METHODS: dict[tuple[str, str], Callable[[Sought], Scene]] = {
    ("fast", "fast"): _locate_default,
    ("paper", "fast"): _camera_behind,
    ("fast", "paper"): _pose_before,
    ("paper", "paper"): _locate_published,
}
"""How the scene is found, by the methods of the camera and of pose and sizes."""

TRACK_METHODS: dict[str, Callable[[Masks, Scene, TrackSettings, Progress | None], Poses]] = {
    "fast": follow_clip,
    "paper": _track_published,
}
"""How the mechanism is followed."""

IdentifyMethod = Callable[[tuple[Poses, ...], Mechanism, IdentifySettings, Progress | None], Fit]
IDENTIFY_METHODS: dict[str, IdentifyMethod] = {
    "fast": identify_jointly,
    "paper": _identify_published,
}
"""How a mechanism is identified, its bodies chosen."""


def segment(
    video: Video,
    settings: SegmentSettings | None = None,
    *,
    background: str | Path | None = None,
    progress: Progress | None = None,
) -> Masks:
    """Separate the moving mechanism from the background of a clip.

    Args:
        video: The clip, from ``read``.
        settings: How the foreground is found.
        background: A picture of the scene without the mechanism, of the clip's size; else it is taken from
            the clip.
        progress: Called with the number of frames read.

    Returns:
        The masks, computed frame by frame as they are iterated over.

    Raises:
        VideoError: fewer than two frames, nothing moves, or the background picture has another size.
    """
    settings = settings or SegmentSettings()
    return SEGMENT_METHODS[settings.method or "fast"](video, settings, background, progress)


@overload
def locate(
    masks: Masks, mechanism: Mechanism, settings: LocateSettings | None = None, *,
    camera: CameraSettings | None = None, fix: Mapping[str, float] | None = None, free: Sequence[str] = (),
    mapped: Mapping[str, str] | None = None, once: bool = False, progress: Progress | None = None,
    guess: SceneGuess | None = None,
) -> Scene:  # fmt: skip
    """Find the scene of masks."""


@overload
def locate(
    masks: PointTracks, mechanism: Mechanism, settings: LocateSettings | None = None, *,
    camera: CameraSettings | None = None, fix: Mapping[str, float] | None = None, free: Sequence[str] = (),
    mapped: Mapping[str, str] | None = None, once: bool = False, progress: Progress | None = None,
) -> PointScene:  # fmt: skip
    """Find the scene of tracked points."""


def locate(
    masks: Masks | PointTracks,
    mechanism: Mechanism,
    settings: LocateSettings | None = None,
    *,
    camera: CameraSettings | None = None,
    fix: Mapping[str, float] | None = None,
    free: Sequence[str] = (),
    mapped: Mapping[str, str] | None = None,
    once: bool = False,
    progress: Progress | None = None,
    guess: SceneGuess | None = None,
) -> Scene | PointScene:
    """Find camera, sizes and first pose from the topology alone.

    Args:
        masks: The soft foreground of the clip, or points that another tool tracked.
        mechanism: Topology, shape kinds and start sizes; its fixed parameters stay as they are.
        settings: How the search goes.
        camera: How the camera is found.
        fix: Values of ``camera.*`` parameters that must stay.
        free: ``camera.*`` parameters to estimate in addition to x, y and depth.
        mapped: What points are whose names are not those of the mechanism: a joint, a body (its far end), a
            site, ``<body>.marker``, ``world`` or ``none``.
        once: Look for it in the whole of the picture alone, by the default method: enough to compare
            mechanisms.
        progress: Called as the steps go.
        guess: About where it is, from other frames of the same camera: refined before anything is searched.

    Returns:
        The scene.

    Raises:
        MechanismError: joints that no picture tells apart.
        SettingsError: a name in ``fix`` or ``free`` is not a camera parameter, or cannot be estimated; or the
            published method is chosen for points.
    """
    settings = settings or LocateSettings()
    methods = (camera or CameraSettings()).method or "fast", settings.method or "fast"
    settings = replace(settings, method=methods[1])
    fix = dict(fix or {})
    check_camera(mechanism, methods[0], fix, free)
    # methods report their steps whether or not the caller wants progress
    report = progress or (lambda step, done, total: None)
    # no picture shows the roll of a camera before a mechanism on one hinge: the motion has to
    by_motion = bool(by_roll(mechanism).any())
    if focal := fix.get("camera.focal", settings.focal):
        pictures = masks if isinstance(masks, PointTracks) else masks.video
        check_view(focal, pictures.width, pictures.height)
    if isinstance(masks, PointTracks):
        if "paper" in methods:
            raise SettingsError(
                "method 'paper': the published method looks at silhouettes; points take the method 'fast' "
                "for camera and location."
            )
        shown = [name for name in free if not (name == ROLL and by_motion)]
        sought = SoughtPoints(masks, mechanism, settings.focal, fix, shown, mapped or {}, report)
        scene = locate_points(sought)
    else:
        check_told_apart(mechanism)
        find = find_scene if once else LOCATE_METHODS[methods]
        scene = find(Sought(masks, mechanism, settings, fix, free, report, guess))
    if not by_motion:
        return scene
    unknown = ROLL not in fix and feels_roll(mechanism)
    assumed = ROLL not in fix and ROLL not in free
    rolled = with_roll(scene.mechanism, scene.camera.roll, free=unknown, assumed=assumed)
    return replace(scene, mechanism=rolled)


def track(
    masks: Masks | PointTracks,
    scene: Scene | PointScene,
    settings: TrackSettings | None = None,
    *,
    progress: Progress | None = None,
) -> Poses:
    """Follow the mechanism through the clip, as far as it moves freely.

    Args:
        masks: The masks of the clip to follow, taken anew with the background and the colours that the scene
            was found with; or the tracked points.
        scene: Camera, sizes and first pose, found from the same kind.
        settings: How the mechanism is followed.
        progress: Called with the number of frames done.

    Returns:
        Joint positions [rad; m in the start scale] with covariance; frames in which the mechanism does not
        lie on its mask, in which something holds it, that repeat the one before or that did not decode are
        not seen and hold NaN; so are joints that the points do not determine.

    Raises:
        VideoError: the pictures of ``masks`` have another size than those of the scene, a camera that moves
            has other places in them, or masks and scene are not of one kind.
    """
    return track_freely(masks, scene, settings, progress=progress)[0]


def track_freely(
    masks: Masks | PointTracks,
    scene: Scene | PointScene,
    settings: TrackSettings | None = None,
    *,
    span: tuple[float, float | None] | None = None,
    progress: Progress | None = None,
) -> tuple[Poses, FreeSpan]:
    """Follow the mechanism through the clip and find the frames in which it moves freely.

    Args:
        masks: The masks of the clip to follow, or the tracked points.
        scene: Camera, sizes and first pose.
        settings: How the mechanism is followed.
        span: Of points: begin and end [s] of the frames in which the mechanism moves freely; None finds them.
        progress: Called with the number of frames done.

    Returns:
        The poses as from ``track``, and the stretch of the clip in which nothing holds the mechanism.

    Raises:
        VideoError: the pictures of ``masks`` have another size than those of the scene, a camera that moves
            has other places in them, or masks and scene are not of one kind.
    """
    settings = settings or TrackSettings()
    if isinstance(masks, PointTracks) and isinstance(scene, PointScene):
        poses = follow_points(masks, scene)
        if masks.clip is not None:
            poses = at_true_times(poses, masks.clip)
        elif masks.tick:
            poses = with_time_noise(poses, masks.tick / math.sqrt(12.0))
        free = span_of_poses(poses, scene.mechanism, span)
        return blanked(poses, free), free
    if isinstance(masks, PointTracks) or isinstance(scene, PointScene):
        raise VideoError("track: expected masks with a scene of masks, or points with one of points.")
    # tracking may go on in another clip of the same camera, but not at another size
    video = masks.video
    if (video.width, video.height) != (scene.camera.width, scene.camera.height):
        raise VideoError(
            f"{video.path}: expected pictures of {scene.camera.width}x{scene.camera.height} like the scene, "
            f"got {video.width}x{video.height}; locate the mechanism in this clip."
        )
    if video.camera_path is not scene.masks.video.camera_path:
        raise VideoError(
            f"{video.path}: expected the clip in which the scene was located, or one of a camera that stands "
            "still in both, got another one with a camera that moves; locate the mechanism in this clip."
        )
    poses = TRACK_METHODS[settings.method or "fast"](masks, scene, settings, progress)
    poses = at_true_times(poses, video)
    free = free_span(masks, scene, poses)
    return blanked(poses, free), free


def identify(
    poses: Poses | Sequence[Poses],
    mechanism: Mechanism,
    settings: IdentifySettings | None = None,
    *,
    progress: Progress | None = None,
) -> Fit:
    """Find the parameters and start states whose simulated motion is closest to the measured one.

    Minimizes sum_t |W_t (q_sim(t; parameters, start) - q_t)|^2 with W_t.W_t the inverse covariance of sample
    t, plus the picture's information about the sizes; ``settings.torque`` chooses the torque model.

    Args:
        poses: One record, or several that share the parameters.
        mechanism: Topology, start values, what is free and fixed.
        settings: How to search.
        progress: Called as ``progress("identify", done, total)`` with the stages done.

    Returns:
        The identified mechanism with intervals; its ``grade``, and ``ok``, rest on the fitted frames alone.

    Raises:
        VideoError: There is no record, or one that cannot be used, as one in degrees or milliseconds.
        MechanismError: The joints of a record are not those of the mechanism.
        SettingsError: A setting is out of its range.

    Source:
        Eq. (14) and Case I (eq. 9, as a torque against the motion) of "Estimating dynamics on-the-fly using
        monocular video", 2012.

    Example:
        >>> import numpy as np
        >>> from monodyn.mechanism import load
        >>> from monodyn.mechanism.simulate import rollout
        >>> mechanism, time = load("single"), np.arange(40) / 30
        >>> start = np.array([0.5]), np.array([0.0])
        >>> swing, _ = rollout(mechanism.tree, time, *start, substeps=8)
        >>> std = np.full((40, 1, 1), 1e-3**2)
        >>> poses = Poses(("joint1",), np.arange(40), time, swing, std, np.ones(40, dtype=bool))
        >>> fit = identify(poses, mechanism).check()
        >>> round(fit.parameter("link1.length").value, 3)
        0.2
    """
    began = time.perf_counter()
    settings = settings or IdentifySettings()
    method = settings.method or "fast"
    records = (poses,) if isinstance(poses, Poses) else tuple(poses)
    # whether masses are free belongs to the mechanism: methods see it there
    bodies = chosen_bodies(mechanism, settings.bodies)
    mechanism = mechanism.with_bodies(bodies)
    mechanism = as_rods(mechanism) if bodies == "free" else mechanism
    settings = replace(settings, method=method)
    if any(record.torques is not None for record in records):
        check_known(settings)
    fit = IDENTIFY_METHODS[method](records, mechanism, settings, progress)
    return replace(fit, seconds=time.perf_counter() - began)


def check_camera(mechanism: Mechanism, method: str, fix: Mapping[str, float], free: Sequence[str]) -> None:
    """Refuse camera parameters that do not exist, have an impossible value, or cannot be estimated.

    Args:
        mechanism: The mechanism that is to be located.
        method: How the camera is found, ``fast`` or ``paper``.
        fix: Values by parameter name.
        free: Names of parameters to estimate.

    Raises:
        SettingsError: there is no such parameter, it is both fixed and freed, its value is impossible, or it
            cannot be estimated.
    """
    for name in (*fix, *free):
        if name not in PARAMETERS:
            names = known("parameters", list(PARAMETERS), name)
            raise SettingsError(f"parameter '{name}': expected one of the camera's; {names}")
        if name in fix and name in free:
            raise SettingsError(f"parameter '{name}': is both fixed and freed; choose one of them.")
    for name, value in fix.items():
        check_value(name, float(value))
    for name in free:
        # before a mechanism on one hinge the roll is an unknown of the motion
        if method == "paper" and name not in PLACE and not (name == ROLL and by_roll(mechanism).any()):
            raise SettingsError(
                f"parameter '{name}': camera.method paper estimates {', '.join(PLACE)} alone; leave it "
                "out of --free, give the value with --fix, or use camera.method fast."
            )
