"""The numbers by which solvers are compared, computed for all of them by the same code from the same configurations."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from arm_ik_service.bench.arm_tasks import ArmTask
from arm_ik_service.geometry.batch import angle_between
from arm_ik_service.ik.solver import Counts

Array = npt.NDArray[np.float64]

STUCK_M = 0.01  # a hand further off is seen to be off
ELBOW_STEP_M = 0.05  # an elbow that moves further within one frame is seen to jump
OUTSIDE_RAD = 0.0175  # a degree beyond a limit counts as outside


class ArmResult(NamedTuple):
    """One contender on one task, frame by frame."""

    microseconds: Array  # (B,) an arm-frame, one for each timed call
    iterations: Counts  # (N,)
    position_error_m: Array  # (N,)
    orientation_error_rad: Array  # (N,)
    elbow: Array  # (N, 3) in the shoulder frame [m]
    outside: npt.NDArray[np.bool_]  # (N,) beyond a limit of the arm by more than a degree
    configuration: Array  # (N, 10)


def evaluate(task: ArmTask, microseconds: Array, configuration: Array, iterations: Counts) -> ArmResult:
    """Where a contender's configurations put hand and elbow of our arm: nobody's own word is taken."""
    poses = task.arm.forward(configuration)
    targets = task.targets[: len(configuration)]
    return ArmResult(
        microseconds,
        iterations,
        np.linalg.norm(poses["hand"][:, :3] - targets[:, :3], axis=1),
        angle_between(poses["hand"][:, 3:], targets[:, 3:]),
        poses["elbow"][:, :3],
        np.abs(task.arm.excess(configuration)).max(axis=1) > OUTSIDE_RAD,
        configuration,
    )


def jerk_rms(elbow: Array, rate_hz: float) -> float:
    """Root mean square of the third difference of a path (N, 3) [m/s^3]; NaN for fewer than four points."""
    if len(elbow) < 4:
        return float("nan")
    jerk = np.diff(elbow, 3, axis=0) * rate_hz**3
    return float(np.sqrt(np.mean(np.sum(jerk * jerk, axis=1))))


def elbow_steps(elbow: Array) -> int:
    """Frames into which an elbow (N, 3) moved by more than ELBOW_STEP_M."""
    return int(np.sum(np.linalg.norm(np.diff(elbow, axis=0), axis=1) > ELBOW_STEP_M))


class Summary(NamedTuple):
    """All frames of all arms of one contender. None: not measured."""

    frames: int
    elbow_steps: int
    elbow_jerk: float | None  # mean over arms [m/s^3]
    us_p50: float | None = None  # an arm-frame
    us_p99: float | None = None
    iterations_p50: float | None = None
    iterations_p95: float | None = None
    position_mm_p50: float | None = None
    position_mm_p99: float | None = None
    orientation_deg_p50: float | None = None
    orientation_deg_p99: float | None = None
    stuck: int | None = None  # frames further off than STUCK_M
    stuck_unlike_others: int | None = None  # of these, where another contender inside the limits met the target
    outside_limits_percent: float | None = None
    elbow_cm: float | None = None  # mean over arms of the mean distance to the recorded elbow


def summarise(tasks: list[ArmTask], results: list[ArmResult], met: list[npt.NDArray[np.bool_]]) -> Summary:
    """Pool one contender's results, one a task. `met` says of each frame whether anybody did, inside the limits."""
    us = np.concatenate([one.microseconds for one in results])
    iterations = np.concatenate([one.iterations for one in results])
    position = 1e3 * np.concatenate([one.position_error_m for one in results])
    orientation = np.degrees(np.concatenate([one.orientation_error_rad for one in results]))
    stuck = np.concatenate([one.position_error_m for one in results]) > STUCK_M
    errors = [
        float(np.linalg.norm(one.elbow - task.elbow[: len(one.elbow)], axis=1).mean())
        for task, one in zip(tasks, results, strict=True)
        if task.elbow is not None
    ]
    return Summary(
        frames=len(iterations),
        us_p50=float(np.percentile(us, 50)),
        us_p99=float(np.percentile(us, 99)),
        iterations_p50=float(np.percentile(iterations, 50)),
        iterations_p95=float(np.percentile(iterations, 95)),
        position_mm_p50=float(np.percentile(position, 50)),
        position_mm_p99=float(np.percentile(position, 99)),
        orientation_deg_p50=float(np.percentile(orientation, 50)),
        orientation_deg_p99=float(np.percentile(orientation, 99)),
        stuck=int(stuck.sum()),
        stuck_unlike_others=int((stuck & np.concatenate(met)).sum()),
        outside_limits_percent=float(100.0 * np.concatenate([one.outside for one in results]).mean()),
        elbow_cm=100.0 * float(np.mean(errors)) if errors else None,
        elbow_steps=sum(elbow_steps(one.elbow) for one in results),
        elbow_jerk=_finite_mean([jerk_rms(one.elbow, task.rate_hz) for task, one in zip(tasks, results, strict=True)]),
    )


def recorded(tasks: list[ArmTask]) -> Summary | None:
    """Measure how the people's own elbows jump and jerk, for comparison. None where no elbow is known."""
    known = [(task, task.elbow) for task in tasks if task.elbow is not None]
    if not known:
        return None
    return Summary(
        frames=sum(len(elbow) for _, elbow in known),
        elbow_steps=sum(elbow_steps(elbow) for _, elbow in known),
        elbow_jerk=_finite_mean([jerk_rms(elbow, task.rate_hz) for task, elbow in known]),
    )


def _finite_mean(values: list[float]) -> float | None:
    finite = [value for value in values if np.isfinite(value)]
    return float(np.mean(finite)) if finite else None
