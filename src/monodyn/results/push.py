"""A regulator in, from how far it balances its mechanism out, where the user gave no start.

One joint is let go a little away from the equilibrium, all of them at rest, and from half as far and so on
until it is balanced.
"""

from __future__ import annotations

from typing import NamedTuple

from monodyn.mechanism import Mechanism
from monodyn.results.closed import ClosedLoop, closed_loop
from monodyn.results.regulator import Regulator

PUSHED = 0.2
"""How far the first hinge without a motor is from the equilibrium at the beginning [rad]."""
HALVINGS = 5
"""How many times that is halved where it is not balanced from there."""


class Push(NamedTuple):
    """Where a balance begins.

    Attributes:
        joint: Which joint is away from the equilibrium.
        unit: Of its position.
        at: The equilibrium of that joint [rad or m].
        far: How far it is away [rad or m].
        held: The largest of that, its half, a quarter and so on from which it is balanced; 0 where from none.
    """

    joint: str
    unit: str
    at: float
    far: float
    held: float

    @property
    def begun(self) -> str:
        """Where it began, a sentence."""
        where = f"{self.joint} {self.far:.3g} {self.unit} from the equilibrium"
        return f"It was let go with {where}; --start begins elsewhere."

    @property
    def fallen(self) -> str:
        """From where it is not balanced, and what to do, the rest of a sentence."""
        said = f"when {self.joint} is let go {self.far:.3g} {self.unit} from the equilibrium"
        if self.held:
            return (
                f"{said}, but from {self.held:.2g} {self.unit} it does: --start "
                f"{self.joint}={self.at + self.held:.6g} begins there"
            )
        return (
            f"{said}, nor from {self.far / 2**HALVINGS:.2g} {self.unit}: measure more often (--rate), weigh "
            "the torques otherwise (--allowed effort=SHARE), or add a motor"
        )


def let_go(mechanism: Mechanism, regulator: Regulator, seconds: float) -> tuple[Push, ClosedLoop]:
    """Let a mechanism go near its equilibrium.

    The first hinge without a motor is away: by 0.2 rad where a motor has to catch it on a slide, else by a
    quarter of that.

    Args:
        mechanism: The mechanism.
        regulator: Its regulator.
        seconds: How long it is simulated [s].

    Returns:
        From how far it is balanced, and its motion from the farthest that is tried.
    """
    hinges = [i for i, joint in enumerate(mechanism.joints) if joint.kind == "hinge"]
    free = [i for i in hinges if regulator.joints[i] not in regulator.actuated] or hinges
    row = free[0] if free else 0
    # of several hinges in a row a motor catches less
    far = PUSHED if len(hinges) == 1 else PUSHED / 4.0
    loops: list[ClosedLoop] = []
    held = 0.0
    for away in (far / 2**k for k in range(HALVINGS + 1)):
        begin = regulator.position.copy()
        begin[row] += away
        loops.append(closed_loop(mechanism, regulator, begin, seconds=seconds))
        if loops[-1].balanced:
            held = away
            break
    unit = "rad" if hinges else "m"
    return Push(regulator.joints[row], unit, float(regulator.position[row]), far, held), loops[0]
