"""One device in time: follow what is good, hold what is not, and say which."""

from __future__ import annotations

from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import scalar as g
from arm_ik_service.tracking.state import HELD, INFERRED, LOST, NEVER_S, TRACKED
from arm_ik_service.tracking.validity import position_quality, rotation_quality

FOLLOW = 1  # of TrackingSettings.dead_reckoning


@compiled
def _state(quality: int, age_s: float, settings: Record) -> int:
    if quality == TRACKED or (quality == INFERRED and settings.dead_reckoning == FOLLOW):
        return quality
    return LOST if age_s > settings.lost_after_s else HELD


@compiled
def step_device(device: Record, sample: Record, elapsed_s: float, settings: Record) -> None:
    """Take in one sample, `elapsed_s` after the last one."""
    seen = device.position_age_s < NEVER_S
    position, rotation = g.vector(device.position), g.quaternion(device.rotation)
    device.position_age_s = min(device.position_age_s + elapsed_s, NEVER_S)
    device.rotation_age_s = min(device.rotation_age_s + elapsed_s, NEVER_S)
    device.position_state = _state(position_quality(sample), device.position_age_s, settings)
    device.rotation_state = _state(rotation_quality(sample), device.rotation_age_s, settings)
    if device.position_state >= INFERRED:
        device.position_age_s = 0.0
        g.store(device.position, g.vector(sample.position))
    if device.rotation_state >= INFERRED:
        device.rotation_age_s = 0.0
        new = g.normalized(g.quaternion(sample.rotation))
        if g.multiply(g.conjugate(rotation), new)[3] < 0.0:
            new = (-new[0], -new[1], -new[2], -new[3])
        g.store(device.rotation, new)
    rate = 1.0 / elapsed_s if seen else 0.0
    moved = g.subtract(g.vector(device.position), position)
    turned = g.log(g.multiply(g.quaternion(device.rotation), g.conjugate(rotation)))
    g.store(device.linear_velocity, g.scale(rate, moved))
    g.store(device.angular_velocity, g.scale(rate, turned))
