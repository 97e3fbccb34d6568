"""Frames in order of their sample time, for senders whose clocks repeat, jitter, pause and start again.

Time is taken from the samples; the receive time only decides how long to wait before believing that the sender's
clock has stepped back.
"""

from __future__ import annotations

from arm_ik_service.compiled import Record, compiled
from arm_ik_service.tracking.state import ACCEPTED, DUPLICATE, OUT_OF_ORDER

STEP_AFTER_NS = 100_000_000  # nothing newer was received for so long: an older sample is from a sender that restarted
RECEIVER_STEP_NS = 10_000_000_000  # our own clock went back by more than this: it was set, and proves nothing
FIRST_PERIOD_S = 1.0 / 90.0  # of a headset
LONGEST_PERIOD_S = 0.1  # a longer interval is a gap and says nothing about the period
PERIOD_GAIN = 0.05  # of the running estimate: it follows a new rate within a third of a second
SHORTEST_INTERVAL = 0.25  # of the period: what is nearer together shares a jittery clock rather than a moment


@compiled
def step_clock(tracking: Record, seq: int, sample_time_ns: int, now_ns: int) -> int:
    """Judge one frame by its times: a verdict. If ACCEPTED, sets the times of `tracking`."""
    clock = tracking.clock
    dt_ns = sample_time_ns - tracking.sample_time_ns
    if clock.started == 0:
        clock.started, clock.period_s, dt_ns = 1, FIRST_PERIOD_S, 0
    elif dt_ns == 0 and seq == clock.seq:
        return DUPLICATE
    elif dt_ns < 0:
        # Judged by accepted frames alone: a refusal leaves no trace, so solving what was accepted gives the same bytes.
        if -RECEIVER_STEP_NS < now_ns - clock.accepted_at_ns < STEP_AFTER_NS:
            return OUT_OF_ORDER
        clock.steps += 1
        dt_ns = 0
    clock.accepted_at_ns = now_ns
    clock.seq = seq
    tracking.sample_time_ns = sample_time_ns
    tracking.dt_s = 1e-9 * dt_ns
    if 0.0 < tracking.dt_s < LONGEST_PERIOD_S:
        clock.period_s += PERIOD_GAIN * (tracking.dt_s - clock.period_s)
    tracking.interval_s = clock.period_s
    if dt_ns > 0:
        tracking.interval_s = max(tracking.dt_s, SHORTEST_INTERVAL * clock.period_s)
    return ACCEPTED
