"""What was found in, what to do with it out: commands to copy, each with a word on what it is for."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monodyn.choices import is_bundled
from monodyn.errors import SettingsError
from monodyn.estimation.fit import Fit
from monodyn.mechanism.simulate import energy
from monodyn.results.experiment import next_commands, next_motion
from monodyn.results.findings import Findings
from monodyn.results.linear import inertia
from monodyn.results.regulator import equilibrium
from monodyn.results.releases import hanging_at_rest

COUPLED = 1e-3
"""Least inertia that two joints share, by the root of the product of their own, with which the motor of one
moves the other."""


class Step(NamedTuple):
    """One thing to do.

    Attributes:
        what: What it is for.
        command: The command, for the folder of the run; empty where there is none.
    """

    what: str
    command: str = ""


def next_steps(findings: Findings) -> list[Step]:
    """Return what one can do with an identified mechanism, or about one that was refused.

    Args:
        findings: The fit and its records.

    Returns:
        The steps.
    """
    fit = findings.fit
    if not (fit.ok and fit.starts):
        return _refused(findings)
    joints = [joint.name for joint in fit.mechanism.joints]
    begin = ",".join(f"{name}={0.5 if k == 0 else 0:g}" for k, name in enumerate(joints))
    film = "" if findings.filmed is None else " --film"
    steps = [
        Step(
            "Look at it in MuJoCo (pip install 'monodyn[viewer]')", "python -m mujoco.viewer --mjcf=model.xml"
        ),
        Step(
            "Let it go from another state",
            f"monodyn predict . --from {shlex.quote(begin)} --until 5 --out ahead{film}",
        ),
        Step(
            "Go on with it in another record, with what the pictures know of the sizes"
            if findings.filmed is not None
            else "Go on with it in another record",
            "monodyn identify other.csv --model . --out other",
        ),
    ]
    return [*steps, *_balanced(fit), *_filmed_again(findings)]


def _refused(findings: Findings) -> list[Step]:
    """Return where to look for what is wrong, and how to go on with another record."""
    filmed, log = findings.filmed, findings.log
    name = "" if log is None else log.inputs.get("model", {}).get("name", "")
    model = _named(name) if name else "MODEL"
    again = f"identify again.csv --model {model}" if filmed is None else f"run again.mp4 --model {model}"
    # a fit with known torques was given what drives it
    driven = [] if findings.fit.torque == "known" else [
        Step("Where a motor drives it, give a log of times and torques with the record",
             f"monodyn {again} --torques torques.csv --out again")
    ]  # fmt: skip
    if filmed is None:
        return [
            Step("Look at the residuals in the plots of this page: where they grow, or repeat, the model "
                 "lacks something, or what was measured is wrong"),
            Step("Measure another record, of a larger motion or with another model, and identify it",
                 f"monodyn {again} --out again"),
            *driven,
        ]  # fmt: skip
    picture = "overlay.mp4" if filmed.sight is None else "diagnosis.png"
    return [
        Step(f"Look at {picture}: the outline has to lie on the mechanism, and on nothing else that moves"),
        Step("Film it again, as docs/filming.md shows it, or give another model, and run it",
             f"monodyn {again} --out again"),
        *driven,
    ]  # fmt: skip


def _named(model: str) -> str:
    """Return how the mechanism of a run is called from its folder, quoted."""
    return shlex.quote(model if is_bundled(model) else str(Path(model).resolve()))


def _balanced(fit: Fit) -> list[Step]:
    """Return how the one hinge of a cart is balanced; nothing of other mechanisms."""
    kinds = [joint.kind for joint in fit.mechanism.joints]
    if sorted(kinds) != ["hinge", "slide"]:
        return []
    slide, hinge = kinds.index("slide"), kinds.index("hinge")
    angle = _upright(fit, slide, hinge)
    if angle is None:
        return []
    motor, pole = (fit.mechanism.joints[dof].name for dof in (slide, hinge))
    # what is rounded to 0 is no -0
    at = f"{round(angle, 4) + 0.0:g}"
    aim = f"--at {shlex.quote(f'{pole}={at}')} --actuated {shlex.quote(motor)}"
    return [
        Step(
            f"Balance it by a motor at {motor} ({pole} is {at} where it stands upright)",
            f"monodyn control . {aim} --out control",
        )
    ]


def _upright(fit: Fit, slide: int, hinge: int) -> float | None:
    """Return where a hinge stands upright and a motor at the slide moves it: the equilibrium half a turn from
    where it hangs [rad]; None without one."""
    tree, joint = fit.mechanism.tree, fit.mechanism.joints[hinge]
    hanging = hanging_at_rest(fit)
    hanging[slide] = 0.0
    near = hanging.copy()
    near[hinge] = np.remainder(hanging[hinge] + 2.0 * np.pi, 2.0 * np.pi) - np.pi
    try:
        q = equilibrium(fit.mechanism, near, [slide])
    except SettingsError:
        # a spring may leave none there
        return None
    low, high = energy(tree, np.array([hanging, q]), np.zeros((2, 2)))
    mass = inertia(tree, q)
    coupled = abs(mass[0, 1]) > COUPLED * np.sqrt(mass[0, 0] * mass[1, 1])
    return float(q[hinge]) if high > low and coupled and joint.lower <= q[hinge] <= joint.upper else None


def _filmed_again(findings: Findings) -> list[Step]:
    """Return what to film next, and the commands that take both records."""
    advised = next_motion(findings.fit)
    if advised is None:
        return []
    if advised.release is None:
        return [Step(advised.said)]
    tables = []
    if findings.filmed is None and findings.log is not None:
        inputs = findings.log.inputs
        # the commands are for another folder than the one in which the tables were named
        tables = [str(Path(inputs[p]["name"]).resolve()) for p in inputs if p.startswith("poses ")]
    clip = None if findings.filmed is None else "again.mp4"
    first, *others = next_commands(".", tables=tables, clip=clip, second="again" if clip else "again.csv")
    return [Step(advised.said, first), *(Step("Then identify it from both", line) for line in others)]
