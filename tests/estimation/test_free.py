"""One torque a joint and time stamp."""

import numpy as np
import pytest

from driven import DOUBLE, NOISE, RATE, SIZES, THICKNESS, pull, simulated, started
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.verdict import advice
from monodyn.results.fill import fill
from monodyn.results.predict import predict
from monodyn.results.torques import torques
from monodyn.stages import identify
from monodyn.types import Poses


def test_any_torque_is_found_when_sizes_are_known(tmp_path):
    record, applied = simulated(DOUBLE, [-1.5, 0.3], 90, pull)
    start = started(DOUBLE, tmp_path, 1.0, **THICKNESS, **SIZES)
    fit = identify(record, start, IdentifySettings(torque="free"))
    assert fit.ok, fit.status
    assert len(fit.names) == 2 * 90 + 4
    # friction is part of a free torque
    rate = fill(fit, record.time).velocity
    whole = applied - rate * np.array([0.001, 0.0005])
    error = (torques(fit, record.time).torque - whole)[5:-5]
    assert (np.sqrt(np.mean(error**2, axis=0)) < 0.06 * np.sqrt(np.mean(whole**2, axis=0))).all()
    assert max(fit.rms.values()) < 1.1 * NOISE


def test_free_torques_say_what_they_rest_on(driven, tmp_path):
    fit = identify(driven[0][:60], started(DOUBLE, tmp_path, 0.5), IdentifySettings(torque="free"))
    assert fit.ok, fit.status
    assert not fit.parameter("link1.length").identifiable
    assert set(advice.free_torques(fit.mechanism)) <= set(fit.advice)
    assert np.isinf(predict(fit).std).all()
    assert np.isfinite(fill(fit, driven[0].time[:60]).std).all()
    assert fit.mechanism.drive.at(np.array([10.0])).tolist() == [[0.0, 0.0]]
    # camera and slides follow the common scale
    assert fit.scale == pytest.approx(fit.parameter("link1.length").value / 0.115)


def test_free_torques_take_one_record_of_a_few_hundred_frames(driven, tmp_path):
    start, settings = started(DOUBLE, tmp_path, 0.5), IdentifySettings(torque="free")
    assert identify([driven[0], driven[0]], start, settings).status == (
        "Free torques belong to one record each; identify one record at a time."
    )
    count = 1100
    long = Poses(
        driven[0].joints, np.arange(count), np.arange(count) / RATE,
        np.resize(driven[0].position, (count, 2)), np.resize(driven[0].covariance, (count, 2, 2)),
        np.ones(count, dtype=bool),
    )  # fmt: skip
    assert identify(long, start, settings).status == (
        "2200 torques, one a joint and time stamp, are too many at once; fit at most 1000 frames."
    )
