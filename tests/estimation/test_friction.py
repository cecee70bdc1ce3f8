"""Dry friction, estimated where it shows."""

import pytest

from driven import DOUBLE, THICKNESS, simulated, started
from monodyn.stages import identify


def test_dry_friction_is_estimated_where_it_shows(passive, tmp_path):
    start = started(DOUBLE, tmp_path, 0.5, **THICKNESS)
    without = identify(passive[0], start)
    assert not without.parameter("joint1.friction").free
    # MuJoCo's friction gives way a little by default
    stiff = (
        'damping="0.001" frictionloss="0.004" solreffriction="0.002 1" solimpfriction="0.999 0.9999 0.001"'
    )
    dry = DOUBLE.replace('damping="0.001"', stiff)
    record, _ = simulated(dry, [-0.8, 0.4], 120)
    found = identify(record, start)
    assert found.ok, found.status
    assert found.parameter("joint1.friction").free
    assert found.parameter("joint1.friction").value == pytest.approx(0.004, rel=0.05)
    held = identify(record, start.with_choices(fix={"joint1.friction": 0.0, "joint2.friction": 0.0}))
    assert held.parameter("joint1.friction").value == 0.0
    assert held.rms["joint1"] > 1.5 * found.rms["joint1"]
