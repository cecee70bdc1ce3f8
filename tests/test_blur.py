"""Clips whose pictures are exposed while the mechanism moves, from locating to tracking."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

import monodyn
from monodyn import blur
from monodyn.blur import Exposed, blurred, follow_exposed, unsettled
from monodyn.mechanism import Mechanism, load
from monodyn.mechanism.simulate import rollout
from monodyn.settings import RunSettings
from monodyn.stages import track_freely
from monodyn.types import FULL, Camera
from monodyn.vision.drawing.camera import around_origin, from_origin
from monodyn.vision.drawing.shutter import Shutter
from monodyn.vision.release import FreeSpan
from monodyn.vision.settings import CameraSettings, TrackSettings
from monodyn.vision.tracking.exposure import Exposure
from pictures import CAMERA, exposed_mask

SHUTTER = Shutter(0.0584, 0.0018, 0.0, *np.zeros((3, 3, 1)))


def film(
    folder: Path, rate: float, exposure: float, readout: float, count: int,
    mechanism: Mechanism | None = None, camera: Camera = CAMERA,
) -> tuple[Any, np.ndarray]:  # fmt: skip
    """Film a swinging mechanism, a bob; return the clip and the true joint positions (frame, dof)."""
    mechanism = mechanism or load("bob")
    # where it is half an exposure before each picture, in its middle and half an exposure later
    half = 0.5 * max(exposure, readout)
    times = (half + np.arange(count)[:, None] / rate + [-half, 0.0, half]).ravel()
    start = np.array([-0.3, 0.5][: len(mechanism.joints)])
    every = rollout(mechanism.tree, times, start, np.zeros(len(start)), substeps=16)[0]
    begun, q, ended = every[::3], every[1::3], every[2::3]
    whole, bent = ended - begun, 0.5 * (ended + begun) - q
    y, x = np.mgrid[: camera.height, : camera.width]
    wall = 165.0 + 20.0 * np.sin(x / 9.0) * np.cos(y / 11.0)
    rng = np.random.default_rng(3)
    folder.mkdir()
    for k, (pose, way, bend) in enumerate(zip(q, whole, bent, strict=True)):
        moves = {"sweep": way, "bend": bend} if exposure else {"skew": way, "lean": bend}
        mask = exposed_mask(mechanism, camera, pose, **moves, count=17 if exposure else 1)
        picture = wall + mask[0] / FULL * (60.0 - wall) + rng.normal(size=wall.shape)
        cv2.imwrite(str(folder / f"{k:03d}.png"), np.clip(picture, 0, 255).round().astype(np.uint8))
    return monodyn.read(folder, rate=rate), q


def errors(found: Any, q: np.ndarray) -> np.ndarray:
    """Return the errors of the seen poses [deg]."""
    poses = found[1]
    wrong = (poses.position - q[poses.frame] + np.pi) % (2.0 * np.pi) - np.pi
    return np.degrees(wrong[poses.seen, 0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate", "exposure", "readout", "given"),
    [(12.0, 0.05, 0.0, CameraSettings()), (30.0, 0.0, 0.03, CameraSettings(exposure=0.0, readout=0.03))],
)
def test_poses_are_those_of_the_middle_of_the_exposure(
    tmp_path: Path, rate: float, exposure: float, readout: float, given: CameraSettings
) -> None:
    video, q = film(tmp_path / "film", rate, exposure, readout, 40)
    mechanism = load("bob")
    masks = monodyn.segment(video)
    scene = monodyn.locate(masks, mechanism)
    sharp = (scene, *track_freely(scene.masks, scene))
    found = follow_exposed(sharp, mechanism, RunSettings(camera=given))
    assert found[0].shutter is not None
    assert found[0].shutter.exposure == pytest.approx(exposure, rel=0.1)
    assert found[1].seen.mean() > 0.95
    rms = float(np.sqrt(np.mean(errors(found, q) ** 2)))
    assert rms < 0.3
    assert rms < 0.6 * float(np.sqrt(np.mean(errors(sharp, q) ** 2)))


@pytest.mark.slow
def test_a_camera_that_looks_obliquely_is_found_through_the_blur(tmp_path: Path) -> None:
    mechanism, camera = load("double"), from_origin(replace(around_origin(CAMERA), yaw=0.35))
    video, q = film(tmp_path / "film", 30.0, 0.02, 0.0, 60, mechanism, camera)
    scene = monodyn.locate(monodyn.segment(video), mechanism)
    found = follow_exposed((scene, *track_freely(scene.masks, scene)), mechanism, RunSettings())
    assert found.settled
    assert found.scene.shutter is not None
    assert found.scene.shutter.exposure == pytest.approx(0.02, rel=0.1)
    assert found.scene.camera.yaw == pytest.approx(0.35, abs=0.02)
    assert float(np.sqrt(np.mean(errors(found, q) ** 2))) < 0.2


def test_sharp_pictures_are_left_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    still = SimpleNamespace(masks=None, video=SimpleNamespace(camera_path=None))
    found: Any = (still, None, None)
    monkeypatch.setattr(blur, "exposure_of", lambda *given: Exposure(0.0))
    assert follow_exposed(found, load("bob"), RunSettings()) == Exposed(*found)
    # the published method knows no exposure, and a user may know that there is none
    monkeypatch.setattr(blur, "exposure_of", lambda *given: Exposure(0.05))
    assert follow_exposed(found, load("bob"), RunSettings(track=TrackSettings(method="paper"))) == Exposed(
        *found
    )
    none = RunSettings(camera=CameraSettings(exposure=0.0))
    assert follow_exposed(found, load("bob"), none) == Exposed(*found)
    # a camera that moves blurs the pictures in its own way
    still.video.camera_path = "its way"
    assert follow_exposed(found, load("bob"), RunSettings()) == Exposed(*found)


@pytest.mark.parametrize(
    ("estimates", "rates", "rounds"),
    [
        ([0.04, 0.055, 0.056, 0.056], [3.0] * 4, 3),
        ([0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09], [3.0] * 7, 6),
        ([0.05, 0.05, 0.05, 0.05], [0.5, 3.0, 3.01, 3.01], 3),
    ],
)
def test_scene_and_poses_are_found_again_until_exposure_and_motion_stay(
    monkeypatch: pytest.MonkeyPatch, estimates: list[float], rates: list[float], rounds: int
) -> None:
    """And only then, or after half of the rounds, is it found out whether the camera looks obliquely."""
    mechanism, left = load("bob"), list(zip(estimates, rates, strict=True))
    found_again, looked = [], []

    def moving(scene: Any, poses: Any, exposure: Exposure, readout: float) -> Any:
        shutter = Shutter(
            exposure.seconds, exposure.std, readout, *[np.full((3, 1), x) for x in (0.0, rate[0], 0.0)]
        )
        return SimpleNamespace(**{**vars(scene), "shutter": shutter})

    rate = [0.0]

    def estimated(*given: Any) -> Exposure:
        seconds, rate[0] = left.pop(0)
        return Exposure(seconds)

    def again(sought: Any, scene: Any, poses: Any, *, looks: bool) -> Any:
        found_again.append(scene.shutter.exposure)
        looked.append(looks)
        return scene

    monkeypatch.setattr(blur, "exposure_of", estimated)
    monkeypatch.setattr(blur, "with_shutter", moving)
    monkeypatch.setattr(blur, "find_again", again)
    monkeypatch.setattr(blur, "track_freely", lambda *given, **more: (None, None))
    still = SimpleNamespace(camera_path=None)
    scene: Any = SimpleNamespace(masks=None, video=still, shutter=None, mechanism=mechanism, camera=CAMERA)
    found = follow_exposed((scene, None, None), mechanism, RunSettings())  # pyright: ignore
    assert found_again == estimates[:rounds]
    before = min(rounds - 1, blur.ROUNDS // 2)
    assert looked == [False] * before + [True] * (rounds - before)
    assert found.settled == (rounds < blur.ROUNDS)


def test_the_note_says_how_pictures_were_exposed() -> None:
    scene: Any = SimpleNamespace(shutter=SHUTTER, video=SimpleNamespace(camera_path=None))
    poses: Any = SimpleNamespace(time=np.arange(3) / 10.0)

    found = Exposed(scene, poses, FreeSpan(0, 3, ()))

    def notes(camera: CameraSettings) -> list[str]:
        return blurred(found, camera)

    assert notes(CameraSettings()) == [
        "Motion blurs the pictures: each is exposed for 58.4 ± 1.8 ms, 58% of the time between two frames. "
        "Outlines that move meanwhile are compared with them; the poses are those in the middle of the "
        "exposures."
    ]
    assert unsettled(found) == ""
    assert unsettled(found._replace(settled=False)) == (
        "Exposure and motion still changed after scene and poses had been found with them 6 times: sizes and "
        "poses may be off by more than stated; --camera.exposure SECONDS gives the exposure where it is "
        "known, and shorter exposures or more pictures a second show the motion better."
    )
    scene.shutter = replace(SHUTTER, exposure=0.05, std=0.0)
    assert notes(CameraSettings(exposure=0.05)) == [
        "As given with --camera.exposure, each picture is exposed for 50 ms, 50% of the time between two "
        "frames. Outlines that move meanwhile are compared with them; the poses are those in the middle of "
        "the exposures."
    ]
    scene.shutter = replace(SHUTTER, exposure=0.0, readout=0.02)
    assert notes(CameraSettings()) == []
    assert notes(CameraSettings(readout=0.02)) == []
    scene.shutter = None
    # what was found for sharp pictures before a camera at rest says nothing of one that moves
    assert notes(CameraSettings(readout=0.02)) == []
    scene.video.camera_path = "its way"
    assert notes(CameraSettings()) == []
    assert notes(CameraSettings(readout=0.02)) == [
        "The camera moves: its pictures are taken as of one instant each, and --camera.exposure and "
        "--camera.readout do not count."
    ]
