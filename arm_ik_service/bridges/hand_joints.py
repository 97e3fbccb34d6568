"""A tracked hand without a controller: where the grip would be, from the wrist joint.

A ControllerFrame carries grip poses. XR_EXT_hand_tracking and the WebXR Hand Input module give the wrist joint in one
and the same frame (-Z to the fingers, +Y out of the back of the hand), which is the frame that a profile's
`wrist_from_grip` is stated in. With the default profile the service gets back exactly the wrist that was tracked.
"""

from __future__ import annotations

import numpy as np

from arm_ik_service.body.profile import GripOffset, Profile
from arm_ik_service.geometry import batch
from arm_ik_service.wire.messages import Side, TrackedPose, Vector

_OFFSETS = Profile().grip


def grip_from_wrist(side: Side, wrist: TrackedPose) -> TrackedPose:
    """Return the grip pose of a hand whose wrist joint is `wrist`; flags and time are kept.

    The grip's velocity is the wrist's plus what the hand's rotation adds at the lever; unknown where either part is.
    """
    offset: GripOffset = _OFFSETS.left if side == "left" else _OFFSETS.right
    lever = batch.rotate(wrist.orientation, offset.position_m)
    linear = None
    if wrist.linear_velocity is not None and wrist.angular_velocity is not None:
        linear = _vector(np.asarray(wrist.linear_velocity) + np.cross(wrist.angular_velocity, lever))
    x, y, z, w = (float(part) for part in batch.multiply(wrist.orientation, offset.orientation_xyzw))
    return TrackedPose(
        position=_vector(np.asarray(wrist.position) + lever),
        orientation=(x, y, z, w),
        flags=wrist.flags,
        linear_velocity=linear,
        angular_velocity=wrist.angular_velocity,
    )


def _vector(values: batch.Array) -> Vector:
    x, y, z = (float(part) for part in values)
    return x, y, z
