"""Records laid end to end: what cannot be used is refused with whole messages."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.errors import MechanismError, VideoError
from monodyn.estimation.record.samples import cut, merge, prepare, spread
from monodyn.types import Poses
from support import refuses


def test_records_that_cannot_be_used(poses, double):
    with refuses(VideoError, "identify: expected at least one record of joint positions, got none."):
        prepare([], double)
    with refuses(VideoError, "record 0: expected measured joint positions, got none in 60 rows."):
        prepare([replace(poses, position=np.full((60, 2), np.nan))], double)
    with refuses(
        VideoError,
        "record 0: the covariance of measured sample 0 is not positive definite; give each joint a standard "
        "deviation above zero.",
    ):
        prepare([replace(poses, covariance=0.0 * poses.covariance)], double)
    with refuses(MechanismError, "joint 'elbw' is not in the mechanism; joints: 'joint1', 'joint2'."):
        prepare([replace(poses, joints=("joint1", "elbw"))], double)
    one = Poses(
        ("joint1",), poses.frame, poses.time, poses.position[:, :1], poses.covariance[:, :1, :1], poses.seen
    )
    with refuses(
        MechanismError, "record 1: joint 'joint2' of the mechanism was not measured; joints: 'joint1'."
    ):
        prepare([poses, one], double)


def test_a_record_of_pauses_is_refused(poses, double):
    """Rows would be filled in where nothing was measured, and no motion leads from one part to the next."""
    apart = replace(poses, time=poses.time + 1000.0 * (np.arange(60) >= 30))
    usual = float(np.median(np.diff(poses.time))) * 59
    with refuses(
        VideoError,
        "record 1: expected rows that follow each other, got pauses of 1000 s between rows of "
        f"{usual:.4g} s, the longest after {poses.time[29]:.6g} s; give what comes "
        "before and after a pause as records of their own.",
    ):
        prepare([poses, apart], double)
    # what is not measured is no part of the record
    unseen = replace(apart, seen=np.arange(60) < 30)
    assert len(prepare([unseen], double).times) == 30


def test_gaps_get_rows_that_weigh_nothing(poses, double):
    """No step is over twice the usual one; what was measured keeps its row of the table."""
    holes = replace(poses[:20], seen=~np.isin(np.arange(20), range(8, 14)))
    kept = holes.seen
    sparse = Poses(
        poses.joints, holes.frame[kept], holes.time[kept], holes.position[kept], holes.covariance[kept],
        np.ones(14, dtype=bool),
    )  # fmt: skip
    data = prepare([sparse], double)
    assert np.diff(data.times).max() < 2.0 * np.median(np.diff(data.times)) + 1e-9
    filled = data.source < 0
    assert filled.sum() == 3  # a gap of seven steps in four parts
    assert not data.measured[filled].any()
    assert not data.white[filled].any()
    np.testing.assert_array_equal(data.source[~filled], np.arange(14))
    np.testing.assert_array_equal(data.position[~filled], sparse.position)


@pytest.mark.parametrize("samples", [7, 10, 100])
def test_pieces_are_all_rows_and_join_two_by_two(poses, double, samples):
    data = prepare([poses, poses[:30]], double)
    pieces = cut(data, samples)
    rounds = 0
    while not pieces.whole:
        assert pieces.first[0] == 0
        assert pieces.first[-1] == len(data.times)
        assert (np.diff(pieces.first) > 0).all()
        longer, kept = merge(pieces)
        np.testing.assert_array_equal(longer.first[:-1], pieces.first[kept])
        assert len(longer.record) < len(pieces.record)
        pieces, rounds = longer, rounds + 1
    np.testing.assert_array_equal(pieces.first, data.first)
    assert rounds == int(np.ceil(np.log2(max(round(60 / samples), 1))))


def test_what_holds_for_a_record_holds_for_its_rows(poses, double):
    data = prepare([poses, poses[:30]], double)
    np.testing.assert_array_equal(data.by_row(np.array([3, 5])), [3] * 60 + [5] * 30)


def test_some_pieces_stand_for_all(poses, double):
    data = prepare([poses, poses[:7], poses], double)
    pieces = cut(data, 10)
    part, chosen = spread(data, pieces, 4)
    assert chosen.record.tolist() == [0, 0, 2, 2]
    assert part.first.tolist() == [0, 20, 20, 40]
    assert chosen.first.tolist() == [0, 10, 20, 30, 40]
    rows = [*range(10), *range(40, 50), *range(77, 87), *range(117, 127)]
    np.testing.assert_array_equal(part.position, data.position[rows])
    np.testing.assert_array_equal(part.source, data.source[rows])
    np.testing.assert_array_equal(part.white, data.white[rows])
    # where there are few they all stay
    same, all_of_them = spread(data, pieces, 100)
    np.testing.assert_array_equal(same.times, data.times)
    np.testing.assert_array_equal(all_of_them.first, pieces.first)
