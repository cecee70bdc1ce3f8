"""Make the demo clip: a double pendulum simulated with MuJoCo, drawn in perspective, encoded as H.264.

    python examples/make_demo_clip.py [FOLDER]

writes ``double.mp4`` and ``double.json`` (the truth: sizes, damping, camera, motion) into FOLDER, by default
where the program has it. The drawing is simple: each link is a box, lit by one lamp. Its visible faces are
filled on eight times finer pixels before a textured wall, the picture is reduced, and pixel noise is added.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import av
import cv2
import mujoco
import numpy as np

import monodyn

WIDTH, HEIGHT = 720, 480
"""Size of the picture [px]."""
RATE, SECONDS = 30, 7
"""Frames a second [Hz] and length of the clip [s]."""
SUBSTEPS = 100
"""Steps of the simulation from frame to frame."""
SEED = 7
"""Of the wall and of the noise."""
FINE = 8
"""Fine pixels along the side of a pixel."""
SUBPIXEL_BITS = 4
"""Fractional bits of the corners that OpenCV fills: sixteenths of a fine pixel."""
LENGTH, BREADTH, THICKNESS = (0.24, 0.19), (0.034, 0.028), (0.006, 0.006)
"""Sizes of the links [m]: from hinge to hinge, across in the picture, along the line of sight."""
OVERHANG = (0.017, 0.014)
"""How far each link reaches beyond its hinges, at both ends [m]."""
LAYER = 0.009
"""How far the second link stands before the first [m]."""
DAMPING, DENSITY = (1.2e-3, 6e-4), 2700.0
"""Of the joints [N m s/rad] and of the links [kg/m^3]."""
START = (-0.35, -0.9)
"""Joint positions at rest, before the links are let go [rad]."""
CAMERA = {"position": [0.03, -1.1, -0.15], "fovy_deg": 38.0}
"""Place of the camera [m], x right, y away from it, z up, and its vertical angle of view [deg]."""
COLOURS = np.array([[0.82, 0.30, 0.14], [0.16, 0.42, 0.78]])
"""Red, green and blue of the links, 0 to 1."""
LAMP = np.array([-0.35, -0.75, 0.56])
"""Direction toward the lamp: left, toward the camera, up."""
AMBIENT = 0.35
"""Light on a face that is turned away from the lamp; the lamp adds the rest of 1 on one that faces it."""
WALL, WALL_TINT = 176.0, (1.0, 0.985, 0.95)
"""Grey level of the wall, and its red, green and blue over that."""
MOTTLES = ((6, 9.0), (40, 5.0), (160, 3.0))
"""Spots across the wall and their strength [grey levels], coarse to fine."""
STAND, STAND_WIDTH = (96, 98, 102), 16
"""Colour of the post behind the first hinge and its width [px]."""
NOISE = 2.0
"""Standard deviation of the pixel noise [grey levels]."""

MODEL = """
<mujoco>
  <option gravity="0 0 -9.81" integrator="RK4" timestep="{step}"/>
  <worldbody>
    <body name="link1">
      <joint name="joint1" type="hinge" axis="0 -1 0" damping="{damping[0]}"/>
      <geom type="box" size="{half[0]} {thick[0]} {wide[0]}" pos="{middle[0]} 0 0" density="{density}"
       contype="0" conaffinity="0"/>
      <body name="link2" pos="{length[0]} -{layer} 0">
        <joint name="joint2" type="hinge" axis="0 -1 0" damping="{damping[1]}"/>
        <geom type="box" size="{half[1]} {thick[1]} {wide[1]}" pos="{middle[1]} 0 0" density="{density}"
         contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def simulate() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times [s], (frame,), joint positions [rad] and rates [rad/s], (frame, dof)."""
    text = MODEL.format(
        step=1.0 / (RATE * SUBSTEPS),
        damping=DAMPING,
        density=DENSITY,
        layer=LAYER,
        length=LENGTH,
        half=[length / 2 + over for length, over in zip(LENGTH, OVERHANG, strict=True)],
        middle=[length / 2 for length in LENGTH],
        thick=[t / 2 for t in THICKNESS],
        wide=[b / 2 for b in BREADTH],
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = START
    q, v = [], []
    for _ in range(RATE * SECONDS):
        q.append(data.qpos.copy())
        v.append(data.qvel.copy())
        mujoco.mj_step(model, data, SUBSTEPS)
    return np.arange(RATE * SECONDS) / RATE, np.array(q), np.array(v)


def project(points: np.ndarray) -> np.ndarray:
    """Return where the camera sees points.

    Args:
        points: x right, y away from the camera, z up [m], (point, 3).

    Returns:
        Column and row on fine pixels, (point, 2).
    """
    focal = HEIGHT / 2 / np.tan(np.radians(CAMERA["fovy_deg"]) / 2)
    x, depth, up = (points - CAMERA["position"]).T
    column = (WIDTH - 1) / 2 + focal * x / depth
    row = (HEIGHT - 1) / 2 - focal * up / depth
    # pixel centres are whole numbers: pixel 0 spans the fine pixels 0 to FINE - 1
    return np.column_stack([column, row]) * FINE + (FINE - 1) / 2


def links(q: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return for each link its rotation, (3, 3), and the place of its hinge [m], (3,).

    Args:
        q: Joint positions [rad], (dof,).
    """
    placed, hinge, angle = [], np.zeros(3), 0.0
    for i, turn in enumerate(q):
        angle += turn
        along = np.array([np.cos(angle), 0.0, np.sin(angle)])
        across = np.array([-np.sin(angle), 0.0, np.cos(angle)])
        placed.append((np.column_stack([along, [0.0, -1.0, 0.0], across]), hinge))
        hinge = hinge + LENGTH[i] * along + np.array([0.0, -LAYER, 0.0])
    return placed


def draw_box(canvas: np.ndarray, turn: np.ndarray, hinge: np.ndarray, i: int) -> None:
    """Fill the faces of a link that look at the camera.

    Args:
        canvas: The picture on fine pixels, changed in place, (height, width, 3).
        turn: Rotation of the link, (3, 3).
        hinge: Place of its hinge [m], (3,).
        i: Number of the link.
    """
    low = np.array([-OVERHANG[i], -THICKNESS[i] / 2, -BREADTH[i] / 2])
    high = np.array([LENGTH[i] + OVERHANG[i], THICKNESS[i] / 2, BREADTH[i] / 2])
    lamp = LAMP / np.linalg.norm(LAMP)
    for axis in range(3):
        u, w = [a for a in range(3) if a != axis]
        for side, level in ((-1.0, low[axis]), (1.0, high[axis])):
            corners = np.zeros((4, 3))
            corners[:, axis] = level
            corners[:, u] = [low[u], high[u], high[u], low[u]]
            corners[:, w] = [low[w], low[w], high[w], high[w]]
            world = corners @ turn.T + hinge
            normal = side * turn[:, axis]
            # a box is convex: what looks away from the camera is hidden, and nothing else of it is
            if normal @ (np.array(CAMERA["position"]) - world[0]) <= 0:
                continue
            shade = AMBIENT + (1.0 - AMBIENT) * max(0.0, float(normal @ lamp))
            colour = (255.0 * COLOURS[i] * shade).tolist()
            polygon = np.round(project(world) * 2**SUBPIXEL_BITS).astype(np.int32)
            cv2.fillConvexPoly(canvas, polygon, colour, cv2.LINE_8, SUBPIXEL_BITS)


def wall(rng: np.random.Generator) -> np.ndarray:
    """Return the background on fine pixels, uint8 RGB (height, width, 3): a shaded, mottled wall and a post.

    Args:
        rng: Where the spots come from.
    """
    shape = (HEIGHT * FINE, WIDTH * FINE)
    picture = np.full(shape, WALL)
    for cells, strength in MOTTLES:
        coarse = rng.normal(size=(cells * HEIGHT // WIDTH + 2, cells + 2)).astype(np.float32)
        picture += strength * cv2.resize(coarse, shape[::-1], interpolation=cv2.INTER_CUBIC)
    column = np.linspace(-1, 1, shape[1])
    row = np.linspace(-1, 1, shape[0])[:, None]
    picture *= 1.0 - 0.16 * column**2 - 0.12 * (row - 0.2) ** 2
    rgb = np.clip(picture[..., None] * np.array(WALL_TINT), 0, 255).astype(np.uint8)
    # from just above the hinge, behind the links, to beyond the picture's upper edge
    ends = project(np.array([[0.0, 0.02, 0.012], [0.0, 0.02, 0.6]]))
    foot, top = np.round(ends).astype(int).tolist()
    cv2.line(rgb, foot, top, STAND, STAND_WIDTH * FINE)
    return rgb


def clip_frames(positions: np.ndarray) -> list[np.ndarray]:
    """Return all frames, each RGB uint8 (height, width, 3).

    Args:
        positions: Joint positions [rad], (frame, dof).
    """
    rng = np.random.default_rng(SEED)
    background = wall(rng)
    pictures = []
    for q in positions:
        canvas = background.copy()
        # the second link stands before the first and is drawn over it
        for i, (turn, hinge) in enumerate(links(q)):
            draw_box(canvas, turn, hinge, i)
        picture = cv2.resize(canvas, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA).astype(np.float32)
        picture += rng.normal(scale=NOISE, size=(HEIGHT, WIDTH, 1))
        pictures.append(np.clip(np.round(picture), 0, 255).astype(np.uint8))
    return pictures


def encode(pictures: list[np.ndarray], path: Path) -> None:
    """Write the frames as H.264.

    Args:
        pictures: The frames, each RGB uint8 (height, width, 3).
        path: The file.
    """
    with av.open(str(path), "w", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", rate=RATE, options={"preset": "slow", "crf": "20"})
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        for picture in pictures:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())


def main(folder: Path) -> None:
    """Write the clip and its truth.

    Args:
        folder: Where to; it must exist.
    """
    times, q, v = simulate()
    encode(clip_frames(q), folder / "double.mp4")
    truth = {
        "length": LENGTH,
        "width": BREADTH,
        "thickness": THICKNESS,
        "overhang": OVERHANG,
        "layer": LAYER,
        "damping": DAMPING,
        "density": DENSITY,
        "camera": CAMERA,
        "times": [round(t, 9) for t in times.tolist()],
        "q": np.round(q, 7).tolist(),
        "v": np.round(v, 6).tolist(),
    }
    (folder / "double.json").write_text(json.dumps(truth, separators=(",", ":")) + "\n")
    size = (folder / "double.mp4").stat().st_size
    print(f"{folder / 'double.mp4'}: {size / 1000:.0f} kB, {len(times)} frames")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(monodyn.__file__).parent / "cli" / "clip")
