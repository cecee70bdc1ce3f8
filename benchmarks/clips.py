"""Make clips with known truth: a mechanism, a camera, colours and a wall in, a video and its motion out.

MuJoCo simulates the mechanism (RK4, small steps), ``paint`` draws it, H.264 encodes it. Next to the clip lie
the model that a user would give, with every size deliberately wrong, and the truth. Everything follows from
the case: the same case gives the same clip.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from spec import Case, Drawer, Part, mjcf

VERSION = 4
"""To be raised with each change of the drawing: clips of another version are not used again."""
SUBFRAMES = 8
"""Simulated states a frame, between which motion blur interpolates."""
EXPOSURES = 25
"""Pictures that a blurred frame averages."""
STEP = 2.5e-4
"""Longest step of the simulation [s]."""


@dataclass(frozen=True, eq=False)
class Clip:
    """A clip with its truth.

    Attributes:
        case: What it shows.
        video: The clip.
        model: The mechanism file of a user: right topology, wrong sizes.
        truth: The mechanism file with the true sizes.
        time: Time stamps [s], (frame,).
        position: True joint positions [rad or m], (frame, dof).
    """

    case: Case
    video: Path
    model: Path
    truth: Path
    time: np.ndarray
    position: np.ndarray


def cached(case: Case, folder: Path | None = None) -> Clip:
    """Return the clip of a case, made on first use.

    Args:
        case: What to show.
        folder: Where clips are kept; None is a folder of the system's temporary files.
    """
    # only what differs from the defaults: a new field with a default does not make the clips anew
    told = {f.name: getattr(case, f.name) for f in fields(case) if getattr(case, f.name) != f.default}
    mark = hashlib.sha256(f"{VERSION} {told}".encode()).hexdigest()[:12]
    home = (folder or Path(tempfile.gettempdir()) / "monodyn-clips") / f"{case.name}-{mark}"
    paths = home / "clip.mp4", home / "model.xml", home / "truth.xml"
    # written last: without it the folder is one that was interrupted
    if not (home / "motion.npz").exists():
        home.mkdir(parents=True, exist_ok=True)
        paths[1].write_text(mjcf(tuple(wrong(part) for part in case.parts)))
        paths[2].write_text(mjcf(case.parts))
        states = simulate(case)
        write_video(case, states, paths[0])
        position = states[:, 0]
        np.savez(home / "motion.npz", time=np.arange(len(position)) / case.rate, position=position)
    with np.load(home / "motion.npz") as motion:
        return Clip(case, *paths, motion["time"], motion["position"])


LINK = Part(
    length=0.1, width=0.02, thickness=0.005, layer=0.006, tail=0.01, tip=0.01, ball=0.02, damping=1e-3
)
"""What a user writes for every link."""
CART = replace(LINK, length=0.08, width=0.05, thickness=0.02, mass=0.2, damping=0.01)
"""What a user writes for a cart."""


def wrong(part: Part) -> Part:
    """Return a part with the sizes that a user would guess: the same for every link.

    Args:
        part: With its true sizes; what it does not have (an overhang, a ball, a mass of its own) stays away.
    """
    guess = CART if part.kind == "slide" else LINK
    return replace(
        part,
        length=guess.length,
        width=guess.width,
        thickness=guess.thickness,
        layer=guess.layer * float(np.sign(part.layer)),
        tail=guess.tail * (part.tail > 0),
        tip=guess.tip * (part.tip > 0),
        ball=guess.ball * (part.ball > 0),
        mass=guess.mass * (part.mass > 0) if part.kind == "slide" else part.mass,
        damping=guess.damping,
    )


def simulate(case: Case) -> np.ndarray:
    """Return joint positions [rad or m] from every frame's time on, (frame, subframe, dof).

    Args:
        case: Mechanism and start.
    """
    import mujoco

    model = mujoco.MjModel.from_xml_string(mjcf(case.parts))
    # a whole number of steps between the states, so that frames fall on their exact times
    steps = int(np.ceil(1.0 / (case.rate * SUBFRAMES * STEP)))
    model.opt.timestep = 1.0 / (case.rate * SUBFRAMES * steps)
    data = mujoco.MjData(model)
    data.qpos[:] = case.start
    data.qvel[:] = case.rates or np.zeros(model.nv)
    frames = round(case.rate * case.seconds)
    states = np.empty((frames * SUBFRAMES, model.nq))
    for i in range(len(states)):
        states[i] = data.qpos
        mujoco.mj_step(model, data, steps)
    return states.reshape(frames, SUBFRAMES, model.nq)


def exposures(case: Case, states: np.ndarray) -> Iterator[np.ndarray]:
    """Yield for each frame the joint positions that its exposure averages, (exposure, dof).

    Args:
        case: With its shutter.
        states: From ``simulate``, (frame, subframe, dof); the exposure is centred on the frame's time.
    """
    flat = states.reshape(-1, states.shape[-1])
    within = np.linspace(-0.5, 0.5, EXPOSURES if case.shutter else 1) * case.shutter * SUBFRAMES
    for i in range(len(states)):
        place = np.clip(i * SUBFRAMES + within, 0, len(flat) - 1)
        before = np.minimum(place.astype(int), len(flat) - 2)
        share = (place - before)[:, None]
        yield (1.0 - share) * flat[before] + share * flat[before + 1]


def write_video(case: Case, states: np.ndarray, path: Path) -> None:
    """Draw and encode a clip.

    Args:
        case: What it shows.
        states: From ``simulate``, (frame, subframe, dof).
        path: The file.
    """
    import av

    painter = _drawer(case)
    with av.open(str(path), "w") as container:
        options = {"preset": "medium", "crf": str(case.crf), "threads": "1"}
        stream = container.add_stream("libx264", rate=case.rate, options=options)
        stream.width, stream.height = case.size
        stream.pix_fmt = "yuv420p"
        for positions in exposures(case, states):
            picture = painter.picture(positions)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())


def _drawer(case: Case) -> Drawer:
    """Return what draws a case."""
    if case.engine == "mujoco":
        from glpaint import GlPainter

        return GlPainter(case)
    from paint import Painter

    return Painter(case)
