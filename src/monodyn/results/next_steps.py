"""What was found in, what to do with it out: commands to copy, each with a word on what it is for."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import NamedTuple

from monodyn.results.experiment import next_commands, next_motion
from monodyn.results.findings import Findings


class Step(NamedTuple):
    """One thing to do.

    Attributes:
        what: What it is for.
        command: The command, for the folder of the run; empty where there is none.
    """

    what: str
    command: str = ""


def next_steps(findings: Findings) -> list[Step]:
    """Return what one can do with an identified mechanism.

    Args:
        findings: The fit and its records.

    Returns:
        The steps; none where there is nothing to rely on.
    """
    fit = findings.fit
    if not (fit.ok and fit.starts):
        return []
    joints = [joint.name for joint in fit.mechanism.joints]
    begin = ",".join(f"{name}={0.5 if k == 0 else 0:g}" for k, name in enumerate(joints))
    film = "" if findings.filmed is None else " --film"
    steps = [
        Step("Look at it in MuJoCo", "python -m mujoco.viewer --mjcf=model.xml"),
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
    slides = [joint.name for joint in fit.mechanism.joints if joint.kind == "slide"]
    if slides and len(joints) == 2:
        (motor,), (pole,) = slides[:1], [name for name in joints if name not in slides] or [""]
        hold = f"{pole}=1.5708"
        steps.append(
            Step(
                f"Balance it by a motor at {motor} ({pole} is 1.5708 where it stands upright)",
                f"monodyn control . --at {shlex.quote(hold)} --actuated {shlex.quote(motor)} --out control",
            )
        )
    return [*steps, *_filmed_again(findings)]


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
