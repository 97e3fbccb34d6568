"""How far an arm can reach, and what is asked of it beyond that."""

from __future__ import annotations

import math

from arm_ik_service.compiled import compiled

FULLY_STRETCHED = 0.9995  # of the straight arm: 4 degrees of elbow flexion stay, so its swivel stays defined


@compiled
def soft_reach(ratio: float, soft_from: float) -> float:
    """Reach ratio that is granted for the one asked for: itself up to `soft_from`, from there ever less of it.

    Continuous with its first derivative and never above FULLY_STRETCHED: an arm that runs out of length slows down,
    it does not freeze and lurch.
    """
    room = FULLY_STRETCHED - soft_from
    if ratio <= soft_from or room <= 0.0:
        return min(ratio, FULLY_STRETCHED)
    return FULLY_STRETCHED - room * math.exp(-(ratio - soft_from) / room)
