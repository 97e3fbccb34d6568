"""From what a runtime located to what a controller frame says: flags are read, never assumed."""

from __future__ import annotations

import math

from arm_ik_service.bridges.hand_joints import grip_from_wrist
from arm_ik_service.bridges.openxr.runtime import Located, LocatedHand
from arm_ik_service.wire.messages import (
    ORIENTATION_TRACKED,
    ORIENTATION_VALID,
    POSITION_TRACKED,
    POSITION_VALID,
    Quaternion,
    Side,
    TrackedPose,
    Vector,
)

_POSITION = POSITION_VALID | POSITION_TRACKED
_ORIENTATION = ORIENTATION_VALID | ORIENTATION_TRACKED
_VALID = POSITION_VALID | ORIENTATION_VALID
_TRACKED = POSITION_TRACKED | ORIENTATION_TRACKED
LINEAR_VALID = 1  # XrSpaceVelocityFlagBits
ANGULAR_VALID = 2


def tracked_pose(located: Located) -> TrackedPose:
    """Return the pose with its flags. What is not valid is zero or identity; numbers that are none are not valid."""
    flags = located.flags & (_POSITION | _ORIENTATION)
    if not all(map(math.isfinite, located.position)):
        flags &= ~_POSITION
    norm = math.hypot(*located.orientation)
    if not 0.5 < norm < 2.0:  # also false for NaN; a runtime's unit quaternion is one to 1e-6
        flags &= ~_ORIENTATION
    # tracked without valid means nothing (OpenXR 1.1, 7.3)
    if not flags & POSITION_VALID:
        flags &= ~_POSITION
    if not flags & ORIENTATION_VALID:
        flags &= ~_ORIENTATION
    return TrackedPose(
        position=located.position if flags & POSITION_VALID else (0.0, 0.0, 0.0),
        orientation=located.orientation if flags & ORIENTATION_VALID else (0.0, 0.0, 0.0, 1.0),
        flags=flags,
        linear_velocity=_velocity(located.linear_velocity, located.velocity_flags & LINEAR_VALID),
        angular_velocity=_velocity(located.angular_velocity, located.velocity_flags & ANGULAR_VALID),
    )


def _velocity(value: Vector, valid: int) -> Vector | None:
    return value if valid and all(map(math.isfinite, value)) else None


def hand_pose(side: Side, hand: LocatedHand) -> TrackedPose | None:
    """Return the grip of one hand, or None where there is neither a controller nor a tracked hand.

    A controller goes before the wrist joint, except one that is active but not located at all while the hand is.
    """
    grip = tracked_pose(hand.grip) if hand.grip_active else None
    if grip is not None and grip.flags & _VALID:
        return grip
    if hand.wrist is not None:
        wrist = tracked_pose(hand.wrist)
        if wrist.flags & _VALID == _VALID:
            return grip_from_wrist(side, wrist)
    return grip


class Stillness:
    """Notices a device whose driver died: its last pose stays, to the bit, with all flags set.

    A device that is tracked trembles in its last bits even on a table. One that does not for `after_ns` is called
    inferred: valid, but not tracked. 0 turns it off.
    """

    def __init__(self, after_ns: int) -> None:
        self._after_ns = after_ns
        self._pose: tuple[Vector, Quaternion] | None = None
        self._since_ns = 0

    def check(self, pose: TrackedPose | None, now_ns: int) -> TrackedPose | None:
        """Return the pose, without its tracked flags where it has not changed for too long."""
        if pose is None:
            self._pose = None
            return None
        if (pose.position, pose.orientation) != self._pose:
            self._pose, self._since_ns = (pose.position, pose.orientation), now_ns
            return pose
        if not self._after_ns or now_ns - self._since_ns < self._after_ns:
            return pose
        return TrackedPose(pose.position, pose.orientation, pose.flags & ~_TRACKED)
