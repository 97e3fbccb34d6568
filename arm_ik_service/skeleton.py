"""What does not change from frame to frame, as a message: lengths of the person, limits of the joints."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from arm_ik_service.arm.model import ANGLES, LIMITS, ArmModel
from arm_ik_service.body.profile import GripOffset, Profile
from arm_ik_service.wire.messages import VERSION, JointLimit, Pose, Skeleton


@lru_cache(maxsize=64)
def _joint_limits() -> tuple[JointLimit, ...]:
    model = ArmModel.load()
    flexion, abduction = model.swing_range
    ranges = [flexion, abduction, model.twist_range, *zip(model.lower, model.upper, strict=True)]
    return tuple(
        JointLimit(name, *np.asarray(limits, float).tolist()) for name, limits in zip(ANGLES, ranges, strict=True)
    )


def _pose(offset: GripOffset) -> Pose:
    return Pose(offset.position_m, offset.orientation_xyzw)


def skeleton_of(avatar: str, profile: Profile) -> Skeleton:
    """Describe one avatar. Raises ModelError where the model file cannot be read."""
    body = profile.body
    return Skeleton(
        version=VERSION,
        avatar=avatar,
        stature_m=body.stature_m,
        shoulder_width_m=body.shoulder_width,
        upper_arm_m=body.upper_arm,
        forearm_m=body.forearm,
        hand_m=body.hand,
        joint_limits=_joint_limits(),
        limit_names=LIMITS,
        left_wrist_from_grip=_pose(profile.grip.left),
        right_wrist_from_grip=_pose(profile.grip.right),
    )
