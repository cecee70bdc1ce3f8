"""Controllers of mechanisms that were identified from a clip, tried on the true ones in MuJoCo (``use.py``).

``cartpole``: the clip of ``MONODYN_DATA``, of which 80 frames are used and nothing else is known.
``pendubot``: a double pendulum with a motor at its first hinge, from a clip that is made here; one mass is
known, because torques of a motor are in newton metres.
"""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path

import mujoco
import numpy as np

import monodyn
from clips import cached
from figures import Figure, say
from monodyn.estimation.fit import Fit
from monodyn.results.closed import ClosedLoop, closed_loop
from monodyn.results.draws import Response, drawn
from spec import Case, Part

FRAMES, RATE = (0, 80), 30.0
"""Frames that are looked at, and frames a second [Hz]."""
DRAWS = 50
"""Mechanisms drawn from the covariance."""
AWAY = 0.2
"""How far from upright a pole begins [rad]."""
SECONDS = 10.0
"""How long it has to stay up [s]."""
AGREES = 1e-6
"""The first frames of the clip are those of the file that is written here within this [rad or m]."""
PENDUBOT = Case(
    "pendubot",
    (
        Part(0.22, 0.03, 0.006, (170, 60, 50), tail=0.012, tip=0.012, damping=1e-3),
        Part(0.19, 0.026, 0.006, (45, 70, 150), parent=0, tail=0.012, tip=0.012, damping=6e-4),
    ),
    start=(-0.2, 0.6),
)
"""The clip of the pendubot."""


def controls() -> list[Figure]:
    """Return how controllers of identified mechanisms do on the true ones."""
    return [*cartpole(), *pendubot()]


def cartpole() -> list[Figure]:
    """Return how gains from 80 frames of its clip balance the true cart-pole."""
    data = Path(os.environ.get("MONODYN_DATA") or "missing") / "rendered"
    if not (data / "cartpole.mp4").is_file():
        say("control: cartpole: SKIPPED, MONODYN_DATA is not set; it names the folder with the recordings.")
        return []
    with tempfile.TemporaryDirectory() as folder:
        truth = _true_cartpole(data / "cartpole.json", Path(folder) / "truth.xml")
        fit = _identified(data / "cartpole.mp4", data / "cartpole.xml", Path(folder) / "run")
        regulator = monodyn.lqr(fit, {"joint1": np.pi / 2.0}, actuated=["slide"], draws=DRAWS)
        begin = regulator.position + np.array([0.0, AWAY])
        loop = closed_loop(truth, regulator, begin, seconds=SECONDS)
        others = drawn(fit, DRAWS, response=Response(regulator.position, 0))
        held = [closed_loop(one, regulator, begin, seconds=SECONDS).balanced for one in others]
    case, stability = "cartpole", regulator.stability
    return [
        Figure(case, "trusted", float(fit.grade == "trusted"), ""),
        *_loop_figures(case, loop),
        Figure(case, f"of {DRAWS} draws that are stable", stability.stable, "", DRAWS, least=True),
        Figure(case, f"of {DRAWS} draws that MuJoCo balances", sum(held), "", DRAWS, least=True),
        Figure(case, "slowest pole of any draw", stability.worst, "1/s"),
        Figure(case, "times the masses, at least", stability.lightest, ""),
        Figure(case, "times the masses, at most", stability.heaviest, ""),
    ]


def pendubot() -> list[Figure]:
    """Return how a pendubot is swung up and balanced by what is identified from its clip."""
    clip = cached(PENDUBOT)
    body = mujoco.MjModel.from_xml_path(str(clip.truth))
    known = {"link1.mass": float(body.body("link1").mass[0])}
    with tempfile.TemporaryDirectory() as folder:
        fit = _identified(clip.video, clip.model, Path(folder) / "run", fix=known)
        upright = {"joint1": np.pi / 2.0}
        regulator = monodyn.lqr(fit, upright, actuated=["joint1"], draws=DRAWS)
        swing = monodyn.swing_up(fit, regulator)
        loop = closed_loop(clip.truth, swing, np.array([-np.pi / 2.0, 0.0]), seconds=swing.seconds + SECONDS)
    case, stability = "pendubot", regulator.stability
    return [
        Figure(case, "trusted", float(fit.grade == "trusted"), ""),
        *_loop_figures(case, loop),
        Figure(case, f"of {DRAWS} draws that are stable", stability.stable, "", DRAWS, least=True),
        Figure(case, f"of {swing.draws} draws that are swung up", swing.reached, ""),
        Figure(case, "swing", swing.seconds, "s"),
        Figure(case, "largest torque", float(np.abs(loop.torque).max()), "N m"),
        Figure(case, "limit", float(swing.limit[0]), "N m"),
    ]


def _identified(video: Path, model: Path, out: Path, fix: dict[str, float] | None = None) -> Fit:
    """Return what is identified from the first frames of a clip."""
    seconds = 0.0, (FRAMES[1] - 0.5) / RATE
    settings = monodyn.RunSettings(fit_frames=FRAMES, time_range=seconds, fix=fix or {})
    outcome = monodyn.run(video, model, out, settings)
    say(f"control: {video.stem}: {outcome.document['grade']}: {outcome.document['status']}")
    assert outcome.fit is not None
    return outcome.fit


def _loop_figures(case: str, loop: ClosedLoop) -> list[Figure]:
    """Return whether the true one was balanced, and how exactly at the end."""
    return [
        Figure(case, "true one is balanced", float(loop.balanced), "", 1.0, least=True),
        Figure(case, "farthest in the last second", 1e3 * float(loop.off.max()), "mrad or mm"),
    ]


def _true_cartpole(source: Path, path: Path) -> Path:
    """Write the true cart-pole as a MuJoCo file; check that it moves as the clip does."""
    document = json.loads(source.read_text(encoding="utf-8"))
    truth = document["truth"]
    ((length, width, thickness),) = truth["links"]
    cart, (damping,) = truth["cart"], truth["damping"]
    long, high = cart["size"]
    path.write_text(
        f"""<mujoco><option gravity="0 0 -9.81" integrator="RK4" timestep="0.0005"/>
        <default><geom type="box" contype="0" conaffinity="0"/></default><worldbody><body name="cart">
        <joint name="slide" type="slide" axis="1 0 0" damping="{cart["damping"]}"/>
        <geom size="{long / 2} 0.01 {high / 2}" mass="{cart["mass"]}"/><body name="link1" pos="0 -0.02 0">
        <joint name="joint1" axis="0 -1 0" damping="{damping}"/>
        <geom size="{length / 2} {thickness / 2} {width / 2}" pos="{length / 2} 0 0"
        density="{truth["density"]}"/></body></body></worldbody></mujoco>""",
        encoding="utf-8",
    )
    body = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(body)
    data.qpos[:], data.qvel[:] = document["q"][0], document["v"][0]
    # the truth is that of whole milliseconds, which every third frame falls on
    for row in document["q"][:30:3]:
        assert np.abs(data.qpos - row).max() < AGREES
        mujoco.mj_step(body, data, round(document["times"][3] / body.opt.timestep))
    return path
