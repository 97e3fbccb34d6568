"""Blocks of recorded poses to tracked poses: what is no pose is never passed on as one.

Files hold what a device wrote, not what it knew: not-a-numbers, a zero quaternion before the first sample, the last
pose over and over for a device that has gone. Nothing that is not finite and unit leaves this module with a flag.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from arm_ik_service.geometry import batch
from arm_ik_service.wire.messages import (
    ORIENTATION_TRACKED,
    ORIENTATION_VALID,
    POSITION_TRACKED,
    POSITION_VALID,
    ControllerFrame,
    TrackedPose,
    Vector,
)

Flags = npt.NDArray[np.int64]
Times = npt.NDArray[np.int64]

NORM_TOLERANCE = 0.01  # recordings round quaternions to three digits; the garbage has norms 0 and 2
FROZEN_AFTER_NS = 500_000_000  # a held hand trembles by more than a float's last digit; half a second alike is no hand
LAST_TIME_S = 4.0e9  # in either direction: the year 2096, and well inside 64 bits of nanoseconds
POSITION = POSITION_VALID | POSITION_TRACKED
ORIENTATION = ORIENTATION_VALID | ORIENTATION_TRACKED
ONLY_VALID = ORIENTATION_VALID | POSITION_VALID


def to_nanoseconds(time_s: npt.ArrayLike) -> Times:
    """Times [s] of any content to nanoseconds; what is no time becomes 0, which is out of order in a recording."""
    finite = np.nan_to_num(np.asarray(time_s, np.float64), nan=0.0, posinf=0.0, neginf=0.0)
    return np.rint(np.clip(finite, -LAST_TIME_S, LAST_TIME_S) * 1e9).astype(np.int64)


def clean_poses(raw: npt.ArrayLike) -> tuple[batch.Array, Flags]:
    """Take poses (N,7) of any content apart into finite unit poses (N,7) and the flags (N,) that they deserve."""
    raw = np.asarray(raw, np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        norm = np.linalg.norm(raw[:, 3:], axis=1, keepdims=True)
        unit = np.abs(norm - 1.0) < NORM_TOLERANCE
    finite = np.isfinite(raw[:, :3]).all(axis=1, keepdims=True)
    rotation = np.where(unit, raw[:, 3:], (0.0, 0.0, 0.0, 1.0)) / np.where(unit, norm, 1.0)
    poses: batch.Array = np.concatenate([np.where(finite, raw[:, :3], 0.0), rotation], axis=1)
    return poses, np.asarray(POSITION * finite[:, 0] + ORIENTATION * unit[:, 0], np.int64)


class FrozenDevice:
    """Finds the moment from which a device only repeats itself; keeps its place between blocks."""

    def __init__(self) -> None:
        self._pose: batch.Array | None = None
        self._since_ns = 0

    def tracked(self, times_ns: Times, poses: batch.Array) -> npt.NDArray[np.bool_]:
        """Return a mask (N,): false where poses (N,7) at times (N,) have been the same for long."""
        if len(poses) == 0:
            return np.zeros(0, bool)
        changed = np.empty(len(poses), bool)
        changed[0] = self._pose is None or bool((poses[0] != self._pose).any())
        changed[1:] = (poses[1:] != poses[:-1]).any(axis=1)
        last_change = np.maximum.accumulate(np.where(changed, np.arange(len(poses)), -1))
        since_ns = np.where(last_change >= 0, times_ns[last_change], self._since_ns)
        self._pose, self._since_ns = poses[-1].copy(), int(since_ns[-1])
        return np.asarray(times_ns - since_ns <= FROZEN_AFTER_NS)


def to_tracked_poses(
    poses: batch.Array,
    flags: Flags,
    linear_velocities: Sequence[Vector | None] | None = None,
    angular_velocities: Sequence[Vector | None] | None = None,
) -> Iterator[TrackedPose]:
    """Make messages of poses (N,7), flags (N,) and, where there are any, velocities."""
    none: list[Vector | None] = [None] * len(poses)
    for (x, y, z, qx, qy, qz, qw), flag, v, w in zip(
        poses.tolist(), flags.tolist(), linear_velocities or none, angular_velocities or none, strict=True
    ):
        yield TrackedPose((x, y, z), (qx, qy, qz, qw), flag, v, w)


def finite_frame(frame: ControllerFrame) -> ControllerFrame:
    """Return a frame that JSON can carry: numbers that are none become 0 and lose their flags, as tracking takes them.

    The frame itself comes back where it is finite already, which is nearly always.
    """
    head, left, right = (_finite_pose(pose) for pose in (frame.head, frame.left, frame.right))
    if head is frame.head and left is frame.left and right is frame.right:
        return frame
    return ControllerFrame(
        frame.version, frame.seq, frame.sample_time_ns, frame.publish_time_ns, frame.space, head, left, right
    )


def _finite_pose(pose: TrackedPose | None) -> TrackedPose | None:
    if pose is None:
        return None
    position, orientation, flags = pose.position, pose.orientation, pose.flags
    linear, angular = pose.linear_velocity, pose.angular_velocity
    if _finite(position) and _finite(orientation) and _finite(linear or ()) and _finite(angular or ()):
        return pose
    if not _finite(position):
        position, flags = (0.0, 0.0, 0.0), flags & ~POSITION
    if not _finite(orientation):
        orientation, flags = (0.0, 0.0, 0.0, 1.0), flags & ~ORIENTATION
    return TrackedPose(
        position,
        orientation,
        flags,
        linear if linear is not None and _finite(linear) else None,
        angular if angular is not None and _finite(angular) else None,
    )


def _finite(values: tuple[float, ...]) -> bool:
    return all(map(math.isfinite, values))
