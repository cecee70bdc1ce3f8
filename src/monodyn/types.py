"""The data that flows between the stages: frames, masks, cameras, poses.

Frozen dataclasses without algorithms. Arrays name their axes from a closed list: frame, time, dof, point,
body, param, height, width. SI units and radians throughout.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from monodyn.arrays import Frozen, clock, freeze
from monodyn.errors import VideoError
from monodyn.extras import extra
from monodyn.markup import brief, card, counted, stretch, table
from monodyn.numbers import number, short
from monodyn.typed import check_fields, kind_of

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

FULL = 160
"""Coverage of a pixel that the mechanism covers whole. The values above it keep a part that stands out more
than the mechanism's usual colour from being clipped: its edges stay linear."""

Progress = Callable[[str, int, int | None], None]
"""Called as ``progress(step, done, total)`` on long work; ``total`` is None where it is unknown."""


@dataclass(frozen=True, eq=False)
class Frame(Frozen):
    """One decoded picture in square pixels, upright.

    Attributes:
        index: Number of the frame in the clip, from 0.
        time: Presentation time stamp [s].
        luma: Grey picture, uint8 (height, width).
        chroma: Blue and red difference planes of about half that height and width, each uint8 (row, column)
            with 128 as neutral, or None for a grey clip.
    """

    index: int
    time: float
    luma: np.ndarray
    chroma: tuple[np.ndarray, np.ndarray] | None = None

    def __post_init__(self) -> None:
        check_fields(self, "Frame")
        if not math.isfinite(self.time):
            raise VideoError(f"Frame.time: expected a finite time stamp, got {self.time:g}; give another.")
        for name, plane in (("luma", self.luma), *(("chroma", plane) for plane in self.chroma or ())):
            if not isinstance(plane, np.ndarray) or plane.dtype != np.uint8 or plane.ndim != 2:
                got = f"{plane.dtype} {plane.shape}" if isinstance(plane, np.ndarray) else kind_of(plane)
                raise VideoError(
                    f"Frame.{name}: expected a uint8 array (row, column), got {got}; give another."
                )


@dataclass(frozen=True, eq=False)
class Mask(Frozen):
    """Soft foreground of one frame.

    Attributes:
        index: Number of the frame in the clip, from 0.
        time: Presentation time stamp [s].
        planes: Share of each pixel that the mechanism covers, judged by each of its colours, uint8
            (colour, height, width); ``FULL`` is all of the pixel.
    """

    index: int
    time: float
    planes: np.ndarray

    @property
    def coverage(self) -> np.ndarray:
        """Coverage by whichever colour fits best, uint8 (height, width)."""
        return self.planes[0] if len(self.planes) == 1 else self.planes.max(axis=0)


@dataclass(frozen=True)
class Camera:
    """A pinhole camera before the plane of the mechanism (OpenCV frame: x right, y down, z forward).

    In the mechanism's frame (x right, y up, z toward the camera) the camera stands at ``(x, y, depth)`` and
    looks along -z when ``pitch`` and ``yaw`` are zero.

    Attributes:
        width: Picture width [px].
        height: Picture height [px].
        focal: Focal length [px].
        x: Camera position to the right of the mechanism's origin [m].
        y: Camera position above the mechanism's origin [m].
        depth: Distance of the camera from the plane of the mechanism [m].
        roll: Turn about the optical axis [rad]; positive turns the picture of the mechanism clockwise.
        pitch: Turn about the camera's x axis [rad]; positive looks up.
        yaw: Turn about the camera's y axis [rad]; positive looks right.
    """

    width: int
    height: int
    focal: float
    x: float = 0.0
    y: float = 0.0
    depth: float = 1.0
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0


@dataclass(frozen=True, eq=False)
class TorqueLog(Frozen):
    """Torques that are known to have acted, as a controller logged them.

    Attributes:
        joints: Names of the joints at which they act; none acts at the others.
        time: Time stamps on the clock of the record [s], (row,).
        torque: Torque [N m] at a hinge, force [N] at a slide, (row, dof); linear between the rows, before
            the first and after the last as there.
    """

    joints: tuple[str, ...]
    time: np.ndarray
    torque: np.ndarray

    def __post_init__(self) -> None:
        check_fields(self, "TorqueLog")
        freeze(self, (None,), "time", error=VideoError)
        freeze(self, (len(self.time), len(self.joints)), "torque", error=VideoError)
        clock("TorqueLog.time", self.time, error=VideoError)
        if len(self.time) < 2 or not np.isfinite(self.torque).all() or not self.torque.any():
            raise VideoError(
                "TorqueLog: expected two rows or more of finite torques that are not all zero, got others; "
                "give what acted, or no log."
            )

    def __repr__(self) -> str:
        rows = counted(len(self.time), "row")
        return f"<TorqueLog of {brief(self.joints, 'joints')}: {rows}, {stretch(self.time.tolist())}>"


@dataclass(frozen=True, eq=False)
class Poses(Frozen):
    """Measured joint positions of one record (a clip or an encoder log).

    Attributes:
        joints: Joint names, in the order of the dof axis.
        frame: Frame numbers, int (frame,).
        time: Time stamps [s], (frame,).
        position: Joint positions [rad or m], unwrapped, (frame, dof); NaN where not seen.
        covariance: Covariance of each frame's positions, (frame, dof, dof); of a joint that was not seen, how
            well the motion before determines it.
        seen: True where the frame was measured (every joint of it, where ``joint_seen`` is known), (frame,).
        metric: True when slides are in metres; False when they are in the start scale of the mechanism
            file, as a picture gives them.
        joint_seen: True where a joint was measured, bool (frame, dof): in a frame in which something hides
            one body the others may be seen. None where frames were measured as a whole.
        roll: Roll of the camera that the positions take into account [rad]; None where they are against
            gravity, whatever the camera's roll was.
        shifts: What moves all positions together, (direction, frame, dof): by how much the position of each
            frame is wrong if sizes and camera are wrong by one standard deviation along one of several
            independent directions; None where nothing is said of it.
        torques: Torques that are known to have acted, or None.
        cleared: True where what moves all positions together was told from an identified motion and taken
            off; ``shifts`` are what is left of it, and are not looked for again.
    """

    joints: tuple[str, ...]
    frame: np.ndarray
    time: np.ndarray
    position: np.ndarray
    covariance: np.ndarray
    seen: np.ndarray
    metric: bool = field(default=True)
    joint_seen: np.ndarray | None = field(default=None)
    roll: float | None = field(default=0.0)
    shifts: np.ndarray | None = field(default=None)
    torques: TorqueLog | None = field(default=None)
    cleared: bool = field(default=False)

    def __post_init__(self) -> None:
        check_fields(self, "Poses")
        frames, dofs = len(self.time), len(self.joints)
        freeze(self, (frames,), "frame", dtype=np.int64, error=VideoError)
        freeze(self, (frames,), "time", error=VideoError)
        freeze(self, (frames, dofs), "position", error=VideoError)
        freeze(self, (frames, dofs, dofs), "covariance", error=VideoError)
        freeze(self, (frames,), "seen", dtype=np.bool_, error=VideoError)
        if self.joint_seen is not None:
            freeze(self, (frames, dofs), "joint_seen", dtype=np.bool_, error=VideoError)
            if np.any(self.seen != self.joint_seen.all(axis=1)):
                raise VideoError(
                    "Poses.seen: expected the frames in which every joint was seen, got others; change "
                    "'joint_seen' too."
                )
        if self.shifts is not None:
            freeze(self, (None, frames, dofs), "shifts", error=VideoError)
        clock("Poses.time", self.time, error=VideoError)
        if self.roll is not None and not abs(self.roll) <= 2.0 * math.pi:
            raise VideoError(
                f"Poses.roll: expected an angle within a turn [rad], got {self.roll:g}; give it in radians."
            )

    def __len__(self) -> int:
        return len(self.time)

    @cached_property
    def measured(self) -> np.ndarray:
        """True where there is a measured joint position, bool (frame, dof)."""
        seen = self.seen[:, np.newaxis] if self.joint_seen is None else self.joint_seen
        return np.asarray(np.isfinite(self.position) & seen)

    # a record is cut, not gone through: without this Python would ask for row after row
    __iter__ = None

    def __getitem__(self, rows: slice) -> Self:
        """Return a stretch of the rows, as ``poses[40:80]``, with all that belongs to them."""
        if not _forward(rows):
            raise VideoError(
                "Poses: expected rows in the order of time, such as poses[40:80], got "
                f"poses[{_asked(rows)}]; a single one is poses[40:41]."
            )
        return replace(self, **self._cut(rows))

    def _cut(self, rows: slice) -> dict[str, Any]:
        """Return the fields that have rows, cut."""
        by_row = ("frame", "time", "position", "covariance", "seen")
        cut = {name: getattr(self, name)[rows] for name in by_row}
        cut["joint_seen"] = None if self.joint_seen is None else self.joint_seen[rows]
        cut["shifts"] = None if self.shifts is None else self.shifts[:, rows]
        return cut

    @property
    def std(self) -> np.ndarray:
        """Standard deviation of each position [rad or m], (frame, dof)."""
        # rounding may leave a variance slightly below zero
        return np.sqrt(np.maximum(np.diagonal(self.covariance, axis1=1, axis2=2), 0.0))

    def columns(self) -> dict[str, np.ndarray]:
        """Return the record as columns of ``poses.csv`` by name, each (frame,).

        Errors that the positions share are not among them; ``shared_columns`` has these.
        """
        std, measured = self.std, self.measured
        found = {"frame": self.frame, "time": self.time, "seen": self.seen}
        for end, values in (("", self.position), ("_std", std), ("_seen", measured)):
            found |= {f"{name}{end}": values[:, dof] for dof, name in enumerate(self.joints)}
        return found

    def to_pandas(self) -> DataFrame:
        """Return the record as a table of pandas, with the columns of ``poses.csv`` (needs monodyn[tables]).

        Returns:
            One row a frame: ``frame``, ``time`` [s], ``seen``, and by joint the position [rad or m],
            ``_std``, ``_seen`` and ``_shared1``, ...
        """
        pandas = extra("to_pandas", "pandas", "tables")
        return pandas.DataFrame(self.columns() | shared_columns(self.joints, self.shifts))

    def to_xarray(self) -> Dataset:
        """Return the record as a data set of xarray, covariances and all (needs monodyn[tables]).

        Returns:
            ``position``, ``std`` and ``seen`` by ``time`` and ``joint``, ``covariance`` by ``time``,
            ``joint`` and ``other_joint``, and ``shared`` by ``direction``, ``time`` and ``joint``.
        """
        xarray, row = extra("to_xarray", "xarray", "tables"), ("time", "joint")
        data: dict[str, Any] = {name: (row, values) for name, values in (
            ("position", self.position), ("std", self.std), ("seen", self.measured),
        )}  # fmt: skip
        data["covariance"] = (("time", "joint", "other_joint"), self.covariance)
        if self.shifts is not None:
            data["shared"] = (("direction", "time", "joint"), self.shifts)
        joints = list(self.joints)
        places = {"time": self.time, "frame": ("time", self.frame), "joint": joints, "other_joint": joints}
        return xarray.Dataset(data, places)

    def __repr__(self) -> str:
        times, seen = stretch(self.time.tolist()), int(self.measured.all(axis=1).sum())
        frames = counted(len(self), "frame")
        return f"<{type(self).__name__} of {brief(self.joints, 'joints')}: {frames}, {times}, {seen} seen>"

    def _repr_html_(self) -> str:
        """Return the record as HTML, for notebooks."""
        rows = []
        for dof, name in enumerate(self.joints):
            use = self.measured[:, dof]
            values, std = self.position[use, dof], self.std[use, dof]
            texts = ["–"] * 4
            if len(values):
                ends = (np.min(values), np.max(values), np.ptp(values))
                texts = [*(number(float(end)) for end in ends), short(float(np.median(std)))]
            rows.append([name, str(len(values)), *texts])
        columns = ("joint [rad or m]", "measured", "least", "most", "range", "std (median)")
        return card(repr(self), table(columns, rows))


def shared_columns(joints: Sequence[str], shifts: np.ndarray | None) -> dict[str, np.ndarray]:
    """Return errors that the positions of a record share as columns of ``poses.csv`` by name, each (frame,).

    Args:
        joints: Joint names.
        shifts: One standard deviation of each independent direction, (direction, frame, dof); None for none.
    """
    several = () if shifts is None else shifts
    return {
        f"{name}_shared{k + 1}": one[:, dof]
        for k, one in enumerate(several)
        for dof, name in enumerate(joints)
    }


def _forward(rows: object) -> bool:
    """Return whether rows are a slice of whole numbers that goes on in time."""
    try:
        return isinstance(rows, slice) and rows.indices(1)[2] > 0
    except (TypeError, ValueError):
        return False


def _asked(rows: object) -> str:
    """Return what stood within the brackets."""
    if not isinstance(rows, slice):
        said = str(rows)
        return said if len(said) <= 40 and "\n" not in said else f"a value of type {type(rows).__name__}"
    ends = ["" if end is None else str(end) for end in (rows.start, rows.stop, rows.step)]
    return ":".join(ends)


def under(progress: Progress | None, name: str) -> Progress | None:
    """Return progress that is reported under one name, whatever its steps are called.

    Args:
        progress: Where to, or None.
        name: The name; an empty one leaves the steps as they are.
    """
    return progress if progress is None or not name else lambda _, done, total: progress(name, done, total)
