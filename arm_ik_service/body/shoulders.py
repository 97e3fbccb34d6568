"""The shoulder girdle: the clavicle gives way when the hand reaches far."""

from __future__ import annotations

from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import scalar as g

GIVES_FROM = 0.95  # reach ratio beyond which the girdle takes part of the reach ...
GIVES = 0.5  # ... this part of it
GIVES_AT_MOST = 0.4  # half shoulder widths
STERNOCLAVICULAR = (0.15, -0.15, -0.35)  # the joint from the chest's origin, to its own side, in half widths


@compiled
def step_shoulder(body: Record, k: int) -> None:
    """Place the shoulder and the clavicle of one side for the wrist in `body.wrists[k]`."""
    side = -1.0 if k == 0 else 1.0
    chest, world_from_chest = g.vector(body.chest_position), g.quaternion(body.chest_rotation)
    shoulder = g.add(chest, g.rotate(world_from_chest, (side * body.half_width, 0.0, 0.0)))
    away = g.subtract(g.vector(body.wrists[k].position), shoulder)
    distance = g.norm(away)
    excess = GIVES * max(distance - GIVES_FROM * body.arm_length, 0.0)
    give = min(excess, GIVES_AT_MOST * body.half_width) / max(distance, 1e-9)
    shoulder = g.add(shoulder, g.scale(give, away))
    g.store(body.shoulders[k], shoulder)

    x, y, z = STERNOCLAVICULAR
    root = g.scale(body.half_width, (side * x, y, z))
    root = g.add(chest, g.rotate(world_from_chest, root))
    bone = g.scale(side, g.subtract(shoulder, root))
    to_right = g.scale(1.0 / g.norm(bone), bone)
    anterior = g.cross(g.rotate(world_from_chest, g.Y), to_right)
    anterior = g.scale(1.0 / g.norm(anterior), anterior)
    g.store(body.clavicles[k].position, root)
    g.store(body.clavicles[k].rotation, g.from_columns(anterior, g.cross(to_right, anterior), to_right))
