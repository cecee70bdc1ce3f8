"""A clip of a camera that moves in, the same clip as a camera at rest would have filmed it out.

A few frames decide whether the camera moves at all; a clip of one that stands still is left as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monodyn.errors import VideoError
from monodyn.types import Frame, Progress
from monodyn.vision.clip.homography import Homography, at_rest
from monodyn.vision.clip.steady import CameraPath, shown_in_place
from monodyn.vision.clip.video import Video
from monodyn.vision.registration.align import align, more_alike_blocks
from monodyn.vision.registration.keypicture import Key, key_of, pyramid
from monodyn.vision.registration.keys import Registrar

COMPARED = 12
"""Frames that decide whether the camera moves."""
MOVED_PX, MOVED_STDS = 0.4, 6.0
"""Displacement from which it does [px], and in standard deviations."""
WIDESPREAD = 7
"""Blocks that must match the key picture better with the displacement than without: a cart and its shadow may
cover several."""
LEAST_MOVED = 2
"""Frames that must show it."""
LEAST_STILL = 0.5
"""Share of them that must show it where it was; else they do not show whether it moves."""
LEAST_REGISTERED = 0.5
"""Share of the frames that must be registered."""
IMAGINED = 0.1
"""Share of the frames below which what they were to be registered on is no scene."""
BENT_PX, BENT_PERCENT = 0.1, 80.0
"""Displacement halfway to a corner by perspective, in this share of the frames [%], below which there is none
[px]."""
LEAST_ZOOM = 0.001
"""Change of the zoom that is worth a word."""
CLEANED = 1
"""Times that the picture of the scene is taken from frames registered on it."""
STILL_SHARE = 0.9
"""Share of the picture that surely stands still."""
AROUND = 24
"""Frames from which the picture of the whole scene is taken, at most."""


def steadied(video: Video, samples: Sequence[Frame], progress: Progress | None = None) -> Video:
    """Return a clip as a camera at rest would have filmed it; the clip itself where it did.

    Args:
        video: The clip.
        samples: Some of its frames, spread over the motion.
        progress: Called with the number of frames registered.

    Raises:
        VideoError: The camera moves, and the still scene does not show how.
    """
    key = _middle_key(samples)
    moves = camera_moves(samples, key) if key.holds else None
    if moves is False:
        return video
    path = camera_path(video, samples, progress) if moves else None
    if path is None:
        video.remarks.append(
            "The background shows too little to tell whether the camera moves; it is taken to stand still."
        )
        return replace(video, bare=True)
    video.remarks.append(_about(path))
    return replace(video, camera_path=path)


def _middle_key(samples: Sequence[Frame]) -> Key:
    """Return the middle one of frames as a key picture."""
    luma = samples[len(samples) // 2].luma
    return key_of(pyramid(luma), at_rest((luma.shape[1], luma.shape[0])), faint=False)


def camera_moves(samples: Sequence[Frame], key: Key) -> bool | None:
    """Return whether frames show a still scene in different places; None where they do not show one.

    Args:
        samples: Frames spread over a clip.
        key: One of them as a key picture.
    """
    compared = np.unique(np.linspace(0, len(samples) - 1, COMPARED).astype(int))
    moved = still = 0
    for i in compared:
        pictures = pyramid(samples[i].luma)
        found = align(pictures, key, key.at)
        if not found.known:
            continue
        if found.at.apart(key.at) <= max(MOVED_PX, MOVED_STDS * found.std):
            still += 1
            continue
        # before a bare wall the mechanism and the noise around it may pass for a scene, and the motion of the
        # mechanism for one of the camera; but most blocks then hold noise alone, which no displacement makes
        # match the key picture better
        moved += more_alike_blocks(pictures[-1], key.levels[-1], found.at, key.at) >= WIDESPREAD
    if moved >= LEAST_MOVED:
        return True
    return False if still >= LEAST_STILL * len(compared) else None


def onto_scene(picture: Frame, name: str, path: CameraPath) -> Frame:
    """Return another picture of the scene as a camera at rest would have taken it.

    Args:
        picture: The picture, of the clip's size.
        name: Its name, for the message.
        path: The way of the camera of the clip.

    Raises:
        VideoError: It does not show the scene of the clip.
    """
    rest = at_rest(path.size)
    found = align(pyramid(picture.luma), key_of(pyramid(path.scene.luma), rest), rest)
    if not found.known:
        raise VideoError(
            f"{name}: expected a picture of the scene of the clip, whose camera moves, got one in which that "
            "scene does not show; take it from where the clip was filmed, or leave out --background."
        )
    alone = CameraPath(found.at.entries[np.newaxis], np.array([found.std]), path.scene)
    steady = alone.steady(replace(picture, index=0))
    assert steady is not None
    return steady


def camera_path(
    video: Video, samples: Sequence[Frame], progress: Progress | None = None
) -> CameraPath | None:
    """Register every frame of a clip on the still scene.

    Args:
        video: The clip.
        samples: Some of its frames, spread over the motion.
        progress: Called with the number of frames registered.

    Returns:
        The way of the camera, from its mean place; None where next to no frame shows the scene, so that it
        was none: noise before a bare wall.

    Raises:
        VideoError: The still scene shows in too few frames.
    """
    size = (video.width, video.height)
    known = sampled_path(samples, size, video.count)
    scene = clean_scene(samples, known)
    registrar = Registrar(size, scene.key)
    maps, std, shown = np.full((video.count, 3, 3), np.nan), np.full(video.count, np.nan), 0
    for shown, frame in enumerate(video.frames(), start=1):
        found = registrar.add(frame, known.at(frame.index))
        if found is not None:
            maps[frame.index], std[frame.index] = found.at.entries, found.std
        if progress is not None:
            progress("camera", shown, video.count)
    count = int(np.sum(np.isfinite(std)))
    if count < IMAGINED * shown:
        return None
    if count < LEAST_REGISTERED * shown:
        raise VideoError(
            f"clip '{video.path}': expected a still scene by which the moving camera can be followed, found "
            f"it in {count} of {shown} frames; put the camera on a tripod, or film before a background with "
            "edges and patterns over much of the picture."
        )
    path = from_mean(CameraPath(maps, std, scene.picture))
    return replace(path, scene=median_scene(samples, path))


class CleanScene(NamedTuple):
    """The still scene without noise and without what moves.

    Attributes:
        picture: The picture.
        key: It as a key picture.
    """

    picture: Frame
    key: Key


def sampled_path(samples: Sequence[Frame], size: tuple[int, int], count: int) -> CameraPath:
    """Register frames one on the other as far as they show the same scene.

    Args:
        samples: The frames.
        size: Their width and height [px].
        count: Number of frames of the clip.

    Returns:
        The way of the camera, from its mean place.
    """
    registrar = Registrar(size)
    maps, std = np.full((count, 3, 3), np.nan), np.full(count, np.nan)
    scene = np.full(count, -1)
    for frame in samples:
        found = registrar.add(frame)
        if found is not None:
            row = frame.index
            maps[row], std[row], scene[row] = found.at.entries, found.std, registrar.scene
    # a title or a cut shows another scene: the longest one is that of the mechanism
    longest = int(np.argmax(np.bincount(scene + 1, minlength=2)[1:]))
    maps[scene != longest], std[scene != longest] = np.nan, np.nan
    return from_mean(CameraPath(maps, std, samples[0]))


def clean_scene(samples: Sequence[Frame], path: CameraPath) -> CleanScene:
    """Return the still scene: the median of registered frames, each registered on it once more.

    Noise that a codec copies from frame to frame moves in its own way and looks like a pattern of the scene;
    in the median of frames far apart there is none of it.

    Args:
        samples: Frames of the clip.
        path: Where the scene appears in them, about.
    """
    picture = median_scene(samples, path)
    for _ in range(CLEANED):
        rest, maps, std = at_rest(path.size), path.maps.copy(), path.std.copy()
        pictures = pyramid(picture.luma)
        noise = _difference(samples, replace(path, scene=picture), pictures)
        key = key_of(pictures, rest, noise)
        for frame in samples:
            at = path.at(frame.index)
            if at is not None:
                found = align(pyramid(frame.luma), key, at)
                maps[frame.index] = found.at.entries if found.known else np.nan
                std[frame.index] = found.std if found.known else np.nan
        # where nothing is left the clip is refused later, by what its frames show
        if not np.isfinite(std).any():
            break
        path = from_mean(CameraPath(maps, std, picture))
        picture = median_scene(samples, path)
    pictures = pyramid(picture.luma)
    noise = _difference(samples, replace(path, scene=picture), pictures)
    return CleanScene(picture, key_of(pictures, at_rest(path.size), noise))


def _difference(samples: Sequence[Frame], path: CameraPath, scene: list[np.ndarray]) -> list[float]:
    """Return by how much registered frames differ from the scene at each size [grey levels]."""
    steady = [
        frame for sample in samples[:: max(1, len(samples) // COMPARED)] if (frame := path.steady(sample))
    ]
    off = [
        [_noise_between(a, b) for a, b in zip(pyramid(frame.luma), scene, strict=True)] for frame in steady
    ]
    return np.median(off, axis=0).tolist() if off else [0.0] * len(scene)


def _noise_between(one: np.ndarray, other: np.ndarray) -> float:
    """Return the noise by which two pictures differ, but for what moved between them [grey levels]."""
    import cv2

    counts = np.bincount(cv2.absdiff(one, other).ravel(), minlength=256)
    still = np.diff(np.minimum(np.cumsum(counts), STILL_SHARE * counts.sum()), prepend=0.0)
    # squares of whole numbers: the smallest differences make up for those that are left out
    return float(np.sqrt(still @ np.arange(256.0) ** 2 / still.sum()))


def from_mean(path: CameraPath) -> CameraPath:
    """Return a way from the mean place of the camera: it shows most of the scene, and may be level.

    Args:
        path: The way, from any place.
    """
    known = path.registered
    if not known.any():
        return path
    maps = path.maps @ np.linalg.inv(np.mean(path.maps[known], axis=0))
    maps = maps / maps[:, 2:, 2:]
    plain = maps.copy()
    bent = []
    for row in np.flatnonzero(known):
        at = Homography(maps[row], path.size)
        level = levelled(at)
        plain[row] = level.entries
        bent.append(at.apart(level))
    # what is within the noise only costs time
    return replace(path, maps=plain if np.percentile(bent, BENT_PERCENT) < BENT_PX else maps)


def levelled(at: Homography) -> Homography:
    """Return the map without perspective that is nearest to one with it, over the picture.

    Args:
        at: The map.
    """
    across, down = np.meshgrid(np.linspace(-0.8, 0.8, 5), np.linspace(-0.8, 0.8, 5))
    places = np.column_stack([across.ravel(), down.ravel()]) * at.middle
    z = places @ [1.0, 1.0j]
    shown = (at.of(places + at.middle) - at.middle) @ [1.0, 1.0j]
    # over a symmetric grid the mean displacement and the mean growth do not depend on one another
    shift, growth = complex(shown.mean()), complex(np.vdot(z, shown) / np.vdot(z, z))
    entries = np.array(
        [[growth.real, -growth.imag, shift.real], [growth.imag, growth.real, shift.imag], [0, 0, 1]]
    )
    return Homography(entries, at.size)


def median_scene(frames: Sequence[Frame], path: CameraPath) -> Frame:
    """Return the picture of the whole scene: the median of registered frames, wherever they show it.

    Args:
        frames: Frames of the clip as they are.
        path: Where the scene appears in them.
    """
    known = [(frame, at) for frame in frames if (at := path.at(frame.index)) is not None]
    if not known:
        return frames[0]
    chosen = [known[i] for i in np.unique(np.linspace(0, len(known) - 1, AROUND).astype(int))]
    maps = [at for _, at in chosen]
    planes = [[frame.luma, *(frame.chroma or ())] for frame, _ in chosen]
    luma, *chroma = (_median([p[k] for p in planes], maps) for k in range(min(len(p) for p in planes)))
    return Frame(-1, 0.0, luma, (chroma[0], chroma[1]) if chroma else None)


def _median(planes: Sequence[np.ndarray], maps: Sequence[Homography]) -> np.ndarray:
    """Return the median of planes in the place of the scene, over those that show a pixel."""
    import cv2

    nothing = np.zeros(planes[0].shape, np.uint8)
    stack, shown = [], np.zeros(nothing.shape, dtype=np.int64)
    for plane, at in zip(planes, maps, strict=True):
        # what is not shown comes last in the order of the values
        picture, within = np.full_like(nothing, 255), np.full_like(nothing, 255)
        shown_in_place(plane, at, picture)
        shown_in_place(nothing, at, within)
        stack.append(picture)
        shown += within == 0
    ordered = np.sort(np.stack(stack), axis=0)
    found = np.take_along_axis(ordered, np.maximum(shown - 1, 0)[np.newaxis] // 2, axis=0)[0]
    # what no frame shows looks like what is next to it
    return (
        cv2.inpaint(found, (shown == 0).astype(np.uint8), 3.0, cv2.INPAINT_TELEA)
        if not shown.all()
        else found
    )


def _about(path: CameraPath) -> str:
    """Return the sentence about the way of the camera."""
    known = path.registered
    far = float(np.hypot(*path.shift[known].T).max())
    turn, zoom = float(np.degrees(np.abs(path.turn[known]).max())), path.zoom[known]
    zooms = f", with a zoom of {zoom.min():.3f} to {zoom.max():.3f}" if np.ptp(zoom) > LEAST_ZOOM else ""
    return (
        f"The camera moves: up to {far:.1f} px and {turn:.2f} deg from its mean place{zooms}; its "
        f"pictures were registered on the still scene, each within "
        f"{float(np.median(path.std[known])):.2f} px (camera.csv)."
    )
