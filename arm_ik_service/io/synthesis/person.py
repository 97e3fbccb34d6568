"""One person in a posture: from trunk, gaze and joint-like hand postures to the poses of headset and grips.

The hand is not placed by its rotation: it hangs on a forearm that the elbow's place decides, and only pronation and
the two wrist angles are chosen. So whatever a scene asks for, the wrist is one that a person has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from arm_ik_service.geometry import batch
from arm_ik_service.geometry.batch import Array

STATURE_M = 1.75
UPPER_ARM_M = 0.186 * STATURE_M  # this and the next three: Drillis & Contini, in Winter, table 4.1
FOREARM_M = 0.146 * STATURE_M
SHOULDER_HEIGHT_M = 0.818 * STATURE_M
HIP_HEIGHT_M = 0.53 * STATURE_M
HALF_SHOULDER_WIDTH_M = 0.103 * STATURE_M  # to the glenohumeral joint
ARM_M = UPPER_ARM_M + FOREARM_M

NECK_ABOVE_SHOULDERS_M = 0.107  # puts the eyes of an upright person at 0.936 of the stature
HEAD_FROM_NECK = np.array([0.0, 0.1, -0.09])  # headset over the joint between head and neck
PROTRACTION_M = 0.05  # how far the shoulder girdle follows a hand at full reach
LONGEST_REACH = 0.985  # of the arm: nobody moves with locked elbows

# wrist_from_grip of a right hand in the OpenXR wrist frame; the left one is its mirror image
WRIST_FROM_GRIP = np.array([0.0, -0.02, -0.075, 0.5, 0.5, 0.5, 0.5])


@dataclass(frozen=True)
class Posture:
    """A person at N instants. Angles in radians; yaw is positive to the left, pitch upwards, lean forwards."""

    pelvis: Array  # (N,3) [m] displacement from standing upright on the origin
    trunk: Array  # (N,2) yaw of the shoulders, lean
    gaze: Array  # (N,2) yaw and pitch of the head, in the world
    left: Array  # (N,7) see `hand`
    right: Array  # (N,7) x y z of the wrist [m], pronation, wrist flexion, wrist deviation, elbow lift


@dataclass(frozen=True)
class Poses:
    """What the sensors are to see, and what they cannot: world poses (N,7) and points (N,3)."""

    head: Array
    left: Array
    right: Array
    left_shoulder: Array
    right_shoulder: Array
    left_elbow: Array
    right_elbow: Array
    left_wrist: Array
    right_wrist: Array


def _about(axis: tuple[float, float, float], angle: npt.ArrayLike) -> Array:
    return batch.exp(np.asarray(angle)[..., None] * np.array(axis))


def pose_person(posture: Posture) -> Poses:
    """Place a person. Wrists out of reach are drawn in; everything else is as asked."""
    yaw = _about((0, 1, 0), posture.trunk[:, 0])
    spine = batch.multiply(yaw, _about((1, 0, 0), -posture.trunk[:, 1]))
    hips = posture.pelvis + np.array([0.0, HIP_HEIGHT_M, 0.0])
    girdle = hips + batch.rotate(spine, [0.0, SHOULDER_HEIGHT_M - HIP_HEIGHT_M, 0.0])
    neck = girdle + batch.rotate(spine, [0.0, NECK_ABOVE_SHOULDERS_M, 0.0])
    gaze = batch.multiply(_about((0, 1, 0), posture.gaze[:, 0]), _about((1, 0, 0), posture.gaze[:, 1]))
    head = np.concatenate([neck + batch.rotate(gaze, HEAD_FROM_NECK), gaze], axis=1)
    world_from_girdle = np.concatenate([girdle, yaw], axis=1)
    # the left hand is asked for and placed as a right one, then reflected
    right = [batch.compose(world_from_girdle, part) for part in _arm(posture.right)]
    left = [batch.compose(world_from_girdle, batch.mirror_pose(part)) for part in _arm(posture.left)]
    return Poses(
        head,
        *(left[3], right[3]),
        *(left[0][:, :3], right[0][:, :3]),
        *(left[1][:, :3], right[1][:, :3]),
        *(left[2][:, :3], right[2][:, :3]),
    )


def _arm(hand: Array) -> tuple[Array, Array, Array, Array]:
    """Shoulder, elbow, wrist and grip poses (N,7) of a right arm, in the girdle frame: origin between the shoulders.

    `hand` (N,7): wrist there [m], x to the right, y up, z back; pronation (0 palm up, 90 degrees thumb up), wrist
    flexion, ulnar deviation, and the lift of the elbow from below the arm (0) to beside it (90 degrees) [rad].
    """
    asked, (pronation, flexion, deviation, lift) = hand[:, :3], hand[:, 3:].T
    shoulder = np.broadcast_to([HALF_SHOULDER_WIDTH_M, 0.0, 0.0], asked.shape)
    reach = np.linalg.norm(asked - shoulder, axis=1, keepdims=True)
    towards = (asked - shoulder) / reach
    shoulder = shoulder + PROTRACTION_M * _smooth(reach / ARM_M, 0.6, 1.1) * towards * [0.5, 0.5, 1.0]
    reach = np.linalg.norm(asked - shoulder, axis=1, keepdims=True)
    axis = (asked - shoulder) / reach
    reach = np.minimum(reach, LONGEST_REACH * ARM_M)
    wrist = shoulder + reach * axis

    beside, below = np.sin(lift)[:, None], np.cos(lift)[:, None]
    # an elbow hangs down, a little out and back: back is where it goes when the arm hangs
    wanted = below * batch.normalized([0.14, -1.0, 0.45]) + beside * batch.normalized([1.0, -0.1, 0.2])
    across = wanted - np.sum(wanted * axis, axis=1, keepdims=True) * axis
    across = batch.normalized(across)
    along = (UPPER_ARM_M**2 - FOREARM_M**2 + reach**2) / (2.0 * reach)
    elbow = shoulder + along * axis + np.sqrt(np.maximum(UPPER_ARM_M**2 - along**2, 0.0)) * across

    # the forearm's ISB axes: y from wrist to elbow, z the elbow's hinge (to the right), x where flexion goes
    y = batch.normalized(elbow - wrist)
    z = batch.normalized(np.cross(shoulder - elbow, y))
    forearm = batch.from_matrix(np.stack([np.cross(y, z), y, z], axis=-1))
    hand_isb = forearm
    for about, angle in (((0, 1, 0), pronation), ((0, 0, 1), flexion), ((1, 0, 0), deviation)):
        hand_isb = batch.multiply(hand_isb, _about(about, angle))
    # columns: the axes of the OpenXR wrist frame: z is y, away from the fingers; y is -x, out of the back of the hand
    isb_from_xr = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
    wrist_rotation = batch.multiply(hand_isb, batch.from_matrix(isb_from_xr))
    grip = batch.compose(np.concatenate([wrist, wrist_rotation], axis=1), WRIST_FROM_GRIP)
    still = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (len(hand), 4))
    return (
        np.concatenate([shoulder, still], axis=1),
        np.concatenate([elbow, forearm], axis=1),
        np.concatenate([wrist, wrist_rotation], axis=1),
        grip,
    )


def _smooth(x: Array, low: float, high: float) -> Array:
    s = np.clip((x - low) / (high - low), 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)
