"""How well one arm was solved over a recording: residuals, reach, elbow steps, jerk, time at limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

OUT_OF_REACH = 1.02
LARGE_STEP_M = 0.1  # an elbow that moves so much more than the hand in a frame has flipped


@dataclass(frozen=True)
class ArmReport:
    """One arm over all its frames."""

    position_error_p50_m: float
    position_error_p99_m: float
    orientation_error_p50_rad: float
    orientation_error_p99_rad: float
    reach_p50: float
    reach_p99: float
    out_of_reach: float  # share of frames that ask for more than OUT_OF_REACH
    iterations_p50: float
    iterations_p99: float
    elbow_step_max_m: float  # in a frame
    elbow_flips: int  # frames in which the elbow moved LARGE_STEP_M more than the hand
    elbow_jerk_rms_m_s3: float
    hand_jerk_rms_m_s3: float
    limit_time: dict[str, float]  # share of frames at each limit that was touched, most first


def jerk_rms(t_s: Array, positions: Array) -> float:
    """Root mean square [m/s^3] of the third derivative of positions (N, 3); frames at repeated times are left out."""
    kept = np.concatenate([[True], np.diff(t_s) > 0.0])
    t, x = t_s[kept], positions[kept]
    for _ in range(3):
        if len(t) < 2:
            return 0.0
        x = np.diff(x, axis=0) / np.diff(t)[:, None]
        t = 0.5 * (t[1:] + t[:-1])
    return float(np.sqrt(np.mean(np.sum(x * x, axis=1)))) if len(x) else 0.0


def report_arm(
    t_s: Array,
    *,
    elbow: Array,
    hand: Array,
    position_error_m: Array,
    orientation_error_rad: Array,
    reach_ratio: Array,
    iterations: npt.NDArray[np.int64],
    limits: npt.NDArray[np.int64] | None = None,
    limit_names: Sequence[str] = (),
) -> ArmReport:
    """Report on an arm's frames (N,), N > 0: world positions (N, 3), residuals, and a mask of limits a frame."""
    elbow_steps = np.linalg.norm(np.diff(elbow, axis=0), axis=1)
    hand_steps = np.linalg.norm(np.diff(hand, axis=0), axis=1)
    touched: dict[str, float] = {}
    if limits is not None:
        shares = {name: float(np.mean(limits >> bit & 1)) for bit, name in enumerate(limit_names)}
        touched = dict(sorted(((n, s) for n, s in shares.items() if s > 0.0), key=lambda item: -item[1]))

    def percentile(values: npt.NDArray[np.float64] | npt.NDArray[np.int64], percent: float) -> float:
        return float(np.percentile(values, percent))

    return ArmReport(
        position_error_p50_m=percentile(position_error_m, 50.0),
        position_error_p99_m=percentile(position_error_m, 99.0),
        orientation_error_p50_rad=percentile(orientation_error_rad, 50.0),
        orientation_error_p99_rad=percentile(orientation_error_rad, 99.0),
        reach_p50=percentile(reach_ratio, 50.0),
        reach_p99=percentile(reach_ratio, 99.0),
        out_of_reach=float(np.mean(reach_ratio > OUT_OF_REACH)),
        iterations_p50=percentile(iterations, 50.0),
        iterations_p99=percentile(iterations, 99.0),
        elbow_step_max_m=float(elbow_steps.max(initial=0.0)),
        elbow_flips=int(np.sum(elbow_steps - hand_steps > LARGE_STEP_M)),
        elbow_jerk_rms_m_s3=jerk_rms(t_s, elbow),
        hand_jerk_rms_m_s3=jerk_rms(t_s, hand),
        limit_time=touched,
    )
