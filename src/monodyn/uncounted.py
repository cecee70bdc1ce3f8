"""How kernels that make no array are compiled: without counting who holds the arrays that they are given.

numba counts that, so that an array goes when nobody holds it any more, and leaves it out of a function that
branches only in simple cases. To count takes an atomic addition, some 5 ns: of a few branches in the inmost
loop of a rollout that was a half of the time. Whoever calls a kernel holds its arrays until it returns, so
that what makes none has nothing to count. A function is compiled as the one that calls it unless it says
otherwise: what makes arrays and is called by such a kernel says that it counts.
"""

from __future__ import annotations

from typing import Any

UNCOUNTED: dict[str, Any] = {"_nrt": False}
"""Options of a kernel that makes no array, and of all that it calls."""
COUNTED: dict[str, Any] = {"_nrt": True}
"""Options of one that makes arrays for itself, and is called by such a kernel."""
