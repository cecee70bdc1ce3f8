"""What is true of a clip: its motion and what that motion determines of the mechanism; files that state
it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from monodyn.errors import VideoError
from monodyn.estimation.record.tables import read_poses
from monodyn.mechanism import Joint, Mechanism

NEAR = 1e-6
"""Time stamps of clip and truth that differ by less are the same [s]."""


@dataclass(frozen=True, eq=False)
class Truth:
    """The true motion of a clip.

    Attributes:
        time: Time stamps [s], (frame,).
        position: Joint positions [rad or m], NaN where not known, (frame, dof).
        velocity: Joint rates [rad/s or m/s], NaN where not known, (frame, dof).
        values: True values of what the motion determines, under the names of ``identifiable``.
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    values: Mapping[str, float] = field(default_factory=dict)

    def at(self, times: np.ndarray) -> Truth:
        """Return the truth at other time stamps, interpolated; unknown before and after its own.

        Args:
            times: Time stamps [s], (frame,).
        """
        return Truth(
            times, _interpolated(self.time, self.position, times),
            _interpolated(self.time, self.velocity, times), self.values,
        )  # fmt: skip


def _interpolated(time: np.ndarray, values: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return each column at other times, NaN where it is not known."""
    found = np.full((len(times), values.shape[1]), np.nan)
    for column in range(values.shape[1]):
        known = np.isfinite(values[:, column])
        if known.any():
            own, stamps = values[known, column], time[known]
            within = (times >= stamps[0] - NEAR) & (times <= stamps[-1] + NEAR)
            found[within, column] = np.interp(times[within], stamps, own)
    return found


def read_truth(path: str | Path, mechanism: Mechanism, times: np.ndarray) -> Truth:
    """Read the truth of a clip, at the clip's time stamps.

    A JSON document has ``q``, joint positions by frame [rad or m], and may have ``v``, rates, and
    ``times`` [s]; without times its rows are the frames of the clip. ``pendulum`` or ``truth.links`` state
    sizes. Any other file is a table with a column ``time`` and one for each joint, as ``monodyn identify``
    reads it.

    Args:
        path: The file.
        mechanism: The mechanism, whose joints the columns are.
        times: Time stamps of the clip [s], (frame,).

    Returns:
        The truth at the clip's stamps.

    Raises:
        VideoError: the file cannot be read, is not such a document or table, or covers no frame of the clip.
    """
    path = Path(path)
    if path.suffix.lower() == ".json":
        truth = _document_truth(path, mechanism, times)
    else:
        poses = read_poses(path, mechanism)
        seen = np.where(poses.measured, poses.position, np.nan)
        truth = Truth(poses.time, seen, np.full_like(seen, np.nan))
    found = truth.at(times)
    if not np.isfinite(truth.position).any():
        raise VideoError(
            f"{path.name}: expected true positions that are numbers, got none; give the truth of this clip."
        )
    if not np.isfinite(found.position).any():
        raise VideoError(
            f"{path.name}: expected true positions within the clip's {times[0]:.2f} to {times[-1]:.2f} s, "
            f"got {truth.time[0]:.2f} to {truth.time[-1]:.2f} s; give the truth of this clip."
        )
    return found


def _document_truth(path: Path, mechanism: Mechanism, times: np.ndarray) -> Truth:
    """Return the truth that a JSON document states."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise VideoError(f"{path}: cannot be read ({error.strerror}); name the truth of the clip.") from None
    except (ValueError, RecursionError):  # a nesting deeper than the reader's stack
        raise VideoError(f"{path.name}: expected a JSON document, got something else; correct it.") from None
    if not isinstance(document, dict) or "q" not in document:
        raise VideoError(
            f"{path.name}: expected a JSON document with joint positions 'q' by frame, got none; add them."
        )
    dofs = len(mechanism.joints)
    position = _table(path, document, "q", dofs)
    velocity = _table(path, document, "v", dofs) if document.get("v") else np.full_like(position, np.nan)
    # without stamps of its own the truth has one row for each frame
    stamps = times[: len(position)] if "times" not in document else _table(path, document, "times", 0)
    if len(stamps) != len(position) or len(velocity) != len(position):
        raise VideoError(
            f"{path.name}: expected as many times and rates as positions, got {len(stamps)} and "
            f"{len(velocity)} for {len(position)}; correct it."
        )
    if not (np.isfinite(stamps).all() and (np.diff(stamps) > 0.0).all()):
        raise VideoError(f"{path.name}: expected times that increase, got others; correct 'times'.")
    return Truth(stamps, position, velocity, stated_values(document, path.name))


def _table(path: Path, document: Mapping[str, Any], name: str, dofs: int) -> np.ndarray:
    """Return one entry of the document as numbers: (frame, dof), or (frame,) where ``dofs`` is 0."""
    shape = f"rows of {dofs} numbers, one a joint," if dofs else "a list of numbers"
    try:
        table = np.array(document[name], dtype=float)
    except (TypeError, ValueError, OverflowError):  # an integer beyond every float
        table = np.zeros(0)
    if not table.size or table.ndim != (2 if dofs else 1) or (dofs and table.shape[-1] != dofs):
        raise VideoError(f"{path.name}: expected {shape} as '{name}', got something else; correct it.")
    return table


def stated_values(document: Mapping[str, Any], where: str = "truth") -> dict[str, float]:
    """Return what a document states of the bodies, under the names of ``identifiable``.

    Args:
        document: With ``pendulum`` (length, width, thickness, density and damping of each rod) or
            ``truth`` with ``links``, (length, width, thickness) of each; other entries are left alone.
        where: The file, for messages.

    Raises:
        VideoError: what is stated has another form.
    """
    name = "pendulum" if document.get("pendulum") else "truth"
    stated = document.get(name) or {}
    if not isinstance(stated, Mapping):
        raise VideoError(f"{where}: expected entries with names in '{name}', got something else; correct it.")
    sizes = _sizes(where, name, stated)
    if not sizes:
        return {}
    damping, given = _numbers(stated.get("damping")), stated.get("density")
    density = _numbers([1.0 if given is None else given])
    if damping is None and stated.get("damping") is not None:
        raise VideoError(
            f"{where}: expected a list of numbers as '{name}.damping', got something else; correct it."
        )
    if density is None or not density[0] > 0.0:
        raise VideoError(
            f"{where}: expected a number above 0 as '{name}.density', got something else; correct it."
        )
    # masses follow from sizes for plain bars of one density alone
    plain = stated.get("shape", "box") == "box" and not stated.get("bob") and given is not None
    mass = None
    if plain and all(len(size) == 3 for size in sizes):
        mass = density[0] * np.prod(np.array(sizes), axis=1)
    return true_values([size[0] for size in sizes], mass, damping)


def _sizes(where: str, name: str, stated: Mapping[str, Any]) -> list[list[float]]:
    """Return the sizes of each body that an entry states, the length first; none where it states none."""
    links = stated.get("links")
    if links is None and "length" in stated:
        columns = [_numbers(stated.get(size)) or [] for size in ("length", "width", "thickness")]
        if not columns[0] or len({len(column) for column in columns}) > 1:
            raise VideoError(
                f"{where}: expected lists of as many numbers as '{name}.length', '{name}.width' and "
                f"'{name}.thickness', got something else; correct it."
            )
        links = [list(row) for row in zip(*columns, strict=True)]
    rows = [_numbers(row) or [] for row in links] if isinstance(links, list) else []
    # a share of a size or a mass is formed later: none of them may be zero
    if links is not None and not (rows and all(row and min(row) > 0.0 for row in rows)):
        raise VideoError(
            f"{where}: expected sizes above 0 in '{name}', a list for each body, got something else; "
            "correct it."
        )
    return rows


def _numbers(values: object) -> list[float] | None:
    """Return a list of finite numbers, or None for anything else."""
    if not isinstance(values, list | tuple):
        return None
    try:
        numbers = [float(v) for v in values if isinstance(v, int | float) and math.isfinite(v)]
    except OverflowError:  # an integer beyond every float
        return None
    return numbers if len(numbers) == len(values) else None


def true_values(
    lengths: Sequence[float], mass: np.ndarray | None = None, damping: Sequence[float] | None = None
) -> dict[str, float]:
    """Return true values under the names of ``identifiable``.

    Args:
        lengths: Lengths of the bodies that hinges turn [m], (body,).
        mass: Their masses [kg], (body,), or None.
        damping: Damping of the hinges [N m s/rad], (body,), or None.
    """
    found = {f"l{i}": float(length) for i, length in enumerate(lengths, 1)}
    if mass is not None:
        found |= {f"m{i}/m1": float(mass[i - 1] / mass[0]) for i in range(2, len(mass) + 1)}
        if damping is not None:
            found |= {f"b{i}/m1": float(b / mass[0]) for i, b in enumerate(damping, 1)}
    return found


def identifiable(mechanism: Mechanism) -> dict[str, float]:
    """Return what the motion determines: lengths, and ratios of masses and dampings without their scale.

    Numbers count the hinges, and the bodies that they turn.

    Args:
        mechanism: Its joints and parameters.
    """
    values = mechanism.values
    hinges = [joint for joint in mechanism.joints if joint.kind == "hinge"]
    found = {
        f"l{i}": values[f"{joint.body}.length"]
        for i, joint in enumerate(hinges, 1)
        if f"{joint.body}.length" in values
    }
    first = values.get(f"{hinges[0].body}.mass", 0.0) if hinges else 0.0
    if not first > 0.0:
        return found
    found |= {
        f"m{i}/m1": values[f"{joint.body}.mass"] / first
        for i, joint in enumerate(hinges, 1)
        if i > 1 and f"{joint.body}.mass" in values
    }
    return found | {
        f"b{i}/m1": values[f"{joint.name}.damping"] / first
        for i, joint in enumerate(hinges, 1)
        if f"{joint.name}.damping" in values
    }


def errors_of(
    position: np.ndarray, truth: np.ndarray, joints: Sequence[Joint], *, metric: bool = True
) -> np.ndarray:
    """Return measured less true joint positions, up to what a picture cannot show.

    A hinge is known up to whole turns; a slide up to its origin, because the camera's place is found as
    well, and where it is not ``metric`` up to its scale.

    Args:
        position: Measured joint positions [rad; m or start scale], NaN where not seen, (frame, dof).
        truth: True ones [rad or m], NaN where not known, (frame, dof).
        joints: The joints.
        metric: True where slides are in metres.

    Returns:
        Errors [rad or m], (frame, dof).
    """
    errors = position - truth
    for dof, joint in enumerate(joints):
        both = np.isfinite(errors[:, dof])
        if not both.any():
            continue
        # the median is right even where single frames are off
        if joint.kind == "hinge":
            errors[:, dof] -= 2.0 * np.pi * np.round(np.median(errors[both, dof]) / (2.0 * np.pi))
        elif metric:
            errors[:, dof] -= np.median(errors[both, dof])
        else:
            scale, origin = np.polyfit(truth[both, dof], position[both, dof], 1)
            errors[:, dof] = (position[:, dof] - origin) / scale - truth[:, dof]
    return errors
