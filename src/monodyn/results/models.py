"""``model.xml`` and ``model.urdf``: the identified mechanism, with what a simulator needs to know beside it.

That is where the motion began, the camera that saw it, and in comments how far its numbers can be relied on.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from monodyn.estimation.masses import given_scale
from monodyn.estimation.wording import listed
from monodyn.results.findings import openness
from monodyn.results.folder import DRAWN, RunFolder

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

    from monodyn.estimation.fit import Fit
    from monodyn.mechanism.mjcf import Eye, Keyframe
    from monodyn.results.closed import ClosedLoop
    from monodyn.results.filmed import Filmed
    from monodyn.results.findings import Findings

OPEN = {
    "factor": "Known up to that factor",
    "combined": "Known in combinations with one another alone, which fit.json has",
    "open": "Not determined by the motion",
}
"""What is said of parameters, by what is left open of them."""
OF_THE_FILE = "the mechanism file states densities"
"""How exactly masses are known where the picture shows their volumes, and the user gave nothing."""


def write_models(folder: RunFolder, findings: Findings) -> None:
    """Write the identified mechanism as ``model.xml`` and ``model.urdf``.

    Args:
        folder: Where to.
        findings: The fit, and the camera where a clip was filmed.
    """
    from monodyn.mechanism import write_mjcf, write_urdf

    fit, filmed = findings.fit, findings.filmed
    known, camera = what_is_known(fit), None if filmed is None else eye_of(filmed)
    keys, said = keyframes(fit), [*known, *_how_to_start(fit)]
    if filmed is not None and filmed.camera_path is not None:
        said.append("The camera moved: it stands in its mean place here, and camera.csv has its way.")
    folder.write(
        "model.xml",
        lambda path: write_mjcf(fit.mechanism, path, keyframes=keys, camera=camera, remarks=said),
    )
    folder.write("model.urdf", lambda path: write_urdf(fit.mechanism, path, remarks=known))
    for name, one in zip(DRAWN, findings.ensemble, strict=False):
        remarks = [f"One of {len(findings.ensemble)} models that the data allow.", *known]
        folder.write(name, lambda path, m=one, r=remarks: write_mjcf(m, path, keyframes=keys, remarks=r))


def write_controlled(
    folder: RunFolder, fit: Fit, actuated: Sequence[str], loop: ClosedLoop, held: np.ndarray
) -> None:
    """Write the identified mechanism as the ``model.xml`` of a controller, with its motors.

    Args:
        folder: Where to.
        fit: The fit.
        actuated: Joints with a motor.
        loop: Its motion under the controller, the first state of which is a keyframe.
        held: The equilibrium, which is another [rad or m], (dof,).
    """
    from monodyn.mechanism import write_mjcf
    from monodyn.mechanism.mjcf import Keyframe, motor_at

    keys = [
        Keyframe("start", 0.0, loop.position[0], loop.velocity[0]),
        Keyframe("equilibrium", 0.0, held, 0.0 * held),
    ]
    said = [
        *what_is_known(fit),
        "Keyframe start is where the closed loop of control.json begins, equilibrium where it is to stay. "
        f"Controls of {listed([motor_at(name) for name in actuated])} are the torques of its law.",
    ]
    folder.write(
        "model.xml",
        lambda path: write_mjcf(fit.mechanism, path, keyframes=keys, motors=actuated, remarks=said),
    )


def keyframes(fit: Fit) -> list[Keyframe]:
    """Return the state at the first fitted frame of each record; ``start``, or ``start0``, ``start1``, ...

    Args:
        fit: The fit.
    """
    from monodyn.mechanism.mjcf import Keyframe

    several, stretch = len(fit.starts) > 1, fit.mechanism.values["time_scale"]
    return [
        Keyframe(f"start{k}" if several else "start", start.time * stretch, start.position, start.velocity)
        for k, start in enumerate(fit.starts)
    ]


def eye_of(filmed: Filmed) -> Eye:
    """Return the identified camera in the frame of the mechanism.

    Args:
        filmed: Clip and camera.
    """
    import numpy as np

    from monodyn.mechanism.mjcf import Eye
    from monodyn.vision.drawing.camera import rotation

    camera = filmed.camera
    right, down, _ = rotation(camera)
    place = np.array([camera.x, camera.y, camera.depth])
    return Eye("clip", place, right, -down, camera.focal, (camera.width, camera.height))


def what_is_known(fit: Fit) -> list[str]:
    """Return sentences on how far the numbers of the identified mechanism can be relied on.

    Args:
        fit: The fit.
    """
    mechanism = fit.mechanism
    said = [f"{fit.grade.capitalize()}: {fit.status}", _mass_scale_said(fit)]
    gravity = mechanism.parameter("gravity")
    if not gravity.free and gravity.value > 0.0:
        said.append(f"Lengths rest on gravity, which was taken as {gravity.value:g} m/s^2.")
    kinds = {p.name: p.kind for p in mechanism.parameters}
    ways = {name: how for name, how in openness(fit).items() if kinds[name] != "torque"}
    for how, words in OPEN.items():
        rows = [name for name, way in ways.items() if way == how]
        if rows:
            said.append(f"{words}: {', '.join(rows)}.")
    return said


def _mass_scale_said(fit: Fit) -> str:
    """Return a sentence on what determines masses themselves."""
    absolute = "masses, inertias, frictions, springs and torques"
    scale, given = fit.mass_scale, given_scale(fit.mechanism)
    if scale == "torques":
        return f"Known torques determine {absolute}: they are in SI units."
    were = f"{listed(given)} {'was' if len(given) == 1 else 'were'} given" if given else OF_THE_FILE
    if scale == "given":
        return f"{absolute.capitalize()} are in SI units, as exactly as {were}."
    makes = "A known torque or one measured mass makes them absolute."
    if given:
        # beside bodies that may weigh anything
        makes = f"A known torque makes them absolute; that {were} does not."
    return (
        f"Only ratios show: {absolute} are known up to one common factor, that of the file that the run "
        f"began with. {makes}"
    )


def _how_to_start(fit: Fit) -> list[str]:
    """Return sentences on the clock of a simulation, and on torques that are in another file."""
    if not fit.starts:
        return []
    said = [
        "Keyframes are the states at the first fitted frame of each record, their time that of the tables: "
        "mujoco.mj_resetDataKeyframe(model, data, 0) begins there."
    ]
    stretch = fit.mechanism.values["time_scale"]
    if stretch != 1.0:
        said.append(f"data.time is the time of the tables times {stretch!r}, the time scale.")
    if fit.torque == "known":
        said.append("torques.csv has the known torques: data.ctrl by joint, linear between the rows.")
    return said
