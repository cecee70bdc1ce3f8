"""How kernels that make no array are compiled: without counting who holds the arrays that they are given.

numba counts that, so that an array goes when nobody holds it any more, and leaves it out of a function that
branches only in simple cases. To count takes an atomic addition, some 5 ns: of a few branches in the inmost
loop of a rollout that was more than half of the time. Whoever calls a kernel holds its arrays until it
returns, so that one that makes none, returns none (nor what has one in it) and takes none from another kernel
has nothing to count.

What a function does not say of itself numba takes from whatever calls it first, and keeps: kernels that are
called by these say all of it, those that make arrays for themselves, and return none, that they count.
"""

from __future__ import annotations

from typing import Any

UNCOUNTED: dict[str, Any] = {"_nrt": False, "forceinline": False}
"""Options of a kernel that makes, returns and takes no array."""
INLINED: dict[str, Any] = {"_nrt": False, "forceinline": True}
"""Options of one that becomes a part of those that call it."""
COUNTED: dict[str, Any] = {"_nrt": True, "forceinline": False}
"""Options of a kernel that makes arrays, returns none, and is called by one of these."""
