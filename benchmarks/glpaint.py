"""Draw a case with MuJoCo's own renderer, which needs an OpenGL that draws without a screen.

A second renderer next to ``paint``, which every machine can run. This one has lamps, highlights and smooth
shading, but only a checker or a plain wall and no clutter.
"""

from __future__ import annotations

import numpy as np

from spec import Case, Drawer, NoRenderer, looking, mjcf, view

WALL_BEHIND = 0.25
"""Distance of the wall behind the mechanism [m]."""
DARK_CHECK = 0.9
"""Light of the darker checks over that of the others."""
CHECKS = 25
"""Pairs of checks a metre."""

SCENE = """
<visual>
  <global offwidth="{width}" offheight="{height}"/>
  <quality offsamples="8"/>
  <headlight ambient="0.3 0.3 0.3" diffuse="0.35 0.35 0.35" specular="0.1 0.1 0.1"/>
</visual>
<asset>
  <texture name="wall" type="2d" builtin="checker" width="256" height="256" rgb1="{light}" rgb2="{dark}"/>
  <material name="wall" texture="wall" texrepeat="{repeat} {repeat}" specular="0" reflectance="0"/>
</asset>
<worldbody>
  <light pos="-0.8 -2 1.6" dir=".35 .8 -.7" castshadow="false" diffuse=".5 .5 .5" specular=".3 .3 .3"/>
  <geom type="plane" size="6 6 1" pos="0 {wall} 0" zaxis="0 -1 0" material="wall" contype="0"/>
  <camera name="eye" pos="{eye[0]} {eye[1]} {eye[2]}" xyaxes="{axes}" fovy="{case.fovy}"/>
"""


class GlPainter(Drawer):
    """Draws the pictures of one case in their order."""

    def __init__(self, case: Case) -> None:
        import mujoco

        self._case = case
        self._rng = np.random.default_rng(case.seed)
        width, height = case.size
        _, eye = view(case)
        light = np.array(case.base) / 255.0
        colours = [
            " ".join(f"{c:.4f}" for c in shade * light)
            for shade in (1.0, 1.0 if case.wall == "plain" else DARK_CHECK)
        ]
        right, _, up = looking(case)
        axes = " ".join(f"{x:.12g}" for x in (*right, *up))
        scene = SCENE.format(
            width=width, height=height, light=colours[0], dark=colours[1], case=case, eye=eye,
            wall=WALL_BEHIND, repeat=CHECKS, axes=axes,
        )  # fmt: skip
        self._model = mujoco.MjModel.from_xml_string(
            mjcf(case.parts, case.bolts).replace("<worldbody>", scene, 1)
        )
        self._data = mujoco.MjData(self._model)
        try:
            self._renderer = mujoco.Renderer(self._model, height, width)
        except Exception as error:
            raise NoRenderer(
                f"MuJoCo cannot draw here without a screen ({error}); install a software OpenGL "
                "(Debian: libegl1 and libgl1-mesa-dri, or libosmesa6 with MUJOCO_GL=osmesa)."
            ) from error

    def picture(self, positions: np.ndarray) -> np.ndarray:
        """Return one frame, uint8 RGB (height, width, 3).

        Args:
            positions: Joint positions during the exposure, (exposure, dof).
        """
        import mujoco

        total = 0.0
        for q in positions:
            self._data.qpos[:] = q
            mujoco.mj_forward(self._model, self._data)
            self._renderer.update_scene(self._data, "eye")
            total = total + self._renderer.render().astype(np.float32) / len(positions)
        return self.grainy(total, self._rng)
