"""The glitch gate: a step that no human hand makes is not followed, unless what comes after agrees with it.

Stated human bounds. The fastest hands on record move at 15 to 20 m/s (a boxer's, a drummer's); in 87 000 frames of Beat
Saber and dance the fastest real strokes reach 13 m/s, 900 m/s^2 and 90 rad/s, while steps where tracking snapped back
are of 16 to 65 m/s.
"""

from __future__ import annotations

from typing import Any

from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Quaternion, Vector

FASTEST_M_S = 14.0
FASTEST_M_S2 = 1500.0
FASTEST_RAD_S = 140.0
LARGEST_TURN_RAD = 2.5  # nearer to half a turn the direction of a step is not known, whatever the time
NOISE_M = 0.02  # that a step may be off by besides
PREDICTS_FOR_S = 0.02  # as long as a hand keeps its velocity
PERSISTS_FOR_S = 0.02  # samples that agree with each other for so long are true: at 90 Hz the third is followed
LEAST_INTERVAL = 0.75  # of the period: time stamps jitter more than the moments they are of


@compiled
def gate_interval_s(elapsed_s: float, period_s: float) -> float:
    """Time that a step may be judged by."""
    return max(elapsed_s, LEAST_INTERVAL * period_s)


@compiled
def _predicted(channel: Record, after_s: float) -> Vector:
    return g.add(g.vector(channel.measured), g.scale(min(after_s, PREDICTS_FOR_S), g.vector(channel.rate)))


@compiled
def human_move(channel: Record, position: Vector, held_s: float, dt_s: float) -> bool:
    """Whether a hand that was followed until `held_s` ago can have got to `position` in the `dt_s` since then."""
    moved = g.norm(g.subtract(position, _predicted(channel, held_s)))
    swerve = g.norm(g.subtract(position, _predicted(channel, held_s + dt_s)))
    return moved <= FASTEST_M_S * dt_s + NOISE_M and swerve <= FASTEST_M_S2 * dt_s * dt_s + NOISE_M


@compiled
def human_turn(start: Quaternion, end: Quaternion, dt_s: float) -> bool:
    """Whether a hand can turn so far in `dt_s`."""
    angle = g.norm(g.log(g.multiply(end, g.conjugate(start))))
    return angle <= min(FASTEST_RAD_S * dt_s, LARGEST_TURN_RAD)


@compiled
def agreeing_moves(channel: Record, position: Vector, dt_s: float) -> bool:
    """Whether a suspect position goes on from the suspect before."""
    return g.norm(g.subtract(position, g.vector(channel.suspect))) <= FASTEST_M_S * dt_s + NOISE_M


@compiled
def suspect(channel: Record, value: Any, agrees: bool, dt_s: float) -> bool:
    """Note a sample that no hand could bring about; whether it has persisted for long enough to be true."""
    if channel.suspects == 0 or not agrees:
        channel.suspects, channel.suspected_for_s = 0, 0.0
    else:
        channel.suspected_for_s += dt_s
    channel.suspects += 1
    g.store(channel.suspect, value)
    return bool(channel.suspects > 1 and channel.suspected_for_s >= PERSISTS_FOR_S)
