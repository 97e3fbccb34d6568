"""Tracking losses put into recordings, seeded; and how fast the published wrists move through them.

A speed here is that of a wrist in world axes: its way since the last frame that lies at least half a period back, over
the difference of the sample times. So frames that share a time stamp, or nearly so, are one.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from persons import LEFT, RIGHT, Array, Take

from arm_ik_service.body.profile import Profile
from arm_ik_service.io.session import RecordedFrame, open_session
from arm_ik_service.programs.offline import solve_frames
from arm_ik_service.settings import Settings
from arm_ik_service.wire.messages import (
    ORIENTATION_TRACKED,
    ORIENTATION_VALID,
    POSITION_VALID,
    VERSION,
    ControllerFrame,
    TrackedPose,
)

# What a sender gives while it does not see a hand: nothing; the last pose; the true pose plus an error that grows. The
# last two with flags that say so, or with flags that claim all is well.
Kind = Literal["lost", "frozen", "frozen_unflagged", "dead_reckoned", "dead_reckoned_unflagged"]
KINDS: tuple[Kind, ...] = get_args(Kind)
DURATIONS_S = (0.1, 0.5, 3.0)
FARTHEST_SNAP_M = 0.9
BETWEEN_S = 1.0  # from the end of one loss to the next
INFERRED = POSITION_VALID | ORIENTATION_VALID | ORIENTATION_TRACKED


@dataclass(frozen=True)
class Loss:
    """One hand unseen in the frames [start, stop)."""

    device: int
    start: int
    stop: int


def take_of(path: Path) -> Take:
    """Read a recording; times from its first frame on."""
    frames = [recorded.frame for recorded in open_session(path).frames()]
    t = np.array([frame.sample_time_ns for frame in frames])
    poses, flags = np.zeros((len(frames), 3, 7)), np.zeros((len(frames), 3), np.int64)
    poses[..., 6] = 1.0
    for k, frame in enumerate(frames):
        for device, pose in enumerate((frame.head, frame.left, frame.right)):
            if pose is not None:
                poses[k, device] = (*pose.position, *pose.orientation)
                flags[k, device] = pose.flags
    return Take((t - t[0]) * 1e-9, poses, flags)


def lose(take: Take, kind: Kind, duration_s: float, seed: int) -> tuple[Take, list[Loss]]:
    """Put losses of one kind and length into a take, one second apart, of one hand or the other or of both."""
    rng = np.random.default_rng(seed)
    poses, flags = take.poses.copy(), take.flags.copy()
    losses = []
    at_s = BETWEEN_S * rng.uniform(0.3, 1.0)
    while at_s + duration_s + 0.3 < take.t[-1]:
        start, stop = np.searchsorted(take.t, [at_s, at_s + duration_s])
        hands = ((LEFT,), (RIGHT,), (LEFT, RIGHT))[rng.integers(3)]
        for device in hands:
            way = rng.normal(size=3)
            way *= rng.uniform(0.2, 1.0) * FARTHEST_SNAP_M / np.linalg.norm(way)
            if stop - start < 2 or not flags[start - 1 : stop + 1, device].all():
                continue
            if kind in ("frozen", "frozen_unflagged"):
                if np.linalg.norm(poses[stop, device, :3] - poses[start - 1, device, :3]) > FARTHEST_SNAP_M:
                    continue  # whoever walked on
                poses[start:stop, device] = poses[start - 1, device]
            elif kind in ("dead_reckoned", "dead_reckoned_unflagged"):
                grown = (take.t[start:stop] - take.t[start - 1]) / (take.t[stop - 1] - take.t[start - 1])
                poses[start:stop, device, :3] += grown[:, None] * way
            if kind == "lost":
                flags[start:stop, device] = 0
            elif kind in ("frozen", "dead_reckoned"):
                flags[start:stop, device] = INFERRED
            losses.append(Loss(device, int(start), int(stop)))
        at_s += duration_s + BETWEEN_S * rng.uniform(1.0, 1.5)
    return replace(take, poses=poses, flags=flags), losses


def _frames_of(take: Take) -> Iterator[RecordedFrame]:
    for k, (t, poses, flags) in enumerate(zip(take.t, take.poses, take.flags, strict=True)):
        head, left, right = (
            TrackedPose(tuple(pose[:3].tolist()), tuple(pose[3:].tolist()), flags=int(flag))
            for pose, flag in zip(poses, flags, strict=True)
        )
        time_ns = round((t + 1.0) * 1e9)
        frame = ControllerFrame(VERSION, k, time_ns, time_ns, "stage", head, left, right)
        yield RecordedFrame("somebody", frame, None)


@dataclass(frozen=True)
class Published:
    """What was answered to every frame, in world axes: wrists (N, 2, 3) [m], chests (N, 7)."""

    wrists: Array
    chests: Array
    error_m: Array  # (N, 2) from what was asked


def publish(take: Take, profile: Profile, settings: Settings | None = None) -> Published:
    """Send a take through all stages."""
    answers = [
        state for _, state in solve_frames(_frames_of(take), defaultdict(lambda: profile), settings or Settings())
    ]
    assert len(answers) == len(take.t)
    arms = [(state.left, state.right) for state in answers]
    return Published(
        np.array([[arm.bones.hand.position for arm in both] for both in arms]),
        np.array([[*state.chest.position, *state.chest.orientation] for state in answers]),
        np.array([[arm.position_error_m for arm in both] for both in arms]),
    )


def wrist_speeds(t: Array, wrists: Array) -> Array:
    """Speeds [m/s] (N,) of wrists (N, 3) sampled at `t`; nought in the first half a period."""
    period = np.median(np.diff(t))
    before = np.searchsorted(t, t - 0.5 * period, side="right") - 1
    moved = np.linalg.norm(wrists - wrists[np.maximum(before, 0)], axis=1)
    return np.where(before < 0, 0.0, moved / np.maximum(t - t[np.maximum(before, 0)], 0.5 * period))
