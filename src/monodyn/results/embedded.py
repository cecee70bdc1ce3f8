"""The film of a run as its page holds it: itself, or reduced, and as much of it as there is room for."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

SIDE = 640
"""Longest side of a picture of a reduced film [px]."""
QUALITY = {"preset": "veryfast", "crf": "30", "tune": "zerolatency"}
"""How it is encoded: every picture comes out as it goes in, so that its size is known before the next one."""
PER_PICTURE, BESIDES = 32, 20_000
"""Bytes that a film has of each picture, and of all of them, besides what is encoded."""


def embedded(film: Path, most: int) -> tuple[bytes, float | None]:
    """Return a film of at most so many bytes.

    Args:
        film: The film (H.264).
        most: How many bytes there is room for.

    Returns:
        The film, nothing where there is room for no picture; and how long it is [s] where its end is left
        out, else None.
    """
    if film.stat().st_size <= most:
        return film.read_bytes(), None
    import av

    made, size, shown, begin = io.BytesIO(), BESIDES, None, None
    with av.open(str(film)) as source, av.open(made, "w", format="mp4") as target:
        pictures: Any = source.streams.video[0]
        share = min(1.0, SIDE / max(pictures.width, pictures.height))
        # H.264 takes even sizes
        width, height = (2 * max(1, round(0.5 * share * side)) for side in (pictures.width, pictures.height))
        stream: Any = target.add_stream("libx264", rate=pictures.average_rate, options=QUALITY)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.codec_context.time_base = pictures.time_base
        for picture in source.decode(pictures):
            begin = picture.time if begin is None else begin
            packets = stream.encode(picture.reformat(width, height))
            size += PER_PICTURE + sum(packet.size for packet in packets)
            if size > most:
                shown = picture.time - begin
                break
            target.mux(packets)
    # without a picture there is no film
    return (made.getvalue(), shown) if shown != 0.0 else (b"", None)
