"""The page that shows what a run saw: as large as it should be, whatever was found."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.estimation.fit import Grade
from monodyn.results.diagnosis import diagnosis, jpeg, png, write_diagnosis
from monodyn.results.folder import RunFolder
from monodyn.results.sheet import GREEN, ORANGE, RED, SKY, WIDTH
from monodyn.results.sight import Sight
from monodyn.types import Poses
from monodyn.vision.clip.video import Video, read
from monodyn.vision.locating.scene import Scene
from support import ClipMaker


def test_every_stage_has_its_page(filmed: tuple[Scene, Poses]) -> None:
    scene, poses = filmed
    video = scene.masks.video
    sights = [
        Sight(video), Sight(video, scene.masks), Sight(video, scene.masks, scene),
        Sight(video, scene.masks, scene, poses),
    ]  # fmt: skip
    pages = [diagnosis(sight) for sight in sights]
    for page in pages:
        assert page.shape[1] == WIDTH
        assert 900 < page.shape[0] < 2200
    assert len({page.tobytes() for page in pages}) == 4


@pytest.mark.parametrize(
    ("grade", "colour"), [(None, SKY), ("trusted", GREEN), ("approximate", ORANGE), ("refused", RED)]
)
def test_the_verdict_has_its_colour(
    make_clip: ClipMaker, grade: Grade | None, colour: tuple[int, int, int]
) -> None:
    page = diagnosis(Sight(read(make_clip()), status="What came of it.", grade=grade))
    assert (page[60:80] == colour).all(axis=2).sum() > 50


@pytest.mark.slow
def test_the_page_is_written_as_a_picture(make_clip: ClipMaker, tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    page = write_diagnosis(folder, Sight(read(make_clip())))
    assert page is not None
    assert folder.written == ["diagnosis.png"]
    assert np.array_equal(cv2.imread(str(tmp_path / "run" / "diagnosis.png")), page)
    assert cv2.imdecode(np.frombuffer(jpeg(page), np.uint8), 1).shape == page.shape
    assert png(page)[1:4] == b"PNG"


def test_a_clip_without_pictures_has_no_page(tmp_path: Path) -> None:
    def broken(start: int, stop: int):
        raise VideoError("no picture")
        yield

    video = Video(tmp_path / "clip.mp4", 64, 48, np.arange(3.0), broken)
    assert write_diagnosis(RunFolder(tmp_path / "run"), Sight(video)) is None
