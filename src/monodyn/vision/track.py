"""From masks and scene to joint positions with covariance in every frame, streamed.

Each frame starts from the motion's prediction and moves the outline onto the mask's edges within the move
limits. Each link answers for itself: what does not lie on the mask is hidden or elsewhere, and a joint counts
as seen where the links that do lie on it determine it. A mechanism that is lost is looked for anew in the
whole picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from monodyn.arrays import usual_step
from monodyn.mechanism.tree import HINGE
from monodyn.mechanism.turning import unwound
from monodyn.types import Frame, Mask, Poses, Progress
from monodyn.vision.drawing.around import rows_around
from monodyn.vision.drawing.follow import EVERYWHERE, EdgeSearch, MoveLimits
from monodyn.vision.drawing.mismatch import covered_area
from monodyn.vision.drawing.rig import Rig, joint_limits, rig_of
from monodyn.vision.drawing.shutter import SLOW_PX, way
from monodyn.vision.foreground.masks import EVERY_PLANE, LEFT_OUT, PLANE, Masks, View, Wanted, planes_for
from monodyn.vision.locating.keyframes import KeyFrame, KeyFrames, key_frame, no_frames
from monodyn.vision.locating.scene import Scene
from monodyn.vision.locating.search import as_thick, search_pose
from monodyn.vision.settings import TrackSettings
from monodyn.vision.tracking.motion import PREDICTED_FRAMES, Motion
from monodyn.vision.tracking.occluders import Occluders, without
from monodyn.vision.tracking.registered import displaced_pose
from monodyn.vision.tracking.sighting import Rule, sighted, sure, take_as_usual

USUAL_GAIN = 0.1
"""Share of a frame in the usual score."""
USUAL_SCORE = 1.8
"""Score of a pose that fits as usual, before the first frames (of 2: all outline samples on edges, all
covered inside)."""
SCORE_SLACK = 0.15
"""A pose whose score is lower than usual by no more than this is accepted as it stands."""
FAR = 3.0
"""Length of a long search over that of a short one."""
NEAR_SHARE = 0.015
"""How far beyond the expected outline the mask is taken, as a share of the picture's longer side; where that
does not suffice all of it is."""
NOTED_FRAMES = 4
"""Of frames in which all is as usual, one in so many shows where the mechanism is not hidden."""
KNOWN = 0.1
"""A hidden link whose joint is known this well, as a share of the move limit, shows where it is hidden."""
LIKELY = 6.0
"""A pose from the whole picture within this many standard deviations of the prediction goes on with the
motion."""
UNEXPLAINED = 0.1
"""Share of the mechanism's area by which a pose from the whole picture may leave more foreground unexplained
than the one that goes on with the motion."""


@dataclass(frozen=True, eq=False)
class Sighting:
    """What was found in one frame.

    Attributes:
        position: Joint positions, (dof,); where a joint was not seen, as its motion goes on, NaN if unknown.
        covariance: Their covariance, (dof, dof); NaN where nothing was seen.
        joints: True for the joints that were seen, (dof,).
        score: How well the outline lies on the mask, 0 to 2.
        whole: True where every link lies on the mask.
    """

    position: np.ndarray
    covariance: np.ndarray
    joints: np.ndarray
    score: float
    whole: bool

    @property
    def fits(self) -> bool:
        """True where any joint was seen."""
        return bool(self.joints.any())


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
        Joint positions [rad; m in the start scale] with covariance; joints whose links do not lie on their
        mask, and frames that did not decode, are not seen and hold NaN.
    """
    first = Follower(scene, settings)
    poses = _followed(masks, first, progress)
    # What hides the mechanism is known only in the end. Where it was missed, the clip is followed once more,
    # with those places left out of the picture.
    if first.unusual and np.any(hidden := first.occluders.hidden()):
        poses = _followed(masks, Follower(scene, settings, hidden), progress)
    poses = unwound(poses, first.turning)
    if scene.doubt is None:
        return poses
    return scene.doubt.with_shifts(poses, scene.mechanism.slides)


def _followed(masks: Masks, follower: Follower, progress: Progress | None) -> Poses:
    """Follow the mechanism through the clip once."""
    video, scene = masks.video, follower.scene
    count, dofs = video.count, len(scene.mechanism.joints)
    position, covariance = np.full((count, dofs), np.nan), np.full((count, dofs, dofs), np.nan)
    joints, rows = np.zeros((count, dofs), dtype=bool), 0
    for frame in video.within(*scene.masks.background.window).frames():
        found = follower.find(frame)
        position[frame.index] = np.where(found.joints, found.position, np.nan)
        covariance[frame.index], joints[frame.index] = found.covariance, found.joints
        rows = frame.index + 1
        if progress is not None:
            progress("track", rows, count)
    names = tuple(joint.name for joint in scene.mechanism.joints)
    joints = joints[:rows]
    whole = np.asarray(joints.all(axis=1))
    # frames that did not decode at the end of the clip have no row
    return Poses(
        names, np.arange(rows), video.times[:rows], position[:rows], covariance[:rows], whole,
        metric=False, joint_seen=None if np.all(whole == joints.any(axis=1)) else joints,
        roll=scene.camera.roll,
    )  # fmt: skip


class Follower:
    """Follows the mechanism from frame to frame; what it keeps is the motion so far.

    Args:
        scene: Camera, sizes and first pose.
        settings: How the mechanism is followed.
        hidden: Pixels behind something, bool (height, width), which say nothing about the pose.

    Attributes:
        scene: The scene.
        occluders: Where the mechanism should have shown and did not.
        turning: True for the hinges that may turn all around, bool (dof,).
        unusual: Number of frames in which not every link lay on the mask as usual.
    """

    def __init__(self, scene: Scene, settings: TrackSettings, hidden: np.ndarray | None = None) -> None:
        self.scene = scene
        self._settings = settings
        self._still: Rig = rig_of(scene.mechanism, scene.camera)
        self._rig = self._still
        view = scene.masks.view(len(self._rig.radius))
        self._view: View = view if hidden is None else without(view, hidden)
        self.occluders, self.unusual = Occluders(self._rig, view), 0
        self._lower, self._upper = joint_limits(scene.mechanism)
        self._hinge = self._rig.kind == HINGE
        self.turning = np.array([joint.turns for joint in scene.mechanism.joints])
        reach = float(np.ptp(scene.mechanism.shapes.points[:, :2], axis=0).max())
        self._move = np.where(self._hinge, settings.move, settings.move * reach)
        self._known = dict(zip(scene.key_frames, scene.key_positions, strict=True))
        step = usual_step(scene.masks.video.times)
        self._motion = Motion(np.where(self._hinge, np.pi, reach), step)
        height, width = view.trust.shape[1:]
        self._near_px = math.ceil(settings.first_reach + NEAR_SHARE * max(height, width))
        self._undrawn = ~np.isin(np.arange(len(self._lower)), self._rig.link)
        coloured = _have_own_planes(self._view.part, self._rig.link, len(self._lower))
        self._rule = Rule(settings.matched, settings.inside, self._move, coloured)
        near, far = settings.first_reach, FAR * settings.first_reach
        self._short = np.array([near, 0.5 * (near + settings.reach), settings.reach, settings.reach])
        self._long = np.append(np.geomspace(far, settings.reach, 6), settings.reach)
        self._incomplete = 0
        self._usual, self._usual_std = USUAL_SCORE, np.full(len(self._lower), np.nan)

    @cached_property
    def _coarse(self) -> tuple[KeyFrames, Rig]:
        """How whole pictures are reduced to be searched, and the mechanism in them."""
        reduced = replace(no_frames(self.scene.masks, self._view), thicker=self.scene.thicker)
        thick = as_thick(reduced, self.scene.mechanism, self.scene.camera)
        return reduced, rig_of(thick, self.scene.camera, shrink=reduced.shrink)

    def find(self, frame: Frame, expected: np.ndarray | None = None) -> Sighting:
        """Find the pose in the next frame, from as little of its mask as that takes.

        Args:
            frame: The next frame, in the order of time.
            expected: Where the dynamics have the joints, (dof,), if they are known: it is tried first.

        Returns:
            What was found, as ``step`` finds it in the whole mask.
        """
        found = self._near(frame, expected)
        return self.step(self.scene.masks.of(frame), expected) if found is None else found

    def step(self, mask: Mask, expected: np.ndarray | None = None) -> Sighting:
        """Find the pose in the next mask.

        Args:
            mask: The next mask, in the order of time.
            expected: Where the dynamics have the joints, (dof,), if they are known: it is tried first.

        Returns:
            What was found.
        """
        shutter = self.scene.shutter
        if shutter is not None:
            self._rig = shutter.of(self._still, mask.index)
        mask = self._read(mask)
        found = self._along(mask, expected)
        usual = found is not None and self._as_usual(found)
        if not usual:
            if self._incomplete % self._settings.patience == 0:
                found = self._anywhere(mask, found)
            self._incomplete += 1
            self.unusual += self._motion.begun
        if found is not None and found.fits:
            return self._concluded(mask, found, usual)
        dofs = len(self._lower)
        nothing = np.full((dofs, dofs), np.nan)
        return Sighting(nothing[0], nothing, np.zeros(dofs, dtype=bool), 0.0, False)

    def _near(self, frame: Frame, expected: np.ndarray | None) -> Sighting | None:
        """Follow the mechanism in the part of the picture in which its motion goes on; None where it does not
        lie there as usual, and the whole picture is needed."""
        starts = self._motion.predictions(frame.time)
        # what is blurred goes beyond its outline
        if not starts or self.scene.shutter is not None:
            return None
        start = starts[0] if expected is None else expected
        start = np.minimum(np.maximum(start, self._lower), self._upper)
        mask = self._read(self.scene.masks.of(frame, self._around(start)))
        found, kept = self._follow(mask, start, self._settings.first_reach, float(self._near_px))
        # a joint that it shows less well than usual may go on anywhere with its motion
        if not (kept and self._as_usual(found) and self._sure(found).all()):
            return None
        return self._concluded(mask, found, True)

    def _around(self, start: np.ndarray) -> Wanted:
        """Return the part of a mask around the outline of a pose."""
        wanted = rows_around(self._rig, start, self._view.part, self._near_px, self._view.trust.shape[1:])
        if len(self._view.trust) == 1:
            # the largest coverage counts there, by whatever colour
            wanted.rows[:, PLANE] = EVERY_PLANE
        return wanted

    def _read(self, mask: Mask) -> Mask:
        """Return a mask with the planes that the view describes."""
        # without measured colours there is one plane for all geoms, whatever a mask has
        if len(mask.planes) == len(self._view.trust):
            return mask
        return replace(mask, planes=planes_for(mask, self._view))

    def _as_usual(self, found: Sighting) -> bool:
        """Return whether all of the mechanism lies on its mask about as well as before."""
        return found.whole and found.score > self._usual - SCORE_SLACK

    def _concluded(self, mask: Mask, found: Sighting, usual: bool) -> Sighting:
        """Judge what was found, and go on from there."""
        found = self._judged(found, mask.time)
        # what a picture shows faintly because it moves is not hidden
        if (not usual or mask.index % NOTED_FRAMES == 0) and not self._blurred(found.position):
            known = np.sqrt(np.diag(found.covariance)) < KNOWN * self._move
            self.occluders.note(mask.planes, found.position, known)
        self._motion.add(mask.time, found.position, found.joints)
        return self._as_registered(mask, found)

    def _as_registered(self, mask: Mask, found: Sighting) -> Sighting:
        """Add what the registration of a moving camera leaves open to the covariance of a sighting."""
        path = self.scene.masks.video.camera_path
        if path is None:
            return found
        s, seen = self._settings, found.joints
        gain = displaced_pose(mask, self._view, self._rig, found.position, self._move, (s.reach, s.spacing))
        # the path states the whole displacement, of which each axis has one half
        added = 0.5 * path.std[mask.index] ** 2 * (gain @ gain.T)
        return replace(found, covariance=found.covariance + np.where(seen[:, None] & seen, added, 0.0))

    def _along(self, mask: Mask, expected: np.ndarray | None = None) -> Sighting | None:
        """Follow the mechanism from where its motion goes on; None where there is no such place."""
        found = None
        starts = [np.clip(q, self._lower, self._upper) for q in self._motion.predictions(mask.time)]
        if not self._motion.begun and mask.index in self._known:
            starts = [self._known[mask.index]]
        if expected is not None:
            starts = [np.clip(expected, self._lower, self._upper), *starts]
        shutter = self.scene.shutter
        if shutter is not None and mask.index < len(shutter.position):
            # where the mechanism was when the clip was followed before
            before = self._with_turns(shutter.position[mask.index], mask.time)
            starts = [before, *starts] if np.all(np.isfinite(before)) else starts
        # Every start is tried with a short search, then with a long one, until a pose fits about as well as
        # those before it. A pose that fits much worse may have locked on a wrong edge: it is kept, but the
        # other starts and the search of the whole picture have their chance to do better.
        for first_reach in (self._settings.first_reach, FAR * self._settings.first_reach):
            for start in starts:
                found = _better(found, self._follow(mask, start, first_reach)[0])
                if self._as_usual(found):
                    return found
        return found

    def _follow(
        self, mask: Mask, start: np.ndarray, first_reach: float, margin: float = EVERYWHERE
    ) -> tuple[Sighting, bool]:
        """Move a start pose onto the mask within the move limits, and judge each link; return in addition
        whether nothing was looked at that is farther from the start's outline than ``margin`` [px]."""
        reaches = self._long if first_reach > self._settings.first_reach else self._short
        lower = np.maximum(self._lower, start - self._move)
        upper = np.minimum(self._upper, start + self._move)
        limits, search = MoveLimits(lower, upper, self._move), EdgeSearch(reaches, self._settings.spacing)
        q, covariance, joints, shown, score, kept = sighted(
            mask.planes, self._view, self._rig, start, limits, search, margin, self._rule
        )
        whole, some = bool((shown | self._undrawn).all()), bool(shown.any())
        if some and not whole:
            # What a link that is hidden or elsewhere takes for its edges pulls at the others too: the pose is
            # found again by the links that lie on the mask.
            part = np.where(shown[self._rig.link], self._view.part, LEFT_OUT)
            view = self._view._replace(part=part)
            q, covariance, joints, _, _, kept = sighted(
                mask.planes, view, self._rig, start, limits, search, margin, self._rule
            )
        if not some:
            joints[:] = False
        return Sighting(q, covariance, joints, score, whole and bool(joints.all())), kept

    def _judged(self, found: Sighting, time: float) -> Sighting:
        """Compare a sighting with what is usual; let joints that were not seen go on with their motion."""
        blurred = self._blurred(found.position)
        # the faster, the less a picture determines the pose
        seen = found.joints if blurred else self._sure(found)
        all_seen = bool(seen.all())
        if found.whole and all_seen:
            self._incomplete = 0
            if not blurred:
                self._usual += USUAL_GAIN * (found.score - self._usual)
                take_as_usual(found.covariance, self._usual_std)
        if all_seen or not self._motion.begun:
            return replace(found, joints=seen)
        position = np.where(seen, found.position, self._motion.expected(time))
        spread = np.diag(self._motion.spread(time) ** 2)
        covariance = np.where(seen[:, None] & seen, found.covariance, np.where(seen[:, None], 0.0, spread))
        return replace(found, position=position, covariance=covariance, joints=seen)

    def _sure(self, found: Sighting) -> np.ndarray:
        """Return which joints a sharp picture determines about as well as usual, bool (dof,)."""
        return sure(found.covariance, found.joints, self._usual_std)

    def _blurred(self, position: np.ndarray) -> bool:
        """Return whether the outline moves far while the picture is exposed."""
        return self.scene.shutter is not None and way(self._rig, position) > SLOW_PX

    def _anywhere(self, mask: Mask, along: Sighting | None) -> Sighting | None:
        """Look for the mechanism in the whole picture; choose between that and what its motion leads to."""
        reduced, rig = self._coarse
        frame, motion = key_frame(mask, reduced), self._motion
        q, _ = search_pose(frame, reduced.only([]), rig, self.scene.mechanism)
        q = self._with_turns(q, mask.time)
        expected = motion.expected(mask.time) if motion.begun else q
        found, _ = self._follow(mask, q, self._settings.first_reach)
        if not motion.begun:
            return _better(along, found)
        if not found.whole:
            return along
        # A folded mechanism lies well on a picture in which one of its links is hidden. Two things speak
        # against it: the jump from where it was, and the foreground that it leaves unexplained.
        jump = np.abs(found.position - expected)
        likely = np.all(jump <= np.maximum(self._move, LIKELY * motion.spread(mask.time)))
        lost = motion.frames_since(mask.time).min() > PREDICTED_FRAMES
        if not (likely or lost) or found.score < self._usual - 2.0 * SCORE_SLACK:
            return along
        if along is not None and along.fits:
            more = self._explained(frame, along.position) - self._explained(frame, found.position)
            if more > UNEXPLAINED * frame.area or along.score >= found.score:
                return along
        return found

    def _with_turns(self, position: np.ndarray, time: float) -> np.ndarray:
        """Return a pose, whose whole turns no picture shows, with those of the motion so far."""
        return np.where(self.turning, self._motion.turned(position, time), position)

    def _explained(self, frame: KeyFrame, position: np.ndarray) -> float:
        """Return the foreground that a pose covers [reduced px^2]."""
        return covered_area(frame.sums, self._coarse[1], position)


def _have_own_planes(part: np.ndarray, link: np.ndarray, links: int) -> np.ndarray:
    """Return which links show in planes that no other link shows in, bool (dof,), from both by geom."""
    shown = [set(part[link == i].tolist()) for i in range(links)]
    return np.array(
        [
            bool(own) and min(own) >= 0 and not any(own & other for k, other in enumerate(shown) if k != i)
            for i, own in enumerate(shown)
        ]
    )


def _better(found: Sighting | None, candidate: Sighting) -> Sighting:
    """Return whichever pose lies better on its mask; one of the whole mechanism before one of a part."""
    if found is None or (candidate.whole, candidate.fits) > (found.whole, found.fits):
        return candidate
    if (candidate.whole, candidate.fits) < (found.whole, found.fits):
        return found
    return candidate if candidate.score > found.score else found
