"""From masks and scene to joint positions with covariance in every frame, streamed.

Each frame starts from the motion's prediction and moves the outline onto the mask's edges within the move
limits. A pose that does not fit is looked for anew in the whole picture; one that still does not fit was
not seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monodyn.mechanism.tree import HINGE
from monodyn.types import Mask, Poses, Progress
from monodyn.vision.drawing.follow import EdgeSearch, MoveLimits, follow
from monodyn.vision.drawing.rig import Rig, joint_limits, rig_of
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.locating.keyframes import key_frame
from monodyn.vision.locating.scene import Scene
from monodyn.vision.locating.search import search_pose
from monodyn.vision.settings import TrackSettings

CORRELATION = 2.0
"""Neighbouring edge samples share the codec's blocks: their errors count as if there were half as many."""
LEAST_NOISE_PX = 0.05
"""Least standard deviation of an edge sample [px]."""

TURNS_KNOWN_FRAMES = 8
"""Frames out of sight over which the last rates count for the number of turns."""
PREDICTED_FRAMES = 30
"""Frames out of sight after which the last poses predict nothing."""
LEAST_SAMPLES = 8
"""Outline samples below which a pose was not seen."""
DETERMINED = 0.3
"""A pose that the mask determines less well than this share of the move limit was not seen."""
USUAL_SCORE = 1.8
"""Score of a pose that fits as usual, before the first frames (of 2: all outline samples on edges, all
covered inside)."""
SCORE_SLACK = 0.15
"""A pose whose score is lower than usual by no more than this is accepted as it stands."""
MOST_AMPLIFIED = 16.0
"""Sum of the weights of an extrapolation above which it would mostly amplify noise."""


@dataclass(frozen=True, eq=False)
class _Found:
    """A pose in one frame: positions (dof,), covariance (dof, dof), whether it lies on the mask, how well."""

    position: np.ndarray
    covariance: np.ndarray
    fits: bool
    score: float


def follow_clip(
    masks: Masks, scene: Scene, settings: TrackSettings, progress: Progress | None = None
) -> Poses:
    """Move the outline onto the masks' edges from prediction to prediction.

    Args:
        masks: The masks of the clip to follow; they are taken anew with the background and the colours that
            the scene was found with.
        scene: Camera, sizes and first pose.
        settings: How the mechanism is followed.
        progress: Called with the number of frames done.

    Returns:
        Joint positions [rad; m in the start scale] with covariance; frames in which the mechanism does not
        lie on its mask, or that did not decode, are not seen and hold NaN.
    """
    video = masks.video
    follower = Follower(scene, settings)
    blank = np.full(len(scene.mechanism.joints), np.nan)
    rows = []
    for frame in video.frames():
        mask = scene.masks.of(frame)
        rows += [
            (i, video.times[i], blank, np.outer(blank, blank), False) for i in range(len(rows), mask.index)
        ]  # frames that did not decode
        rows.append((mask.index, mask.time, *follower.step(mask)))
        if progress is not None:
            progress("track", len(rows), video.count)
    index, time, position, covariance, seen = (np.array(column) for column in zip(*rows, strict=True))
    joints = tuple(joint.name for joint in scene.mechanism.joints)
    return Poses(joints, index, time, position, covariance, seen, metric=False)


class Follower:
    """Follows the mechanism from frame to frame; what it keeps is the motion so far.

    Args:
        scene: Camera, sizes and first pose.
        settings: How the mechanism is followed.
    """

    def __init__(self, scene: Scene, settings: TrackSettings) -> None:
        self._scene = scene
        self._settings = settings
        self._rig: Rig = rig_of(scene.mechanism, scene.camera)
        self._view = scene.masks.view(len(self._rig.radius))
        self._lower, self._upper = joint_limits(scene.mechanism)
        self._hinge = self._rig.kind == HINGE
        reach = float(np.ptp(scene.mechanism.shapes.points[:, :2], axis=0).max())
        self._move = np.where(self._hinge, settings.move, settings.move * reach)
        self._known = dict(zip(scene.key_frames, scene.key_positions, strict=True))
        self._past: list[tuple[float, np.ndarray]] = []
        self._lost = 0
        self._usual = USUAL_SCORE

    def step(self, mask: Mask) -> tuple[np.ndarray, np.ndarray, bool]:
        """Find the pose in the next frame.

        Args:
            mask: The next mask, in the order of time.

        Returns:
            Joint positions (dof,), their covariance (dof, dof), and whether the mechanism was seen.
        """
        found = None
        predictions = self._predictions(mask)
        # Every start is tried with a short search, then with a long one, until a pose fits about as well as
        # those before it. A pose that fits much worse may have locked on a wrong edge: it is kept, but the
        # other starts and the search of the whole picture have their chance to do better.
        for first_reach in (self._settings.first_reach, 3.0 * self._settings.first_reach):
            for start in predictions:
                found = _better(found, self._follow(mask, start, first_reach))
                if found.fits and found.score > self._usual - SCORE_SLACK:
                    break
            else:
                continue
            break
        else:
            if self._lost % self._settings.patience == 0:
                found = _better(found, self._search(mask))
        if found is not None and found.fits:
            # three poses are what the prediction by constant acceleration needs
            self._past = [*self._past[-2:], (mask.time, found.position)]
            self._lost = 0
            self._usual += 0.1 * (found.score - self._usual)
            return found.position, found.covariance, True
        self._lost += 1
        dofs = len(self._lower)
        return np.full(dofs, np.nan), np.full((dofs, dofs), np.nan), False

    def _predictions(self, mask: Mask) -> list[np.ndarray]:
        """Return where the mechanism may be: by constant acceleration, by constant rate, where it was."""
        predictions = []
        past = self._past
        if mask.index in self._known and not past:
            predictions.append(self._known[mask.index])
        if past and self._lost < PREDICTED_FRAMES:
            t = [time for time, _ in past]
            q = [position for _, position in past]
            if len(past) == 3:
                # the parabola through three poses (Lagrange); the time stamps need not be equally spaced
                weights = [
                    (mask.time - t[1]) * (mask.time - t[2]) / ((t[0] - t[1]) * (t[0] - t[2])),
                    (mask.time - t[0]) * (mask.time - t[2]) / ((t[1] - t[0]) * (t[1] - t[2])),
                    (mask.time - t[0]) * (mask.time - t[1]) / ((t[2] - t[0]) * (t[2] - t[1])),
                ]
                if np.sum(np.abs(weights)) < MOST_AMPLIFIED:
                    predictions.append(sum(w * p for w, p in zip(weights, q, strict=True)))
            if len(past) >= 2:
                rate = (q[-1] - q[-2]) / (t[-1] - t[-2])
                predictions.append(q[-1] + rate * min(mask.time - t[-1], 3.0 * (t[-1] - t[-2])))
            predictions.append(q[-1])
        return [np.clip(p, self._lower, self._upper) for p in predictions]

    def _follow(self, mask: Mask, start: np.ndarray, first_reach: float) -> _Found:
        """Move a start pose onto the mask within the move limits."""
        s = self._settings
        if first_reach > s.first_reach:
            reaches = np.concatenate([np.geomspace(first_reach, s.reach, 6), [s.reach]])
        else:
            reaches = np.array([s.first_reach, 0.5 * (s.first_reach + s.reach), s.reach, s.reach])
        lower = np.maximum(self._lower, start - self._move)
        upper = np.minimum(self._upper, start + self._move)
        q, information, agreement = follow(
            mask.planes,
            self._view,
            self._rig,
            start,
            MoveLimits(lower, upper, self._move),
            EdgeSearch(reaches, s.spacing),
        )
        noise = CORRELATION * max(agreement.rms_px, LEAST_NOISE_PX) ** 2
        # where the picture does not show a joint, the move limit is all that is known of it
        covariance = np.linalg.inv(information / noise + np.diag(1.0 / self._move**2))
        std = np.sqrt(np.diag(covariance))
        determined = np.all(std < DETERMINED * self._move) and agreement.samples >= LEAST_SAMPLES
        fits = determined and agreement.matched >= s.matched and agreement.inside >= s.inside
        return _Found(q, covariance, bool(fits), float(agreement.matched + agreement.inside))

    def _expected(self, time: float) -> np.ndarray:
        """Return where the joints would be by now at their last rate; after a long gap, where they were."""
        last, position = self._past[-1]
        if len(self._past) < 2 or self._lost > TURNS_KNOWN_FRAMES:
            return position
        before, earlier = self._past[-2]
        return position + (position - earlier) * (time - last) / (last - before)

    def _search(self, mask: Mask) -> _Found:
        """Look for the mechanism in the whole picture."""
        scene = self._scene
        frame, frames = key_frame(mask, scene.masks, len(self._rig.radius))
        coarse = rig_of(scene.mechanism, scene.camera, shrink=frames.shrink)
        q, _ = search_pose(frame, frames, coarse, scene.mechanism)
        # a picture shows a hinge's angle but for whole turns; those come from the motion so far
        if self._past:
            turns = np.round((self._expected(mask.time) - q) / (2.0 * np.pi))
            q = q + np.where(self._hinge & ~np.isfinite(self._lower), 2.0 * np.pi * turns, 0.0)
        return self._follow(mask, q, self._settings.first_reach)


def _better(found: _Found | None, candidate: _Found) -> _Found:
    """Return whichever pose lies better on its mask."""
    return candidate if found is None or candidate.score > found.score else found
