"""Frames in order of their sample time, for senders whose clocks repeat, jitter, pause and start again.

Time is taken from the samples; the receive time only decides how long to wait before believing that the sender's
clock has stepped back.
"""

from __future__ import annotations

from arm_ik_service.compiled import Record, compiled
from arm_ik_service.tracking.state import ACCEPTED, DUPLICATE, OUT_OF_ORDER

STEP_AFTER_NS = 100_000_000  # older frames, and only such, for so long: the sender was restarted
STEP_AFTER_FRAMES = 24  # the same where the receive time stands still or is unknown
FIRST_PERIOD_S = 1.0 / 90.0  # of a headset
LONGEST_PERIOD_S = 0.1  # a longer interval is a gap and says nothing about the period
PERIOD_GAIN = 0.05  # of the running estimate: it follows a new rate within a third of a second
SHORTEST_INTERVAL = 0.25  # of the period: what is nearer together shares a jittery clock rather than a moment


@compiled
def _stepped_back(clock: Record, sample_time_ns: int, now_ns: int) -> bool:
    """Whether frames have been refused for so long, in order among themselves, that the sender must have restarted."""
    if clock.refused == 0 or sample_time_ns < clock.refused_sample_time_ns or now_ns < clock.refused_since_ns:
        clock.refused, clock.refused_since_ns = 0, now_ns
    clock.refused += 1
    clock.refused_sample_time_ns = sample_time_ns
    waited = now_ns - clock.refused_since_ns >= STEP_AFTER_NS and clock.refused > 1
    return bool(waited or clock.refused > STEP_AFTER_FRAMES)


@compiled
def step_clock(tracking: Record, seq: int, sample_time_ns: int, now_ns: int) -> int:
    """Judge one frame by its times: a verdict. If ACCEPTED, sets `tracking.sample_time_ns` and `tracking.dt_s`."""
    clock = tracking.clock
    dt_ns = sample_time_ns - tracking.sample_time_ns
    if clock.started == 0:
        clock.started, clock.period_s, dt_ns = 1, FIRST_PERIOD_S, 0
    elif dt_ns == 0 and seq == clock.seq:
        return DUPLICATE
    elif dt_ns < 0:
        if not _stepped_back(clock, sample_time_ns, now_ns):
            return OUT_OF_ORDER
        clock.steps += 1
        dt_ns = 0
    clock.refused = 0
    clock.seq = seq
    tracking.sample_time_ns = sample_time_ns
    tracking.dt_s = 1e-9 * dt_ns
    if 0.0 < tracking.dt_s < LONGEST_PERIOD_S:
        clock.period_s += PERIOD_GAIN * (tracking.dt_s - clock.period_s)
    return ACCEPTED


@compiled
def interval_s(tracking: Record) -> float:
    """Time [s] to divide a movement by: since the last frame, but never so little that noise looks like speed."""
    dt_s, period_s = float(tracking.dt_s), float(tracking.clock.period_s)
    return max(dt_s, SHORTEST_INTERVAL * period_s) if dt_s > 0.0 else period_s
