"""The same motion in another clip: turned, cut or coded otherwise, and by a model that is written otherwise.

A clip is painted once for each mechanism; what was found in it is compared with what is found in each of its
changes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

import monodyn
from cases import CASES
from clips import Clip, cached
from monodyn.estimation.fit import Fit
from monodyn.types import Poses

pytestmark = pytest.mark.slow

LENGTH_TOLERANCE = 0.01
"""Relative difference of a length between two clips: three of the deviations that clips this short leave."""
POSE_TOLERANCE = 0.5
"""Rms difference of a hinge [deg]: links of 50 px whose edges are seen to 0.1 px, in the smallest pictures
twice that."""
Pictures = Sequence[np.ndarray]
H264: Mapping[str, str] = {"crf": "18"}


@dataclass(frozen=True)
class Pair:
    """A change of a clip, and its effect on the joint positions.

    Attributes:
        name: What is changed.
        change: Changes the pictures.
        clip: Name of the clip.
        sign: Factor of the positions.
        offset: What is added to the first hinge [rad].
        rows: The first frame that is there, and each how many-th from there on.
        rate: Frames a second.
        codec: Encoder, its options and its pixels.
        ending: Of the file's name.
        said: What the advice has to say.
    """

    name: str
    change: Callable[[np.ndarray], np.ndarray] = lambda picture: picture
    clip: str = "double_two_colours"
    sign: float = 1.0
    offset: float = 0.0
    rows: tuple[int, int] = (0, 1)
    rate: int = 30
    codec: tuple[str, Mapping[str, str], str] = ("libx264", H264, "yuv420p")
    ending: str = "mp4"
    said: str = ""


def larger(picture: np.ndarray) -> np.ndarray:
    """Enlarge a picture by one half."""
    return cv2.resize(picture, None, fx=1.5, fy=1.5, interpolation=cv2.INTER_CUBIC)


def padded(picture: np.ndarray) -> np.ndarray:
    """Put black bars around a picture, each of another width."""
    return cv2.copyMakeBorder(picture, 20, 30, 40, 10, cv2.BORDER_CONSTANT, value=(0, 0, 0))


VP9 = {"crf": "24", "b": "0", "cpu-used": "8", "deadline": "realtime"}
TURNED = "Gravity acts {} deg from straight down in the picture, more than a camera is usually out of level"
PAIRS = (
    Pair("mirrored", lambda p: p[:, ::-1], sign=-1.0, offset=-np.pi),
    Pair("larger", larger),
    Pair("cropped", lambda p: p[4:-6, 16:-4]),
    Pair("padded", padded),
    Pair("begun later", rows=(12, 1)),
    Pair("every second frame", rows=(0, 2), rate=15),
    Pair("h265", codec=("libx265", {"crf": "20", "x265-params": "log-level=none"}, "yuv420p")),
    Pair("vp9", codec=("libvpx-vp9", VP9, "yuv420p"), ending="webm"),
    Pair("mjpeg", codec=("mjpeg", {"qscale": "3"}, "yuvj420p"), ending="avi"),
    Pair("brighter", lambda p: np.clip(1.2 * p + 12.0, 0.0, 255.0).astype(np.uint8)),
    Pair("upside down", lambda p: p[::-1, ::-1], said=TURNED.format(180)),
    Pair("turned to the left", np.rot90, "single_capsule", said=TURNED.format(90)),
    Pair("turned to the right", lambda p: np.rot90(p, 3), "single_capsule", said=TURNED.format(90)),
    Pair("cart mirrored", lambda p: p[:, ::-1], "cart_narrow_light", sign=-1.0, offset=-np.pi),
)


@pytest.fixture(scope="module")
def home(tmp_path_factory) -> Path:
    """Return the folder of the clips."""
    return tmp_path_factory.mktemp("clips")


@cache
def painted(name: str, home: Path) -> Clip:
    """Return a clip of two and a half seconds."""
    return cached(replace(CASES[name], size=(320, 240), seconds=2.5), home)


@cache
def plain(name: str, home: Path) -> tuple[Poses, Fit]:
    """Return what is found in a clip as it was painted."""
    clip = painted(name, home)
    return identified(clip.video, clip.model)


def identified(video: Path, model: Path) -> tuple[Poses, Fit]:
    """Return poses and fit of a clip."""
    scene = monodyn.locate(monodyn.segment(monodyn.read(video)), monodyn.load(model))
    poses = monodyn.track(scene.masks, scene)
    return poses, monodyn.identify(poses, scene.mechanism)


@pytest.mark.parametrize("pair", PAIRS, ids=lambda pair: pair.name)
def test_the_same_in_another_clip(pair: Pair, home: Path, tmp_path: Path) -> None:
    clip = painted(pair.clip, home)
    with av.open(str(clip.video)) as source:
        pictures = [frame.to_ndarray(format="rgb24") for frame in source.decode(video=0)]
    video = written(
        tmp_path / f"clip.{pair.ending}",
        [pair.change(p) for p in pictures[pair.rows[0] :: pair.rows[1]]],
        pair,
    )
    poses, fit = identified(video, clip.model)
    compare(plain(pair.clip, home), (poses, fit), pair)
    assert pair.said in " ".join(fit.advice)


@dataclass(frozen=True)
class Model:
    """A change of the text of a model.

    Attributes:
        name: What is changed.
        change: Changes the text.
        clip: Name of the clip.
        offset: What is added to the first hinge [rad].
    """

    name: str
    change: Callable[[str], str]
    clip: str = "double_two_colours"
    offset: float = 0.0


def based(more: str) -> Callable[[str], str]:
    """Return what gives the first body another place, or another turn."""
    return lambda text: text.replace('pos="0 0 0"', more, 1)


def sized(factor: float) -> Callable[[str], str]:
    """Return what multiplies all sizes and places of a model of boxes."""

    def change(text: str) -> str:
        for what in ("pos", "size"):
            parts = text.split(f' {what}="')
            for k, part in enumerate(parts[1:], 1):
                numbers, rest = part.split('"', 1)
                parts[k] = " ".join(f"{factor * float(n):.9g}" for n in numbers.split()) + '"' + rest
            text = f' {what}="'.join(parts)
        return text

    return change


MODELS = (
    Model("moved and turned", based('pos="0.4 0 1" euler="0 40 0"'), offset=float(np.radians(40.0))),
    Model("a tenth", sized(0.1)),
    Model("ten times", sized(10.0)),
    Model("cart moved by little", based('pos="0 0 0.05"'), "cart_narrow_light"),
    Model("cart moved", based('pos="0.3 0 1"'), "cart_narrow_light"),
)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_the_same_by_another_model(model: Model, home: Path, tmp_path: Path) -> None:
    clip, path = painted(model.clip, home), tmp_path / "model.xml"
    text = clip.model.read_text()
    path.write_text(model.change(text))
    assert path.read_text() != text
    compare(plain(model.clip, home), identified(clip.video, path), Pair("", offset=model.offset))


def written(path: Path, pictures: Pictures, pair: Pair) -> Path:
    """Encode pictures."""
    name, options, pixels = pair.codec
    with av.open(str(path), "w") as container:
        stream = container.add_stream(name, rate=pair.rate, options=dict(options))
        stream.height, stream.width = (side // 2 * 2 for side in pictures[0].shape[:2])
        stream.pix_fmt = pixels
        for picture in pictures:
            even = np.ascontiguousarray(picture[: stream.height, : stream.width])
            container.mux(stream.encode(av.VideoFrame.from_ndarray(even, format="rgb24")))
        container.mux(stream.encode())
    return path


def compare(before: tuple[Poses, Fit], after: tuple[Poses, Fit], pair: Pair) -> None:
    """Compare grades, lengths and poses."""
    (first, plain_fit), (other, fit) = before, after
    assert (plain_fit.grade, fit.grade) == ("trusted", "trusted")
    for name, value in plain_fit.mechanism.values.items():
        if name.endswith(".length") and not name.startswith("cart"):
            assert fit.mechanism.values[name] == pytest.approx(value, rel=LENGTH_TOLERANCE)
    if not pair.said:
        hinges = np.array([joint.kind == "hinge" for joint in fit.mechanism.joints])
        expected = pair.sign * first.position[pair.rows[0] :: pair.rows[1]][:, hinges]
        expected[:, 0] += pair.offset
        off = np.degrees(np.angle(np.exp(1j * (other.position[:, hinges] - expected))))
        assert np.sqrt(np.nanmean(off**2, axis=0)).max() < POSE_TOLERANCE
