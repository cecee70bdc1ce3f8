"""Files of masks in, a clip of them out: a folder of numbered pictures, a film, or an array.

The masks become the pictures of the clip, one object below the other, white on black.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from monodyn.errors import VideoError
from monodyn.mechanism import Mechanism
from monodyn.names import meant, near_files
from monodyn.types import Frame
from monodyn.vision.clip.folder import DEFAULT_RATE, series, steps_of
from monodyn.vision.clip.video import Decode, Video, check_rate, read

BLACK, WHITE = 16, 235
"""Grey levels of the masks as pictures."""
LOOKED_AT = 12
"""Masks whose values show what they mean."""
FULL_VALUES = (1.0, 255.0, 65535.0)
"""Values that can stand for a covered pixel: a share, and the largest of 8 and of 16 bits."""
DARKEST = 0.25
"""Brightness of a coloured pixel, as a share of the brightest one's, from which it is covered."""
ARRAYS = ("masks", "mask", "arr_0")
"""Names under which an array of masks is looked for, before any other."""


@dataclass(frozen=True, eq=False)
class OpenedMasks:
    """Masks of which no frame has been looked for motion yet.

    Attributes:
        objects: The masks as a clip, one object below the other.
        planes: Number of objects.
    """

    objects: Video
    planes: int

    @property
    def together(self) -> Video:
        """The masks as a clip whose pictures show all objects in one."""
        video, planes = self.objects, self.planes
        if planes == 1:
            return video
        return replace(video, decode=partial(_in_one, video, planes))


def _in_one(video: Video, planes: int, start: int, stop: int) -> Iterator[Frame]:
    """Yield pictures of all objects together."""
    for frame in video.decode(start, stop):
        yield replace(frame, luma=frame.luma.reshape(planes, video.height, -1).max(axis=0))


def opened_masks(
    path: str | Path, mechanism: Mechanism, *, rate: float | None = None, clip: Video | None = None
) -> OpenedMasks:
    """Open masks that another tool made.

    Args:
        path: As ``read_masks`` takes it.
        mechanism: The mechanism.
        rate: Frames a second [Hz], or None.
        clip: The clip that the masks are of, or None.

    Returns:
        The masks as a clip.

    Raises:
        VideoError: there are no masks, or they are not of the clip.
    """
    check_rate(rate)
    path = Path(path)
    video, planes = _opened(path, mechanism, rate, clip)
    if clip is not None:
        if (clip.count, clip.width, clip.height) != (video.count, video.width, video.height):
            raise VideoError(
                f"{path}: expected {clip.count} masks of {clip.width}x{clip.height} px like the clip, got "
                f"{video.count} of {video.width}x{video.height}; give the masks of this clip."
            )
        if rate is None:
            decode = partial(_restamped, video.decode, clip.times)
            video = replace(video, times=clip.times, decode=decode)
    return OpenedMasks(video, planes)


def _restamped(decode: Decode, times: np.ndarray, start: int, stop: int) -> Iterator[Frame]:
    """Yield pictures with other time stamps."""
    for frame in decode(start, stop):
        yield replace(frame, time=float(times[frame.index]))


def _opened(path: Path, mechanism: Mechanism, rate: float | None, clip: Video | None) -> tuple[Video, int]:
    """Return masks as a clip whose pictures hold all planes one below the other, and the number of planes."""
    times, notes = None, []
    if path.suffix.lower() in (".npz", ".npy"):
        masks, times = _array(path)
        pictures = _Array(path, masks)
        frames = np.arange(len(pictures))
    elif path.is_dir():
        files, numbers = series(path)
        pictures = _Folder(tuple(files))
        frames, notes = steps_of(path, numbers)
    else:
        if not path.exists():
            end = meant(near_files(path)) or "check the path."
            raise VideoError(
                f"masks '{path}': expected a film, a folder of pictures or an array (.npz, .npy), found "
                f"nothing; {end}"
            )
        film = read(path, rate=rate, whole=True)
        return (film if clip is None else replace(film, remarks=[])), 1
    count = int(frames[-1]) + 1
    if times is None or rate is not None:
        times = np.arange(count) / (rate or DEFAULT_RATE)
        if rate is None and clip is None:
            notes.append(
                f"Masks have no time stamps: {DEFAULT_RATE:g} a second assumed; give --rate, or the clip "
                "with --clip, if it differs."
            )
    some = range(0, len(frames), max(1, len(frames) // LOOKED_AT))
    scale = _scale(path, [np.asarray(pictures[k]) for k in some], mechanism)
    height, width = pictures[0].shape[-2:]
    decode = partial(_decoded, pictures, frames, times, scale)
    return Video(path, width, height, times, decode, remarks=notes), scale.planes


def _decoded(
    pictures: _Array | _Folder, frames: np.ndarray, times: np.ndarray, scale: _Scale, start: int, stop: int
) -> Iterator[Frame]:
    """Yield the masks of a range of frame numbers; where a number is missing there is none."""
    for k in range(*np.searchsorted(frames, [start, stop])):
        yield Frame(int(frames[k]), float(times[frames[k]]), scale.luma(pictures[k]))


class _Array:
    """Masks of an array, which stay in their file when they are pickled."""

    def __init__(self, path: Path, masks: np.ndarray | None = None) -> None:
        self.path, self.masks = path, _array(path)[0] if masks is None else masks

    def __len__(self) -> int:
        return len(self.masks)

    def __getitem__(self, k: int) -> np.ndarray:
        return self.masks[k]

    def __reduce__(self) -> tuple[type, tuple[Path]]:
        return _Array, (self.path,)


@dataclass(frozen=True)
class _Folder:
    """Pictures of masks by number.

    Attributes:
        files: The files in order.
    """

    files: tuple[Path, ...]

    def __len__(self) -> int:
        return len(self.files)

    def __getitem__(self, k: int) -> np.ndarray:
        flat = self._read(k)
        height, width = self._shape
        if flat.shape != (height, width):
            raise VideoError(
                f"{self.files[k]}: expected a mask of {width}x{height} px like the first one, got "
                f"{flat.shape[1]}x{flat.shape[0]} px; give masks of one size."
            )
        return flat

    @cached_property
    def _shape(self) -> tuple[int, int]:
        height, width = self._read(0).shape
        return height, width

    def _read(self, k: int) -> np.ndarray:
        import cv2

        data = np.frombuffer(self.files[k].read_bytes() or b"\0", np.uint8)
        picture = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
        if picture is None:
            raise VideoError(f"{self.files[k]}: expected a picture of a mask, cannot read it as one.")
        if picture.ndim == 2:
            return picture
        flat = picture[..., :3].max(axis=2)
        if np.array_equal(flat, picture[..., :3].min(axis=2)):
            return flat
        # a colour names an object: how bright it is says nothing
        return np.where(flat > DARKEST * flat.max(), 255, 0).astype(np.uint8)


def _array(path: Path) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the array of an NPZ file and its times [s], if it has any."""
    try:
        loaded = np.load(path, allow_pickle=False)
        if isinstance(loaded, np.ndarray):
            arrays = {"masks": loaded}
        else:
            with loaded as file:
                arrays = {name: file[name] for name in file.files}
    except (
        OSError,
        ValueError,
        EOFError,
        LookupError,
        NotImplementedError,
        MemoryError,
        BadZipFile,
        zlib.error,
    ) as reason:
        raise VideoError(f"{path}: cannot be read as NPZ ({reason}); save it with numpy.savez.") from None
    # a member that is no array is read as bytes
    arrays = {name: array for name, array in arrays.items() if isinstance(array, np.ndarray)}
    names = [name for name in (*ARRAYS, *arrays) if name in arrays and arrays[name].ndim in (3, 4)]
    if not names or len(arrays[names[0]]) < 2 or not arrays[names[0]].size:
        raise VideoError(
            f"{path}: expected an array (frame, height, width) or (frame, body, height, width), got none."
        )
    masks = arrays[names[0]]
    if masks.dtype.kind not in "biuf":
        raise VideoError(
            f"{path}: expected numbers in '{names[0]}', got values of type {masks.dtype}; save 0 and 1."
        )
    times = next((arrays[name] for name in ("times", "time") if name in arrays), None)
    if times is not None and (
        times.dtype.kind not in "iuf" or times.shape != (len(masks),) or not (np.diff(times) > 0).all()
        or not np.isfinite(times).all()
    ):  # fmt: skip
        raise VideoError(
            f"{path}: expected times of {len(masks)} masks in seconds, one after the other, got something "
            "else; correct them, or leave them out and give --rate."
        )
    return masks, times


@dataclass(frozen=True)
class _Scale:
    """What the values of masks mean.

    Attributes:
        path: The masks, for messages.
        planes: Number of objects.
        labels: True where values are the numbers of the objects.
        full: Value of a covered pixel, or the largest label.
    """

    path: Path
    planes: int
    labels: bool
    full: float

    def luma(self, picture: np.ndarray) -> np.ndarray:
        """Return a mask as a picture with its planes one below the other, uint8 (row, column)."""
        low, high = float(picture.min()), float(picture.max())
        # written so that what is no number, NaN, is refused
        if not (low >= 0.0 and high <= self.full):
            wrong = low if low < 0.0 else high
            raise VideoError(
                f"{self.path}: expected values from 0 to {self.full:g} in all masks, got {wrong:g}; correct "
                "them."
            )
        values = picture.astype(np.float32)
        if self.labels:
            share = np.stack([values == k + 1 for k in range(self.planes)]).astype(np.float32)
        else:
            share = values / self.full
        stacked = share.reshape(-1, share.shape[-1])
        return np.round(BLACK + (WHITE - BLACK) * stacked).astype(np.uint8)


def _scale(path: Path, pictures: Sequence[np.ndarray], mechanism: Mechanism) -> _Scale:
    """Find what the values of masks mean."""
    bodies = len(dict.fromkeys(mechanism.shapes.body))
    planes = len(pictures[0]) if pictures[0].ndim == 3 else 1
    if planes not in (1, bodies):
        raise VideoError(
            f"{path}: expected one mask, or {bodies} for the bodies of '{mechanism.name}', got {planes} in a "
            "frame."
        )
    most = max(float(picture.max()) for picture in pictures)
    whole = all(np.array_equal(picture, np.round(picture)) for picture in pictures)
    if whole and pictures[0].ndim == 2 and 1 < most <= bodies:
        return _Scale(path, bodies, True, float(bodies))
    for full in FULL_VALUES:
        # soft masks reach more than half of what stands for covered, but for shares of 1
        if most <= full and (most > 0.5 * full or full == 1.0):
            return _Scale(path, planes, False, full)
    raise VideoError(
        f"{path}: expected values from 0 to 1, 255 or 65535, or labels 1 to {bodies} for the bodies of "
        f"'{mechanism.name}', got values up to {most:g}; scale them."
    )
