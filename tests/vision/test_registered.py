"""How a pose follows a displacement of its mask, against poses found on displaced masks."""

from __future__ import annotations

import numpy as np

from monodyn.mechanism import load
from monodyn.types import Mask
from monodyn.vision.clip.steady import displaced
from monodyn.vision.drawing.follow import EdgeSearch, MoveLimits, follow
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.tracking.registered import displaced_pose
from pictures import CAMERA, drawn_mask, trusted

MECHANISM = load("double")
POSE = np.array([-0.9, 0.7])
LIMIT = np.full(2, 0.6)


def test_a_pose_follows_its_mask() -> None:
    rig, view, free = rig_of(MECHANISM, CAMERA), trusted(MECHANISM), np.full(2, np.inf)
    search = EdgeSearch(np.full(6, 4.0), 2.0)
    planes = drawn_mask(MECHANISM, CAMERA, POSE)

    def found(by: np.ndarray) -> np.ndarray:
        return follow(
            displaced(planes, by), view, rig, POSE, MoveLimits(-free, free, np.full(2, 1e3)), search
        )[0]

    gain = displaced_pose(Mask(0, 0.0, planes), view, rig, POSE, LIMIT, (4.0, 2.0))
    for axis in np.eye(2):
        # whole pixels, so that the mask is not drawn anew between its pixels
        measured = 0.5 * (found(axis) - found(-axis))
        np.testing.assert_allclose(gain @ axis, measured, atol=0.15 * np.abs(gain).max())
    # along a link nothing turns it; across it both directions do, by one over some part of its length
    assert np.linalg.norm(gain[0]) > 0.5 / 60.0


def test_a_joint_that_does_not_show_stays() -> None:
    blank = np.zeros((1, CAMERA.height, CAMERA.width), np.uint8)
    view = trusted(MECHANISM)._replace(trust=np.zeros(blank.shape, np.float32))
    rig = rig_of(MECHANISM, CAMERA)
    assert not displaced_pose(Mask(0, 0.0, blank), view, rig, POSE, LIMIT, (4.0, 2.0)).any()
