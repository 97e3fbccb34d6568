"""Coming after a goal without kinks."""

from __future__ import annotations

from arm_ik_service.compiled import compiled


@compiled
def followed_rate(rate: float, away: float, trails_s: float, elapsed_s: float) -> float:
    """Rate of a critically damped follower that is `away` from its goal and trails a steady motion by `trails_s`.

    Implicit in time: it blows up at no length of a frame.
    """
    stiff = 2.0 * elapsed_s / trails_s
    return (rate + stiff * stiff / elapsed_s * away) / (1.0 + 2.0 * stiff + stiff * stiff)
