"""What a recording is like: rates, gaps, glitches, losses, recentres and speeds, device by device."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from arm_ik_service.compiled import compiled, record_dtype
from arm_ik_service.geometry import scalar as g
from arm_ik_service.settings import TrackingSettings, to_record
from arm_ik_service.tracking.state import ACCEPTED, HELD, INFERRED, LOST, TRACKED, TRACKING
from arm_ik_service.tracking.step import initialise_tracking, step_tracking

Array = npt.NDArray[np.float64]
Records = np.ndarray[Any, Any]

DEVICES = ("head", "left", "right")
GAP_PERIODS, GAP_S = 5.0, 0.1  # an interval that is longer than both is a gap

_ROW = record_dtype(
    [
        ("verdict", np.int64),
        ("t", np.float64),
        ("dt_s", np.float64),
        ("recentred", np.int64),
        ("speed", np.float64, (3,)),  # of the data [m/s]
        ("turn_rate", np.float64, (3,)),  # [rad/s]
        ("position_state", np.int64, (3,)),
        ("rotation_state", np.int64, (3,)),
        ("glitched", np.int64, (3,)),
    ]
)


@dataclass(frozen=True)
class DeviceReport:
    """One device. Shares are of the accepted frames; speeds are of tracked data before smoothing."""

    tracked: float
    inferred: float
    held: float
    lost: float
    glitches: int  # samples not followed because no hand moves like that
    glitch_times_s: tuple[float, ...]  # of the first of each run, from the start
    longest_loss_s: float
    speed_p50_m_s: float
    speed_p99_m_s: float
    speed_max_m_s: float
    turn_p99_rad_s: float
    turn_max_rad_s: float


@dataclass(frozen=True)
class SessionReport:
    """A recording as the tracking stage took it."""

    frames: int
    refused: int  # out of order or duplicates
    seconds: float
    rate_hz: float  # by the median interval
    interval_p1_s: float
    interval_p99_s: float
    repeated_times: int
    gaps: tuple[tuple[float, float], ...]  # start from the beginning, length [s]
    clock_steps: int
    recentre_times_s: tuple[float, ...]
    devices: dict[str, DeviceReport]


@compiled
def _note_device(row: Any, k: int, device: Any, glitches_before: int) -> None:
    row.speed[k] = g.norm(g.vector(device.position_channel.rate))
    row.turn_rate[k] = g.norm(g.vector(device.rotation_channel.rate))
    row.position_state[k] = device.position_state
    row.rotation_state[k] = device.rotation_state
    row.glitched[k] = device.glitches > glitches_before


@compiled
def _watch(tracking: Any, frames: Any, receive_times_ns: Any, rows: Any, settings: Any) -> None:
    for i in range(len(frames)):
        head, left, right = tracking.head.glitches, tracking.hands[0].glitches, tracking.hands[1].glitches
        recentres = tracking.recentres
        row = rows[i]
        row.verdict = step_tracking(tracking, frames[i], receive_times_ns[i], settings)
        row.t, row.dt_s = 1e-9 * tracking.sample_time_ns, tracking.dt_s
        row.recentred = tracking.recentres - recentres
        _note_device(row, 0, tracking.head, head)
        _note_device(row, 1, tracking.hands[0], left)
        _note_device(row, 2, tracking.hands[1], right)


def _runs(where: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return (start, stop) of every run of true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _percentile(values: Array, percent: float) -> float:
    return float(np.percentile(values, percent)) if len(values) else 0.0


def _device_report(rows: Records, k: int, elapsed_s: Array) -> DeviceReport:
    state = np.minimum(rows["position_state"][:, k], rows["rotation_state"][:, k])
    shares = {s: float(np.mean(state == s)) for s in (LOST, HELD, INFERRED, TRACKED)}
    tracked = state == TRACKED
    speed, turn = rows["speed"][tracked, k], rows["turn_rate"][tracked, k]
    end = np.append(elapsed_s[1:], elapsed_s[-1])
    losses = [float(end[stop - 1] - elapsed_s[start]) for start, stop in _runs(state <= HELD)]
    glitched = rows["glitched"][:, k] > 0
    return DeviceReport(
        tracked=shares[TRACKED],
        inferred=shares[INFERRED],
        held=shares[HELD],
        lost=shares[LOST],
        glitches=int(glitched.sum()),
        glitch_times_s=tuple(float(elapsed_s[start]) for start, _ in _runs(glitched)),
        longest_loss_s=max(losses, default=0.0),
        speed_p50_m_s=_percentile(speed, 50.0),
        speed_p99_m_s=_percentile(speed, 99.0),
        speed_max_m_s=float(speed.max(initial=0.0)),
        turn_p99_rad_s=_percentile(turn, 99.0),
        turn_max_rad_s=float(turn.max(initial=0.0)),
    )


def report_session(
    frames: Records,
    receive_times_ns: npt.NDArray[np.int64] | None = None,
    settings: TrackingSettings | None = None,
) -> SessionReport:
    """Report on FRAME records (N,), N > 0; without receive times the sample times stand in for them."""
    tracking = np.zeros(1, TRACKING)
    initialise_tracking(tracking[0])
    rows = np.zeros(len(frames), _ROW)
    times = np.ascontiguousarray(frames["sample_time_ns"] if receive_times_ns is None else receive_times_ns)
    _watch(tracking[0], frames, times, rows, to_record(settings or TrackingSettings()))
    rows = rows[rows["verdict"] == ACCEPTED]

    elapsed_s = np.cumsum(rows["dt_s"])  # not the clock's: it may have stepped
    intervals = rows["dt_s"][rows["dt_s"] > 0.0]
    period_s = float(np.median(intervals)) if len(intervals) else 0.0
    is_gap = rows["dt_s"] > max(GAP_PERIODS * period_s, GAP_S)
    return SessionReport(
        frames=len(frames),
        refused=len(frames) - len(rows),
        seconds=float(elapsed_s[-1]),
        rate_hz=1.0 / period_s if period_s > 0.0 else 0.0,
        interval_p1_s=_percentile(intervals, 1.0),
        interval_p99_s=_percentile(intervals, 99.0),
        repeated_times=int(np.sum(rows["dt_s"][1:] == 0.0) - tracking[0].clock.steps),
        gaps=tuple((float(elapsed_s[i] - rows["dt_s"][i]), float(rows["dt_s"][i])) for i in np.flatnonzero(is_gap)),
        clock_steps=int(tracking[0].clock.steps),
        recentre_times_s=tuple(float(elapsed_s[i]) for i in np.flatnonzero(rows["recentred"])),
        devices={name: _device_report(rows, k, elapsed_s) for k, name in enumerate(DEVICES)},
    )
