"""Large pictures are looked at reduced, unless somebody gives something in their pixels."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

import monodyn
from monodyn.cli.demo import CLIP, MODEL
from monodyn.live.sources import open_source
from monodyn.settings import RunSettings
from monodyn.vision.clip import video as video_module
from support import command


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    """Return a folder of pictures with sides that are no multiple of two."""
    noise = np.random.default_rng(0).integers(0, 255, (3, 81, 103, 3), dtype=np.uint8)
    for k, picture in enumerate(noise):
        cv2.imwrite(str(tmp_path / f"{k}.png"), picture)
    return tmp_path


def test_each_pixel_is_the_mean_of_those_that_it_covers(
    pictures: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = monodyn.read(pictures, rate=30.0)
    assert (whole.width, whole.height, whole.shrink, whole.notes) == (103, 81, 1, ())
    monkeypatch.setattr(video_module, "WHOLE_PIXELS", 2100)
    reduced = monodyn.read(pictures, rate=30.0)
    assert (reduced.width, reduced.height, reduced.shrink) == (51, 40, 2)
    assert reduced.notes == (
        "Pictures of 103x81 px are looked at reduced, 51x40; --whole looks at all of their pixels, with more "
        "memory and time.",
    )
    assert monodyn.read(pictures, whole=True).shrink == 1
    for large, small in zip(whole.frames(), reduced.frames(), strict=True):
        means = large.luma[:80, :102].reshape(40, 2, 51, 2).mean(axis=(1, 3))
        assert np.abs(small.luma - means).max() <= 0.5
        assert not small.luma.flags.writeable
        assert small.chroma is not None
        assert {plane.shape for plane in small.chroma} == {(20, 26)}
        assert (small.index, small.time) == (large.index, large.time)
    monkeypatch.setattr(video_module, "WHOLE_PIXELS", 1000)
    assert (monodyn.read(pictures).shrink, monodyn.read(pictures).width) == (3, 34)


@pytest.mark.parametrize(
    ("settings", "whole"),
    [
        (RunSettings(), False),
        (RunSettings(rate=30.0, fix={"gravity": 9.81}), False),
        (RunSettings(whole=True), True),
        (RunSettings(roi=(0, 0, 40, 40)), True),
        (RunSettings(fix={"camera.focal": 900.0}), True),
        (RunSettings(locate=monodyn.LocateSettings(focal=900.0)), True),
        (RunSettings(background=Path("empty.png")), True),
        (RunSettings(masks=Path("masks.npz")), True),
        (RunSettings(points=Path("points.csv")), True),
    ],
)
def test_what_is_given_in_pixels_is_in_those_of_the_file(settings: RunSettings, whole: bool) -> None:
    assert settings.in_pixels is whole


def test_a_stream_of_a_file_is_reduced_as_the_file_is(
    pictures: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(video_module, "WHOLE_PIXELS", 2100)
    assert open_source(str(pictures)).width == 51
    assert open_source(str(pictures), whole=True).width == 103


@pytest.mark.slow
def test_a_run_of_reduced_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lengths, the region in pixels of the file, and a film of a prediction over the reduced pictures."""
    monkeypatch.setattr(video_module, "WHOLE_PIXELS", 200_000)
    out, film = tmp_path / "run", tmp_path / "film"
    done = command("run", CLIP, "--model", MODEL, "--out", out, "--quiet")
    assert (done.code, done.err) == (0, "")
    log, fit = (json.loads((out / f"{name}.json").read_text(encoding="utf-8")) for name in ("run", "fit"))
    assert log["notes"][0].startswith("Pictures of 720x480 px are looked at reduced, 360x240;")
    assert (fit["camera"]["width"], fit["camera"]["height"]) == (360, 240)
    truth = json.loads(CLIP.with_suffix(".json").read_text(encoding="utf-8"))
    found = {row["name"]: row["value"] for row in fit["parameters"]}
    assert found["link1.length"] == pytest.approx(truth["length"][0], rel=5e-3)
    left, top, width, height = log["region"]
    assert 360 < left + width <= 720
    assert 240 < top + height <= 480
    # the region may be given as it stands there
    again = command("track", CLIP, "--model", MODEL, "--roi", ",".join(map(str, log["region"])),
                    "--out", tmp_path / "again", "--quiet")  # fmt: skip
    assert again.code == 0
    for camera, size in (("reduced", (360, 240)), ("whole", (720, 480))):
        if camera == "whole":
            done = command("run", CLIP, "--model", MODEL, "--out", out, "--force", "--whole", "--quiet")
            assert (done.code, done.err) == (0, "")
        done = command("predict", out, "--until", 12, "--film", "--out", film, "--force", "--quiet")
        assert (done.code, done.err) == (0, "")
        drawn = monodyn.read(film / "prediction.mp4", whole=True)
        assert (drawn.width, drawn.height) == size
