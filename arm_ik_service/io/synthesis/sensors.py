"""What a headset makes of a person: noise, clocks that jitter, and hands that it loses sight of.

The numbers are those of controllers tracked from the headset at its good moments: a few tenths of a millimetre, a
tenth of a degree, in errors that mostly come and go within a second rather than from frame to frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from arm_ik_service.geometry import batch
from arm_ik_service.geometry.batch import Array
from arm_ik_service.io.samples import ONLY_VALID, to_tracked_poses
from arm_ik_service.io.session import RecordedFrame
from arm_ik_service.io.synthesis.person import Poses
from arm_ik_service.wire.messages import (
    FULLY_TRACKED,
    ORIENTATION_TRACKED,
    VERSION,
    ControllerFrame,
    Side,
    TrackedPose,
    Vector,
)

AVATAR = "demo"
START_NS = 1_735_689_600 * 1_000_000_000  # 2025-01-01, midnight: when all of this is said to have taken place
PREDICTION_NS = 22_000_000  # how far ahead of the sender's clock the poses are: two frames until the display lights up
JITTER_NS = 150_000  # of the predicted time, standard deviation
TRANSPORT_NS = 400_000  # to the receiver, at least
LATE_NS = 300_000  # on top of it, mean of an exponential

WHITE_POSITION_M, SLOW_POSITION_M = 0.0001, 0.0003  # standard deviations an axis
WHITE_ROTATION_RAD, SLOW_ROTATION_RAD = 0.0003, 0.0015
SLOW_S = 0.4  # time constant of the slow part
VELOCITY_NOISE_M_S, VELOCITY_NOISE_RAD_S = 0.005, 0.02
DECIMALS = 6  # a micrometre: finer digits would only be noise that does not compress

COASTING_S = 0.3  # time constant with which a runtime lets a hand that it lost come to a stand
DRIFT_M_S = 0.12  # and how fast it is then wrong


@dataclass(frozen=True)
class Loss:
    """A time in which the headset has no good pose of a hand.

    `inferred`: the runtime carries the hand on with its last velocity and lets it stand, valid but not tracked.
    `held`: the position stands still, valid but not tracked, while the controller itself still tracks the rotation.
    `lost`: the last pose over and over, without a flag. `absent`: there is no device, the controller is asleep.
    """

    hand: Side
    begin_s: float
    end_s: float
    kind: Literal["inferred", "held", "lost", "absent"]


class _Device:
    """One device as it is sensed, N samples at once."""

    def __init__(self, poses: Array, time_s: Array, random: np.random.Generator) -> None:
        count, period_s = len(poses), float(time_s[1] - time_s[0])
        shift = _noise(count, period_s, WHITE_POSITION_M, SLOW_POSITION_M, random)
        turn = batch.exp(_noise(count, period_s, WHITE_ROTATION_RAD, SLOW_ROTATION_RAD, random))
        rotation = batch.multiply(poses[:, 3:], turn)
        flip = np.where(np.sum(rotation[1:] * rotation[:-1], axis=1) < 0.0, -1.0, 1.0)
        rotation[1:] *= np.cumprod(flip)[:, None]  # q and -q are one rotation: stay on one side
        self.position, self.rotation = poses[:, :3] + shift, rotation
        velocity = np.gradient(poses[:, :3], period_s, axis=0)
        steps = batch.log(batch.multiply(poses[1:, 3:], batch.conjugate(poses[:-1, 3:]))) / period_s
        angular = np.concatenate([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]])
        self.linear_velocity = velocity + random.normal(0.0, VELOCITY_NOISE_M_S, velocity.shape)
        self.angular_velocity = angular + random.normal(0.0, VELOCITY_NOISE_RAD_S, angular.shape)
        self.flags = np.full(count, FULLY_TRACKED)
        self.present = np.ones(count, bool)

    def lose(self, loss: Loss, time_s: Array, random: np.random.Generator) -> None:
        """Spoil the samples of one loss."""
        during = np.flatnonzero((time_s >= loss.begin_s) & (time_s < loss.end_s))
        last = max(0, int(during[0]) - 1)
        since_s = (time_s[during] - time_s[last])[:, None]
        if loss.kind == "absent":
            self.present[during] = False
            return
        self.position[during] = self.position[last]
        self.flags[during] = 0
        if loss.kind == "inferred":
            drift = DRIFT_M_S * batch.normalized(random.normal(size=3))
            coasting = COASTING_S * (1.0 - np.exp(-since_s / COASTING_S))
            self.position[during] += coasting * self.linear_velocity[last] + since_s * drift
            self.linear_velocity[during] = np.exp(-since_s / COASTING_S) * self.linear_velocity[last] + drift
            self.flags[during] = ONLY_VALID
        elif loss.kind == "held":
            self.linear_velocity[during] = 0.0
            self.flags[during] = ONLY_VALID | ORIENTATION_TRACKED
        else:
            self.rotation[during] = self.rotation[last]
            self.linear_velocity[during] = self.angular_velocity[during] = np.nan

    def samples(self) -> Iterator[TrackedPose | None]:
        """Give the messages."""
        poses = np.round(np.concatenate([self.position, self.rotation], axis=1), DECIMALS)
        velocities = (_messages(velocity) for velocity in (self.linear_velocity, self.angular_velocity))
        for pose, there in zip(to_tracked_poses(poses, self.flags, *velocities), self.present, strict=True):
            yield pose if there else None


def sense(
    poses: Poses, time_s: Array, losses: Sequence[Loss], skipped_s: Sequence[float], seed: int
) -> Iterator[RecordedFrame]:
    """Record poses at regular times (N,); at the times `skipped_s` the sender misses a frame. Deterministic."""
    random = np.random.default_rng(seed)
    head, left, right = (_Device(device, time_s, random) for device in (poses.head, poses.left, poses.right))
    for loss in losses:
        (left if loss.hand == "left" else right).lose(loss, time_s, random)
    sample_ns = START_NS + np.rint(1e9 * time_s + random.normal(0.0, JITTER_NS, len(time_s))).astype(np.int64)
    publish_ns = sample_ns - PREDICTION_NS
    late_ns = TRANSPORT_NS + np.rint(random.exponential(LATE_NS, len(time_s))).astype(np.int64)
    receive_ns = np.maximum.accumulate(publish_ns + late_ns)
    skipped = {int(np.searchsorted(time_s, moment)) for moment in skipped_s}
    for seq, (sample, publish, receive, *devices) in enumerate(
        zip(
            *(times.tolist() for times in (sample_ns, publish_ns, receive_ns)),
            *(device.samples() for device in (head, left, right)),
            strict=True,
        )
    ):
        if seq not in skipped:
            yield RecordedFrame(AVATAR, ControllerFrame(VERSION, seq, sample, publish, "stage", *devices), receive)


def _noise(count: int, period_s: float, white: float, slow: float, random: np.random.Generator) -> Array:
    """Errors (N,3): white noise, and a part that wanders about zero with the time constant SLOW_S."""
    keep = float(np.exp(-period_s / SLOW_S))
    pushes = random.normal(0.0, slow * np.sqrt(1.0 - keep * keep), (count, 3))
    wandering = np.empty_like(pushes)
    wandering[0] = random.normal(0.0, slow, 3)
    for i in range(1, count):
        wandering[i] = keep * wandering[i - 1] + pushes[i]
    return np.asarray(wandering + random.normal(0.0, white, (count, 3)))


def _messages(velocity: Array) -> list[Vector | None]:
    rows = velocity.round(3).tolist()
    return [(x, y, z) if math.isfinite(x) else None for x, y, z in rows]
