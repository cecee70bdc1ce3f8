"""Balance a cart-pole by what two seconds of its swing tell, without knowing its masses.

    python examples/balance_cartpole.py

MuJoCo stands for the laboratory: its cart-pole swings, positions are measured 25 times a second with noise,
and nothing else of it is used. The gains come from what is identified from that, are tried on mechanisms that
the measurements allow, and then hold the true one. A run of ``monodyn run`` or ``monodyn identify`` does as
well as the measurements: ``fit = monodyn.open_run("run")``. Needs ``pip install 'monodyn[control]'``.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

import monodyn
from laboratory import swinging

TRUE = """
<mujoco><option gravity="0 0 -9.81" integrator="RK4" timestep="0.001"/>
  <default><geom type="box" contype="0" conaffinity="0"/></default><worldbody>
  <body name="cart"><joint name="slide" type="slide" axis="1 0 0" damping="0.05"/>
    <geom size="0.06 0.01 0.03" mass="0.35"/>
    <body name="link1" pos="0 -0.02 0"><joint name="joint1" axis="0 -1 0" damping="0.0008"/>
      <geom size="0.13 0.004 0.011" pos="0.13 0 0" density="2700"/></body></body></worldbody></mujoco>
"""
FALL = 0.2
"""How far from upright the pole is let go [rad]."""


def main() -> int:
    """Measure, identify, design, and let go.

    Returns:
        The exit code: 0 when the true cart-pole stays up for ten seconds.
    """
    with tempfile.TemporaryDirectory() as folder:
        true = Path(folder) / "true.xml"
        true.write_text(TRUE, encoding="utf-8")
        measured = swinging(true, (0.05, -0.4), frames=50, seed=1)
        fit = monodyn.identify(measured, monodyn.load("cartpole")).check()
        print(fit.status)
        regulator = monodyn.lqr(fit, {"joint1": np.pi / 2}, actuated=["slide"])
        print(f"gains: {np.round(regulator.gain[0], 2).tolist()} by {regulator.linear.system.state_labels}")
        stability = regulator.stability
        print(f"they hold {stability.stable} of {stability.draws} mechanisms that the measurements allow,")
        print(f"and {stability.lightest:.2g} to {stability.heaviest:.2g} times the masses")
        let_go = regulator.position + np.array([0.0, FALL])
        loop = monodyn.closed_loop(true, regulator, let_go, seconds=10.0)
    print(f"the true one {'stays up' if loop.balanced else 'falls'}: in the last second it is within")
    print(f"{1e3 * loop.off[0]:.2g} mm and {np.degrees(loop.off[1]):.2g} deg of where it should be")
    return 0 if loop.balanced else 1


if __name__ == "__main__":
    raise SystemExit(main())
