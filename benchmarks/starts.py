"""Print from how many wrong starts a clip is located in the same scene, next to targets.

Run: ``MONODYN_DATA=<folder> python benchmarks/starts.py [--only NAME ...] [--starts N] [--altered]
[--json FILE] [--gate]``. Every size of the model is multiplied by its own factor, and all of them by a common
one. With ``--altered`` the model stays and the clip is encoded again, halved, begun later, or thinned out.
Scenes are compared in the picture: where the joints are drawn in key frames, and then also what the outline
covers, which is another one where a part that does not stand out is taken for thinner or wider.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np

import monodyn
from figures import Figure, command_line, finish, say, table
from monodyn.types import Camera
from monodyn.vision.drawing.camera import pixels
from monodyn.vision.drawing.outline import covered_pixels
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.drawing.silhouette import link_frames
from monodyn.vision.locating.scene import Scene

STARTS = 20
"""Starts of each clip."""
FACTOR = 4.0
"""Each size is wrong by up to this factor, either way."""
DECADES = 3.0
"""The whole file is wrong by up to this many powers of ten, either way."""
VARIED = ("length", "width", "tail", "tip", "extent", "along", "across", "thickness", "offset")
"""Kinds of the parameters that are drawn."""
APART, COMMON = 0.015, 0.9
"""Scenes are the same when all joints are drawn within this share of the mechanism's reach, and the outlines
have this share of their pixels in common."""
SAME = 95.0
"""Least share of the starts that end in the same scene [%]."""
QUALITY = 28
"""Constant rate factor of the clips that are encoded again, which is coarse."""
LATER, PATTERN = 7, 6
"""Frames by which a clip is begun later; one of so many frames is left out of a thinned one."""


@dataclass(frozen=True)
class Footage:
    """One clip.

    Attributes:
        path: In the data folder.
        model: Name of a bundled model, or empty for the file beside the clip.
        frames: Frames that are looked at, from the first to before the second; None for all.
        pivot: Where the first hinge is drawn [px], of a real clip.
        length: How long its first link is drawn [px].
    """

    path: str
    model: str = ""
    frames: tuple[int, int] | None = None
    pivot: tuple[float, float] = (np.nan, np.nan)
    length: float = np.nan


CLIPS = {
    **{name: Footage(f"rendered/{name}.mp4") for name in ("double_a", "triple", "bob", "cartpole")},
    "double_hand": Footage("rendered/double_hand.mp4", frames=(45, 240)),
    "double_ell": Footage("rendered/double_ell.mp4"),
    "bob_above": Footage("rendered/bob_above.mp4"),
    "ball_above": Footage("rendered/ball_above.mp4"),
    "double_pendulum": Footage("real/double_pendulum.webm", "double", None, (550.0, 494.0), 151.0),
    "holonomic_pendulum": Footage("real/holonomic_pendulum.webm", "bob", None, (508.0, 584.0), 333.0),
    "pendubot": Footage("real/pendubot.m4v", "", None, (551.0, 856.0), 286.0),
}
"""The clips by name."""

Picture = Callable[[list[np.ndarray]], list[np.ndarray]]
ALTERED: dict[str, Picture] = {
    "encoded again": lambda pictures: pictures,
    "halved": lambda pictures: [_halved(picture) for picture in pictures],
    "begun later": lambda pictures: pictures[LATER:],
    "thinned out": lambda pictures: [p for i, p in enumerate(pictures) if i % PATTERN],
}
"""What is done to a clip."""


def main() -> int:
    """Locate what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``, 2 when the data are missing.
    """
    parser = command_line(__doc__, tuple(CLIPS))
    parser.add_argument("--starts", type=int, default=STARTS, metavar="N", help="starts of each clip")
    parser.add_argument("--altered", action="store_true", help="alter the clips, and not the model")
    options = parser.parse_args()
    data = Path(os.environ.get("MONODYN_DATA") or "missing")
    if not (data / "rendered").is_dir():
        print("MONODYN_DATA: expected the folder that holds rendered/; set the variable.", file=sys.stderr)
        return 2
    figures: list[Figure] = []
    for name in options.only or CLIPS:
        began = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            clip = _cut(data / CLIPS[name].path, CLIPS[name].frames, Path(folder))
            scenes = _altered(clip, name, Path(folder)) if options.altered else _started(clip, name, options)
        figures += _compared(name, data, scenes)
        say(f"{name}: {time.perf_counter() - began:.1f} s")
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def _started(clip: Path, name: str, options) -> list[Scene | None]:
    """Locate a clip from many starts, the first one that of the file; None where that is refused."""
    mechanism = _model(clip, name)
    masks = monodyn.segment(monodyn.read(clip))
    rng = np.random.default_rng(1)
    return [_located(masks, _wrong(mechanism, rng) if i else mechanism) for i in range(options.starts + 1)]


def _altered(clip: Path, name: str, folder: Path) -> list[Scene | None]:
    """Locate a clip as it is and altered in several ways."""
    mechanism = _model(clip, name)
    pictures = [frame.to_ndarray(format="rgb24") for frame in av.open(str(clip)).decode(video=0)]
    scenes = [_located(monodyn.segment(monodyn.read(clip)), mechanism)]
    for what, change in ALTERED.items():
        path = folder / f"{what.replace(' ', '_')}.mp4"
        _write(path, change(pictures), QUALITY)
        scenes.append(_located(monodyn.segment(monodyn.read(path)), mechanism))
    return scenes


def _model(clip: Path, name: str) -> monodyn.Mechanism:
    """Load the model of a clip."""
    return monodyn.load(CLIPS[name].model or clip.with_suffix(".xml"))


def _wrong(mechanism: monodyn.Mechanism, rng: np.random.Generator) -> monodyn.Mechanism:
    """Return the mechanism with wrong sizes."""
    common = 10.0 ** rng.uniform(-DECADES, DECADES)
    sizes = [p for p in mechanism.parameters if p.kind in VARIED and not p.follows]
    factors = FACTOR ** rng.uniform(-1.0, 1.0, len(sizes))
    return mechanism.with_values(
        {p.name: p.value * common * by for p, by in zip(sizes, factors, strict=True)}
    )


def _located(masks, mechanism: monodyn.Mechanism) -> Scene | None:
    """Locate a mechanism; None where that is refused."""
    began = time.perf_counter()
    try:
        scene = monodyn.locate(masks, mechanism)
    except monodyn.MonodynError as error:
        say(str(error))
        return None
    pivot, length = _first_link(scene)
    say(f"  pivot {pivot.round(1)}, first link {length:.1f} px, {time.perf_counter() - began:.1f} s")
    return scene


def _compared(name: str, data: Path, scenes: list[Scene | None]) -> list[Figure]:
    """Find the scene with which most others agree, and compare it with the truth."""
    found = [scene for scene in scenes if scene is not None]
    same, jointed = f"in the same scene, of {len(scenes)}", "joints in the same places"
    if not found:
        return [Figure(name, what, 0.0, "%", SAME, least=True) for what in (same, jointed)]
    agree = np.array([[_is_same(one, other) for other in found] for one in found])
    best = int(np.argmax(agree.sum(axis=1)))
    share = 100.0 * float(agree[best].sum()) / len(scenes)
    alike = sum(_is_same(found[best], other, joints_alone=True) for other in found)
    for scene, agrees in zip(found, agree[best], strict=True):
        if not agrees:
            pivot, length = _first_link(scene)
            say(f"  another scene: pivot {pivot.round(1)}, first link {length:.1f} px")
    pivot, length = _first_link(found[best])
    known, drawn = _truth(name, data)
    return [
        Figure(name, same, share, "%", SAME, least=True),
        Figure(name, jointed, 100.0 * alike / len(scenes), "%", SAME, least=True),
        Figure(name, "pivot off the truth, of the first link", 100.0 * _far(pivot, known) / drawn, "%"),
        Figure(name, "first link off the truth", 100.0 * abs(length / drawn - 1.0), "%"),
    ]


def _is_same(one: Scene, other: Scene, *, joints_alone: bool = False) -> bool:
    """Return whether two scenes show the same in the key frames that they share, or have the same joints."""
    # a clip of another size or beginning shares no frames: then the first links are compared
    unit = one.camera.width / other.camera.width
    pivots, lengths = zip(_first_link(one), _first_link(other), strict=True)
    if _far(pivots[0], unit * pivots[1]) > 2.0 * APART * lengths[0]:
        return False
    if abs(unit * lengths[1] / lengths[0] - 1.0) > 2.0 * APART:
        return False
    if one.masks.video.path != other.masks.video.path:
        return True
    shared = sorted(set(one.key_frames) & set(other.key_frames))
    for frame in shared:
        drawn = [(scene, scene.key_positions[scene.key_frames.index(frame)]) for scene in (one, other)]
        joints, covered = zip(*[(_joints(*pair), _covered(*pair)) for pair in drawn], strict=True)
        reach = max(np.hypot(*(joints[0] - joints[0][0]).T).max(), lengths[0])
        if np.hypot(*(joints[0] - joints[1]).T).max() > APART * reach:
            return False
        if not joints_alone and (covered[0] & covered[1]).sum() < COMMON * (covered[0] | covered[1]).sum():
            return False
    return len(shared) > 0


def _joints(scene: Scene, position: np.ndarray) -> np.ndarray:
    """Return where the joints are drawn [px], (dof, 2)."""
    frames = link_frames(rig_of(scene.mechanism, scene.camera), position)
    return pixels(scene.camera, np.column_stack([frames[:, :2], np.zeros(len(frames))]))


def _covered(scene: Scene, position: np.ndarray) -> np.ndarray:
    """Return what the mechanism covers, bool (height, width)."""
    return covered_pixels(scene.mechanism, scene.camera, position, margin=0.0)


def _first_link(scene: Scene) -> tuple[np.ndarray, float]:
    """Return where the first joint is drawn in the plane of the mechanism's root [px], and how long the
    body of the first hinge is there [px]."""
    hinged = next(joint for joint in scene.mechanism.joints if joint.kind == "hinge")
    pivot = _joints(scene, np.zeros(len(scene.mechanism.joints)))[0]
    px = scene.camera.focal / scene.camera.depth
    if scene.mechanism.joints[0].kind != "hinge":
        pivot = pivot * [0.0, 1.0]
    return pivot, scene.mechanism.values[f"{hinged.body}.length"] * px


def _truth(name: str, data: Path) -> tuple[np.ndarray, float]:
    """Return where the first joint is in truth and how long the first link is [px]."""
    footage = CLIPS[name]
    if np.isfinite(footage.length):
        return np.array(footage.pivot), footage.length
    truth = json.loads((data / footage.path).with_suffix(".json").read_text(encoding="utf-8"))
    told = truth["camera"]
    x, y, z = map(float, told["pos"].split())
    focal = 0.5 * told["h"] / np.tan(np.radians(0.5 * told["fovy"]))
    pivot = pixels(Camera(told["w"], told["h"], focal, x=x, y=z, depth=-y), np.zeros((1, 3)))[0]
    if (truth["truth"].get("cart") or None) is not None:
        pivot = pivot * [0.0, 1.0]
    return pivot, focal * truth["truth"]["links"][0][0] / -y


def _far(one: np.ndarray, other: np.ndarray) -> float:
    """Return the distance of two places [px]."""
    return float(np.hypot(*(np.asarray(one) - np.asarray(other))))


def _cut(clip: Path, frames: tuple[int, int] | None, folder: Path) -> Path:
    """Return a clip of some frames only, beside its model."""
    if frames is None:
        return clip
    pictures = [frame.to_ndarray(format="rgb24") for frame in av.open(str(clip)).decode(video=0)]
    _write(folder / clip.name, pictures[slice(*frames)], 12)
    (folder / clip.name).with_suffix(".xml").write_bytes(clip.with_suffix(".xml").read_bytes())
    return folder / clip.name


def _halved(picture: np.ndarray) -> np.ndarray:
    """Return a picture at half its size, uint8 (height, width, 3)."""
    height, width = (2 * (side // 4) for side in picture.shape[:2])
    blocks = picture[: 2 * height, : 2 * width].reshape(height, 2, width, 2, 3)
    return blocks.mean(axis=(1, 3)).round().astype(np.uint8)


def _write(path: Path, pictures: list[np.ndarray], quality: int) -> None:
    """Write pictures as a clip of 30 frames a second."""
    with av.open(str(path), "w") as file:
        stream = file.add_stream("libx264", rate=30, options={"crf": str(quality), "preset": "veryfast"})
        stream.height, stream.width = pictures[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        for picture in pictures:
            file.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        file.mux(stream.encode())


if __name__ == "__main__":
    raise SystemExit(main())
