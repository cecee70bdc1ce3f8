"""What a run refuses: impossible camera values, frame ranges, ends of a prediction; clips without a pose."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from monodyn.errors import FitError, SettingsError
from monodyn.types import Poses
from monodyn.vision.clip.video import Video
from monodyn.vision.drawing.camera import PARAMETERS

MOST_ROWS = 1_000_000
"""Most rows of a prediction."""


def check_camera(fix: Mapping[str, float], free: Sequence[str]) -> None:
    """Refuse choices of camera parameters that no camera can have; other names are left alone.

    Args:
        fix: Values by parameter name.
        free: Names of parameters to estimate.

    Raises:
        SettingsError: there is no such parameter, it is both fixed and freed, or its value is impossible.
    """
    for name in (*fix, *free):
        if name.startswith("camera.") and name not in PARAMETERS:
            raise SettingsError(
                f"parameter '{name}': expected one of the camera's ({', '.join(PARAMETERS)}); "
                "correct the name."
            )
        if name.startswith("camera.") and name in fix and name in free:
            raise SettingsError(f"parameter '{name}': is both fixed and freed; choose one of them.")
    for name in PARAMETERS:
        value, unit = float(fix.get(name, 1.0)), PARAMETERS[name]
        if not math.isfinite(value):
            raise SettingsError(
                f"parameter '{name}': expected a finite number, got {value}; give it in {unit}."
            )
        if name in ("camera.depth", "camera.focal") and value <= 0:
            raise SettingsError(
                f"parameter '{name}': expected a value above 0 {unit}, got {value:g}; correct it."
            )
        if name in ("camera.pitch", "camera.yaw") and abs(value) >= math.pi / 2:
            raise SettingsError(
                f"parameter '{name}': expected less than a quarter turn, got {value:g} rad; "
                "the camera looks at the plane, give the angle in radians."
            )


def fitted_range(wanted: tuple[int, int | None] | None, count: int) -> tuple[int, int]:
    """Return the first frame of the fit and the one after its last.

    Args:
        wanted: The user's range; None for all but the last quarter.
        count: Number of frames in the clip.

    Raises:
        SettingsError: the range lies outside the clip or holds fewer than two frames.
    """
    first, stop = wanted if wanted is not None else (0, count - count // 4)
    stop = count if stop is None else stop
    if first < 0 or stop > count or stop < first + 2:
        raise SettingsError(
            f"fit-frames: expected a range of at least two frames within 0:{count}, got {first}:{stop}; "
            f"the clip has {count} frames."
        )
    return first, stop


def prediction_times(video: Video, stop: int, until: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Return the time stamps [s] and frame numbers of the prediction, (frame,).

    Args:
        video: The clip; its stamps are continued by their median step beyond the end.
        stop: First frame that is predicted.
        until: End of the prediction [s]; None for the end of the clip.

    Raises:
        SettingsError: the end does not come after the last fitted frame.
    """
    times, numbers = video.times[stop:], np.arange(stop, video.count)
    if until is None:
        return times, numbers
    last = float(video.times[stop - 1])
    if not (np.isfinite(until) and until > last):
        raise SettingsError(
            f"until: expected a time after the last fitted frame at {last:.3f} s, got {until:g} s."
        )
    step = float(np.median(np.diff(video.times)))
    end = float(video.times[-1])
    most = min(end + 10.0 * (end - float(video.times[0])) + 60.0, end + MOST_ROWS * step)
    if until > most:
        raise SettingsError(
            f"until: expected at most {most:.6g} s (ten more times the clip and a minute, and {MOST_ROWS} "
            f"rows), got {until:g} s."
        )
    more = int(np.floor((until - video.times[-1]) / step + 1e-6)) if until > video.times[-1] else 0
    times = np.concatenate([times[times <= until + 1e-9], video.times[-1] + step * np.arange(1, more + 1)])
    return times, stop + np.arange(len(times))


def check_tracked(poses: Poses, video: Video, notes: Sequence[str]) -> None:
    """Refuse poses of which none was measured.

    Args:
        poses: The poses.
        video: Their clip.
        notes: What is known about the reason.

    Raises:
        FitError: no frame was measured.
    """
    if np.any(poses.seen):
        return
    first, last = (int(poses.frame[0]), int(poses.frame[-1])) if len(poses) else (0, 0)
    raise FitError(
        f"clip '{video.path}': expected the mechanism in frames {first} to {last}, tracked it in none; "
        + " ".join(notes)
    )
