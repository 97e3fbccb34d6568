"""Hands without data: they go along with the person, or hang at rest.

A hand that is held is held on the person, not in the room: one that stayed behind while its owner walks or turns would
end up behind the back or through the chest. The person's heading is that of the head less what the neck turns.
"""

from __future__ import annotations

import math

from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Quaternion, Vector
from arm_ik_service.tracking.state import HANDS_AT_REST, LOST, NEVER_S

FADE_TO_REST = 2  # of TrackingSettings.dead_reckoning
FADES_FOR_S = 0.4  # time constant of the way to rest ...
FASTEST_M_S, FASTEST_RAD_S = 1.0, 3.0  # ... and its bounds

NECK_TURNS_RAD = 0.6  # a glance within this leaves the body, and with it a held hand, where it is
SWINGS_AT_M_S = 12.0  # at most: a dancer's spin would swing a hand that is held away faster than any hand
BODY_FOLLOWS_S = 1.5  # nobody looks aside for ever: time constant with which the body comes after the head


@compiled
def turn_person(tracking: Record, elapsed_s: float) -> float:
    """Update the person's heading after the head; how far it turned [rad], about +Y."""
    ahead = g.heading(g.quaternion(tracking.head.rotation))
    yaw = math.atan2(-ahead[0], -ahead[2])
    if tracking.has_heading == 0:
        tracking.has_heading, tracking.heading = 1, yaw
        return 0.0
    heading = g.wrap(tracking.heading + tracking.recentred_yaw)  # what is held was moved along by the recentre itself
    aside = g.wrap(yaw - heading)
    glance = g.clip(aside, -NECK_TURNS_RAD, NECK_TURNS_RAD)
    turn = aside - glance + glance * (1.0 - math.exp(-elapsed_s / BODY_FOLLOWS_S))
    tracking.heading = g.wrap(heading + turn)
    return turn


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
def _swing(hand: Record, away: Vector, turned: float, elapsed_s: float) -> float:
    """How far a held hand goes round with a person who `turned` [rad]; what is too fast it makes up for later."""
    if hand.position_age_s == 0.0:
        hand.turn_left = 0.0
        return turned
    most = SWINGS_AT_M_S * elapsed_s / max(math.sqrt(away[0] * away[0] + away[2] * away[2]), 1e-9)
    wanted = hand.turn_left + turned
    swing = g.clip(wanted, -most, most)
    hand.turn_left = g.wrap(wanted - swing)
    return float(swing)


@compiled
def place_hand_without_data(
    tracking: Record, k: int, head_before: Vector, turned: float, elapsed_s: float, dead_reckoning: int
) -> None:
    """Move what is not followed of one hand after a person whose head was at `head_before` and who `turned` [rad]."""
    hand, head = tracking.hands[k], g.vector(tracking.head.position)
    away = g.subtract(g.vector(hand.position), head_before)
    turn, upright = g.rotation_y(_swing(hand, away, turned, elapsed_s)), g.rotation_y(tracking.heading)
    rest = g.add(head, g.rotate(upright, HANDS_AT_REST[k]))
    fades = dead_reckoning == FADE_TO_REST
    if hand.position_age_s >= NEVER_S:
        g.store(hand.position, rest)
    elif hand.position_age_s > 0.0:
        g.store(hand.position, g.add(head, g.rotate(turn, away)))
        if fades and hand.position_state == LOST:
            _approach_position(hand, rest, elapsed_s)
    if hand.rotation_age_s >= NEVER_S:
        g.store(hand.rotation, upright)
    elif hand.rotation_age_s > 0.0:
        g.store(hand.rotation, g.normalized(g.multiply(turn, g.quaternion(hand.rotation))))
        if fades and hand.rotation_state == LOST:
            _approach_rotation(hand, upright, elapsed_s)
