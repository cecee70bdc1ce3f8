"""What a file says of the rate at which its pictures were captured, and what that makes of its time stamps.

A player shows slow motion because the stamps are stretched. The one idea: who stretches stamps also writes the
rate of capture, and the ratio of the two rates brings the stamps back.

| who | what it writes | what is done |
|---|---|---|
| Android | ``com.android.capture.fps``, a key of the file (AOSP ``MPEG4Writer.cpp``); stamps are multiplied by capture rate over rate of playback (``InputSurfaceSource.cpp``) | used |
| Sony, S&Q and HFR | ``captureFps`` in the XML ``NonRealTimeMeta`` beside the media (Professional Disc) | used |
| Apple | true stamps in the original; ``full-frame-rate-playback-intent`` is 0 of other clips, too; what Photos exports with a slow part says nothing | nothing can be |
| Samsung | ``smta`` holds 240 or 120 (Media3 ``SmtaAtomUtil``), but the original's stamps are true: the player slows it | nothing to do |
| Xiaomi | Android's key; ``com.xiaomi.slow_moment`` is a flag of some and a rate of other cameras | Android's is used |
| GoPro | true stamps at any frame rate | nothing to do |
"""  # noqa: E501

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from monodyn.vision.settings import RATES

ANDROID = "com.android.capture.fps"
"""Key of the capture rate in files of Android."""
SONY = re.compile(rb'\bcaptureFps="([^"]*?)p?"')
"""Capture rate in the XML of Sony's cameras; that of half pictures ends in i and is no number."""
DIFFERENT = 1.45
"""Ratio of two rates from which on they are not the same rate: the least that is offered is 1.5 (90 played at 60);
a camera that takes 24 in the dark in place of 30 makes 1.25."""
SLOWEST_SHOWN = 20.0
"""Least rate at which slow motion is shown [Hz]: films have 24, a camera in the dark takes 15 in place of 30."""
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
    stated = _stated(path, tags)
    if stated is None:
        return 1.0
    name, text = stated
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    said = f"The file states a capture rate of {text!r} ({name})"
    if not RATES[0] <= rate <= RATES[1]:
        notes.append(f"{said}, which is no number of frames a second; its time stamps are taken as they are.")
        return 1.0
    ratio = rate / played
    if 1.0 / DIFFERENT < ratio < DIFFERENT:
        return 1.0
    said = f"The file states that {rate:g} pictures a second were taken ({name}), and shows {played:.4g}"
    if ratio > 1.0 and played < SLOWEST_SHOWN:
        notes.append(
            f"{said}, as a camera does that slows down in the dark; its time stamps are taken as they are. "
            f"If it is slow motion, give --rate {rate:g}."
        )
        return 1.0
    kind, change = ("slow motion", "divided") if ratio > 1.0 else ("time lapse", "multiplied")
    factor = max(ratio, 1.0 / ratio)
    factor = round(factor) if abs(factor / round(factor) - 1.0) < WHOLE else factor
    notes.append(
        f"{said}: {kind}. All times are {change} by {factor:.4g}; if it shows the motion at its true speed, give "
        f"--rate {played:.4g}."
    )
    return factor if ratio > 1.0 else 1.0 / factor


def _stated(path: Path, tags: Mapping[str, str]) -> tuple[str, str] | None:
    """Return the capture rate that a file states, with the name under which it does."""
    # Matroska writes keys in capitals
    for key, value in tags.items():
        if key.lower() == ANDROID:
            return ANDROID, value.strip()
    for box in _beside_media(path):
        if match := SONY.search(box):
            return "captureFps", match[1].decode("ascii", "replace")
    return None


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
