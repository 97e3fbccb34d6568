"""Hands that nobody knows anything of: where they hang, and how a lost one gets there."""

from __future__ import annotations

import math

from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Quaternion, Vector
from arm_ik_service.tracking.state import HANDS_AT_REST, LOST, NEVER_S

FADE_TO_REST = 2  # of TrackingSettings.dead_reckoning
FADES_FOR_S = 0.4  # time constant of the way to rest ...
FASTEST_M_S, FASTEST_RAD_S = 1.0, 3.0  # ... and its bounds


@compiled
def _share(distance: float, fastest: float, elapsed_s: float) -> float:
    part = 1.0 - math.exp(-elapsed_s / FADES_FOR_S)
    return min(part, fastest * elapsed_s / max(distance, 1e-9))


@compiled
def _approach_position(device: Record, goal: Vector, elapsed_s: float) -> None:
    way = g.subtract(goal, g.vector(device.position))
    step = g.scale(_share(g.norm(way), FASTEST_M_S, elapsed_s), way)
    g.store(device.position, g.add(g.vector(device.position), step))
    g.store(device.linear_velocity, g.scale(1.0 / elapsed_s, step))


@compiled
def _approach_rotation(device: Record, goal: Quaternion, elapsed_s: float) -> None:
    way = g.log(g.multiply(goal, g.conjugate(g.quaternion(device.rotation))))
    step = g.scale(_share(g.norm(way), FASTEST_RAD_S, elapsed_s), way)
    g.store(device.rotation, g.normalized(g.multiply(g.exp(step), g.quaternion(device.rotation))))
    g.store(device.angular_velocity, g.scale(1.0 / elapsed_s, step))


@compiled
def place_lost_hand(tracking: Record, k: int, head_moved: Vector, elapsed_s: float, dead_reckoning: int) -> None:
    """Move a hand that is lost: with the head, or to rest; one never seen hangs at rest from the start."""
    hand, head = tracking.hands[k], tracking.head
    ahead = g.heading(g.quaternion(head.rotation))
    upright = g.rotation_y(math.atan2(-ahead[0], -ahead[2]))
    rest = g.add(g.vector(head.position), g.rotate(upright, HANDS_AT_REST[k]))
    if hand.position_state == LOST:
        if hand.position_age_s >= NEVER_S:
            g.store(hand.position, rest)
        elif dead_reckoning == FADE_TO_REST:
            _approach_position(hand, rest, elapsed_s)
        else:
            g.store(hand.position, g.add(g.vector(hand.position), head_moved))
    if hand.rotation_state == LOST:
        if hand.rotation_age_s >= NEVER_S:
            g.store(hand.rotation, upright)
        elif dead_reckoning == FADE_TO_REST:
            _approach_rotation(hand, upright, elapsed_s)
