"""How a mechanism is identified: settings alone, so that the command line can list them without the rest."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Literal, get_args

from monodyn.choices import METHOD_NAMES, Method, check_choice
from monodyn.errors import SettingsError
from monodyn.typed import check_fields

MOST_TERMS = 50
"""Harmonics of the longest Fourier series."""
USUAL_TERMS = 7
"""Where the number of harmonics is open, no more than these are tried."""
Torque = Literal["auto", "friction", "fourier", "free"]
Series = Literal["with-friction", "alone"]
Bodies = Literal["auto", "uniform", "free"]
Uncertainty = Literal["linear", "profile", "bootstrap"]


@dataclass(frozen=True)
class IdentifySettings:
    """How a mechanism is identified.

    Attributes:
        method: ``fast``: parameters and start state in one weighted least squares; ``paper``: eq. (14) of
            the 2012 paper, start state from the filtered poses; that of the whole run when left out.
        torque: What acts at the joints: ``friction``: viscous and dry; ``fourier``: a periodic torque as a
            Fourier series; ``free``: one torque a joint and time stamp; ``auto``: the simplest that the
            evidence supports, quadratic drag among them (with the method ``paper`` as ``friction``); see
            ``series`` for friction next to a torque over time.
        terms: Harmonics of the Fourier series; 0 takes as many as the record supports, 7 with the method
            ``paper``.
        series: ``with-friction`` keeps friction in addition to a torque over time, ``alone`` leaves it out;
            with friction when left out, and alone with the method ``paper``.
        bodies: ``uniform``: mass and inertia follow from sizes and density; ``free``: each body's mass,
            centre of mass and inertia are unknowns; ``auto``: uniform, free where only dots are seen, and
            with the torque ``auto`` where the evidence is for it.
        starts: Starts that are tried at most, until the motion is explained.
        seed: Seed of the scattered starts.
        piece: Measured samples in each of the short rollouts the search begins with.
        error_bound: The integration error of a rollout stays below this [rad or m].
        outlier: A sample is left out when its residual is above this many typical ones, 3 or more; 0 keeps
            all, as the method ``paper`` always does.
        evaluations: Evaluations of the model in one search, at most.
        uncertainty: Where intervals come from: ``linear``, the covariance at the optimum, or where sizes are
            assumed that nothing measures, draws in the inertias in which the motion is linear; ``profile``,
            how the cost rises to either side of the optimum; ``bootstrap``, fits of 200 records with other
            noise.
    """

    method: Method | None = None
    torque: Torque = "auto"
    terms: int = 0
    series: Series | None = None
    bodies: Bodies = "auto"
    starts: int = 6
    seed: int = 0
    piece: int = 10
    error_bound: float = 1e-5
    outlier: float = 8.0
    evaluations: int = 100
    uncertainty: Uncertainty = "linear"

    def __post_init__(self) -> None:
        check_fields(self, "identify")
        check_choice("identify.method", self.method, (*METHOD_NAMES, None))
        for name, words in (("torque", get_args(Torque)), ("bodies", get_args(Bodies))):
            check_choice(f"identify.{name}", getattr(self, name), words)
        check_choice("uncertainty", self.uncertainty, get_args(Uncertainty))
        check_choice("identify.series", self.series, (*get_args(Series), None))
        if self.torque != "fourier" and self.terms:
            raise SettingsError(
                "identify.terms: expected --identify.torque fourier with it, got "
                f"'{self.torque}'; choose that torque, or leave the terms out."
            )
        if self.torque in ("auto", "friction") and self.series is not None:
            raise SettingsError(
                "identify.series: expected --identify.torque fourier or free with it, got "
                f"'{self.torque}'; choose one of them, or leave the series out."
            )
        ranges = (
            ("terms", 0, MOST_TERMS),
            ("starts", 1, 1000), ("seed", 0, 2**63), ("piece", 5, 10000), ("error_bound", 1e-10, 1e-2),
            ("evaluations", 5, 10000),
        )  # fmt: skip
        for name, low, high in ranges:
            value = getattr(self, name)
            if not low <= value <= high:
                shown = f"identify.{name.replace('_', '-')}"
                raise SettingsError(f"{shown}: expected {low:g} to {high:g}, got {value:g}.")
        if self.outlier != 0 and not (self.outlier >= 3 and isfinite(self.outlier)):
            raise SettingsError(f"identify.outlier: expected 0 or at least 3, got {self.outlier:g}.")


def check_known(settings: IdentifySettings) -> None:
    """Refuse known torques next to torques that are to be found, or with the published method.

    Args:
        settings: How the mechanism is identified.

    Raises:
        SettingsError: They cannot be used so.
    """
    if settings.torque not in ("auto", "friction") or settings.method == "paper":
        got = "the method 'paper'" if settings.method == "paper" else f"--identify.torque {settings.torque}"
        raise SettingsError(
            f"torques: expected the method 'fast' and --identify.torque friction with known torques, got "
            f"{got}; leave one of them out."
        )
