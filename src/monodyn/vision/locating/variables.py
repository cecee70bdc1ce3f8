"""The parameters that a refinement may change, as one vector; what weakly holds each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.mechanism.parts import PLACE_KINDS
from monodyn.types import Camera
from monodyn.vision.drawing import camera as pinhole
from monodyn.vision.drawing.rig import SIZE_KINDS

OFFSET_STD = 0.02
"""Standard deviation of how far a body may stand before its parent, in mean lengths of the mechanism."""
LOG_STD = 1.0
"""Standard deviation of the logarithm of a start size: the file's sizes are only a start."""
PLACE_STD = 0.5
"""Standard deviation of a start place, in lengths of its body: the file's places are only a start."""
LOG_CAMERA = ("camera.depth", "camera.focal")
"""Parameters of the camera that are refined as logarithms, like the sizes."""
SIDES = "thickness"
"""Kind of the variable that all thicknesses are in proportion to: how far the sides of bodies show."""


@dataclass(frozen=True, eq=False)
class SceneVariables:
    """The refined parameters as one vector: sizes and depths as logarithms, the rest in their own units, but
    for places on a body, which are ratios to its length and so grow with it.

    Attributes:
        names: Names of the parameters: sizes, places, turns, offsets and ``camera.*``.
        kinds: Their kinds; the name itself for one of the camera's.
        against: Name of the size that a place is a ratio to, empty for all others.
        thick: Names of the thicknesses that keep their proportions to the one among the variables.
        start: Values of the mechanism file by name, to which weak springs hold what the masks do not show.
        length: Mean length of the bodies in the file [m]; 0 without any.
        creeps: True for what may be hidden inside of another geom of its body, bool (param,): not the ends of
            a body of one geom.
        focal: Focal length that the refinement starts from [px].
        about_origin: True where the camera's place is that of the mechanism's origin before it: turned about
            the origin it goes on seeing the hinge where it is, and place and turns need not change together.
    """

    names: tuple[str, ...]
    kinds: tuple[str, ...]
    against: tuple[str, ...]
    thick: tuple[str, ...]
    start: dict[str, float]
    length: float
    creeps: np.ndarray
    focal: float = 1.0
    about_origin: bool = False

    @cached_property
    def is_size(self) -> np.ndarray:
        """True for sizes, bool (param,)."""
        return np.array([kind in SIZE_KINDS for kind in self.kinds], dtype=bool)

    @cached_property
    def log(self) -> np.ndarray:
        """True for what is refined as a logarithm, bool (param,)."""
        return np.array([kind in (*SIZE_KINDS, SIDES, *LOG_CAMERA) for kind in self.kinds], dtype=bool)

    @cached_property
    def is_place(self) -> np.ndarray:
        """True for places, bool (param,)."""
        return np.array([kind in PLACE_KINDS for kind in self.kinds], dtype=bool)

    @property
    def assumed(self) -> np.ndarray:
        """Information that what is assumed of the camera has on each variable, (param,)."""
        # infinity stands for nothing
        return np.array([pinhole.CAMERA_STD.get(name, np.inf) ** -2.0 for name in self.names])

    def read(self, mechanism: Mechanism, camera: Camera) -> np.ndarray:
        """Read the vector off a mechanism and a camera.

        Args:
            mechanism: The mechanism.
            camera: The camera.

        Returns:
            The variables, (param,).
        """
        values, log = mechanism.values, self.log
        camera = pinhole.around_origin(camera) if self.about_origin else camera
        x = np.array(
            [pinhole.value_of(camera, n) if n in pinhole.PARAMETERS else values[n] for n in self.names]
        )
        x = x / np.array([values[size] if size else 1.0 for size in self.against])
        return np.where(log, np.log(np.where(log, np.maximum(x, 1e-12), 1.0)), x)

    def write(self, x: np.ndarray, mechanism: Mechanism, camera: Camera) -> tuple[Mechanism, Camera]:
        """Write the vector into a mechanism and a camera.

        Args:
            x: The variables, (param,).
            mechanism: The mechanism.
            camera: The camera.

        Returns:
            Both with the new values.
        """
        return self.mechanism_at(x, mechanism), self.camera_at(x, camera)

    def mechanism_at(self, x: np.ndarray, mechanism: Mechanism) -> Mechanism:
        """Write what concerns a mechanism into it.

        Args:
            x: The variables, (param,).
            mechanism: The mechanism.

        Returns:
            The mechanism with the new values.
        """
        rows, values = self.values_at(x[np.newaxis], mechanism)
        return mechanism.at_rows(rows, values[0])

    def values_at(self, x: np.ndarray, mechanism: Mechanism) -> tuple[np.ndarray, np.ndarray]:
        """Return what concerns a mechanism, at many steps of the variables.

        Args:
            x: The variables, (step, param).
            mechanism: The mechanism.

        Returns:
            Rows of its table of parameters, int64 (row,), and the values there, (step, row).
        """
        of_all, before = self._values(x), mechanism.plan_numbers
        values = of_all.copy()
        for i, size in enumerate(self.against):
            if size:
                inside = size in self.names
                values[:, i] *= of_all[:, self.names.index(size)] if inside else before[mechanism.row(size)]
        own = [i for i, name in enumerate(self.names) if name not in pinhole.PARAMETERS]
        rows, values = mechanism.rows([self.names[i] for i in own]), values[:, own]
        if SIDES not in self.kinds:
            return rows, values
        first, thick = self.kinds.index(SIDES), mechanism.rows(self.thick)
        factor = of_all[:, [first]] / before[mechanism.row(self.names[first])]
        kept = np.all(rows[:, None] != thick, axis=1)
        return np.append(rows[kept], thick), np.hstack([values[:, kept], before[thick] * factor])

    def camera_at(self, x: np.ndarray, camera: Camera) -> Camera:
        """Write what concerns a camera into it.

        Args:
            x: The variables, (param,).
            camera: The camera.

        Returns:
            The camera with the new values.
        """
        pairs = zip(self.names, self._values(x).tolist(), strict=True)
        of_camera = {name: value for name, value in pairs if name in pinhole.PARAMETERS}
        if not self.about_origin:
            return pinhole.with_values(camera, of_camera)
        return pinhole.from_origin(pinhole.with_values(pinhole.around_origin(camera), of_camera))

    def _values(self, x: np.ndarray) -> np.ndarray:
        """Return what the variables stand for, (..., param); places are ratios still."""
        return np.where(self.log, np.exp(np.where(self.log, x, 0.0)), x)


def scene_variables(mechanism: Mechanism, names: Sequence[str]) -> SceneVariables:
    """Name the parameters that are refined.

    Args:
        mechanism: The mechanism as in its file.
        names: Sizes, places, turns, offsets, thicknesses and ``camera.*``; of the thicknesses only the first
            becomes a variable, the others keep their proportions to it.

    Returns:
        The variables.
    """
    known = {p.name: p for p in mechanism.parameters}
    kinds = tuple(name if name in pinhole.PARAMETERS else known[name].kind for name in names)
    against = tuple(
        known[name].against if kind in PLACE_KINDS else "" for name, kind in zip(names, kinds, strict=True)
    )
    thick = tuple(name for name, kind in zip(names, kinds, strict=True) if kind == SIDES)
    single = [i for i, name in enumerate(names) if name not in thick[1:]]
    kinds, against = tuple(kinds[i] for i in single), tuple(against[i] for i in single)
    lengths = [p.value for p in mechanism.parameters if p.kind == "length"]
    mean = float(np.mean(lengths or [0.0]))
    names = tuple(names[i] for i in single)
    geoms = Counter(p.owner for p in mechanism.parameters if p.kind == "width")
    ends = [n for n, kind in zip(names, kinds, strict=True) if kind in ("tail", "tip")]
    alone = [n for n in ends if geoms[known[n].owner] < 2]
    creeps = np.array([n not in alone for n in names], dtype=bool)
    return SceneVariables(names, kinds, against, thick, mechanism.values, mean, creeps)


def springs(variables: SceneVariables, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where weak springs hold what the masks do not show, and how stiff they are.

    A length is held to its start; another size, and a place, to its start proportion to the lengths.

    Args:
        variables: The variables.
        x: Their values, (param,).

    Returns:
        Where each pulls, and one over its variance, 0 for none, each (param,).
    """
    names, kinds, start = variables.names, variables.kinds, variables.start
    anchor, stiffness = np.zeros(len(names)), np.zeros(len(names))
    # Depth and sizes grow together unseen: the springs of the lengths alone fix the common scale, and the
    # other sizes follow it, so that they do not pull it back to the file's.
    grown = [x[i] - np.log(start[name]) for i, name in enumerate(names) if kinds[i] == "length"]
    common = float(np.mean(grown)) if grown else 0.0
    reach = OFFSET_STD * variables.length
    for i, name in enumerate(names):
        if kinds[i] == "length":
            anchor[i], stiffness[i] = np.log(start[name]), 1.0 / LOG_STD**2
        elif kinds[i] in (*SIZE_KINDS, SIDES):
            std = LOG_STD if kinds[i] in ("width", "extent", SIDES) else 0.5 * LOG_STD
            anchor[i], stiffness[i] = np.log(start[name]) + common, 1.0 / std**2
        elif kinds[i] in PLACE_KINDS:
            size = variables.against[i]
            anchor[i], stiffness[i] = start[name] / (start[size] if size else 1.0), 1.0 / PLACE_STD**2
        elif kinds[i] == "turn":
            anchor[i], stiffness[i] = start[name], 1.0
        elif kinds[i] == "offset":
            anchor[i], stiffness[i] = start[name], 1.0 / (abs(start[name]) + reach + 1e-12) ** 2
        elif name in pinhole.CAMERA_STD:
            anchor[i] = np.log(variables.focal) if name in LOG_CAMERA else 0.0
            stiffness[i] = 1.0 / pinhole.CAMERA_STD[name] ** 2
    return anchor, stiffness
