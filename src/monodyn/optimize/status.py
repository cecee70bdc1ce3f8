"""The sentence that a search gives as its status: each of them stands here once."""

from __future__ import annotations

REACHED = "The minimum is reached."
EXHAUSTED = "The evaluations ran out before the minimum was reached."
NOT_EVALUABLE = "The function is not finite at the start; choose another start."
STALLED = "No smaller value was found along any step of the search."
EDGE = "The search ended at the edge of where the residuals exist; choose another start."
UNMET = "The rounds of multipliers were over before the constraints were met to the tolerance."
VIOLATED = "No point within the inequalities was found; begin from one."
SETTLED = "The population has settled."
ENDED = "The generations are over; the best candidate may not be at the minimum."
NOWHERE = "The function is not finite at any candidate; choose other bounds."
