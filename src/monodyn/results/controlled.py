"""A run folder in, a controller of its mechanism out: gains as JSON, the closed loop as plot and film."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from monodyn.errors import SettingsError
from monodyn.estimation.fit import Fit
from monodyn.mechanism import Mechanism, write_mjcf
from monodyn.results.closed import ClosedLoop, closed_loop
from monodyn.results.export import json_text
from monodyn.results.folder import FolderKind, RunFolder
from monodyn.results.linear import by_joint
from monodyn.results.numbers import shown_in
from monodyn.results.opened import open_run
from monodyn.results.overlay import FITTED, Drawing, write_overlay
from monodyn.results.regulator import RATE, Allowed, Regulator, lqr
from monodyn.results.sight import outlines_of
from monodyn.results.swing import SwingUp, swing_up
from monodyn.types import Camera, Frame, Progress
from monodyn.vision.clip.video import Video

CONTROL = FolderKind("controller", ("control.json", "control.html", "control.mp4", "model.xml"))
WIDTH, HEIGHT = 720, 480
"""Size of the film [px]."""
FILM_RATE = 30.0
"""Frames a second of the film [Hz]."""
PAPER = 220
"""Grey level behind the mechanism."""
FAR_AWAY = 6.0
"""Distance of the camera of the film, in sizes of what it shows."""
MARGIN = 1.15
"""How much larger what it shows is than the motion."""
BALANCING = 10.0
"""How long a balance is simulated, also after a swing [s]."""
PUSHED = 0.2
"""How far the first hinge without a motor is from the equilibrium at the beginning of a balance [rad]."""


@dataclass(frozen=True)
class Aim:
    """What a controller is to do.

    Attributes:
        at: Joint positions of the equilibrium [rad or m], by name; those left out are zero.
        actuated: Joints with a motor.
        swing: True swings it up from where it hangs, or from ``start``.
        start: Joint positions at the beginning [rad or m], by name; those left out are where the equilibrium
            has them. None: hanging for a swing, else 0.2 rad away.
        limit: Largest torque by joint [N m or N], for a swing.
        within: Least and largest position by joint on the way [rad or m], for a swing.
        seconds: How long the swing takes [s]; None tries.
        rate: Measurements, and torques, a second [Hz].
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
    draws: int = 50
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Controlled:
    """A controller and what it does.

    Attributes:
        fit: The identified mechanism.
        regulator: What holds it.
        swing: What swings it up, or None.
        loop: The identified mechanism under it, in MuJoCo.
        folder: Where the files are; None where none were written.
    """

    fit: Fit
    regulator: Regulator
    swing: SwingUp | None
    loop: ClosedLoop
    folder: Path | None = None

    @property
    def ok(self) -> bool:
        """True where the mechanism was balanced, and the fit can be used."""
        return self.fit.ok and self.loop.balanced

    @property
    def notes(self) -> tuple[str, ...]:
        """What one should know about it, in sentences."""
        stability, notes = self.regulator.stability, []
        if not self.fit.ok:
            notes.append(f"The mechanism is not to be relied on: {self.fit.status}")
        if stability.draws:
            notes.append(
                f"The gains hold {stability.stable} of {stability.draws} mechanisms that the data allow; the "
                f"slowest pole of any is at {stability.worst:.3g} 1/s."
            )
        else:
            notes.append("No mechanisms were drawn: the gains were tried on the identified mechanism alone.")
        notes.append(
            f"They hold it with {stability.lightest:.2g} to {stability.heaviest:.2g} times the masses."
        )
        if self.swing is not None:
            notes.append(
                f"The swing takes {self.swing.seconds:.3g} s and reaches the balance with "
                f"{self.swing.reached} of {self.swing.draws} mechanisms that the data allow."
            )
        kept = "stays balanced" if self.loop.balanced else "does not stay balanced"
        notes.append(f"In MuJoCo the identified mechanism {kept}.")
        return (*notes, *self.regulator.linear.notes)

    @property
    def document(self) -> dict[str, Any]:
        """The content of ``control.json``."""
        regulator, linear, loop = self.regulator, self.regulator.linear, self.loop
        names = list(regulator.joints)
        states = [*names, *(f"{name}_vel" for name in names)]
        return {
            "grade": self.fit.grade,
            "notes": list(self.notes),
            "law": "torque = operating torque - gain (state - operating state), held for 1 / rate seconds; "
            "within a swing with the gain, torque and state of each of its rows in their place",
            "states": states,
            "motors": list(regulator.actuated),
            "rate": regulator.rate,
            "operating_point": {
                "position": dict(zip(names, linear.position, strict=True)),
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
        progress: Called with the frames drawn.

    Returns:
        The controller and what it does.
    """
    fit = open_run(run)
    found = control(fit, aim)
    if out is None:
        return found
    folder = RunFolder(
        out, force=force, inputs=[Path(run) / "fit.json", Path(run) / "model.xml"], kind=CONTROL
    )
    folder.write_text("control.json", json_text(found.document))
    folder.write("model.xml", lambda path: write_mjcf(fit.mechanism, path))
    folder.write_text("control.html", _plot(found))
    if film:
        folder.write("control.mp4", lambda path: _film(path, found, progress))
    folder.finish()
    return replace(found, folder=folder.path)


def control(fit: Fit, aim: Aim, allowed: Allowed | None = None) -> Controlled:
    """Design a controller for an identified mechanism, and simulate it in MuJoCo.

    Args:
        fit: The identified mechanism.
        aim: What it is to do.
        allowed: What weighs as much as one another in the cost; None takes the defaults.

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
        fit, aim.at, actuated=aim.actuated, allowed=allowed, rate=aim.rate, draws=aim.draws, seed=aim.seed
    )
    start = None
    if aim.start is not None:
        given = by_joint(fit.mechanism, "start", aim.start)
        named = np.array([name in aim.start for name in regulator.joints])
        start = np.where(named, given, regulator.position)
    if not aim.swing:
        begin = _pushed(fit.mechanism, regulator) if start is None else start
        loop = closed_loop(fit.mechanism, regulator, begin, seconds=BALANCING)
        return Controlled(fit, regulator, None, loop)
    swing = swing_up(
        fit, regulator, start=start, limit=aim.limit, within=aim.within, seconds=aim.seconds, seed=aim.seed
    )
    loop = closed_loop(fit.mechanism, swing, swing.start, seconds=swing.seconds + BALANCING)
    return Controlled(fit, regulator, swing, loop)


def _pushed(mechanism: Mechanism, regulator: Regulator) -> np.ndarray:
    """Return positions away from the equilibrium, (dof,): by 0.2 rad where a motor has to catch a hinge on a
    slide, else by a quarter of that."""
    position = regulator.position.copy()
    hinges = [i for i, joint in enumerate(mechanism.joints) if joint.kind == "hinge"]
    free = [i for i in hinges if regulator.joints[i] not in regulator.actuated] or hinges
    # of several hinges in a row a motor catches less
    alone = len(hinges) == 1
    for i in free[:1]:
        position[i] += PUSHED if alone else PUSHED / 4.0
    return position


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


def _plot(found: Controlled) -> str:
    """Return a page with the positions of the joints and the torques of the motors over time."""
    from plotly.graph_objects import Figure, Scatter
    from plotly.subplots import make_subplots

    joints, loop, swing = found.fit.mechanism.joints, found.loop, found.swing
    actuated = found.regulator.actuated
    rows = len(joints) + len(actuated)
    figure: Figure = make_subplots(rows=rows, cols=1, shared_xaxes=True, vertical_spacing=0.04)
    for dof, joint in enumerate(joints):
        scale, unit = shown_in(joint)
        line = Scatter(
            x=loop.time, y=loop.position[:, dof] * scale, name=joint.name, line={"color": "#1f77b4"}
        )
        figure.add_trace(line, row=dof + 1, col=1)
        if swing is not None:
            plan = {"color": "#7f7f7f", "dash": "dot"}
            way = Scatter(
                x=swing.time, y=swing.states[:, dof] * scale, name=f"{joint.name}, planned", line=plan
            )
            figure.add_trace(way, row=dof + 1, col=1)
        figure.update_yaxes(title_text=f"{joint.name} [{unit}]", row=dof + 1, col=1)
    kinds = {joint.name: "N m" if joint.kind == "hinge" else "N" for joint in joints}
    for motor, name in enumerate(actuated):
        row = len(joints) + motor + 1
        line = Scatter(
            x=loop.time, y=loop.torque[:, motor], name=f"torque, {name}", line={"color": "#c0392b"}
        )
        figure.add_trace(line, row=row, col=1)
        figure.update_yaxes(title_text=f"{name} [{kinds[name]}]", row=row, col=1)
    figure.update_xaxes(title_text="time [s]", row=rows, col=1)
    title = f"{found.fit.mechanism.name} in MuJoCo under its controller"
    figure.update_layout(template="plotly_white", title=title, height=140 + 200 * rows, showlegend=False)
    return figure.to_html(include_plotlyjs=True, full_html=True)


def _film(path: Path, found: Controlled, progress: Progress | None) -> None:
    """Write the motion as a film."""
    loop, mechanism = found.loop, found.fit.mechanism
    every = max(1, round(found.regulator.rate / FILM_RATE))
    time, position = loop.time[::every], loop.position[::every]
    camera = camera_for(mechanism, position)
    paper = np.full((HEIGHT, WIDTH), PAPER, np.uint8)

    def frames(first: int, stop: int) -> Iterator[Frame]:
        for row in range(first, min(stop, len(time))):
            yield Frame(row, float(time[row]), paper, None)

    def drawing(frame: Frame) -> Drawing:
        outlines = outlines_of(mechanism, camera, position[frame.index])
        swinging = found.swing is not None and frame.time < found.swing.seconds
        said = f"{frame.time:.2f} s  {'swing up' if swinging else 'balance'}"
        return Drawing([(polygon, FITTED) for polygon in outlines], said)

    write_overlay(path, Video(path, WIDTH, HEIGHT, time, frames), drawing, progress=progress)


def camera_for(mechanism: Mechanism, position: np.ndarray) -> Camera:
    """Return a camera that sees all of a motion.

    Args:
        mechanism: The mechanism.
        position: Joint positions [rad or m], (frame, dof).
    """
    # a camera far away shows where everything is: from there the real one is placed
    reach = float(np.sum(np.hypot(*mechanism.tree.links[:, :2].T)) + np.abs(mechanism.shapes.points).max())
    slides = [i for i, joint in enumerate(mechanism.joints) if joint.kind == "slide"]
    reach += float(np.abs(position[:, slides]).sum(axis=1).max(initial=0.0))
    far = Camera(WIDTH, HEIGHT, focal=1e3, depth=1e3 * reach)
    corners = np.vstack(
        [
            polygon
            for q in position[:: max(1, len(position) // 100)]
            for polygon in outlines_of(mechanism, far, q)
        ]
    )
    metre = far.focal / far.depth
    low, high = corners.min(axis=0), corners.max(axis=0)
    middle = (0.5 * (low + high) - [(WIDTH - 1) / 2.0, (HEIGHT - 1) / 2.0]) / metre
    size = MARGIN * float(np.max((high - low) / [WIDTH, HEIGHT])) * HEIGHT / metre
    return Camera(
        WIDTH, HEIGHT, focal=FAR_AWAY * HEIGHT, x=float(middle[0]), y=float(-middle[1]), depth=FAR_AWAY * size
    )
