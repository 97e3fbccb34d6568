"""The tracking stage: a frame in, the devices as they are believed to be out."""

from __future__ import annotations

from typing import Any

import numpy as np

from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import scalar as g
from arm_ik_service.tracking.clock import step_clock
from arm_ik_service.tracking.device import step_device
from arm_ik_service.tracking.recentre import follow_recentre
from arm_ik_service.tracking.rest import place_hand_without_data, turn_person
from arm_ik_service.tracking.state import (
    ACCEPTED,
    HANDS_AT_REST,
    HEAD_AT_REST,
    LOST,
    NEVER_S,
    REFUSALS,
    TRACKING,
)

__all__ = ["ACCEPTED", "REFUSALS", "initialise_tracking", "step_tracking"]


def _reset_device(device: Record, position: Any) -> None:
    device.position[:], device.rotation[:] = position, g.IDENTITY
    device.position_state = device.rotation_state = LOST
    device.position_age_s = device.rotation_age_s = NEVER_S
    for rotation in ("measured", "suspect", "smooth"):
        device.rotation_channel[rotation][:] = g.IDENTITY


def initialise_tracking(tracking: Record) -> None:
    """Set a TRACKING record to someone who stands at the origin, looks along -Z and was never seen: all `LOST`."""
    for name in TRACKING.names or ():
        tracking[name] = np.zeros((), TRACKING[name])
    _reset_device(tracking.head, HEAD_AT_REST)
    for k in range(2):
        _reset_device(tracking.hands[k], np.add(HEAD_AT_REST, HANDS_AT_REST[k]))


@compiled
def step_tracking(tracking: Record, frame: Record, now_ns: int, settings: Record) -> int:
    """Take in one FRAME that was received at `now_ns`; returns ACCEPTED, OUT_OF_ORDER or DUPLICATE.

    Unless ACCEPTED nothing visible has changed. An accepted frame always leaves finite poses and unit quaternions,
    whatever it held.
    """
    verdict = step_clock(tracking, frame.seq, frame.sample_time_ns, now_ns)
    if verdict != ACCEPTED:
        return verdict
    elapsed_s, period_s = tracking.interval_s, tracking.clock.period_s
    follow_recentre(tracking, frame, elapsed_s)
    head_before = g.vector(tracking.head.position)
    step_device(tracking.head, frame.head, elapsed_s, period_s, settings)
    turned = turn_person(tracking, elapsed_s)
    for k in range(2):
        step_device(tracking.hands[k], frame.hands[k], elapsed_s, period_s, settings)
        place_hand_without_data(tracking, k, head_before, turned, elapsed_s, settings.dead_reckoning)
    return ACCEPTED
