"""The interface of a segmentation: a second, independent method goes through the other stages."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest

from monodyn import stages
from monodyn.mechanism import load
from monodyn.types import FULL, Frame, Mask, Progress
from monodyn.vision import settings as vision_settings
from monodyn.vision.clip.steady import NO_PARALLAX, Parallax
from monodyn.vision.clip.video import Video, read
from monodyn.vision.foreground.background import Background, Samples, background_of
from monodyn.vision.foreground.masks import GeomColours, Masks, View, Wanted, plain_view
from monodyn.vision.foreground.sampling import sample_frames
from monodyn.vision.settings import SegmentSettings
from support import DEMO

LEAST_GREY, FULL_GREY = 10.0, 50.0
"""Differences from the background at which a pixel begins to count, and counts in full [grey levels]."""


@dataclass(frozen=True, eq=False)
class DifferenceMasks:
    """Foreground by the plain difference from a background, between two fixed levels."""

    video: Video
    samples: Samples
    background: Background
    varied: bool = True

    def of(self, frame: Frame, wanted: Wanted | None = None) -> Mask:
        beyond = np.abs(frame.luma.astype(np.float32) - self.background.luma) - LEAST_GREY
        share = np.clip(beyond / (FULL_GREY - LEAST_GREY), 0.0, 1.0)
        return Mask(frame.index, frame.time, np.round(share * FULL).astype(np.uint8)[np.newaxis])

    def __iter__(self) -> Iterator[Mask]:
        return (self.of(frame) for frame in self.video.frames())

    def view(self, geoms: int) -> View:
        return plain_view(self.background.known.astype(np.float32), geoms)

    def over(self, samples: Samples) -> DifferenceMasks:
        return replace(self, samples=samples)

    def refined(self, covered: Sequence[np.ndarray]) -> DifferenceMasks:
        return self

    @property
    def parallax(self) -> Parallax:
        return NO_PARALLAX

    def nearer(self, parallax: Parallax) -> DifferenceMasks:
        return self

    def away(self, frame: int) -> np.ndarray:
        return np.zeros(2)

    def coloured(self, colours: GeomColours | None) -> DifferenceMasks:
        return self


if TYPE_CHECKING:

    def same_shape(masks: DifferenceMasks) -> Masks:
        return masks


def difference_masks(
    video: Video, settings: SegmentSettings, background: str | Path | None, progress: Progress | None
) -> DifferenceMasks:
    """Segment by the difference from a picture that the user gives."""
    assert background is not None
    samples = sample_frames(video, progress=progress)
    frame = next(iter(read(background, still=True).frames()))
    grey = cv2.GaussianBlur(frame.luma.astype(np.float32), (0, 0), 0.7)
    measured = background_of(samples)
    known = np.ones(grey.shape, bool)
    wall = replace(measured, luma=grey, chroma=None, known=known, given=True)
    return DifferenceMasks(video, samples, wall)


@pytest.mark.slow
def test_another_method_is_a_class_and_an_entry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(stages.SEGMENT_METHODS, "difference", difference_masks)
    monkeypatch.setattr(vision_settings, "SEGMENT_METHOD_NAMES", ("fast", "difference"))
    video = read(DEMO / "double.mp4")
    wall = background_of(sample_frames(video)).luma
    cv2.imwrite(str(tmp_path / "wall.png"), np.clip((wall - 16.0) * 255.0 / 219.0, 0, 255).round())

    chosen = SegmentSettings(method="difference")  # type: ignore[arg-type]
    masks = stages.segment(video, chosen, background=tmp_path / "wall.png")
    assert isinstance(masks, DifferenceMasks)
    scene = stages.locate(masks, load(str(DEMO / "double.xml")))
    assert isinstance(scene.masks, DifferenceMasks)
    poses = stages.track(scene.masks, scene)
    assert poses.seen.mean() > 0.95

    truth = np.array(json.loads((DEMO / "double.json").read_text())["q"])
    off = (np.degrees(poses.position - truth)[poses.seen] + 180.0) % 360.0 - 180.0
    # fixed levels on a soft edge: a few tenths of a pixel on links of 110 px
    assert np.sqrt(np.mean(off**2, axis=0)).max() < 0.5


def test_a_plain_view_reads_one_plane_for_all_geoms() -> None:
    view = plain_view(np.full((4, 5), 0.5, np.float32), 3)
    assert view.trust.shape == (1, 4, 5)
    assert view.part.tolist() == [0, 0, 0]
    assert view.shaded.tolist() == [False, False, False]
