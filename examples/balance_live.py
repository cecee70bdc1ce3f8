"""Balance a mechanism that is only seen: watched, identified, put to rest, swung up, held, from pictures.

    python examples/balance_live.py [cartpole | pendubot]

MuJoCo stands for the laboratory. It draws 60 pictures a second of a mechanism whose sizes, frictions and
camera are not known to the program; one mass is, because the torque of a motor is in newton metres and
pictures have none. For five seconds it swings freely while ``monodyn.stream`` finds it and identifies it
frame by frame. Then one regulator puts it to rest, a planned way leads it up, and another regulator holds it,
each fed with the positions and rates that the stream estimates; the torques that are applied enter the
estimate. All of it is in simulated time. Needs ``pip install 'monodyn[control]'``, and an OpenGL that draws
without a screen (``MUJOCO_GL=egl`` or ``osmesa``).
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import numpy as np

import monodyn

RATE, STEPS = 60, 16
"""Pictures a second [Hz], and steps of the simulation to each."""
FREE, STILL, HELD = 5.0, 0.4, 10.0
"""Seconds that it swings freely; that it has to be at rest before it is swung up; that it has to stay up."""
LONGEST = 60.0
"""Seconds after which it is given up."""
RESTS = 0.06
"""Rates that count as rest [rad/s or m/s]."""
SCENE = """
<mujoco><option gravity="0 0 -9.81" integrator="RK4" timestep="{step}"/>
  <visual><global offwidth="640" offheight="480"/><headlight ambient=".5 .5 .5" diffuse=".4 .4 .4"/>
    <quality offsamples="8"/></visual>
  <asset><texture name="wall" type="2d" builtin="checker" width="256" height="256" rgb1=".62 .66 .7"
    rgb2=".57 .61 .65"/><material name="wall" texture="wall" texrepeat="20 20" specular="0"/></asset>
  <default><geom type="box" density="2700" contype="0" conaffinity="0"/><joint axis="0 -1 0"/></default>
  <worldbody><camera name="eye" pos="0.02 -1.6 0.01" xyaxes="1 0 0 0 0 1" fovy="{fovy}"/>
    <geom type="plane" size="6 6 1" pos="0 0.4 0" zaxis="0 -1 0" material="wall"/>{bodies}
  </worldbody></mujoco>
"""


@dataclass(frozen=True)
class Mechanism:
    """What is filmed, and what is known of it.

    Attributes:
        bodies: Its true bodies.
        fovy: How much the camera shows [deg].
        model: What the program is told: how it is jointed.
        motor: The joint that has a motor.
        weighed: The body whose mass is known.
        start: Where it is let go [m, rad], (dof,).
    """

    bodies: str
    fovy: float
    model: str
    motor: str
    weighed: str
    start: tuple[float, ...]


MECHANISMS = {
    "cartpole": Mechanism(
        """<body name="cart"><joint name="slide" type="slide" axis="1 0 0" damping="0.08"/>
        <geom size="0.06 0.01 0.03" density="0" mass="0.35" rgba=".15 .2 .3 1"/>
        <body name="link1" pos="0 -0.02 0"><joint name="joint1" damping="0.0008"/>
        <geom size="0.13 0.004 0.011" pos="0.13 0 0" rgba=".7 .15 .1 1"/></body></body>""",
        40.0, "cartpole", "slide", "cart", (0.05, -0.5),
    ),
    "pendubot": Mechanism(
        """<body name="link1"><joint name="joint1" damping="0.0012"/>
        <geom size="0.12 0.004 0.015" pos="0.11 0 0" rgba=".7 .15 .1 1"/>
        <body name="link2" pos="0.22 -0.01 0"><joint name="joint2" damping="0.0006"/>
        <geom size="0.1 0.003 0.012" pos="0.09 0 0" rgba=".15 .2 .4 1"/></body></body>""",
        42.0, "double", "joint1", "link1", (-0.4, 0.7),
    ),
}  # fmt: skip
"""What can be balanced."""


class Laboratory:
    """A true mechanism with a motor before a camera.

    Args:
        kind: Which.
    """

    def __init__(self, kind: Mechanism) -> None:
        text = SCENE.format(step=1.0 / (RATE * STEPS), fovy=kind.fovy, bodies=kind.bodies)
        self.body = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.body)
        self.data.qpos[:] = kind.start
        self.motor = self.body.joint(kind.motor).dofadr[0]
        self.torque = 0.0

    def pictures(self) -> Iterator[np.ndarray]:
        """Yield what the camera sees, uint8 (height, width, 3); between two pictures the torque is held."""
        with mujoco.Renderer(self.body, 360, 480) as renderer:
            while True:
                renderer.update_scene(self.data, camera="eye")
                yield renderer.render()
                self.data.qfrc_applied[self.motor] = self.torque
                mujoco.mj_step(self.body, self.data, STEPS)


class Pilot:
    """What is done with the motor, by what is known at each frame.

    Args:
        kind: What is to be balanced.
        laboratory: Where the motor is.

    Attributes:
        does: What it does at the moment.
        since: When it has begun to [s].
        up: How long the regulator of the end has held it [s].
    """

    def __init__(self, kind: Mechanism, laboratory: Laboratory) -> None:
        self.does, self.since, self.up = "watches", 0.0, 0.0
        self._kind, self._laboratory, self._still = kind, laboratory, 0.0

    def apply(self, step: monodyn.Step) -> Mapping[str, float] | None:
        """Apply a torque at a frame.

        Args:
            step: What is known at it.

        Returns:
            The torque, by joint.
        """
        torque = 0.0
        if step.estimate is not None:
            torque = self._torque(step, *step.estimate.state(step.time))
        self._laboratory.torque = torque
        return {self._kind.motor: torque}

    def _torque(self, step: monodyn.Step, q: np.ndarray, v: np.ndarray) -> float:
        """Return the torque for a frame; where something is done, go on to the next."""
        trusted = step.verdict == "trusted" and step.fit.mass_scale == "given"
        if self.does == "watches" and step.time >= FREE and trusted:
            self._design(step.fit)
            self._go_on("brings it to rest", step.time)
        elif self.does == "brings it to rest":
            off = np.abs(v).max()
            self._still = self._still + 1.0 / RATE if off < RESTS else 0.0
            if self._still > STILL:
                self._go_on("swings it up", step.time)
        elif self.does == "swings it up" and step.time - self.since > self._swing.seconds:
            self._go_on("holds it", step.time)
        elif self.does == "holds it":
            self.up = step.time - self.since
        if self.does == "watches":
            return 0.0
        control = self._rest if self.does == "brings it to rest" else self._swing
        torque = control.torque_at(step.time - self.since + (self.does == "holds it") * 60.0, q, v)
        return float(np.clip(torque, -self._swing.limit, self._swing.limit)[0])

    def _design(self, fit: monodyn.Fit) -> None:
        """Design all that is done with the motor by what was identified."""
        motor = [self._kind.motor]
        self._rest = monodyn.lqr(fit, {"joint1": -np.pi / 2}, actuated=motor, rate=RATE)
        upright = monodyn.lqr(fit, {"joint1": np.pi / 2}, actuated=motor, rate=RATE)
        self._swing = monodyn.swing_up(fit, upright)
        print(
            f"planned: up in {self._swing.seconds:.2f} s with at most {np.abs(self._swing.torque).max():.2f}"
        )

    def _go_on(self, does: str, time: float) -> None:
        self.does, self.since = does, time
        print(f"{time:6.2f} s: {does}")


def main() -> int:
    """Watch, identify, design, swing up, hold.

    Returns:
        The exit code: 0 when the true mechanism stays up for ten seconds.
    """
    kind = MECHANISMS[sys.argv[1] if len(sys.argv) > 1 else "cartpole"]
    laboratory = Laboratory(kind)
    pilot = Pilot(kind, laboratory)
    mass = float(laboratory.body.body(kind.weighed).mass[0])
    settings = monodyn.RunSettings(rate=RATE, fix={f"{kind.weighed}.mass": mass})
    said = ""
    for step in monodyn.stream(laboratory.pictures(), kind.model, settings=settings, apply=pilot.apply):
        if step.said != said:
            said = step.said
            print(f"{step.time:6.2f} s: {said}")
        if pilot.up > HELD or step.time > LONGEST:
            break
    if pilot.does == "watches":
        print("nothing is designed: what was seen is not trusted, or leaves open what a torque does")
    stays = pilot.up > HELD and bool(np.abs(laboratory.data.qvel).max() < 1.0)
    print(f"the true one {'is swung up and stays up' if stays else 'does not stay up'}")
    return 0 if stays else 1


if __name__ == "__main__":
    raise SystemExit(main())
