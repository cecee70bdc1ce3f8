"""What a run looks at: a clip, or points or masks of another tool in its place, opened with its mechanism.

Everything here is refused before anything is written.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from monodyn.blur import check_exposure
from monodyn.checks import chosen_mechanism, clip_and_mechanism, drawn_mechanism
from monodyn.errors import SettingsError, VideoError
from monodyn.estimation.record.logs import read_torques
from monodyn.estimation.record.samples import check_covered
from monodyn.settings import RunSettings
from monodyn.types import Poses, TorqueLog
from monodyn.vision.clip.lens import Lens, lens_of, straightened
from monodyn.vision.clip.repeats import LONGEST
from monodyn.vision.clip.video import Video, read
from monodyn.vision.foreground.mask_files import OpenedMasks, opened_masks
from monodyn.vision.points.marks import marks_of
from monodyn.vision.points.read import read_points
from monodyn.vision.points.tracks import PointTracks, without_pictures

if TYPE_CHECKING:
    from monodyn.mechanism import Mechanism

MOST_LOST = 0.01
"""Share of the points above which it is said that a lens can show none where they are."""


def opened(
    clip: str | Path | None, model: str | Path, settings: RunSettings
) -> tuple[Video, PointTracks | OpenedMasks | None, Mechanism]:
    """Return the clip, what takes the place of its pictures, and the mechanism.

    Args:
        clip: Video file or folder of pictures; None where points or masks take its place.
        model: Mechanism file or bundled name.
        settings: The user's choices.

    Returns:
        The clip, tracked points or masks of another tool or None, and the mechanism with the choices.

    Raises:
        VideoError: there is no clip, and nothing in its place.
        SettingsError: a picture would be exposed for longer than it is to the next one.
    """
    if settings.points is not None:
        tracks, video, mechanism = points_and_mechanism(clip, model, settings)
        return _straight(video, settings), _straight_points(tracks, settings), mechanism
    if settings.masks is not None:
        opened, video, mechanism = masks_and_mechanism(clip, model, settings)
        check_exposure(opened.objects, settings.camera)
        masks = replace(opened, objects=_straight(opened.objects, settings))
        return (masks.objects if video is opened.objects else _straight(video, settings)), masks, mechanism
    if clip is None:
        raise VideoError("clip: expected a video file or a folder of pictures, got none; name one.")
    video, mechanism = clip_and_mechanism(clip, model, settings)
    # which pictures repeat the one before is known only once all have been looked at
    check_exposure(video, settings.camera, repeats=LONGEST)
    return _straight(video, settings), None, mechanism


def _lens(settings: RunSettings, width: int, height: int) -> Lens | None:
    """Return the lens that the user gave, None without one."""
    bends = settings.distortion
    if bends is None:
        return None
    return lens_of(bends, settings.fix.get("camera.focal", settings.locate.focal), width, height)


def _straight(video: Video, settings: RunSettings) -> Video:
    """Return a clip as a lens that bends nothing would show it."""
    lens = _lens(settings, video.width, video.height)
    return video if lens is None else straightened(video, lens)


def _straight_points(tracks: PointTracks, settings: RunSettings) -> PointTracks:
    """Return points where a lens that bends nothing would show them."""
    lens = _lens(settings, tracks.width, tracks.height)
    if lens is None:
        return tracks
    if not tracks.in_picture:
        raise SettingsError(
            "camera.distortion: expected points in pixels, got lengths of a scene; leave one of them out."
        )
    straight = replace(tracks, px=lens.points(tracks.px))
    before, lost = int(tracks.found.sum()), int((tracks.found & ~straight.found).sum())
    if lost <= MOST_LOST * before:
        return straight
    note = (
        f"{lost} of {before} points lie where no place of a straight picture appears by --camera.distortion "
        "and --locate.focal: they count as not found. Check both where the points are right."
    )
    return replace(straight, notes=(*straight.notes, note))


def input_files(clip: str | Path | None, model: str | Path, settings: RunSettings) -> dict[str, str | Path]:
    """Return the files of a run by their part.

    Args:
        clip: Video file or folder of pictures, or None.
        model: Mechanism file or bundled name.
        settings: The user's choices.
    """
    given = {"clip": clip, "points": settings.points, "masks": settings.masks, "model": model}
    return {**{part: path for part, path in given.items() if path is not None}, **torque_files(settings)}


def torque_files(settings: RunSettings) -> dict[str, Path]:
    """Return the logs of known torques by their part of a run.

    Args:
        settings: The user's choices.
    """
    return {f"torques {i + 1}": path for i, path in enumerate(settings.torques)}


def with_torques(records: Sequence[Poses], mechanism: Mechanism, settings: RunSettings) -> list[Poses]:
    """Return records with the torques that are known.

    Args:
        records: Records of joint positions.
        mechanism: Gives the joints.
        settings: The user's choices.
    """
    logs = opened_torques(settings, mechanism, len(records))
    return [replace(record, torques=log) for record, log in zip(records, logs, strict=True)]


def clip_torques(
    settings: RunSettings, mechanism: Mechanism, times: np.ndarray, frames: tuple[int, int]
) -> TorqueLog | None:
    """Return the known torques of a clip, or None.

    They have to reach over the frames to fit, which are known before the clip is seen where the user names
    them.

    Args:
        settings: The user's choices.
        mechanism: Gives the joints.
        times: Time stamps of the clip [s], (frame,).
        frames: First frame to fit and the one after the last.
    """
    log = opened_torques(settings, mechanism, 1)[0]
    if settings.fit_frames is not None:
        check_torques(log, times, frames)
    return log


def frames_with_torques(
    log: TorqueLog | None, times: np.ndarray, frames: tuple[int, int]
) -> tuple[tuple[int, int], list[str]]:
    """Leave out the frames before and after known torques of a clip.

    Args:
        log: The torques, or None.
        times: Time stamps of the clip [s], (frame,).
        frames: First frame to fit and the one after the last.

    Returns:
        The frames that are left, and a sentence on those that are not.

    Raises:
        VideoError: fewer than two are left.
    """
    if log is None:
        return frames, []
    first, stop = frames
    covered = np.flatnonzero((times[first:stop] >= log.time[0]) & (times[first:stop] <= log.time[-1]))
    if len(covered) < 2:
        # of a log with few rows all of them may lie within a row's time of its ends
        check_torques(log, times, frames)
        return frames, []
    begin, end = first + int(covered[0]), first + int(covered[-1]) + 1
    if (begin, end) == frames:
        return frames, []
    return (begin, end), [f"The log of torques covers frames {begin}:{end} alone, which the fit is of."]


def check_torques(log: TorqueLog | None, times: np.ndarray, frames: tuple[int, int]) -> None:
    """Refuse known torques of a clip that do not reach over the frames to fit.

    Args:
        log: The torques, or None.
        times: Time stamps of the clip [s], (frame,).
        frames: First frame to fit and the one after the last.

    Raises:
        VideoError: they begin too late or end too early.
    """
    if log is not None:
        first, stop = frames
        what = f"the frames to fit ({first}:{stop})"
        check_covered(log, float(times[first]), float(times[stop - 1]), what)


def opened_torques(settings: RunSettings, mechanism: Mechanism, records: int) -> list[TorqueLog] | list[None]:
    """Return the known torques of each record, or none for any.

    Args:
        settings: The user's choices.
        mechanism: Gives the joints.
        records: Number of records.

    Raises:
        SettingsError: There is another number of logs.
    """
    if not settings.torques:
        return [None] * records
    if len(settings.torques) != records:
        raise SettingsError(
            f"torques: expected one log for each of {records} records, got {len(settings.torques)}; name "
            "as many, in their order."
        )
    return [read_torques(path, mechanism) for path in settings.torques]


def points_and_mechanism(
    clip: str | Path | None, model: str | Path, settings: RunSettings
) -> tuple[PointTracks, Video, Mechanism]:
    """Return tracked points, the clip that they are from, and the mechanism with the user's choices.

    Args:
        clip: Video file or folder of pictures; None for a clip without pictures.
        model: Mechanism file or bundled name.
        settings: The user's choices, with the file of the points.

    Raises:
        SettingsError: there is no file of points, or a setting of the pictures is given.
    """
    mechanism = chosen_mechanism(model, settings)
    for name, given in (("background", settings.background), ("roi", settings.roi)):
        if given is not None:
            raise SettingsError(
                f"{name}: expected nothing next to --points, which take the place of the pictures."
            )
    if settings.points is None:
        raise SettingsError("points: expected a file of tracked points, got none; name one.")
    film = None if clip is None else read(clip, rate=settings.rate, whole=True)
    tracks = read_points(
        settings.points, rate=settings.rate, clip=film, size=settings.points_size, axis=settings.points_axis
    )
    marks_of(mechanism, tracks.names, settings.points_map)
    return tracks, film or without_pictures(tracks), mechanism


def masks_and_mechanism(
    clip: str | Path | None, model: str | Path, settings: RunSettings
) -> tuple[OpenedMasks, Video, Mechanism]:
    """Return masks that another tool made, the clip that they are of, and the mechanism.

    Args:
        clip: Video file or folder of pictures; None takes the masks as pictures.
        model: Mechanism file or bundled name.
        settings: The user's choices, with the masks.

    Raises:
        SettingsError: there are no masks, or a background is given.
    """
    mechanism = drawn_mechanism(model, settings)
    if settings.background is not None:
        raise SettingsError("background: expected nothing next to --masks, which have none; leave it out.")
    if settings.masks is None:
        raise SettingsError("masks: expected a folder, a film or an NPZ file, got none; name one.")
    film = None if clip is None else read(clip, rate=settings.rate, whole=True)
    opened = opened_masks(settings.masks, mechanism, rate=settings.rate, clip=film)
    return opened, film or opened.together, mechanism
