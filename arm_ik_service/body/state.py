"""What the body stage knows of one person: measures, the pose of the chest in time, and what the arms are asked."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from arm_ik_service.body.profile import GripOffset, Profile
from arm_ik_service.compiled import Record, record_dtype
from arm_ik_service.geometry import batch
from arm_ik_service.geometry.scalar import IDENTITY

POSE = record_dtype([("position", np.float64, (3,)), ("rotation", np.float64, (4,))])
TARGET = record_dtype(
    [
        # of the wrist frame in the shoulder frame of its side, after the soft reach clamp
        ("position", np.float64, (3,)),
        ("rotation", np.float64, (4,)),
        ("linear_velocity", np.float64, (3,)),
        ("angular_velocity", np.float64, (3,)),
    ]
)
BODY = record_dtype(
    [
        # measures, from the profile
        ("arm_length", np.float64),  # shoulder to wrist, straight
        ("half_width", np.float64),  # of the shoulders
        ("grip_from_wrist", POSE, (2,)),
        # the answer, in world axes; left, right
        ("head_position", np.float64, (3,)),
        ("head_rotation", np.float64, (4,)),
        ("chest_position", np.float64, (3,)),  # midway between the shoulders at rest
        ("chest_rotation", np.float64, (4,)),
        ("clavicles", POSE, (2,)),  # at the sternoclavicular joints: +X anterior, +Y up, +Z along the bone to the right
        ("shoulders", np.float64, (2, 3)),  # glenohumeral joints
        ("wrists", POSE, (2,)),  # as asked for, before the clamp
        ("targets", TARGET, (2,)),
        ("reach_ratio", np.float64, (2,)),  # shoulder to wrist asked for, over arm_length
        # memory
        ("started", np.int64),
        ("yaw", np.float64),  # of the chest, about +Y
    ]
)


def _inverse_offset(offset: GripOffset) -> npt.NDArray[np.float64]:
    rotation = batch.normalized(offset.orientation_xyzw)
    return batch.inverse(np.concatenate([offset.position_m, rotation]))


def initialise_body(body: Record, profile: Profile) -> None:
    """Set a BODY record to the measures of `profile`; its pose follows from the first frame."""
    for name in BODY.names or ():
        body[name] = np.zeros((), BODY[name])
    body.arm_length = profile.body.upper_arm + profile.body.forearm
    body.half_width = 0.5 * profile.body.shoulder_width
    for k, offset in enumerate((profile.grip.left, profile.grip.right)):
        pose = _inverse_offset(offset)
        body.grip_from_wrist[k].position[:], body.grip_from_wrist[k].rotation[:] = pose[:3], pose[3:]
    for q in (body.head_rotation, body.chest_rotation):
        q[:] = IDENTITY
    for k in range(2):
        for pose_record in (body.clavicles[k], body.wrists[k], body.targets[k]):
            pose_record.rotation[:] = IDENTITY
