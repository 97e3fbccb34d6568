"""The shoulder girdle: the clavicle follows the hand, and over time the shoulders settle where the arms can reach.

Constants marked (fit) are fitted to the CMU and Xia recordings, as those of the chest are.
"""

from __future__ import annotations

import math

from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Vector

ELEVATION_M = 0.02  # rise of the shoulder from a hanging arm to one straight up (fit)
PROTRACTION_M = 0.015  # advance of the shoulder for an arm straight ahead (fit)
# In a fit to the shoulders alone the place where this sets in is flat from 0.8 to 0.87; the lower, the better hands are
# met. Over a range that no hand passes in a frame it sets in without a jerk.
GIVES_FROM = 0.82  # reach ratio beyond which the girdle takes part of the reach (fit) ...
GIVES = 0.5  # ... in the end this part of what is added (fit) ...
GIVES_FULLY_AFTER = 0.25  # ... over this range of the ratio (fit)
GIVES_AT_MOST = 0.5  # half shoulder widths

OVERSTRETCHED = 0.99  # reach ratio beyond which the shoulders, not the girdle, are thought to be in the wrong place
SETTLING_TIME_S = 6.0
SETTLES_AT_MOST = 0.16  # arm lengths; more is a hand that let go, or arms longer than the profile says

STERNOCLAVICULAR = (0.15, -0.1, -0.35)  # the joint from the chest's origin, to its own side, in half shoulder widths


@compiled
def girdle_gives(ratio: float) -> float:
    """Part of the arm's length by which the shoulder moves towards a hand that asks for `ratio` of it."""
    x = max(ratio - GIVES_FROM, 0.0)
    w = GIVES_FULLY_AFTER
    return GIVES * (0.5 * x * x / w if x < w else x - 0.5 * w)


@compiled
def _shoulder_in_chest(side: float, half_width: float, arm_length: float, wrist: Vector) -> Vector:
    """Glenohumeral joint in the chest's frame for a wrist there."""
    shoulder = (side * half_width, 0.0, 0.0)
    away = g.subtract(wrist, shoulder)
    distance = max(g.norm(away), 1e-9)
    part = 1.0 / max(distance, 0.5 * arm_length)  # a hand near the shoulder has no direction to speak of
    give = min(girdle_gives(distance / arm_length) * arm_length, GIVES_AT_MOST * half_width)
    rise = 0.5 * ELEVATION_M * (1.0 + part * away[1])
    advance = PROTRACTION_M * min(part * away[2], 0.0)
    return g.add(shoulder, g.add(g.scale(give / distance, away), (0.0, rise, advance)))


@compiled
def wrist_in_chest(body: Record, k: int) -> Vector:
    """Place of the wrist asked for on one side [m], in the chest's frame."""
    away = g.subtract(g.vector(body.wrists[k].position), g.vector(body.chest_position))
    return g.rotate(g.conjugate(g.quaternion(body.chest_rotation)), away)


@compiled
def step_shoulder(body: Record, k: int) -> None:
    """Place the shoulder and the clavicle of one side for the wrist in `body.wrists[k]`."""
    side = -1.0 if k == 0 else 1.0
    chest, world_from_chest = g.vector(body.chest_position), g.quaternion(body.chest_rotation)
    shoulder = _shoulder_in_chest(side, body.half_width, body.arm_length, wrist_in_chest(body, k))
    g.store(body.shoulders[k], g.add(chest, g.rotate(world_from_chest, shoulder)))

    x, y, z = STERNOCLAVICULAR
    root = g.scale(body.half_width, (side * x, y, z))
    bone = g.scale(side, g.subtract(shoulder, root))
    to_right = g.scale(1.0 / g.norm(bone), bone)
    anterior = g.cross(g.Y, to_right)
    anterior = g.scale(1.0 / g.norm(anterior), anterior)
    rotation = g.from_columns(anterior, g.cross(to_right, anterior), to_right)
    g.store(body.clavicles[k].position, g.add(chest, g.rotate(world_from_chest, root)))
    g.store(body.clavicles[k].rotation, g.normalized(g.multiply(world_from_chest, rotation)))


@compiled
def away_from_rest(body: Record, k: int) -> Vector:
    """From where the shoulder of one side rests to the wrist asked for [m], in the chest's axes."""
    side = -body.half_width if k == 0 else body.half_width
    return g.subtract(wrist_in_chest(body, k), (side, 0.0, 0.0))


@compiled
def settle(body: Record, k: int, elapsed_s: float) -> None:
    """Let the shoulders sink, for good, where the hand of one side is time and again farther down than the arm is long.

    Necks differ by 10 cm between people of one size; a hand that hangs tells where the shoulder above it must be.
    """
    away = away_from_rest(body, k)
    distance = max(g.norm(away), 1e-9)
    excess = min(distance - OVERSTRETCHED * body.arm_length, 0.25 * body.arm_length)
    if excess > 0.0 and away[1] < 0.0:
        sink = -excess * away[1] / distance * (1.0 - math.exp(-elapsed_s / SETTLING_TIME_S))
        body.settled = min(body.settled + sink, SETTLES_AT_MOST * body.arm_length)
