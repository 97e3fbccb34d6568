"""What the body stage knows of one person: measures, the pose of the chest in time, and what the arms are asked."""

from __future__ import annotations

import numpy as np

from arm_ik_service.body.grip import GRIP
from arm_ik_service.body.learning import LEARNING
from arm_ik_service.compiled import record_dtype

ARM_LENGTH_OF_FIT = 0.56  # [m] of the people that the body's constants are from: lengths scale with the arm's

POSE = record_dtype([("position", np.float64, (3,)), ("rotation", np.float64, (4,))])
FOLLOWER = record_dtype([("at", np.float64, (3,)), ("rate", np.float64, (3,))])
TARGET = record_dtype(
    [
        # of the wrist frame in the shoulder frame of its side, after the soft reach clamp
        ("position", np.float64, (3,)),
        ("rotation", np.float64, (4,)),
        ("linear_velocity", np.float64, (3,)),
        ("angular_velocity", np.float64, (3,)),
        ("carried_linear_velocity", np.float64, (3,)),  # of the shoulder frame itself in the world, in its axes
        ("carried_angular_velocity", np.float64, (3,)),
    ]
)
BODY = record_dtype(
    [
        # measures: from the profile, or learnt where it leaves them open
        ("stature", np.float64),
        ("arm_length", np.float64),  # shoulder to wrist, straight
        ("upper_arm", np.float64),
        ("forearm", np.float64),
        ("half_width", np.float64),  # of the shoulders
        ("wrist_in_grip", np.float64, (2, 4)),  # rotation of the wrist in the grip's frame, as the profile has it
        ("grip_in_wrist", np.float64, (2, 3)),  # place of the grip in the wrist's frame, as the profile has it [m]
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
        ("since_s", np.float64),  # since the first frame
        ("trust", np.float64, (2,)),  # in what each hand says of the chest: 1 while it is seen, 0 once it is lost
        ("yaw", np.float64),  # of the chest, about +Y
        ("yaw_rate", np.float64),  # [rad/s] with which it follows
        ("neck", FOLLOWER),  # what the head turns on, in world axes
        ("forearms", FOLLOWER, (2,)),  # from each wrist to its elbow as the hand shows it, in axes that share the yaw
        ("gives", FOLLOWER),  # rotation vector [rad] by which it gives way to the arms, in its own axes: see body.trunk
        ("tilt", FOLLOWER),  # the chest's up over its y, in axes that share its yaw
        ("recentres", np.int64),  # of tracking, that the memory in world axes was moved along with
        ("lengths", FOLLOWER),  # upper arm, forearm and stature, where they are being learnt
        ("learning", LEARNING),
        ("grip", GRIP),
        ("settled", np.float64),  # how far the shoulders have been found to sit below where they were thought to be
    ]
)
