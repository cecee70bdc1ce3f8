"""The mechanism followed through a clip again: an earlier time says where it was, and not on which turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from films import film, swing
from monodyn.vision.settings import TrackSettings
from monodyn.vision.track import Follower, follow_clip
from monodyn.vision.tracking.exposure import Exposure, with_shutter


@pytest.mark.slow
def test_turns_of_an_earlier_time_are_not_gone_on_with(tmp_path) -> None:
    """As where pictures are first taken for sharp, and a blurred one is not seen: across the gap a turn is
    lost, and where the clip is followed again the pictures of the gap are seen."""
    scene, poses = film(tmp_path)
    turned = poses.position.copy()
    turned[20:, 1] -= 2.0 * np.pi
    # an exposure so short that nothing is blurred
    again = with_shutter(scene, replace(poses, position=turned), Exposure(1e-7))
    follower = Follower(again, TrackSettings())
    steps = [follower.find(frame).position for frame in again.masks.video.frames()]
    np.testing.assert_allclose(np.array(steps), swing(), atol=0.02)
    found = follow_clip(again.masks, again, TrackSettings())
    assert found.seen.all()
    np.testing.assert_allclose(found.position, swing(), atol=0.02)
