"""Streams of reachable targets, and one compiled loop that runs step_arm along them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from arm_ik_service.arm import tangent
from arm_ik_service.arm.configuration import difference, read_configuration
from arm_ik_service.arm.model import ArmModel
from arm_ik_service.body.state import TARGET
from arm_ik_service.compiled import compiled
from arm_ik_service.geometry import batch
from arm_ik_service.ik.state import new_arm
from arm_ik_service.ik.step import step_arm
from arm_ik_service.settings import SolverSettings, to_record

LEAP_M = 0.08  # of an elbow in a frame, beyond twice what its hand moves: no elbow goes there at once

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]


def random_stream(
    arm: ArmModel, seed: int, *, frames: int = 2000, rate_hz: float = 90.0, share: float = 0.95, most_m_s: float = 5.0
) -> tuple[Array, Array]:
    """Sums of three sines in every joint over the middle `share` of its range, the swing region included.

    Time is stretched where the hand would be faster than `most_m_s`. Returns configurations (frames, 10) and hands
    (frames, 7).
    """
    rng = np.random.default_rng(seed)
    waves = [(rng.uniform(0.05, 1.0, 3), rng.uniform(0, 2 * np.pi, 3), rng.dirichlet(np.ones(3))) for _ in range(9)]

    def at(t: Array) -> Array:
        s = [sum(a * np.sin(2 * np.pi * f * t + p) for f, p, a in zip(*wave, strict=True)) for wave in waves]
        azimuth, radius = np.arctan2(s[1], s[0]), np.minimum(np.hypot(s[0], s[1]), 1.0)
        edge = arm.swing_edge(azimuth)
        return arm.configurations_at(
            radius * share * edge, azimuth, *(arm.within_range(share * s[2 + i], i) for i in range(7))
        )

    t = np.arange(frames) / rate_hz
    hands = arm.forward(at(t))["hand"]
    fastest = np.linalg.norm(np.diff(hands[:, :3], axis=0), axis=1).max() * rate_hz
    q = at(t * min(1.0, most_m_s / fastest))
    return q, arm.forward(q)["hand"]


def tumbling(seed: int, frames: int = 1500, rate_hz: float = 90.0) -> Array:
    """Hands (frames, 7) that stay before the right shoulder and turn every way, most of the time out of range."""
    rng = np.random.default_rng(seed)
    t = np.arange(frames)[:, None] / rate_hz
    waves = [rng.normal(size=3) * np.sin(2 * np.pi * f * t + rng.uniform(0, 6, 3)) for f in (0.3, 0.7, 1.5, 2.2)]
    sway = 0.05 * np.sin(2 * np.pi * np.array([0.5, 0.7, 0.9]) * t)
    return np.concatenate([np.array([0.1, -0.25, -0.35]) + sway, batch.exp(1.2 * np.sum(waves, axis=0))], axis=1)


@dataclass
class Run:
    """What step_arm answered, frame by frame."""

    configuration: Array
    velocity: Array
    position_error_m: Array
    orientation_error_rad: Array
    iterations: Counts
    limits: Counts
    status: Counts
    restarted: Counts
    elbow: Array
    confidence: Array


def targets_of(hands: Array, dt_s: float) -> npt.NDArray[Any]:
    """TARGET records of all but the first and last hand, twists by central differences."""
    targets = np.zeros(len(hands) - 2, TARGET)
    targets["position"], targets["rotation"] = hands[1:-1, :3], hands[1:-1, 3:]
    targets["linear_velocity"] = (hands[2:, :3] - hands[:-2, :3]) / (2 * dt_s)
    spin = batch.log(batch.multiply(batch.conjugate(hands[:-2, 3:]), hands[2:, 3:]))
    targets["angular_velocity"] = batch.rotate(hands[:-2, 3:], spin) / (2 * dt_s)
    return targets


def run(arm: ArmModel, targets: npt.NDArray[Any], dt_s: float, settings: SolverSettings | None = None) -> Run:
    """Step a fresh arm along TARGET records."""
    n = len(targets)
    iterations, limits, status, restarted = (np.empty(n, np.int64) for _ in range(4))
    answer = Run(
        np.empty((n, 10)),
        np.empty((n, 9)),
        np.empty(n),
        np.empty(n),
        iterations,
        limits,
        status,
        restarted,
        np.empty((n, 3)),
        np.empty(n),
    )
    record = np.array([to_record(settings or SolverSettings())])
    _run(new_arm(arm), targets, dt_s, record, *vars(answer).values())
    return answer


def elbow_leaps(arm: ArmModel, answer: Run) -> Array:
    """How far [m] the elbow goes in each frame but the first beyond what counts as a leap; positive for one."""
    steps = np.linalg.norm(np.diff(answer.elbow, axis=0), axis=1)
    wrists = arm.forward(answer.configuration)["wrist"][:, :3]
    return np.asarray(steps - LEAP_M - 2.0 * np.linalg.norm(np.diff(wrists, axis=0), axis=1))


@compiled
def _run(
    arms: Any,
    targets: Any,
    dt_s: float,
    settings: Any,
    configuration: Any,
    velocity: Any,
    position_error: Any,
    orientation_error: Any,
    iterations: Any,
    limits: Any,
    status: Any,
    restarted: Any,
    elbow: Any,
    confidence: Any,
) -> None:
    arm = arms[0]
    for n in range(len(targets)):
        step_arm(arm, targets[n], dt_s, settings[0])
        configuration[n, :] = arm.shown
        velocity[n, :] = arm.velocity
        position_error[n] = arm.position_error_m
        orientation_error[n] = arm.orientation_error_rad
        iterations[n], limits[n] = arm.iterations, arm.limits
        status[n], restarted[n] = arm.status, arm.restarted
        elbow[n, :] = arm.elbow
        confidence[n] = arm.elbow_confidence


def central_differences(configuration: Array, dt_s: float) -> Array:
    """Velocity (N, 9) of the published configurations; the first and last row are not a number."""
    out = np.full((len(configuration), 9), np.nan)
    for n in range(1, len(configuration) - 1):
        before, after = read_configuration(configuration[n - 1]), read_configuration(configuration[n + 1])
        tangent.store(out[n], tangent.scale(0.5 / dt_s, difference(before, after)))
    return out
