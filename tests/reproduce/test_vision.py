"""What a method sees: both methods on a small clip."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from experiments import JOINTS, mechanism, seen
from monodyn.errors import VideoError
from monodyn.reproduce import vision
from monodyn.reproduce.clip import ClipSettings, make_clip
from monodyn.reproduce.given import opened
from monodyn.reproduce.repetition import START
from monodyn.reproduce.vision import hinges_of, see
from monodyn.stages import segment
from monodyn.types import Camera

SMALL = ClipSettings(camera=Camera(144, 96, 140.0, 0.03, -0.17, 1.15), frames=20)


def test_hinges_are_counted_by_place() -> None:
    assert hinges_of(mechanism().joints) == [0, 1]
    assert seen().hinges == [0, 1]
    assert seen().silhouettes == 0.0


def test_a_failure_stands_in_the_status(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clip, model = tmp_path / "clip.mp4", tmp_path / "start.xml"
    truth = make_clip(clip, SMALL)
    model.write_text(START)
    video, topology = opened(clip, model)

    def fails(*args: object, **more: object) -> None:
        raise VideoError("nothing is seen.")

    masks = segment(video)
    monkeypatch.setattr(vision, "locate", fails)
    found = see("fast", masks, topology, truth)
    assert (found.status, found.poses, found.scene) == ("failed: nothing is seen.", None, None)
    assert tuple(joint.name for joint in found.joints) == JOINTS


@pytest.mark.slow
def test_both_forms_of_the_framework_are_compared(tmp_path: Path) -> None:
    clip, model = tmp_path / "clip.mp4", tmp_path / "start.xml"
    truth = make_clip(clip, SMALL)
    model.write_text(START)
    video, topology = opened(clip, model)
    found = see("paper", segment(video), topology, truth)
    assert found.status == "done"
    assert [form.name for form in found.frameworks] == ["strict", "interleaved"]
    for form in found.frameworks:
        assert form.status == "done"
        assert form.mismatch is not None
        assert form.area is not None
        assert form.error is not None
        # the rods are 3 px wide here: a pixel at their ends is a degree and a half
        assert form.mismatch < 0.25 * form.area
        assert np.abs(form.error).max() < np.radians(5.0)
        assert form.drawings > len(form.history) > 0
    assert found.errors is not None
    assert found.errors.shape == (SMALL.frames, 2)
