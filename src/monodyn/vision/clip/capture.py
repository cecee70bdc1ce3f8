"""What a file says of the rate at which its pictures were captured, and what that makes of its time stamps.

A player shows slow motion because the stamps are stretched. The one idea: who stretches stamps also writes
the rate of capture, and the ratio of the two rates brings the stamps back.

Who writes what:
    Android: ``com.android.capture.fps``, a key of the file (AOSP, ``MPEG4Writer.cpp``). Stamps are multiplied
        by rate of capture over rate of playback (``InputSurfaceSource.cpp``). Used.
    Sony, slow and quick motion: ``captureFps`` in the XML ``NonRealTimeMeta`` beside the media. Used.
    Xiaomi: Android's key; its own, ``com.xiaomi.slow_moment``, is a flag of some and a rate of other cameras.
    Samsung: ``smta`` has 240 or 120 (Media3, ``SmtaAtomUtil``), but stamps are true; the player slows them.
    Apple: true stamps in the original. ``com.apple.quicktime.full-frame-rate-playback-intent`` is 0 of usual
        clips as well, and a copy with a slow part says nothing.
    GoPro: true stamps at any rate.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from monodyn.vision.settings import RATES

ANDROID = "com.android.capture.fps"
"""Key of the capture rate in files of Android."""
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)")
"""A rate as text."""
SONY = re.compile(rb'\bcaptureFps="([\d.]+)p?"')
"""Capture rate in the XML of Sony's cameras; one of half pictures ends in i and counts them, not frames."""
DIFFERENT = 1.4
"""Ratio from which on two rates are not the same one. A camera that takes 24 in place of 30 in the dark makes
1.25, the least slow motion is 1.6 (48 shown at 30): nothing changes from 1.3 to 1.55."""
SLOWEST_SHOWN = 20.0
"""Least rate at which slow motion is shown [Hz]: films have 24; a camera in the dark may take 15, not 30."""
WHOLE = 0.01
"""Deviation from a whole ratio that is none: 120 played at 29.97 was stretched by 4."""


def stretch_of(path: Path, tags: Mapping[str, str], played: float, notes: list[str]) -> float:
    """Return by how much the time stamps of a file are stretched: 4 for 120 a second shown at 30.

    Args:
        path: The file.
        tags: Its keys and their values, as libav reads them.
        played: Frames a second by its time stamps [Hz].
        notes: Takes a sentence where the file states a rate other than that.
    """
    name, text = _stated(path, tags)
    if not name:
        return 1.0
    rate = float(text) if NUMBER.fullmatch(text) else 0.0
    ratio = rate / played
    said = f"The file states that {rate:g} pictures a second were taken ({name}), and shows {played:.4g}"
    if not RATES[0] <= rate <= RATES[1]:
        notes.append(
            f"The file states a capture rate of {text!r} ({name}), which is no number of frames a second; "
            "its time stamps are taken as they are."
        )
    elif ratio >= DIFFERENT and played < SLOWEST_SHOWN:
        notes.append(
            f"{said}, as a camera does that slows down in the dark; its time stamps are taken as they are. "
            f"If it is slow motion, give --rate {rate:g}."
        )
    elif not 1.0 / DIFFERENT < ratio < DIFFERENT:
        slow = ratio > 1.0
        factor = ratio if slow else 1.0 / ratio
        factor = round(factor) if abs(factor / round(factor) - 1.0) < WHOLE else factor
        notes.append(
            f"{said}: {'slow motion' if slow else 'time lapse'}. All times are "
            f"{'divided' if slow else 'multiplied'} by {factor:.4g}; if it shows the motion at its true "
            f"speed, give --rate {played:.4g}."
        )
        return factor if slow else 1.0 / factor
    return 1.0


def _stated(path: Path, tags: Mapping[str, str]) -> tuple[str, str]:
    """Return under which name a file states its capture rate, and what; nothing where it does not."""
    # Matroska writes keys in capitals
    for key, value in tags.items():
        if key.lower() == ANDROID:
            return ANDROID, value.strip()
    for box in _beside_media(path):
        if match := SONY.search(box):
            return "captureFps", match[1].decode()
    return "", ""


def _beside_media(path: Path) -> Iterator[bytes]:
    """Yield the boxes of an MP4 file that may hold XML; nothing of other files."""
    with path.open("rb") as file:
        start = 0
        while len(head := file.read(16)) >= 8:
            size, kind = int.from_bytes(head[:4]), head[4:8]
            if size == 1:
                size = int.from_bytes(head[8:])
            if size < 8 or not (start or kind == b"ftyp"):
                return
            if kind in (b"uuid", b"meta", b"moov"):
                yield head[8:] + file.read(size - len(head))
            start += size
            file.seek(start)
