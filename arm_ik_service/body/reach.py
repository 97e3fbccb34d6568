"""How far an arm can reach, and what is asked of it beyond that."""

from __future__ import annotations

import math

from arm_ik_service.compiled import compiled


@compiled
def soft_reach(ratio: float, soft_from: float) -> float:
    """Reach ratio that is granted for the one asked for: itself up to `soft_from`, then ever less, and never 1.

    Continuous with its first derivative, so an arm that runs out of length slows down and never freezes.
    """
    room = 1.0 - soft_from
    if ratio <= soft_from or room <= 0.0:
        return min(ratio, 1.0)
    return 1.0 - room * math.exp(-(ratio - soft_from) / room)
