"""What is known at one frame of a stream."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from monodyn.estimation.fit import Fit, Grade
from monodyn.results.predict import Prediction
from monodyn.types import Frame, Poses
from monodyn.vision.locating.scene import Scene

if TYPE_CHECKING:
    from monodyn.live.estimate import Estimate

Phase = Literal["watching", "searching", "following"]
"""Watching; looking for the mechanism in what was watched; following it, be it as a first guess has it."""


@dataclass(frozen=True, eq=False)
class Step:
    """What is known at one frame of a stream.

    Attributes:
        index: Number of the frame in the stream, from 0, skipped ones counted.
        time: Time of the frame on the stream's clock [s].
        phase: What is done with the frames at this moment.
        frame: The frame.
        pose: The pose in it, one row, slides in the start scale; None before the mechanism is followed, and
            a row that was not seen where it is lost.
        scene: Mechanism and camera, found or as a first guess has them; None where nothing is followed.
        estimate: What was identified last; None before anything was.
        base: The last fit of a whole stretch, whose verdict holds; None before one.
        said: What there is to say at this moment, a sentence.
        skipped: Frames so far that gave way to newer ones.
        latency: From the arrival of the frame to its pose [s].
        fresh: From the arrival of the frame to what was identified with it [s]; None where that is not of
            this frame.
        error: Root mean square so far of the poses less what was predicted of them ``ahead`` before, by joint
            [rad or m], (dof,); NaN before there was any.
    """

    index: int
    time: float
    phase: Phase
    frame: Frame = field(repr=False)
    pose: Poses | None = None
    scene: Scene | None = field(default=None, repr=False)
    estimate: Estimate | None = field(default=None, repr=False)
    base: Fit | None = field(default=None, repr=False)
    said: str = ""
    skipped: int = 0
    latency: float = 0.0
    fresh: float | None = None
    error: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def fit(self) -> Fit | None:
        """The mechanism as identified so far; None before anything was."""
        return self.base if self.estimate is None else self.estimate.fit

    @property
    def future(self) -> Prediction | None:
        """The motion from this frame on; None before anything was identified."""
        return None if self.estimate is None else self.estimate.future

    @property
    def verdict(self) -> Grade | None:
        """How far what was identified can be relied on; None before anything was."""
        if self.estimate is not None:
            return self.estimate.grade
        return None if self.base is None else self.base.grade
