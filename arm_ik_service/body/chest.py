"""Where the chest is and which way it faces, from head and hands over time.

Constants marked (fit) minimise the distance to the recorded shoulders on the CMU and Xia recordings, half a centimetre
around the optimum being flat; other families of recordings were kept out and are met as well.
"""

from __future__ import annotations

import math

from arm_ik_service.body.state import ARM_LENGTH_OF_FIT
from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Quaternion, Vector

NECK_PIVOT_IN_HEAD: Vector = (0.0, -0.165, 0.13)  # what the head turns on [m], in OpenXR VIEW axes (fit)
SHOULDER_DROP = 0.26  # of the shoulders below that pivot, in half shoulder widths (fit)
PITCH_SHARE = 0.2  # of the head's pitch that the chest takes part in (fit)
ROLL_SHARE = 0.45  # the same for roll (fit)

# The chest faces along a sum of horizontal directions: the head's, of length 1, and those below. They cannot outweigh
# it, so the chest never turns its back to the face, wherever the hands are.
HAND_PULL = 0.35  # from the neck to each hand, in arm lengths, at most 1 (fit)
HANDS_LINE_PULL = 0.25  # perpendicular to the line between the hands, in arm lengths, at most 1 (fit)
FACING_TIME_S = 0.05  # time in which the chest follows (fit)
SURE_FACING = 0.5  # a shorter sum says little about the direction: the chest follows less
FASTEST_TURN_RAD_S = 12.0  # of a chest; a skater's pirouette is 30, a dancer's 15
LARGEST_TURN_RAD = 0.33  # in a frame, whatever its length ...
RECENTRED_RAD = 0.5  # ... unless the space turned by more than this: less may be the pop of a whole recording


@compiled
def _pull(weight: float, x: float, z: float, arm_length: float) -> Vector:
    """Horizontal vector of length `weight` for an arm's length and more, in proportion below."""
    s = weight / max(math.sqrt(x * x + z * z), arm_length)
    return (s * x, 0.0, s * z)


@compiled
def facing(body: Record, neck: Vector, head: Quaternion) -> Vector:
    """Horizontal direction the chest would face if it had the time; shorter where that is less sure."""
    left, right = g.vector(body.wrists[0].position), g.vector(body.wrists[1].position)
    line = g.subtract(right, left)
    total = g.add(g.heading(head), _pull(HANDS_LINE_PULL, line[2], -line[0], body.arm_length))
    for hand in (left, right):
        away = g.subtract(hand, neck)
        total = g.add(total, _pull(HAND_PULL, away[0], away[2], body.arm_length))
    return total


@compiled
def _turn(body: Record, direction: Vector, recentred: float, elapsed_s: float) -> None:
    yaw = math.atan2(-direction[0], -direction[2])
    if body.started == 0:
        body.yaw = yaw
        return
    sure = min(g.norm(direction) / SURE_FACING, 1.0)
    most = FASTEST_TURN_RAD_S * elapsed_s
    turn = sure * g.wrap(yaw - body.yaw - recentred) * (1.0 - math.exp(-elapsed_s / FACING_TIME_S))
    turn = recentred + g.clip(turn, -most, most)
    if abs(recentred) < RECENTRED_RAD:
        turn = g.clip(turn, -LARGEST_TURN_RAD, LARGEST_TURN_RAD)
    body.yaw = g.wrap(body.yaw + turn)


@compiled
def step_chest(body: Record, recentred: float, elapsed_s: float) -> None:
    """Update the pose of the chest from head and wrists, in a space that turned by `recentred` [rad]."""
    head = g.quaternion(body.head_rotation)
    pivot = g.scale(body.arm_length / ARM_LENGTH_OF_FIT, NECK_PIVOT_IN_HEAD)
    neck = g.add(g.vector(body.head_position), g.rotate(head, pivot))
    _turn(body, facing(body, neck, head), recentred, elapsed_s)
    upright = g.rotation_y(body.yaw)
    head_up = g.rotate(g.conjugate(upright), g.rotate(head, g.Y))
    up = (ROLL_SHARE * head_up[0], 1.0, PITCH_SHARE * head_up[2])
    chest = g.normalized(g.multiply(upright, g.between(g.Y, g.scale(1.0 / g.norm(up), up))))
    drop = SHOULDER_DROP * body.half_width + body.settled
    g.store(body.chest_rotation, chest)
    g.store(body.chest_position, g.add(neck, g.rotate(chest, (0.0, -drop, 0.0))))
