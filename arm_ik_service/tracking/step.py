"""The tracking stage: a frame in, the devices as they are believed to be out."""

from __future__ import annotations

from arm_ik_service.compiled import Record, compiled
from arm_ik_service.tracking.clock import interval_s, step_clock
from arm_ik_service.tracking.device import step_device
from arm_ik_service.tracking.state import ACCEPTED


@compiled
def step_tracking(tracking: Record, frame: Record, now_ns: int, settings: Record) -> int:
    """Take in one FRAME that was received at `now_ns`; returns ACCEPTED, OUT_OF_ORDER or DUPLICATE.

    Unless ACCEPTED nothing visible has changed. An accepted frame always leaves finite poses and unit quaternions,
    whatever it held.
    """
    verdict = step_clock(tracking, frame.seq, frame.sample_time_ns, now_ns)
    if verdict != ACCEPTED:
        return verdict
    elapsed_s = interval_s(tracking)
    step_device(tracking.head, frame.head, elapsed_s, settings)
    for k in range(2):
        step_device(tracking.hands[k], frame.hands[k], elapsed_s, settings)
    return ACCEPTED
