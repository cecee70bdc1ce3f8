"""What a torque model is given and what it returns: one task in, one solution out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from monodyn.estimation.parts import TriedTorque
from monodyn.estimation.record.samples import Data
from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.search import Search
from monodyn.estimation.shooting.shoot import Optimum
from monodyn.mechanism import Mechanism
from monodyn.mechanism.tree import BRAKES
from monodyn.types import Poses, Progress


@dataclass(frozen=True, eq=False)
class Task:
    """What is to be explained, and how the search goes.

    Attributes:
        data: The samples of all records.
        smoothed: Smooth motion of each record.
        settings: How to search.
        progress: Called with the stages done.
        otherwise: Returns the mean size of the residuals, in units of the noise, that a reason which is no
            torque, nor the bodies, leaves of what a solution of ``records`` does; infinite for none.
        records: The records themselves, which ``data`` has as samples.
    """

    data: Data
    smoothed: tuple[Smoothed, ...]
    settings: IdentifySettings
    progress: Progress | None
    otherwise: Callable[[tuple[Poses, ...], Problem, Optimum], float] = lambda *_: np.inf
    records: tuple[Poses, ...] = ()

    def of(self, records: np.ndarray) -> Task:
        """Return the same task for some of the records.

        Args:
            records: Which, rising, int (record,).
        """
        which = records.tolist()
        return replace(
            self,
            data=self.data.of(records),
            smoothed=tuple(self.smoothed[k] for k in which),
            records=tuple(self.records[k] for k in which),
        )

    def search(self, problem: Problem) -> Search:
        """Return the search of one problem.

        Args:
            problem: The problem.
        """
        return Search(problem, self.smoothed, self.settings, self.progress)


@dataclass(frozen=True, eq=False)
class TorqueSolution:
    """A problem with its optimum, or the reason why there is none.

    Attributes:
        problem: The problem that was solved last.
        optimum: Its optimum, or None.
        tried: Number of starts.
        reason: Why there is no optimum, a sentence for the user.
        advice: Sentences for the user about the torque.
        doubt: What speaks against the torque, a sentence; empty for nothing.
        compared: The kinds of torque that were tried, the chosen one first; none where one was named.
    """

    problem: Problem
    optimum: Optimum | None
    tried: int = 1
    reason: str = ""
    advice: tuple[str, ...] = ()
    doubt: str = ""
    compared: tuple[TriedTorque, ...] = ()


def frictionless(mechanism: Mechanism) -> Mechanism:
    """Return a copy without friction, but for what the user chose.

    Args:
        mechanism: The mechanism.
    """
    names = [p.name for p in mechanism.parameters if p.kind in BRAKES]
    return mechanism.with_choices(fix={name: 0.0 for name in names if name not in mechanism.chosen})
