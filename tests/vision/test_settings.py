"""What the settings of the vision stages take, and what they say of anything else."""

from __future__ import annotations

import pytest

from monodyn.errors import SettingsError
from monodyn.vision.settings import (
    CameraSettings,
    LocateSettings,
    SegmentSettings,
    TrackSettings,
)
from support import refuses


@pytest.mark.parametrize(
    ("kind", "name", "known"),
    [
        (SegmentSettings, "segment", "'fast'"),
        (CameraSettings, "camera", "'fast', 'paper'"),
        (LocateSettings, "locate", "'fast', 'paper'"),
        (TrackSettings, "track", "'fast', 'paper'"),
    ],
)
def test_methods(kind: type, name: str, known: str) -> None:
    with refuses(SettingsError, f"{name}.method: expected one of {known}, got 'slow'."):
        kind(method="slow")


def test_segment_settings() -> None:
    with refuses(SettingsError, "segment.colour: expected one of 'auto', 'grey', 'colour', got 'sepia'."):
        SegmentSettings(colour="sepia")
    with refuses(SettingsError, "segment.contrast: expected 0 to 255 grey levels, got -1.0."):
        SegmentSettings(contrast=-1.0)
    with refuses(
        SettingsError,
        "roi: expected X,Y,W,H of 0 or more with sides of at least 16 px, got 0,-1,200,100; give column and "
        "row of the upper left corner, width and height.",
    ):
        SegmentSettings(roi=(0, -1, 200, 100))
    with refuses(
        SettingsError, "time-range: expected A:B with B after A, got 3:2 s; give seconds of the clip."
    ):
        SegmentSettings(time_range=(3.0, 2.0))
    assert SegmentSettings(time_range=(3.0, None)).time_range == (3.0, None)


def test_locate_settings() -> None:
    with refuses(SettingsError, "locate.seed: expected 0 or more, got -1; give a whole number."):
        LocateSettings(seed=-1)
    with refuses(
        SettingsError,
        "locate.focal: expected 10 to 1e+06 px, or 0, got -5; give it in pixels of the clip, or leave "
        "it out.",
    ):
        LocateSettings(focal=-5.0)
    with refuses(SettingsError, "locate.search_frames: expected 2 to 1000 key frames, got 1."):
        LocateSettings(search_frames=1)


def test_camera_settings() -> None:
    with refuses(
        SettingsError,
        "camera.exposure: expected 0 to 10 s, got -0.01; give how long each picture is exposed, in seconds.",
    ):
        CameraSettings(exposure=-0.01)
    with refuses(
        SettingsError,
        "camera.readout: expected -10 to 10 s, got 33.0; give the time from the first row of a picture to "
        "the last, in seconds.",
    ):
        CameraSettings(readout=33.0)
    assert CameraSettings(readout=-0.02).exposure is None


def test_track_settings() -> None:
    with refuses(SettingsError, "track.move: expected 0.001 to 10, got -1.0."):
        TrackSettings(move=-1.0)
    with refuses(SettingsError, "track.inside: expected a share from 0 to 1, got 1.5."):
        TrackSettings(inside=1.5)
