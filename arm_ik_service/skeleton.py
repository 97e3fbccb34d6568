"""What does not change from frame to frame, as a message: lengths of the person, limits of the joints."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from arm_ik_service.arm.model import ANGLES, LIMITS, ArmModel
from arm_ik_service.body.profile import BodyMeasures, GripOffset, Profile, RangesOfMotion
from arm_ik_service.wire.messages import VERSION, JointLimit, Pose, Skeleton, SwingRegion

EDGE_POINTS = 36  # of the swing region: every 10 degrees of azimuth, the edge being a series of four harmonics


@lru_cache(maxsize=64)
def _limits(ranges_of_motion: RangesOfMotion) -> tuple[tuple[JointLimit, ...], SwingRegion]:
    model = ArmModel.load(limits=ranges_of_motion.in_radians())
    flexion, abduction = model.swing_range
    ranges = [flexion, abduction, model.twist_range, *zip(model.lower, model.upper, strict=True)]
    limits = tuple(
        JointLimit(name, *np.asarray(limits, float).tolist()) for name, limits in zip(ANGLES, ranges, strict=True)
    )
    centre, edge = model.swing_outline(np.linspace(0.0, 2.0 * np.pi, EDGE_POINTS, endpoint=False))
    x, y, z = centre.tolist()
    return limits, SwingRegion((x, y, z), tuple((a, b, c) for a, b, c in edge.tolist()))


def _pose(offset: GripOffset) -> Pose:
    return Pose(offset.position_m, offset.orientation_xyzw)


def skeleton_of(avatar: str, profile: Profile, measures: BodyMeasures | None = None) -> Skeleton:
    """Describe one avatar; `measures` are those it has now, where they are learnt and no longer the profile's.

    Raises ModelError where the model file cannot be read.
    """
    body = measures or profile.body
    limits, swing = _limits(profile.limits_deg)
    return Skeleton(
        version=VERSION,
        avatar=avatar,
        stature_m=body.stature_m,
        shoulder_width_m=body.shoulder_width,
        upper_arm_m=body.upper_arm,
        forearm_m=body.forearm,
        hand_m=body.hand,
        joint_limits=limits,
        limit_names=LIMITS,
        left_wrist_from_grip=_pose(profile.grip.left),
        right_wrist_from_grip=_pose(profile.grip.right),
        shoulder_swing=swing,
    )
