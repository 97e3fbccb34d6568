"""How the trunk comes after what is asked of it: without kinks, for the arms hang on it.

What a headset trembles by is a few tenths of a millimetre, on a lever of 20 cm some more; the elbow shows all of it.
Two filters of second order, both independent of the frame rate:

- `follow`, critically damped, trails a steady motion by a stated time. Its speed is continuous, so a goal that leaps or
  trembles reaches the arms as a swing.
- `predicted_follow` trails no steady motion at all, only what it speeds up by: acceleration times the square of its
  time, 6 mm for a head that starts with 10 m/s^2. It takes less of the trembling away.
"""

from __future__ import annotations

import math

from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.follower import followed_rate
from arm_ik_service.geometry.scalar import Vector


@compiled
def settled_time(time_s: float, since_s: float) -> float:
    """Time constant of a follower that started `since_s` ago: it takes up the motion that it finds, without a jolt."""
    return max(min(time_s, since_s), 1e-6)


@compiled
def follow(follower: Record, goal: Vector, trails_s: float, since_s: float, elapsed_s: float) -> Vector:
    """Move a FOLLOWER that started `since_s` ago on towards `goal`; where it is then."""
    trails_s = settled_time(trails_s, since_s)
    for i in range(3):
        away = goal[i] - follower.at[i]
        follower.rate[i] = followed_rate(follower.rate[i], away, trails_s, elapsed_s)
        follower.at[i] += follower.rate[i] * elapsed_s
    return g.vector(follower.at)


@compiled
def predicted_follow(follower: Record, goal: Vector, time_s: float, since_s: float, elapsed_s: float) -> Vector:
    """The same without a delay in steady motion, by a fading memory of `time_s` (an alpha-beta filter)."""
    keeps = math.exp(-elapsed_s / settled_time(time_s, since_s))
    for i in range(3):
        follower.at[i] += follower.rate[i] * elapsed_s
        away = goal[i] - follower.at[i]
        follower.at[i] += (1.0 - keeps * keeps) * away
        follower.rate[i] += (1.0 - keeps) * (1.0 - keeps) / elapsed_s * away
    return g.vector(follower.at)


@compiled
def start_at(follower: Record, goal: Vector) -> None:
    """Put a FOLLOWER at rest where its goal is."""
    g.store(follower.at, goal)
    g.store(follower.rate, (0.0, 0.0, 0.0))
