"""How a stream is read and followed: what is out of range is refused."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.errors import SettingsError
from monodyn.live.settings import LiveSettings
from support import refuses


@pytest.mark.parametrize(
    ("name", "value", "least", "most"),
    [
        ("begin", 0.1, 0.2, 60), ("begin", 61.0, 0.2, 60), ("ahead", -0.1, 0, 60), ("window", 0.1, 0.2, 10),
        ("review", 0.5, 1, 60), ("patience", 0.0, 0.1, 3600), ("ahead", float("nan"), 0, 60),
    ],
)  # fmt: skip
def test_times_are_within_their_ranges(name, value, least, most):
    said = f"live.{name}: expected {least:g} to {most:g} s, got {value:g}; give a number in between."
    with refuses(SettingsError, said):
        LiveSettings(**{name: value})


def test_queue_size_and_words():
    for queue in (0, 10_001):
        with refuses(SettingsError, f"live.queue: expected 1 to 10000 frames, got {queue}."):
            LiveSettings(queue=queue)
    for size in ((640, 2), (70_000, 480)):
        with refuses(
            SettingsError,
            f"live.size: expected W,H of 16 to 65535 px, got {size[0]},{size[1]}; give width and height of "
            "the frames.",
        ):
            LiveSettings(size=size)
    for size, expected, got in (
        (np.array(640), "size to be tuple of 2 items, a whole number or None",
         "an array of shape () and type int64"),
        (float("nan"), "size to be tuple of 2 items, a whole number or None", "nan"),
        ((np.array(640), np.array(480)), "size[0] to be a whole number",
         "an array of shape () and type int64"),
        ((float("nan"), 480), "size[0] to be a whole number", "nan"),
    ):  # fmt: skip
        with refuses(SettingsError, f"live: expected {expected}, got {got}; give another."):
            LiveSettings(size=size)
    with pytest.raises(SettingsError, match=r"^live\.pace: expected .*'slow'"):
        LiveSettings(pace="slow")
