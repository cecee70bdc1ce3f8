"""Poses: which joints of which frames were measured."""

from dataclasses import replace

import numpy as np

from monodyn.errors import VideoError
from monodyn.types import Poses
from support import refuses


def poses():
    position = np.arange(6.0).reshape(3, 2)
    position[1, 1] = np.nan
    joint_seen = np.array([[True, True], [True, False], [False, False]])
    covariance = np.tile(np.eye(2), (3, 1, 1))
    return Poses(
        ("a", "b"), np.arange(3), np.arange(3.0), position, covariance, joint_seen.all(axis=1),
        joint_seen=joint_seen,
    )  # fmt: skip


def test_a_joint_of_a_frame_counts_by_itself():
    found = poses()
    np.testing.assert_array_equal(found.measured, found.joint_seen)
    np.testing.assert_array_equal(found.part(1, 3).measured, found.measured[1:])
    alone = replace(found, joint_seen=None)
    np.testing.assert_array_equal(alone.measured, [[True, True], [False, False], [False, False]])


def test_frames_and_joints_that_contradict_each_other():
    with refuses(
        VideoError,
        "Poses.seen: expected the frames in which every joint was seen, got others; change 'joint_seen' too.",
    ):
        replace(poses(), seen=np.ones(3, dtype=bool))
