"""Files of tracked points for the tests of their readers."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from monodyn.vision.clip.video import Video


def written(folder: Path, name: str, content: str | bytes) -> Path:
    """Write a file into a folder."""
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def film(count: int, width: int = 640, height: int = 480, rate: float = 25.0) -> Video:
    """Return a clip that has stamps and a size, and no pictures."""
    return Video(Path("clip.mp4"), width, height, np.arange(count) / rate, lambda start, stop: iter(()))
