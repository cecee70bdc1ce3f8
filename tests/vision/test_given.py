"""Masks of other tools in place of a segmentation."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from zipfile import ZipFile

import cv2
import numpy as np
import pytest

from monodyn.errors import VideoError
from monodyn.mechanism import load
from monodyn.stages import locate, track
from monodyn.types import FULL, Camera
from monodyn.vision.clip.video import Video
from monodyn.vision.drawing.outline import outline
from monodyn.vision.foreground.given import read_masks
from monodyn.vision.foreground.mask_files import opened_masks
from support import refuses
from tracked import apart, swing

CAMERA = Camera(320, 240, 320.0, 0.0, -0.1, 0.9)


def drawn(count: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Return masks of a swinging double pendulum with a label for each body, and its poses."""
    double = load("double")
    q = swing(double, count, (0.4, 0.6))
    labels = np.zeros((count, CAMERA.height, CAMERA.width), np.uint8)
    for mask, pose in zip(labels, q, strict=True):
        for body, (_, polygon) in enumerate(outline(double, CAMERA, pose), start=1):
            cv2.fillPoly(mask, [np.round(polygon * 16.0).astype(np.int32)], body, cv2.LINE_8, 4)
    return labels, q


@pytest.fixture(scope="module")
def labels() -> tuple[np.ndarray, np.ndarray]:
    return drawn()


@pytest.mark.parametrize(
    "form", ["bodies", *(pytest.param(form, marks=pytest.mark.slow) for form in ("binary", "soft", "folder"))]
)
def test_masks_of_every_form_are_followed(
    labels: tuple[np.ndarray, np.ndarray], form: str, tmp_path: Path
) -> None:
    masks, q = labels
    path = tmp_path / "masks.npz"
    if form == "folder":
        path = tmp_path
        for k, mask in enumerate(masks):
            cv2.imwrite(str(tmp_path / f"mask{k:03d}.png"), mask)
    elif form == "bodies":
        np.savez_compressed(path, masks=np.stack([masks == 1, masks == 2], axis=1))
    elif form == "soft":
        np.savez_compressed(path, other=(masks > 0).astype(np.float32))
    else:
        np.savez_compressed(path, masks > 0)
    found = read_masks(path, load("double"), rate=30.0)
    assert found.planes == (2 if form in ("folder", "bodies") else 1)
    mask = found.of(found.samples.frames[0])
    assert int(mask.planes.max()) == FULL
    scene = locate(found, load("double"))
    poses = track(scene.masks, scene)
    assert poses.seen.mean() > 0.9
    assert np.nanstd(apart(poses.position, q)) < np.radians(1.5)


def test_times_are_those_of_the_clip_or_assumed(
    labels: tuple[np.ndarray, np.ndarray], tmp_path: Path
) -> None:
    for k, mask in enumerate(labels[0]):
        cv2.imwrite(str(tmp_path / f"mask{k:03d}.png"), mask)
    alone = read_masks(tmp_path, load("double"))
    assert alone.video.notes == (
        "Masks have no time stamps: 30 a second assumed; give --rate, or the clip with --clip, if it "
        "differs.",
    )
    clip = Video(Path("clip.mp4"), 320, 240, np.arange(40) / 24.0, lambda start, stop: iter(()))
    timed = read_masks(tmp_path, load("double"), clip=clip)
    assert timed.video.times[1] == 1.0 / 24.0
    assert timed.video.notes == ()
    short = Video(Path("clip.mp4"), 320, 240, np.arange(30) / 24.0, lambda start, stop: iter(()))
    with refuses(
        VideoError,
        f"{tmp_path}: expected 30 masks of 320x240 px like the clip, got 40 of 320x240; give the masks of "
        "this clip.",
    ):
        read_masks(tmp_path, load("double"), clip=short)


def test_a_missing_number_is_a_missing_mask(labels: tuple[np.ndarray, np.ndarray], tmp_path: Path) -> None:
    for k in (0, 1, 2, 4, 5, 9):
        cv2.imwrite(str(tmp_path / f"mask{k:03d}.png"), labels[0][k])
    found = read_masks(tmp_path, load("double"), rate=10.0)
    assert [(mask.index, mask.time) for mask in found] == [(k, k / 10) for k in (0, 1, 2, 4, 5, 9)]
    note = "The numbers of the pictures jump 2 times; a missing number is taken as a missing picture."
    assert found.video.notes == (note,)
    clip = Video(Path("clip.mp4"), 320, 240, np.arange(10) / 24.0, lambda start, stop: iter(()))
    timed = read_masks(tmp_path, load("double"), clip=clip)
    assert timed.video.notes == (note,)
    assert [mask.time for mask in timed] == [k / 24 for k in (0, 1, 2, 4, 5, 9)]


def test_colours_of_masks_are_names(labels: tuple[np.ndarray, np.ndarray], tmp_path: Path) -> None:
    colours = np.array([[0, 0, 0], [0, 0, 200], [0, 120, 0]], np.uint8)
    for k, mask in enumerate(labels[0][:5]):
        cv2.imwrite(str(tmp_path / f"mask{k:03d}.png"), colours[mask])
    found = read_masks(tmp_path, load("double"), rate=10.0)
    for mask, truth in zip(found, labels[0], strict=False):
        assert np.array_equal(mask.planes[0] == FULL, truth > 0)


def test_what_are_no_masks_is_refused(tmp_path: Path) -> None:
    path, double = tmp_path / "m.npz", load("double")
    np.savez(path, masks=np.zeros((9, 24, 32)))
    with refuses(
        VideoError,
        f"{path}: expected masks of the mechanism, got no pixel that is covered by half; give masks that are "
        "white, 1 or 255 where the mechanism is.",
    ):
        read_masks(path, double)
    np.savez(path, masks=np.ones((9, 24, 32)))
    with refuses(
        VideoError,
        f"{path}: expected masks of the mechanism, which cover at most 60% of a picture, got 100%; they may "
        "be of the background: exchange black and white.",
    ):
        read_masks(path, double)
    np.savez(path, masks=np.zeros((9, 3, 24, 32)))
    with refuses(
        VideoError, f"{path}: expected one mask, or 2 for the bodies of 'double', got 3 in a frame."
    ):
        read_masks(path, double)
    np.savez(path, masks=np.zeros(9))
    with refuses(
        VideoError,
        f"{path}: expected an array (frame, height, width) or (frame, body, height, width), got none.",
    ):
        read_masks(path, double)
    for most, value in (("5", 5), ("nan", np.nan), ("inf", np.inf), ("300", 300)):
        np.savez(path, masks=np.full((9, 24, 32), value))
        with refuses(
            VideoError,
            f"{path}: expected values from 0 to 1, 255 or 65535, or labels 1 to 2 for the bodies of "
            f"'double', got values up to {most}; scale them.",
        ):
            read_masks(path, double)
    np.savez(path, masks=np.repeat([[-1], [1]], 12, axis=0).reshape(-1, 1, 1) * np.ones((24, 24, 32)))
    with refuses(VideoError, f"{path}: expected values from 0 to 1 in all masks, got -1; correct them."):
        read_masks(path, double)
    np.savez(path, masks=np.full((9, 24, 32), "a"))
    with refuses(VideoError, f"{path}: expected numbers in 'masks', got values of type <U1; save 0 and 1."):
        read_masks(path, double)
    for times in (np.arange(4), -np.arange(9), np.full(9, np.nan), np.full(9, "a")):
        np.savez(path, masks=np.eye(32)[np.newaxis].repeat(9, axis=0), times=times)
        with refuses(
            VideoError,
            f"{path}: expected times of 9 masks in seconds, one after the other, got something else; correct "
            "them, or leave them out and give --rate.",
        ):
            read_masks(path, double)
    path.write_bytes(b"PK")
    with pytest.raises(VideoError) as found:
        read_masks(path, double)
    reason = str(found.value).split("(", 1)[1].rsplit(")", 1)[0]
    with refuses(VideoError, f"{path}: cannot be read as NPZ ({reason}); save it with numpy.savez."):
        read_masks(path, double)
    path.write_bytes(b"")
    with refuses(
        VideoError, f"{path}: cannot be read as NPZ (No data left in file); save it with numpy.savez."
    ):
        read_masks(path, double)
    folder = tmp_path / "masks"
    folder.mkdir()
    cv2.imwrite(str(folder / "m1.png"), np.zeros((24, 32), np.uint8))
    cv2.imwrite(str(folder / "m2.png"), np.zeros((24, 30), np.uint8))
    with refuses(
        VideoError,
        f"{folder / 'm2.png'}: expected a mask of 32x24 px like the first one, got 30x24 px; give masks of "
        "one size.",
    ):
        read_masks(folder, double)
    (folder / "m1.png").write_bytes(b"")
    with refuses(VideoError, f"{folder / 'm1.png'}: expected a picture of a mask, cannot read it as one."):
        read_masks(folder, double)


def test_masks_that_are_not_there_are_no_clip(tmp_path: Path) -> None:
    (tmp_path / "masks.mp4").touch()
    path = tmp_path / "nothing"
    with refuses(
        VideoError,
        f"masks '{path}': expected a film, a folder of pictures or an array (.npz, .npy), found nothing; "
        "check the path.",
    ):
        read_masks(path, load("double"))
    path = tmp_path / "mask.mp4"
    with refuses(
        VideoError,
        f"masks '{path}': expected a film, a folder of pictures or an array (.npz, .npy), found nothing; did "
        f"you mean '{tmp_path / 'masks.mp4'}'?",
    ):
        read_masks(path, load("double"))


def test_files_that_announce_too_much_are_refused(tmp_path: Path) -> None:
    for number in (0, 1, 2, 10**9):
        cv2.imwrite(str(tmp_path / f"m{number}.png"), np.full((24, 32), 255, np.uint8))
    with refuses(
        VideoError,
        f"clip '{tmp_path}': expected pictures with numbers up to 1000000 apart, got 0 to 1000000000; remove "
        "what is no part of the series.",
    ):
        opened_masks(tmp_path, load("double"))
    with ZipFile(tmp_path / "masks.npz", "w") as file:
        file.writestr("masks.npy", "hello")
    with pytest.raises(VideoError, match="expected an array"):
        opened_masks(tmp_path / "masks.npz", load("double"))
    header = BytesIO()
    shape = {"descr": "|u1", "fortran_order": False, "shape": (10**6, 10**4, 10**4)}
    np.lib.format.write_array_header_1_0(header, shape)
    with ZipFile(tmp_path / "huge.npz", "w") as file:
        file.writestr("masks.npy", header.getvalue())
    with pytest.raises(VideoError, match="cannot be read as NPZ"):
        opened_masks(tmp_path / "huge.npz", load("double"))
