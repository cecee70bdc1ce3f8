"""A clip of the user's: what has to be given together, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from monodyn.errors import SettingsError, VideoError
from monodyn.reproduce.clip import ClipSettings, make_clip
from monodyn.reproduce.given import GivenClip, given_truth, opened
from monodyn.types import Camera
from support import refuses

SMALL = Camera(72, 48, 70.0, 0.03, -0.17, 1.15)


def test_clip_and_model_are_given_together() -> None:
    assert GivenClip.of(None, None, None) is None
    assert GivenClip.of("a.mp4", "double", "t.json") == GivenClip("a.mp4", "double", "t.json")
    with refuses(
        SettingsError, "reproduce: expected --clip and --model together, got --clip alone; add --model."
    ):
        GivenClip.of("a.mp4", None, None)
    with refuses(
        SettingsError, "reproduce: expected --clip and --model together, got --model alone; add --clip."
    ):
        GivenClip.of(None, "double", None)
    with refuses(
        SettingsError,
        "reproduce: expected --truth with --clip, got it alone; the made clip has its own, leave it out.",
    ):
        GivenClip.of(None, None, "truth.json")


def test_a_clip_has_a_least_length_and_any_mechanism(tmp_path: Path) -> None:
    clip = tmp_path / "short.mp4"
    make_clip(clip, ClipSettings(camera=SMALL, frames=8))
    with refuses(VideoError, f"clip '{clip}': expected at least 10 frames, got 8; give a longer clip."):
        opened(clip, "double")
    make_clip(clip, ClipSettings(camera=SMALL, frames=12))
    video, mechanism = opened(clip, "cartpole")
    assert (video.count, [joint.kind for joint in mechanism.joints]) == (12, ["slide", "hinge"])
    assert given_truth(GivenClip(clip, "double")) is None
    with pytest.raises(VideoError):
        given_truth(GivenClip(clip, "double", tmp_path / "none.csv"))
