"""From masks and topology to the scene: camera, sizes up to one common scale, and the first pose.

A global search on reduced key frames finds the mechanism; a joint refinement on the sub-pixel edges of the
key frames fits camera, sizes and poses; then the background is taken again with the mechanism masked out,
and the refinement repeated on the better masks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.types import Camera, Progress
from monodyn.vision.drawing.camera import with_values
from monodyn.vision.drawing.outline import covered_pixels
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.drawing.silhouette import pose_mismatch
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.locating.bundle import SIZES, Bundle, camera_spread, refine, size_information
from monodyn.vision.locating.colours import measured_parts
from monodyn.vision.locating.keyframes import KeyFrames, key_frames
from monodyn.vision.locating.scene import Scene
from monodyn.vision.locating.search import Guess, place, search
from monodyn.vision.settings import LocateSettings

VAGUE_FOCAL, VAGUE_TURN = 0.2, 0.1
"""Spread of the focal length as a share of it, and of a turn [rad], from which it is called vague."""
UNEXPLAINED = 0.35
"""Share of the foreground outside of the mechanism, or of the mechanism outside of it, from which it is
said."""
COARSE_REACHES = (9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 4.0, 3.0, 3.0, 3.0)
FINE_REACHES = (8.0, 7.0, 6.0, 5.0, 5.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0)
REACHES = np.array([8.0, 6.0, 5.0, 4.0, 4.0])
LAST_REACHES = (5.0, 4.0, 4.0, 4.0, 3.0, 3.0, 3.0, 3.0)


@dataclass(frozen=True, eq=False)
class Sought:
    """What is to be located.

    Attributes:
        masks: The soft foreground of the clip.
        mechanism: Topology, shape kinds and start sizes; its fixed parameters stay as they are.
        settings: How the search goes.
        fix: Values of ``camera.*`` parameters that must stay.
        free: ``camera.*`` parameters to estimate in addition to x, y and depth.
        progress: Called as the steps go.
    """

    masks: Masks
    mechanism: Mechanism
    settings: LocateSettings
    fix: Mapping[str, float]
    free: Sequence[str]
    progress: Progress

    @property
    def start_camera(self) -> Camera:
        """The camera that the search starts from."""
        video = self.masks.video
        focal = self.settings.focal or float(max(video.width, video.height))
        return with_values(Camera(video.width, video.height, focal), dict(self.fix))


def find_scene(sought: Sought) -> Scene:
    """Find camera, sizes and first pose from the topology alone.

    Args:
        sought: The masks, the mechanism, and what is known of the camera.

    Returns:
        The scene.
    """
    masks, mechanism, settings = sought.masks, sought.mechanism, sought.settings
    names = _refined_names(mechanism, sought.fix, sought.free)
    pinned = frozenset([*sought.fix, *(p.name for p in mechanism.parameters if not p.free)])
    geoms = len(mechanism.shapes.radius)
    sought.progress("locate", 0, 4)
    frames = key_frames(masks, geoms)
    guesses = search(frames, mechanism, sought.start_camera, pinned, settings.search_frames)
    sought.progress("locate", 1, 4)
    start = mechanism.values
    guess = min(
        (_settle(g, frames, names, start, settings.search_frames) for g in guesses[:4]), key=lambda g: g.score
    )
    sought.progress("locate", 2, 4)
    masks, frames, guess = _coloured(masks, frames, guess)
    bundle, picks = _refine_whole(frames, guess, names, start, settings.refine_frames, FINE_REACHES)
    sought.progress("locate", 3, 4)
    masks, frames, guess = _uncovered(masks, frames, bundle)
    bundle, picks = _refine_whole(frames, guess, names, start, settings.refine_frames, LAST_REACHES)
    sought.progress("locate", 4, 4)
    return _scene(masks, frames, bundle, picks, settings)


def _refined_names(mechanism: Mechanism, fix: Mapping[str, float], free: Sequence[str]) -> list[str]:
    """List the parameters that the pictures are asked for."""
    names = [p.name for p in mechanism.parameters if p.free and p.name.endswith((*SIZES, ".offset"))]
    cameras = ["camera.x", "camera.y", "camera.depth", *free]
    for i, parent in enumerate(mechanism.tree.parent):
        if parent < 0 and mechanism.tree.kind[i] == 1:
            # where a slide is zero is a matter of choice: the camera's place fixes it
            direction = np.abs(mechanism.tree.links[i, 3:5])
            gauge = "camera.x" if direction[0] >= direction[1] else "camera.y"
            cameras = [name for name in cameras if name != gauge]
    return names + [name for name in dict.fromkeys(cameras) if name not in fix]


def _settle(
    guess: Guess, frames: KeyFrames, names: Sequence[str], start: dict[str, float], count: int
) -> Guess:
    """Refine a guess on the reduced key frames, place the poses anew, and refine again."""
    chosen = [frames.frames[i] for i in frames.spread(count)]
    planes = [frame.coarse[np.newaxis] for frame in chosen]
    for _ in range(2):
        bundle = refine(
            planes, frames.coarse_view, guess.mechanism, guess.camera, guess.positions,
            names, start, reaches=COARSE_REACHES, shrink=frames.shrink, spacing=1.5,
        )  # fmt: skip
        rig = rig_of(bundle.mechanism, bundle.camera, shrink=frames.shrink)
        placed = [
            place(frame, frames, rig, bundle.mechanism, near=q)
            for frame, q in zip(chosen, bundle.positions, strict=True)
        ]
        new = Guess(
            bundle.mechanism,
            bundle.camera,
            np.array([q for q, _ in placed]),
            np.array([m for _, m in placed]),
        )
        if new.score > guess.score:
            return guess
        guess = new
    return guess


def _coloured(masks: Masks, frames: KeyFrames, guess: Guess) -> tuple[Masks, KeyFrames, Guess]:
    """Find the pose in every sample frame and measure the colours of the geoms there."""
    rig = rig_of(guess.mechanism, guess.camera, shrink=frames.shrink)
    placed = [place(frame, frames, rig, guess.mechanism) for frame in frames.frames]
    positions, mismatch = np.array([q for q, _ in placed]), np.array([m for _, m in placed])
    fits = mismatch <= max(0.5, float(np.median(mismatch)))
    frames_, background = masks.samples.frames, masks.background
    parts = measured_parts(frames_, background, guess.mechanism, guess.camera, positions, fits)
    masks = masks.coloured(parts)
    return masks, key_frames(masks, len(rig.radius)), replace(guess, positions=positions, mismatch=mismatch)


def _uncovered(masks: Masks, frames: KeyFrames, bundle: Bundle) -> tuple[Masks, KeyFrames, Guess]:
    """Take the background again without the mechanism, and the colours over it."""
    mechanism, camera = bundle.mechanism, bundle.camera
    positions, fits = _all_poses(frames, bundle)
    everything = np.ones(frames.view.trust.shape[1:], dtype=bool)
    masks = masks.refined(
        [
            covered_pixels(mechanism, camera, q, grow=3.0) if lies else everything
            for q, lies in zip(positions, fits, strict=True)
        ]
    )
    parts = measured_parts(masks.samples.frames, masks.background, mechanism, camera, positions, fits)
    masks = masks.coloured(parts)
    guess = Guess(mechanism, camera, positions, np.zeros(len(positions)))
    return masks, key_frames(masks, len(mechanism.shapes.radius)), guess


def _refine_whole(
    frames: KeyFrames,
    guess: Guess,
    names: Sequence[str],
    start: dict[str, float],
    count: int,
    reaches: Sequence[float],
) -> tuple[Bundle, list[int]]:
    """Refine on whole pictures over key frames that fit."""
    picks = sorted(frames.spread(count))
    positions = guess.positions[picks]
    half = len(reaches) // 2
    planes = [frames.frames[i].planes for i in picks]
    first = refine(
        planes,
        frames.view,
        guess.mechanism,
        guess.camera,
        positions,
        names,
        start,
        reaches=reaches[:half],
    )
    good = (first.matched > 0.6 * np.median(first.matched)) & (first.inside > 0.6 * np.median(first.inside))
    kept = np.flatnonzero(good) if good.sum() >= max(3, len(picks) // 4) else np.arange(len(picks))
    second = refine(
        [planes[i] for i in kept], frames.view, first.mechanism, first.camera,
        first.positions[kept], names, start, reaches=reaches[half:], settle=10,
    )  # fmt: skip
    return second, [picks[i] for i in kept]


def _fits(matched: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Return which poses lie on their masks."""
    return (matched > 0.55) & (inside > 0.65)


def _all_poses(frames: KeyFrames, bundle: Bundle) -> tuple[np.ndarray, np.ndarray]:
    """Find the pose in every sample frame, and whether it fits."""
    from monodyn.vision.drawing.follow import follow
    from monodyn.vision.locating.search import limits

    coarse = rig_of(bundle.mechanism, bundle.camera, shrink=frames.shrink)
    rig = rig_of(bundle.mechanism, bundle.camera)
    lower, upper = limits(bundle.mechanism)
    spread = np.full(len(lower), 1.0)
    positions, good = [], []
    for frame in frames.frames:
        q, _ = place(frame, frames, coarse, bundle.mechanism)
        q, _, facts = follow(frame.planes, *frames.view, *rig, q, lower, upper, spread, REACHES, 3.0)
        positions.append(q)
        good.append(bool(_fits(facts[1:2], facts[3:4])[0]))
    return np.array(positions), np.array(good)


def _scene(
    masks: Masks, frames: KeyFrames, bundle: Bundle, picks: list[int], settings: LocateSettings
) -> Scene:
    """Collect the result and what the picture knows of the sizes."""
    scale_free = "camera.depth" in bundle.names and all(
        name in bundle.names for name in bundle.mechanism.values if name.endswith(SIZES)
    )
    measured = size_information(bundle, scale_free=scale_free)
    spread = camera_spread(bundle, scale_free=scale_free)
    order = [frames.frames[i].index for i in picks]
    first = int(np.argmin(order))
    advice = []
    rms = float(np.sqrt(np.mean(bundle.rms_px**2)))
    share = float(np.mean(_fits(bundle.matched, bundle.inside)))
    if share < 0.7:
        advice.append(
            f"The mechanism lies on its mask in only {share:.0%} of the key frames: check the drawn outline "
            "in the overlay, the mechanism file, and whether other things move in the clip."
        )
    vague = [name for name, value in spread.items() if value > _vague_from(bundle.camera, name)]
    if vague:
        advice.append(
            f"The clip hardly tells {', '.join(vague)}: leave out --free, or give the value with --fix."
        )
    left = _unexplained(frames, bundle, picks)
    if left > UNEXPLAINED and not masks.palette.varied:
        advice.append(
            f"{min(left, 1.0):.0%} of what stands out from the background is not the mechanism as it was "
            "found: it may be in the wrong place or of the wrong size, or other things move; look at the "
            "overlay, or give --background a picture without the mechanism."
        )
    return Scene(
        bundle.mechanism.with_measured(measured), bundle.camera, masks, order[first], bundle.positions[first],
        tuple(order), bundle.positions, spread, rms, tuple(advice),
    )  # fmt: skip


def _vague_from(camera: Camera, name: str) -> float:
    """Return the spread from which a freed camera parameter is called vague [px or rad]; places never are."""
    if name == "camera.focal":
        return VAGUE_FOCAL * camera.focal
    return VAGUE_TURN if name in ("camera.pitch", "camera.yaw", "camera.roll") else np.inf


def _unexplained(frames: KeyFrames, bundle: Bundle, picks: list[int]) -> float:
    """Return the mean mismatch of outline and mask as a share of the mask's area (paper eq. 3)."""
    rig = rig_of(bundle.mechanism, bundle.camera, shrink=frames.shrink)
    shares = []
    for i, q in zip(picks, bundle.positions, strict=True):
        frame = frames.frames[i]
        cost = pose_mismatch(frame.sums, rig, q[np.newaxis], len(rig.radius))[0]
        shares.append((frame.area + float(cost)) / max(frame.area, 1.0))
    return float(np.median(shares))
