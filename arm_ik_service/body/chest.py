"""Where the chest is and which way it faces, from head and hands over time."""

from __future__ import annotations

import math

from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Quaternion, Vector

NECK_PIVOT_IN_HEAD: Vector = (0.0, -0.11, 0.09)  # base of the neck [m], in head axes (OpenXR VIEW)
SHOULDER_DROP = 0.71  # of the shoulders below the neck, in half shoulder widths
HANDS_IN_YAW = 2.0  # weight of the hands' mean direction against that of the head
FACING_TIME_S = 0.1  # time in which the chest follows


@compiled
def forward_of(head: Quaternion) -> Vector:
    """Horizontal direction a head faces: of unit length at any pitch, so also where it looks straight down."""
    z, y = g.rotate(head, g.Z), g.rotate(head, g.Y)
    return (z[1] * y[0] - y[1] * z[0], 0.0, z[1] * y[2] - y[1] * z[2])


@compiled
def step_chest(body: Record, tracking: Record, elapsed_s: float) -> None:
    """Update `chest_position` and `chest_rotation` from the head and the hands."""
    head = g.quaternion(tracking.head.rotation)
    neck = g.add(g.vector(tracking.head.position), g.rotate(head, NECK_PIVOT_IN_HEAD))
    facing = forward_of(head)
    for k in range(2):
        away = g.subtract(g.vector(tracking.hands[k].position), neck)
        weight = 0.5 * HANDS_IN_YAW / max(g.norm(away), body.half_width)
        facing = g.add(facing, g.scale(weight, (away[0], 0.0, away[2])))
    yaw = math.atan2(-facing[0], -facing[2])
    if body.started == 0:
        body.yaw = yaw
    turn = g.wrap(yaw - body.yaw)
    body.yaw = g.wrap(body.yaw + turn * (1.0 - math.exp(-elapsed_s / FACING_TIME_S)))
    g.store(body.chest_rotation, g.rotation_y(body.yaw))
    g.store(body.chest_position, g.add(neck, (0.0, -SHOULDER_DROP * body.half_width, 0.0)))
