"""What a run is given, checked: mechanism, clip, frames of the fit, times of the prediction.

Everything here is refused before anything is written, except a clip in which the mechanism was not found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from monodyn.arrays import check_unbroken
from monodyn.errors import FitError, MechanismError, SettingsError
from monodyn.estimation.settings import USUAL_TERMS
from monodyn.mechanism.dots import check_dots, dots_of, shows_dots
from monodyn.mechanism.steps import spacing
from monodyn.mechanism.torques import LAG
from monodyn.mechanism.upright import ROLL, by_roll
from monodyn.results.opened import is_run, remembered
from monodyn.results.predict import MOST_ROWS, evenly
from monodyn.results.sight import Sight
from monodyn.settings import RunSettings
from monodyn.stages import check_camera
from monodyn.types import Poses
from monodyn.vision.clip.once import decoded_once
from monodyn.vision.clip.video import Video, read
from monodyn.vision.drawing.outline import check_told_apart
from monodyn.vision.foreground.background import Background
from monodyn.vision.release import FreeSpan

if TYPE_CHECKING:
    from monodyn.estimation.fit import Fit
    from monodyn.mechanism import Mechanism

FILMING = "What makes a clip good, with examples: docs/filming.md."
"""Note on a clip that could not be used as it is."""
UNCOMPARED = (
    "If it may be another mechanism, run the clip without --model: the bundled ones are tried, and the one "
    "that comes nearest is named."
)
"""Note on a refused clip for whose mechanism only one was tried."""


def clip_and_mechanism(clip: str | Path, model: str | Path, settings: RunSettings) -> tuple[Video, Mechanism]:
    """Return the opened clip, which is being decoded, and its mechanism with the user's choices.

    Args:
        clip: Video file or folder of pictures.
        model: Mechanism file or bundled name.
        settings: The user's choices.

    Raises:
        SettingsError: the picture of the background does not exist.
    """
    if settings.background is not None and not Path(settings.background).is_file():
        raise SettingsError(
            f"background '{settings.background}': expected a picture file, found none; check the path."
        )
    # it is decoded while the mechanism is loaded
    video = decoded_once(read(clip, rate=settings.rate, whole=settings.in_pixels))
    return video, drawn_mechanism(model, settings)


def drawn_mechanism(model: str | Path, settings: RunSettings) -> Mechanism:
    """Return a mechanism with the user's choices of which a clip can show something.

    Args:
        model: Mechanism file or bundled name.
        settings: The user's choices.

    Raises:
        MechanismError: no body of the mechanism can be seen, or joints that no picture tells apart.
        SettingsError: it is followed by its dots, whose pictures are taken as of one instant.
    """
    mechanism = chosen_mechanism(model, settings)
    if not mechanism.plan.drawn and not dots_of(mechanism):
        raise MechanismError(
            f"mechanism '{mechanism.name}': expected a moving body with a geom or a site that a clip can "
            "show, got none; add its shape."
        )
    if shows_dots(mechanism):
        check_dots(mechanism)
        if settings.camera.exposure or settings.camera.readout:
            raise SettingsError(
                "camera.exposure, camera.readout: expected a mechanism that shows its outline, got "
                f"'{mechanism.name}', which is followed by its dots; leave them out."
            )
    else:
        check_told_apart(mechanism)
    return mechanism


def chosen_mechanism(model: str | Path, settings: RunSettings, *, camera: bool = True) -> Mechanism:
    """Return a mechanism with the user's choices; those of the camera are only checked, for ``locate``.

    Args:
        model: Mechanism file, bundled name, or the folder of a run that goes on with its mechanism.
        settings: The user's choices.
        camera: False refuses parameters of the camera, where there is none.

    Raises:
        MechanismError: the name of the model is empty.
        SettingsError: a choice of a camera parameter cannot be used.
    """
    from monodyn.mechanism import load

    if not str(model):
        raise MechanismError("model: expected a file or a bundled name, got an empty one; name one.")
    for name in settings.bounds:
        if _of_camera(name):
            raise SettingsError(
                f"bounds of '{name}': expected a parameter of the mechanism; give the camera's with fix."
            )
    # the camera is no part of the mechanism; its parameters go to ``locate`` on their own
    fix, free = camera_choices(settings)
    for name in (*fix, *free):
        if not camera and name != ROLL:
            raise SettingsError(
                f"parameter '{name}': expected one of the mechanism's; tables of joint positions have no "
                "camera, leave it out."
            )
    if settings.locate.focal and "camera.focal" in (*fix, *free):
        raise SettingsError(
            f"parameter 'camera.focal': --locate.focal gives it, {settings.locate.focal:g} px; leave one of "
            "them out."
        )
    mechanism = remembered(model) if is_run(model) else load(model)
    check_camera(mechanism, settings.camera.method or "fast", fix, free)
    if ROLL in free and settings.identify.method == "paper":
        raise SettingsError(
            "parameter 'camera.roll': identify.method paper takes gravity's direction as given; give the "
            "roll with --fix, or use identify.method fast."
        )
    if not camera and (ROLL in free or ROLL in fix) and not by_roll(mechanism).any():
        raise SettingsError(
            "parameter 'camera.roll': expected a mechanism on a single hinge of the world, whose angles a "
            "tilt adds to; leave it out."
        )
    # in a table the roll is the direction of gravity against the measured angles, and needs no camera
    kept = {name: value for name, value in settings.fix.items() if not _of_camera(name)}
    return _with_torque(mechanism, settings).with_choices(
        fix=kept if camera else dict(settings.fix),
        free=[name for name in settings.free if not (camera and _of_camera(name))],
        bounds=settings.bounds,
    )


def camera_choices(settings: RunSettings) -> tuple[dict[str, float], list[str]]:
    """Return the camera parameters that are fixed, and those that are freed.

    Args:
        settings: The user's choices.
    """
    fix = {name: value for name, value in settings.fix.items() if _of_camera(name)}
    return fix, [name for name in settings.free if _of_camera(name)]


def _of_camera(name: str) -> bool:
    """True for the name of a camera parameter, right or wrong; the mechanism has none of that form."""
    return name.startswith("camera.")


def _with_torque(mechanism: Mechanism, settings: RunSettings) -> Mechanism:
    """Return the mechanism with the parameters of a periodic torque, or of a known one, to choose from.

    Free torques have theirs only once the time stamps are known, so none of them can be chosen.
    """
    if (torque := settings.identify.torque) == "fourier":
        # any start value within the bounds will do here: the search for the period brings its own
        low, high = settings.bounds.get("torque.period", (1.0, 1.0))
        period = min(max(1.0, low), high)
        terms = settings.identify.terms or USUAL_TERMS
        return mechanism.with_torque(torque, terms=terms, period=period)
    if settings.torques:
        low, high = settings.bounds.get(LAG, (0.0, 0.0))
        return mechanism.with_torque("known").with_values({LAG: min(max(0.0, low), high)})
    for name in (*settings.fix, *settings.free, *settings.bounds):
        if name in mechanism.plan.index or "torque." not in name:
            continue
        if name == LAG:
            raise SettingsError(
                f"parameter '{name}': expected --torques FILE with it, got none; name the file, or leave the "
                "parameter out."
            )
        if torque == "free":
            raise SettingsError(
                f"parameter '{name}': expected one that can be fixed, freed or bounded, got one of a free "
                "torque, which is found as a whole; leave the parameter out."
            )
        raise SettingsError(
            f"parameter '{name}': expected --identify.torque fourier with it, got '{torque}'; choose that "
            "torque, or leave the parameter out."
        )
    return mechanism


def fitted_range(wanted: tuple[int, int | None] | None, count: int) -> tuple[int, int]:
    """Return the first frame of the fit and the one after its last.

    Args:
        wanted: The user's range; None for all but the last quarter.
        count: Number of frames in the clip.

    Raises:
        SettingsError: the range lies outside the clip or holds fewer than two frames.
    """
    # the last quarter is held out, to be compared with the prediction
    first, stop = wanted if wanted is not None else (0, count - count // 4)
    stop = count if stop is None else stop
    if first < 0 or stop > count or stop < first + 2:
        raise SettingsError(
            f"fit-frames: expected a range of at least two frames within 0:{count}, got {first}:{stop}; "
            f"the clip has {count} frames."
        )
    return first, stop


def fitted_part(record: Poses, wanted: tuple[int, int | None] | None, name: str) -> tuple[int, int]:
    """Return the first row of a table to fit and the one after the last.

    Args:
        record: The table.
        wanted: The user's range of frame numbers; None for all.
        name: What the table is called.

    Raises:
        SettingsError: the table has fewer than two frames of the range.
        VideoError: its rows do not follow each other.
    """
    # before and after the fitted rows the motion is simulated, too
    check_unbroken(name, record.time)
    if wanted is None:
        return 0, len(record)
    frames = record.frame
    ends = wanted[0], int(frames[-1]) + 1 if wanted[1] is None else wanted[1]
    first, stop = np.searchsorted(frames, ends).tolist()
    if stop < first + 2:
        raise SettingsError(
            f"fit-frames: expected a range with at least two of the frames of '{name}', {frames[0]} to "
            f"{frames[-1]}, got {ends[0]}:{ends[1]}; give another."
        )
    return first, stop


def free_range(
    wanted: tuple[int, int | None] | None, frames: tuple[int, int], span: FreeSpan
) -> tuple[int, int]:
    """Return the frames of the fit as far as the mechanism moves freely in them.

    Args:
        wanted: The user's range; None for all but the last quarter of the free stretch.
        frames: First frame of the fit and the one after its last, from ``fitted_range``.
        span: Where the mechanism moves freely.

    Raises:
        FitError: the user's range and the free stretch share fewer than two frames.
    """
    if wanted is None:
        return span.first, span.stop - (span.stop - span.first) // 4
    # what hangs at rest moves freely, too: the user may want it
    first, stop = max(frames[0], span.first - span.hanging), min(frames[1], span.stop)
    if stop < first + 2:
        raise FitError(
            f"fit-frames: expected frames in which the mechanism moves freely, {span.first}:{span.stop}, got "
            f"{frames[0]}:{frames[1]}; give a range there, or --time-range A:B [s] where it moves freely."
        )
    return first, stop


def prediction_times(stamps: np.ndarray, stop: int, until: float | None) -> np.ndarray:
    """Return the time stamps of the prediction.

    Args:
        stamps: Time stamps of the clip, or of a table [s], (frame,); they are continued by their median step
            beyond the end.
        stop: First of them that is predicted.
        until: End of the prediction [s]; None for their end.

    Returns:
        Time stamps [s], (frame,).

    Raises:
        SettingsError: the end does not come after the last fitted frame, or is too far away.
    """
    times = stamps[stop:]
    if until is None:
        return times
    last, end = float(stamps[stop - 1]), float(stamps[-1])
    if not (math.isfinite(until) and until > last):
        raise SettingsError(
            f"until: expected a time after the last fitted frame at {last:.3f} s, got {until:g} s."
        )
    step = spacing(stamps)
    most = min(end + 10.0 * (end - float(stamps[0])) + 60.0, end + MOST_ROWS * step)
    if until > most:
        raise SettingsError(
            f"until: expected at most {most:.6g} s (the end of the record, ten times its length and a "
            f"minute, and no more than {MOST_ROWS} rows), got {until:g} s."
        )
    more = evenly(end, max(until, end), step)[1:]
    return np.concatenate([times[times <= until + 1e-9], more])


def check_tracked(poses: Poses, video: Video, notes: Sequence[str]) -> None:
    """Refuse poses of which none was measured.

    Args:
        poses: The poses.
        video: Their clip.
        notes: What is known about the reason.

    Raises:
        FitError: no frame was measured.
    """
    if np.any(poses.measured):
        return
    first, last = (int(poses.frame[0]), int(poses.frame[-1])) if len(poses) else (0, 0)
    raise FitError(
        f"clip '{video.path}': expected the mechanism in frames {first} to {last}, tracked it in none; "
        + " ".join([*(notes or ["look at diagnosis.png."]), FILMING])
    )


def left_out(background: Background, *, given: bool = False) -> list[str]:
    """Return a note where something else moves in the picture and was left out; nothing otherwise.

    Args:
        background: What the mechanism was located before.
        given: True where the part of the picture is the user's.
    """
    if background.others is None:
        return []
    top, bottom, left, right = background.window
    part = f"{left},{top},{right - left},{bottom - top}"
    if given:
        return [
            f"Something moves outside of --roi {part} as well and is left out: where the mechanism reaches "
            "out of that region, give a larger one."
        ]
    return [
        f"Something else moves in the picture: the mechanism was looked for in {part} [px] alone, and what "
        "moves apart from it there is left out; --roi X,Y,W,H chooses another part."
    ]


def after_refusal(fit: Fit, sight: Sight, *, compared: bool) -> list[str]:
    """Return what else to try for a refused fit to pictures, and where to read how to film; else nothing.

    Args:
        fit: The fit.
        sight: What the run saw of its clip.
        compared: True where the bundled mechanisms were tried.
    """
    # dots are found in the clip; points of a table are another tool's
    given = sight.tracks is not None and sight.tracks.clip is None
    if fit.ok or given:
        return []
    return [FILMING] if compared else [UNCOMPARED, FILMING]


def unshown(poses: Poses) -> list[str]:
    """Return advice where a joint was not shown by the points in a tenth of the frames; nothing otherwise.

    Args:
        poses: The poses of the tracked points.
    """
    shares = poses.measured.mean(axis=0) if len(poses) else np.zeros(len(poses.joints))
    few = [f"{joint} {share:.0%}" for joint, share in zip(poses.joints, shares, strict=True) if share < 0.9]
    if not few:
        return []
    return [
        f"The points do not show every joint in every frame (shown: {', '.join(few)}): points are missing "
        "or lie on no mark there; diagnosis.png shows which."
    ]


def tracked_share(poses: Poses, frames: str) -> str:
    """Return in how many frames the mechanism was tracked, and in how many a part of it alone.

    Args:
        poses: The poses.
        frames: Of how many that is, in words.
    """
    whole = int(np.sum(poses.seen))
    part = int(np.sum(poses.measured.any(axis=1))) - whole
    return f"{whole} of {frames} were tracked" + (f" whole, and {part} in part" if part else "")


def untracked(poses: Poses, repeats: int = 0) -> list[str]:
    """Return advice where a tenth of the frames or more was not measured; nothing otherwise.

    Args:
        poses: The tracked clip.
        repeats: Number of its pictures that repeat the one before, which are not expected to be measured.
    """
    count = len(poses) - repeats
    if np.sum(poses.seen) >= 0.9 * count:
        return []
    return [
        f"Only {tracked_share(poses, f'{count} frames')}; diagnosis.png shows which, and why. Where the "
        "mechanism hardly stands out, a lower --segment.contrast may help; where the background shows parts "
        "of it, --background with a picture without the mechanism."
    ]
