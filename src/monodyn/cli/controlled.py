"""``monodyn control``: its options, and what it prints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from monodyn.cli.shared import ResultOptions

if TYPE_CHECKING:
    from monodyn.results.controlled import Controlled
    from monodyn.results.regulator import Allowed


@dataclass(frozen=True, kw_only=True)
class ControlOptions(ResultOptions):
    """Design a controller for the mechanism of a run, and simulate it in MuJoCo (needs monodyn[control]).

    Attributes:
        run: Folder of a run that identified a mechanism.
        at: Joint positions of the equilibrium [rad, m for slides], e.g. joint1=1.5708; those left out are 0.
        actuated: Joints with a motor, e.g. slide; commas between several.
        out: Folder for control.json, control.html, control.mp4 and model.xml; nothing is written when left
            out.
        swing: Swing it up from where it hangs, or from --start, then balance it.
        start: Joint positions at the beginning [rad, m for slides]; those left out are those of --at. Without
            it a swing begins hanging, and a balance with the first hinge that has no motor 0.2 rad from --at,
            or 0.05 rad where there are several hinges.
        limit: Largest torque of a motor during the swing [N m, N for slides], e.g. joint1=0.5.
        within: Least and largest position of a joint on the way [rad, m for slides], e.g. slide=-0.3:0.3.
        seconds: How long the swing takes; several times are tried when left out.
        rate: Measurements, and torques, a second.
        allowed: What weighs as much as one another in the cost: angle [rad] and length [m] away from where a
            joint is to be, rate, a multiple of these [1/s], effort, a share of a motor's usual torque; e.g.
            effort=1,length=0.05. Those left out are 0.1, 0.1, 30 and 0.5.
        draws: Mechanisms drawn from the covariance of the parameters, all of which the gains should hold.
        seed: Seed of the draws.
        film: Write control.mp4, too.
    """

    run: Path = field(metadata={"metavar": "RUN", "word": True})
    at: Mapping[str, float] = field(
        default_factory=dict, metadata={"metavar": "JOINT=POSITION ...", "example": "joint1=1.5708"}
    )
    actuated: Sequence[str] = field(default=(), metadata={"metavar": "JOINT"})
    out: Path | None = field(default=None, metadata={"metavar": "DIR"})
    swing: bool = False
    start: Mapping[str, float] = field(
        default_factory=dict, metadata={"metavar": "JOINT=POSITION ...", "example": "joint1=0.5"}
    )
    limit: Mapping[str, float] = field(
        default_factory=dict, metadata={"metavar": "JOINT=TORQUE ...", "example": "joint1=0.5"}
    )
    within: Mapping[str, tuple[float, float]] = field(
        default_factory=dict, metadata={"metavar": "JOINT=LOW:HIGH ...", "example": "slide=-0.3:0.3"}
    )
    seconds: float | None = field(default=None, metadata={"metavar": "S"})
    rate: float = field(default=200.0, metadata={"metavar": "HZ"})
    allowed: Mapping[str, float] = field(default_factory=dict, metadata={"example": "effort=1"})
    draws: int = 50
    seed: int = 0
    film: bool = True

    def go(self) -> int:
        """Return the exit code after running the command.

        Raises:
            SettingsError: a weight of another name.
        """
        from monodyn.cli.show import show_result
        from monodyn.results.controlled import Aim, control_run

        aim = Aim(
            at=self.at,
            actuated=self.actuated,
            swing=self.swing,
            start=self.start or None,
            limit=self.limit,
            within=self.within,
            seconds=self.seconds,
            rate=self.rate,
            allowed=_allowed(self.allowed),
            draws=self.draws,
            seed=self.seed,
        )
        with self.progress() as progress:
            found = control_run(self.run, self.out, aim, film=self.film, force=self.force, progress=progress)
        return show_result(
            found.document, found.folder, None if found.ok else found.status,
            lambda: _print(found), as_json=self.json, quiet=self.quiet,
        )  # fmt: skip


def _allowed(given: Mapping[str, float]) -> Allowed:
    """Return what weighs as much as one another."""
    from monodyn.errors import SettingsError
    from monodyn.names import known
    from monodyn.results.regulator import Allowed

    for name in given:
        if name not in Allowed._fields:
            raise SettingsError(
                f"allowed: no weight is called '{name}'; {known('weights', Allowed._fields, name)}"
            )
    return Allowed(**given)


def _print(found: Controlled) -> None:
    """Print gains and what they do."""
    document = found.document
    at = zip(found.regulator.joints, found.regulator.position, strict=True)
    where = ", ".join(f"{name}={round(x, 9):z.6g}" for name, x in at)
    print(f"equilibrium: {where}")
    for motor, row in zip(document["motors"], found.regulator.gain, strict=True):
        gains = ", ".join(f"{name} {x:.5g}" for name, x in zip(document["states"], row, strict=True))
        print(f"gains of {motor}: {gains}")
    for note in found.notes:
        print(f"- {note}")
    if found.folder is not None:
        print(f"plot: {found.folder}/control.html")
