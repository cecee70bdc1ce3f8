"""A run folder in, a controller of its mechanism out: gains as JSON, the closed loop as plot and film."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from monodyn.errors import SettingsError
from monodyn.estimation.fit import Fit
from monodyn.mechanism import Mechanism
from monodyn.numbers import shown_in
from monodyn.results.caveats import draws_said, seldom, turned, undrawn
from monodyn.results.closed import ClosedLoop, closed_loop
from monodyn.results.curves import loop_curves
from monodyn.results.export import json_text
from monodyn.results.folder import FolderKind, RunFolder
from monodyn.results.linear import by_joint
from monodyn.results.loop_film import write_loop
from monodyn.results.models import write_controlled
from monodyn.results.opened import open_run
from monodyn.results.push import Push, let_go
from monodyn.results.regulator import RATE, Allowed, Regulator, lqr
from monodyn.results.run_toml import RUN_TOML, command_toml
from monodyn.results.sequel import Sequel, Table, notes_of, sequel_text
from monodyn.results.swing import SwingUp, swing_up
from monodyn.types import Progress

CONTROL = FolderKind(
    "controller", ("control.json", "control.html", "control.mp4", "model.xml", RUN_TOML), whole=True
)
BALANCING = 10.0
"""How long a balance is simulated, also after a swing [s]."""
LAW = (
    "torque = operating torque - gain (state - operating state), held for 1 / rate seconds; of each joint in "
    "turning the position's difference is taken less the whole turns in it, so that it is at most half a turn"
)
"""How torques follow from what ``control.json`` has."""
LAW_OF_A_SWING = (
    "; from k / rate seconds on, gain, torque and state of row k of the swing stand in their place, after "
    "its last torque the operating ones; each torque is clipped to plus or minus its limit of the swing, "
    "then, too"
)
APPLIED = (
    "In N m and N, by rad, m, rad/s and m/s. The law is in control.json; in model.xml each of these joints "
    "has a motor, whose control is the torque."
)


@dataclass(frozen=True)
class Aim:
    """What a controller is to do.

    Attributes:
        at: Joint positions of the equilibrium [rad or m], by name; those left out are zero.
        actuated: Joints with a motor.
        swing: True swings it up from where it hangs, or from ``start``.
        start: Joint positions at the beginning [rad or m], by name; those left out are where the equilibrium
            has them. None: hanging for a swing, else one joint is a little away, as `Push` says.
        limit: Largest torque by joint [N m or N], for a swing.
        within: Least and largest position by joint on the way [rad or m], for a swing.
        seconds: How long the swing takes [s]; None tries.
        rate: Measurements, and torques, a second [Hz].
        allowed: What weighs as much as one another in the cost.
        draws: Mechanisms drawn from the covariance of the parameters.
        seed: Of the draws.
    """

    at: Mapping[str, float]
    actuated: Sequence[str]
    swing: bool = False
    start: Mapping[str, float] | None = None
    limit: Mapping[str, float] = field(default_factory=dict)
    within: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    seconds: float | None = None
    rate: float = RATE
    allowed: Allowed = field(default_factory=Allowed)
    draws: int = 50
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Controlled:
    """A controller and what it does.

    Attributes:
        aim: What it is to do.
        fit: The identified mechanism.
        regulator: What holds it.
        swing: What swings it up, or None.
        loop: The identified mechanism under it, in MuJoCo.
        folder: Where the files are; None where none were written.
        push: Where the balance begins; None for a swing, and where the start was given.
        remains: What one should know about the folder, in sentences.
    """

    aim: Aim
    fit: Fit
    regulator: Regulator
    swing: SwingUp | None
    loop: ClosedLoop
    folder: Path | None = None
    push: Push | None = None
    remains: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """True where the mechanism was balanced, and the fit can be used."""
        return self.fit.ok and self.loop.balanced

    @property
    def status(self) -> str:
        """What came of it, a sentence."""
        return self.kept if self.fit.ok else self.fit.status

    @property
    def kept(self) -> str:
        """Whether the identified mechanism was balanced, a sentence."""
        said, push = "In MuJoCo the identified mechanism", self.push
        if self.loop.balanced:
            return f"{said} stays balanced."
        if push is None:
            return f"{said} does not stay balanced."
        return f"{said} does not stay balanced {push.fallen}."

    @property
    def doubt(self) -> str:
        """Why the mechanism is not to be relied on, a sentence; empty where it is."""
        return "" if self.fit.ok else f"The mechanism is not to be relied on: {self.fit.status}"

    @property
    def held(self) -> np.ndarray:
        """The equilibrium, after a swing on the turn on which that ends [rad or m], (dof,)."""
        return (self.swing or self.regulator).position

    @property
    def notes(self) -> tuple[str, ...]:
        """What one should know about it, in sentences."""
        stability, notes = self.regulator.stability, [self.doubt] if self.doubt else []
        if stability.draws:
            notes.append(
                f"The gains hold {stability.stable} of {stability.draws} mechanisms that the data allow; the "
                f"slowest pole of any is at {stability.worst:.3g} 1/s."
            )
            if stability.draws < self.aim.draws:
                missing = self.aim.draws - stability.draws
                notes.append(
                    f"Of {self.aim.draws} mechanisms {missing} were not found: what the data allow reaches "
                    "beyond the bounds of the parameters."
                )
            # what falls between two measurements says nothing of the data
            notes += seldom(self.regulator) or draws_said(stability.stable, stability.draws)
        else:
            why = undrawn(self.fit, self.aim.draws)
            notes.append(f"{why}: the gains were tried on the identified mechanism alone.")
        if stability.lightest < stability.heaviest:
            held = f"{stability.lightest:.2g} to {stability.heaviest:.2g}"
            notes.append(f"The linear system stays balanced with {held} times the masses.")
        if self.swing is not None:
            notes.append(
                f"The swing takes {self.swing.seconds:.3g} s and reaches the balance with "
                f"{self.swing.reached} of {self.swing.draws} mechanisms that the data allow."
            )
            # each of these takes long, and so there are few
            if self.swing.reached < self.swing.draws:
                notes += draws_said(self.swing.reached, self.swing.draws)
            if self.fit.mass_scale is None:
                notes.append(
                    "A swing depends on the scale of the masses, which the record leaves open: where the "
                    "mechanism has k times those of model.xml, all its torques have to be k times as large "
                    "(closed_loop has factor= for it)."
                )
            notes += turned(self.regulator.joints, self.regulator.position, self.held)
        begun = [self.push.begun] if self.push is not None and self.loop.balanced else []
        # of both, gains and swing, it may be the same
        return (*dict.fromkeys(notes), self.kept, *begun, *self.regulator.linear.notes, *self.remains)

    @property
    def document(self) -> dict[str, Any]:
        """The content of ``control.json``."""
        regulator, linear, loop = self.regulator, self.regulator.linear, self.loop
        names = list(regulator.joints)
        states = [*names, *(f"{name}_vel" for name in names)]
        return {
            "grade": self.fit.grade,
            "notes": list(self.notes),
            "law": LAW if self.swing is None else LAW + LAW_OF_A_SWING,
            "states": states,
            "turning": [name for name, turns in zip(names, regulator.turns, strict=True) if turns],
            "motors": list(regulator.actuated),
            "rate": regulator.rate,
            "operating_point": {
                "position": dict(zip(names, self.held, strict=True)),
                "torque": dict(zip(regulator.actuated, linear.torque, strict=True)),
            },
            "gain": regulator.gain,
            "weights": {"states": regulator.state_weight, "torques": regulator.torque_weight},
            "linear": {"A": linear.system.A, "B": linear.system.B, "std": linear.std},
            "poles": [[pole.real, pole.imag] for pole in regulator.poles],
            "stability": regulator.stability._asdict(),
            "swing": None if self.swing is None else _way(self.swing, states),
            "closed_loop": {
                "balanced": loop.balanced,
                "off": dict(zip(names, loop.off, strict=True)),
                "time": loop.time,
                "position": dict(zip(names, loop.position.T, strict=True)),
                "torque": dict(zip(regulator.actuated, loop.torque.T, strict=True)),
            },
        }


def control_run(
    run: str | Path,
    out: str | Path | None,
    aim: Aim,
    *,
    film: bool = True,
    force: bool = False,
    progress: Progress | None = None,
) -> Controlled:
    """Design a controller for the mechanism of a run, and simulate it in MuJoCo.

    Args:
        run: The run folder.
        out: Folder for the files; None writes nothing.
        aim: What it is to do.
        film: Write the film, too.
        force: Replace a controller that is already in ``out``.
        progress: Called with the ways up that are looked for, and the frames drawn.

    Returns:
        The controller and what it does.
    """
    fit = open_run(run)
    if out is None:
        return control(fit, aim, progress=progress)
    folder = RunFolder(
        out, force=force, inputs=[Path(run) / "fit.json", Path(run) / "model.xml"], kind=CONTROL
    )
    with folder.filling():
        found = replace(control(fit, aim, progress=progress), remains=tuple(folder.notes))
        folder.write_text("control.json", json_text(found.document))
        write_controlled(folder, fit, found.regulator.actuated, found.loop, found.held)
        folder.write_text(RUN_TOML, command_toml("control", {"run": run, "film": film}, aim))
        files = [*folder.written, *(["control.mp4"] if film else [])]
        folder.write_text("control.html", sequel_text(_page(found, Path(run)), files, Path(run), folder.path))
        if film:
            loop, swinging = found.loop, 0.0 if found.swing is None else found.swing.seconds
            folder.write(
                "control.mp4",
                lambda path: write_loop(path, fit.mechanism, loop, swinging=swinging, progress=progress),
            )
    return replace(found, folder=folder.path)


def control(fit: Fit, aim: Aim, *, progress: Progress | None = None) -> Controlled:
    """Design a controller for an identified mechanism, and simulate it in MuJoCo.

    Args:
        fit: The identified mechanism.
        aim: What it is to do.
        progress: Called with the ways up that are looked for.

    Returns:
        The controller and what it does.

    Raises:
        SettingsError: A swing is described that is not asked for; from deeper down: there is no equilibrium
            there, no way up was found, a joint is not there, or the package ``control`` is missing.
    """
    if not aim.swing and (aim.limit or aim.within or aim.seconds is not None):
        raise SettingsError(
            "control: expected limit, within and seconds together with swing, got them without; add --swing."
        )
    regulator = lqr(
        fit, aim.at, actuated=aim.actuated, allowed=aim.allowed, rate=aim.rate, draws=aim.draws, seed=aim.seed
    )
    start = None
    if aim.start is not None:
        given = by_joint(fit.mechanism, "start", aim.start)
        named = np.array([name in aim.start for name in regulator.joints])
        start = np.where(named, given, regulator.position)
    if not aim.swing:
        if start is None:
            push, loop = let_go(fit.mechanism, regulator, BALANCING)
            return Controlled(aim, fit, regulator, None, loop, push=push)
        loop = closed_loop(fit.mechanism, regulator, start, seconds=BALANCING)
        return Controlled(aim, fit, regulator, None, loop)
    swing = swing_up(
        fit, regulator, start=start, limit=aim.limit, within=aim.within, seconds=aim.seconds, seed=aim.seed,
        progress=progress,
    )  # fmt: skip
    loop = closed_loop(fit.mechanism, swing, swing.start, seconds=swing.seconds + BALANCING)
    return Controlled(aim, fit, regulator, swing, loop)


def _way(swing: SwingUp, states: Sequence[str]) -> dict[str, Any]:
    """Return a swing as JSON has it."""
    return {
        "seconds": swing.seconds,
        "draws": swing.draws,
        "reached": swing.reached,
        "limit": dict(zip(swing.actuated, swing.limit, strict=True)),
        "time": swing.time,
        "state": dict(zip(states, swing.states.T, strict=True)),
        "torque": dict(zip(swing.actuated, swing.torque.T, strict=True)),
        "gain": swing.gain,
    }


def _page(found: Controlled, run: Path) -> Sequel:
    """Return what the page of a controller says."""
    fit, regulator, loop, swing, aim = found.fit, found.regulator, found.loop, found.swing, found.aim
    mechanism, stability, status = fit.mechanism, regulator.stability, found.doubt or found.kept
    states = [*regulator.joints, *(f"{name} rate" for name in regulator.joints)]
    asked = [
        ("equilibrium", _positions(mechanism, regulator.position)),
        ("motors", ", ".join(regulator.actuated)),
        ("from", _positions(mechanism, loop.position[0]) + (", swung up" if swing is not None else "")),
        ("measurements", f"{regulator.rate:g} a second, torques held in between"),
        ("weigh as much as one another", ", ".join(f"{n} {x:g}" for n, x in aim.allowed._asdict().items())),
        ("draws", f"{aim.draws}, seed {aim.seed}"),
    ]
    if swing is not None:
        kinds = {joint.name: "N m" if joint.kind == "hinge" else "N" for joint in mechanism.joints}
        limits = zip(swing.actuated, swing.limit, strict=True)
        asked.append(("torques up to", ", ".join(f"{name} {x:.4g} {kinds[name]}" for name, x in limits)))
        ways = [f"{name} {low:g} to {high:g}".replace("-", "−") for name, (low, high) in aim.within.items()]
        asked += [("on the way [rad, m]", ", ".join(ways))] if ways else []
    facts = [
        (f"{loop.time[-1]:.3g} s", "simulated in MuJoCo"),
        (f"{stability.stable} of {stability.draws}", "draws of what the data allow held")
        if stability.draws
        else (f"0 of {aim.draws}", "mechanisms that the data allow drawn"),
    ]
    if stability.lightest < stability.heaviest:
        facts.append(
            (
                f"{stability.lightest:.2g} to {stability.heaviest:.2g}",
                "times the masses balanced, of the linear system",
            )
        )
    if swing is not None:
        facts.append((f"{swing.reached} of {swing.draws}", "draws swung up and balanced"))
    plan = None if swing is None else (swing.time, swing.states)
    gains = [[name, *(f"{x:.5g}".replace("-", "−") for x in row)]
             for name, row in zip(regulator.actuated, regulator.gain, strict=True)]  # fmt: skip
    return Sequel(
        title=f"{mechanism.name} {'swung up and ' if swing is not None else ''}balanced by "
        f"{', '.join(regulator.actuated)}",
        subtitle=f"Controller of the mechanism that was identified in '{run.resolve().name}'.",
        grade=fit.grade if loop.balanced else "refused",
        status=status,
        notes=notes_of(fit, [note for note in found.notes if note != status]),
        facts=facts,
        asked=asked,
        plots=loop_curves(mechanism, loop, regulator.actuated, plan),
        legend=[("fitted", "in MuJoCo"), *([("observed", "planned")] if swing is not None else [])],
        tables=[Table("Gains", ["torque at", *states], gains, APPLIED)],
    )


def _positions(mechanism: Mechanism, position: np.ndarray) -> str:
    """Write joint positions."""
    found = []
    for joint, x in zip(mechanism.joints, position, strict=True):
        scale, unit = shown_in(joint)
        found.append(f"{joint.name} {round(x * scale, 3):z.4g} {unit}".replace("-", "−"))
    return ", ".join(found)
