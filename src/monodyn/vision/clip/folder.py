"""A folder of numbered pictures as a clip."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from monodyn.errors import VideoError
from monodyn.names import meant, near_files, quoted
from monodyn.types import Frame
from monodyn.vision.clip.orientation import Planes, Turn, upright_planes
from monodyn.vision.clip.stamps import without_pauses

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
DEFAULT_RATE = 30.0
MOST_STEPS = 1_000_000
"""Pictures that the numbers of a series may span."""


def read_folder(path: Path, rate: float | None) -> tuple[int, int, np.ndarray, Any, list[str]]:
    """Find the one numbered series of pictures in a folder.

    A missing number leaves a gap of that many steps in time.

    Args:
        path: The folder.
        rate: Pictures a second [Hz]; None means 30, which the notes state.

    Returns:
        Width and height [px], times [s] (frame,), the decode function and the notes, as ``Video`` takes them.

    Raises:
        VideoError: The folder has fewer than two pictures.
    """
    files, numbers = series(path)
    if len(files) < 2:
        raise VideoError(
            f"clip '{path}': expected a folder of at least two numbered pictures, got one; add the others."
        )
    steps, notes = steps_of(path, numbers)
    if rate is None:
        notes.insert(
            0,
            f"A folder of pictures has no time stamps: {DEFAULT_RATE:g} pictures a second assumed; "
            "give --rate if it differs.",
        )
    rate = rate or DEFAULT_RATE
    times = without_pauses(steps, 1.0 / rate, notes) / rate
    luma, _ = load_picture(files[0], "picture")
    height, width = luma.shape
    return width, height, times, partial(_pictures, files, times, (height, width), notes), notes


def read_still(path: Path) -> tuple[int, int, np.ndarray, Any, list[str]]:
    """Read one picture as a clip of one frame at time 0.

    Args:
        path: The picture file.

    Returns:
        Width and height [px], times [s] (frame,), the decode function and the notes, as ``Video`` takes them.

    """
    luma, chroma = load_picture(path, "picture")
    frame = Frame(0, 0.0, luma, chroma)

    def decode(start: int, stop: int) -> Iterator[Frame]:
        return iter([frame][start:stop])

    return luma.shape[1], luma.shape[0], np.zeros(1), decode, []


def load_picture(path: Path, what: str) -> Planes:
    """Read one picture file.

    Args:
        path: The file.
        what: What the picture is, for the message.

    Returns:
        Luma (height, width) in video range and two chroma planes, or None for a grey picture; uint8.

    Raises:
        VideoError: The file is missing or is not a picture.
    """
    import av
    import cv2
    from av.video.reformatter import VideoReformatter

    if not path.is_file():
        end = meant(near_files(path)) or "check the path."
        raise VideoError(f"{what} '{path}': expected a picture file, found none; {end}")
    # cv2 raises on an empty buffer; a single zero is no picture either, and gives None
    picture = cv2.imdecode(np.frombuffer(path.read_bytes() or b"\0", np.uint8), cv2.IMREAD_ANYCOLOR)
    if picture is None:
        raise VideoError(
            f"{what} '{path}': expected a png, jpg, bmp or tif picture, cannot read it as one; save it anew."
        )
    form = "gray" if picture.ndim == 2 else "bgr24"
    frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture, dtype=np.uint8), format=form)
    return upright_planes(frame, VideoReformatter(), (frame.width, frame.height), Turn())


def steps_of(path: Path, numbers: list[int]) -> tuple[np.ndarray, list[str]]:
    """Return at which step each picture of a series was taken, from 0 on.

    Args:
        path: The folder, for messages.
        numbers: Their numbers, in order.

    Returns:
        The steps, int (picture,), and a note where numbers are missing.

    Raises:
        VideoError: the numbers go far beyond the pictures of any clip.
    """
    # numbers in steps of ten are a series of every picture: the unit is their greatest common divisor
    apart = [b - a for a, b in itertools.pairwise(numbers)]
    unit = max(math.gcd(*apart), 1)
    if (numbers[-1] - numbers[0]) // unit >= MOST_STEPS:
        raise VideoError(
            f"clip '{path}': expected pictures with numbers up to {MOST_STEPS} apart, got {numbers[0]} to "
            f"{numbers[-1]}; remove what is no part of the series."
        )
    notes = []
    gaps = sum(step != unit for step in apart)
    if gaps:
        often = "once" if gaps == 1 else f"{gaps} times"
        notes.append(
            f"The numbers of the pictures jump {often}; a missing number is taken as a missing picture."
        )
    return np.array([(number - numbers[0]) // unit for number in numbers]), notes


def series(path: Path) -> tuple[list[Path], list[int]]:
    """Return the pictures in the order of their last number, and these numbers.

    Args:
        path: The folder.

    Raises:
        VideoError: there is no numbered picture, more than one series, or a number twice.
    """
    found: dict[str, list[tuple[int, Path]]] = {}
    for file in path.iterdir():
        # the last number of the name counts; what is around it names the series
        match = re.fullmatch(r"(.*?)(\d+)(\D*)", file.name)
        if match and file.suffix.lower() in SUFFIXES and not file.name.startswith("."):
            found.setdefault(f"{match[1]}#{match[3]}", []).append((int(match[2]), file))
    if not found:
        raise VideoError(
            f"clip '{path}': expected numbered pictures ({', '.join(SUFFIXES)}) in the folder, found none; "
            "name them like frame0001.png."
        )
    if len(found) > 1:
        raise VideoError(
            f"clip '{path}': expected one series of numbered pictures, got {len(found)} "
            f"({quoted(sorted(found))}); keep each in a folder of its own."
        )
    series = sorted(next(iter(found.values())))
    numbers = [number for number, _ in series]
    for (number, file), (following, other) in itertools.pairwise(series):
        if number == following:
            raise VideoError(
                f"clip '{path}': expected one picture for each number, got '{file.name}' and '{other.name}'; "
                "remove one of them."
            )
    return [file for _, file in series], numbers


def _pictures(
    files: list[Path], times: np.ndarray, shape: tuple[int, int], notes: list[str], start: int, stop: int
) -> Iterator[Frame]:
    """Yield the pictures of a range of frame numbers that can be read."""
    for index in range(start, stop):
        try:
            luma, chroma = load_picture(files[index], "picture")
        except VideoError:
            note = f"Picture '{files[index].name}' cannot be read and is left out."
            if note not in notes:
                notes.append(note)
            continue
        if luma.shape != shape:
            raise VideoError(
                f"picture '{files[index]}': expected {shape[1]}x{shape[0]} px like the first one, "
                f"got {luma.shape[1]}x{luma.shape[0]} px; give pictures of one size."
            )
        yield Frame(index, float(times[index]), luma, chroma)
