"""Dry friction, estimated where it shows."""

import numpy as np
import pytest

from driven import DOUBLE, GEOM, STIFF, THICKNESS, simulated, started
from monodyn.estimation.torque import friction
from monodyn.results.predict import predict
from monodyn.stages import identify

pytestmark = pytest.mark.slow

STOPPING = f"""<mujoco><option gravity="0 0 -9.81" integrator="RK4"/><worldbody>
<body name="link1"><joint name="joint1" type="hinge" axis="0 -1 0" frictionloss="0.08" damping="0.0003"
  {STIFF}/>
<geom {GEOM} size="0.15 0.003 0.015" pos="0.15 0 0"/></body></worldbody></mujoco>"""


def test_dry_friction_is_estimated_where_it_shows(passive, tmp_path):
    start = started(DOUBLE, tmp_path, 0.5, **THICKNESS)
    without = identify(passive[0], start)
    assert not without.parameter("joint1.friction").free
    dry = DOUBLE.replace('damping="0.001"', f'damping="0.001" frictionloss="0.004" {STIFF}')
    record, _ = simulated(dry, [-0.8, 0.4], 120)
    found = identify(record, start)
    assert found.ok, found.status
    assert found.parameter("joint1.friction").free
    assert found.parameter("joint1.friction").value == pytest.approx(0.004, rel=0.05)
    held = identify(record, start.with_choices(fix={"joint1.friction": 0.0, "joint2.friction": 0.0}))
    assert held.parameter("joint1.friction").value == 0.0
    assert held.rms["joint1"] > 1.5 * found.rms["joint1"]


def test_a_motion_that_dry_friction_brings_to_rest_is_explained(tmp_path):
    """The pendulum swings for one second and rests for three, by MuJoCo's friction loss."""
    record, _ = simulated(STOPPING, [0.1], 120)
    found = identify(record, started(STOPPING, tmp_path, 1.0, **{"link1.thickness": 0.006}))
    assert found.ok, found.status
    assert found.parameter("joint1.friction").value == pytest.approx(0.08, rel=0.05)
    assert found.parameter("link1.length").value == pytest.approx(0.3, rel=0.01)
    resting = predict(found, times=record.time).position[60:, 0]
    assert np.abs(resting - np.median(record.position[60:, 0])).max() < np.radians(0.5)


@pytest.mark.parametrize("firm", [False, True])
def test_friction_that_turns_ahead_is_that_of_a_soft_constraint(firm, tmp_path):
    """MuJoCo's default turns 9.5 ms ahead: half of 0.02 s, by the dmax of its impedance."""
    law = f'damping="0.001" frictionloss="0.004" {STIFF if firm else ""}'
    dry = DOUBLE.replace('damping="0.001"', law).replace('damping="0.0005"', law)
    record, _ = simulated(dry, [1.2, -0.9], 120)
    found = identify(record, started(DOUBLE, tmp_path, 0.5, **THICKNESS))
    assert found.ok, found.status
    lead, said = found.parameter("joint1.lead"), [text for text in found.advice if "no bearing" in text]
    assert lead.free == (not firm)
    assert len(said) == (not firm)
    # one for all joints
    assert found.parameter("joint2.lead").value == lead.value
    if not firm:
        assert lead.lower < 0.0095 < lead.upper
        assert lead.value == pytest.approx(0.0095, rel=0.1)
        assert found.parameter("joint1.friction").value == pytest.approx(0.004, rel=0.05)
        held = identify(record, started(DOUBLE, tmp_path, 0.5, **THICKNESS, **{"joint1.lead": 0.0}))
        assert not held.parameter("joint1.lead").free


def test_what_is_found_again_without_a_lead_is_kept(monkeypatch):
    """A lead may lead out of a poor optimum to one that is as good without it."""
    problem, before, better = object(), object(), object()
    monkeypatch.setattr(friction, "_with_frictions", lambda *_: (problem, before))
    monkeypatch.setattr(friction, "_with_leads", lambda *_: (problem, better))
    assert friction.with_dry_friction(None, None, None) == (problem, better)  # pyright: ignore[reportArgumentType]
