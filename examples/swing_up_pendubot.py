"""Swing a pendubot up and balance it by what two seconds of its free swing tell.

    python examples/swing_up_pendubot.py

A pendubot is a double pendulum whose first hinge alone has a motor. MuJoCo stands for the laboratory: the
motor is off, both links swing, and positions are measured 25 times a second with noise. One thing is known in
addition: the mass of the first link, for a free motion shows no torque. From what is identified a way up is
planned, with gains that keep to it and others that hold the end; then the true one is swung up from where it
hangs. Needs ``pip install 'monodyn[control]'``.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import mujoco
import numpy as np

import monodyn
from laboratory import swinging

TRUE = """
<mujoco><option gravity="0 0 -9.81" integrator="RK4" timestep="0.001"/>
  <default><geom type="box" density="2700" contype="0" conaffinity="0"/><joint axis="0 -1 0"/></default>
  <worldbody><body name="link1"><joint name="joint1" damping="0.0012"/>
    <geom size="0.125 0.004 0.014" pos="0.11 0 0"/>
    <body name="link2" pos="0.22 -0.01 0"><joint name="joint2" damping="0.0006"/>
      <geom size="0.105 0.003 0.013" pos="0.09 0 0"/></body></body></worldbody></mujoco>
"""
HANGING, UPRIGHT = np.array([-np.pi / 2, 0.0]), {"joint1": np.pi / 2}
"""Joint positions in which it hangs and stands [rad]."""


def main() -> int:
    """Measure, identify, plan, and swing up.

    Returns:
        The exit code: 0 when the true pendubot is swung up and stays up for ten seconds.
    """
    with tempfile.TemporaryDirectory() as folder:
        true = Path(folder) / "true.xml"
        true.write_text(TRUE, encoding="utf-8")
        # the first link was put on a pair of scales
        weighed = {"link1.mass": float(mujoco.MjModel.from_xml_path(str(true)).body("link1").mass[0])}
        mechanism = monodyn.load("double").with_choices(fix=weighed)
        measured = swinging(true, (-0.3, 0.7), frames=60, seed=2)
        fit = monodyn.identify(measured, mechanism).check()
        print(fit.status)
        regulator = monodyn.lqr(fit, UPRIGHT, actuated=["joint1"])
        swing = monodyn.swing_up(fit, regulator)
        print(f"planned: {swing.seconds:.2f} s with at most {np.abs(swing.torque).max():.2f} N m")
        print(f"it leads up {swing.reached} of {swing.draws} mechanisms that the measurements allow")
        loop = monodyn.closed_loop(true, swing, HANGING, seconds=swing.seconds + 10.0)
    print(f"the true one {'is swung up and stays up' if loop.balanced else 'does not stay up'}: in the last")
    print(f"second it is within {np.degrees(loop.off.max()):.2g} deg of upright")
    return 0 if loop.balanced else 1


if __name__ == "__main__":
    raise SystemExit(main())
