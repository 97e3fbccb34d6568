"""People in postures that are known from their joint angles: chest, arms and hands by forward kinematics of our own.

Nothing of `arm_ik_service.exports` is used here, so that exports can be held to it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from arm_ik_service.body.shoulders import STERNOCLAVICULAR
from arm_ik_service.geometry import batch
from arm_ik_service.wire.messages import (
    SIDES,
    VERSION,
    ArmsState,
    ArmState,
    Bones,
    ControllerFrame,
    IsbShoulder,
    JointAngles,
    Pose,
    Side,
    TrackedPose,
    TrackingState,
)

Array = npt.NDArray[np.float64]
UPPER_ARM_M, FOREARM_M, HALF_WIDTH_M = 0.30, 0.26, 0.18
CHEST_HEIGHT_M, EYES_ABOVE_CHEST = 1.40, np.array([0.0, 0.22, -0.10])
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Arm:
    """The angles [deg] that are not zero with the arm hanging and the palm to the front."""

    abduction: float = 0.0
    flexion: float = 0.0
    twist: float = 0.0
    elbow: float = 0.0
    carrying: float = 0.0
    pronation: float = 0.0
    wrist_flexion: float = 0.0
    deviation: float = 0.0
    axial: float = 0.0


T = Arm(abduction=90.0, pronation=90.0)
HANGING = Arm(pronation=90.0)
RAISED = Arm(abduction=179.0, pronation=90.0)  # straight up
FORWARD = Arm(flexion=90.0, pronation=90.0)
BENT = Arm(abduction=90.0, elbow=90.0, pronation=90.0)  # from the T-pose, the forearm to the front


def _about(axis: int, angle_deg: float) -> Array:
    return batch.exp(np.eye(3)[axis] * np.radians(angle_deg))


def _clavicle() -> Array:
    root = HALF_WIDTH_M * np.array(STERNOCLAVICULAR)
    bone = np.array([HALF_WIDTH_M, 0.0, 0.0]) - root
    bone /= np.linalg.norm(bone)
    anterior = np.cross([0.0, 1.0, 0.0], bone)
    anterior /= np.linalg.norm(anterior)
    return np.concatenate([root, batch.from_matrix(np.stack([anterior, np.cross(bone, anterior), bone], axis=-1))])


CLAVICLE = _clavicle()  # of the right side, at rest, from the chest
# OpenXR's wrist axes (-Z to the fingers, +Y out of the back of the hand) in ISB's, columns x, y, z
ISB_FROM_WRIST = batch.from_matrix(np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]))


def _right_arm(arm: Arm) -> dict[str, Array]:
    """Poses (7,) of the right arm's bones in the chest's axes, from the chest."""
    swing = batch.exp(np.radians([-arm.abduction, 0.0, arm.flexion]))
    upper = batch.multiply(_about(1, 90.0), batch.multiply(swing, _about(1, arm.twist)))  # ISB from OpenXR axes at rest
    elbow = batch.multiply(_about(2, arm.elbow), batch.multiply(_about(0, arm.carrying), _about(1, arm.pronation)))
    wrist = batch.multiply(_about(2, arm.wrist_flexion), batch.multiply(_about(0, arm.deviation), _about(1, arm.axial)))
    fore = batch.multiply(upper, elbow)
    isb_hand = batch.multiply(fore, wrist)
    hand = batch.multiply(isb_hand, ISB_FROM_WRIST)
    shoulder = np.array([HALF_WIDTH_M, 0.0, 0.0])
    elbow_at = shoulder + batch.rotate(upper, np.array([0.0, -UPPER_ARM_M, 0.0]))
    wrist_at = elbow_at + batch.rotate(fore, np.array([0.0, -FOREARM_M, 0.0]))
    return {
        "clavicle": CLAVICLE,
        "upper_arm": np.concatenate([shoulder, upper]),
        "forearm": np.concatenate([elbow_at, fore]),
        "hand": np.concatenate([wrist_at, hand]),
    }


def _on_the_left(name: str, pose: Array) -> Array:
    """Reflect a pose (7,). ISB bones keep +Z to the person's right, so their own z is reflected and not their x."""
    across = np.diag([-1.0, 1.0, 1.0])
    own = across if name == "hand" else np.diag([1.0, 1.0, -1.0])
    rotation = batch.from_matrix(across @ batch.matrix(pose[3:]) @ own)
    return np.concatenate([across @ pose[:3], rotation])


def _pose(pose: Array) -> Pose:
    x, y, z, qx, qy, qz, qw = (float(v) for v in pose)
    return Pose((x, y, z), (qx, qy, qz, qw))


def _state(arm: Arm, bones: Bones, tracking: TrackingState) -> ArmState:
    in_order = (
        *(arm.flexion, arm.abduction, arm.twist, arm.elbow, arm.carrying, arm.pronation),
        *(arm.wrist_flexion, arm.deviation, arm.axial),
    )
    angles = JointAngles(*(float(np.radians(angle)) for angle in in_order))
    rates = JointAngles(*(0.1 * (i + 1) for i in range(9)))
    return ArmState(
        tracking=tracking,
        position_tracking=tracking,
        orientation_tracking=tracking,
        configuration=(0.0, 0.0, 0.0, 1.0, *([0.0] * 6)),
        velocity=(0.0,) * 9,
        angles=angles,
        angle_rates=rates,
        isb_shoulder=IsbShoulder(0.0, 0.0, 0.0, singular=True),
        bones=bones,
        position_error_m=1e-4,
        orientation_error_rad=1e-3,
        reach_ratio=0.9,
        iterations=5,
        limits=("elbow_flexion",),
        elbow_confidence=0.5,
    )


def person(
    left: Arm = HANGING,
    right: Arm = HANGING,
    *,
    at: tuple[float, float] = (0.0, 0.0),
    yaw_deg: float = 0.0,
    lean_deg: float = 0.0,
    head_pitch_deg: float = 0.0,
    avatar: str = "ann",
    seq: int = 0,
    sample_time_ns: int = 5_000_000_000,
    tracking: TrackingState = "tracked",
) -> ArmsState:
    """Return a person at (x, z) [m] who faces -z, turned to the left by `yaw_deg` and leaning forward by `lean_deg`."""
    heading = _about(1, yaw_deg)
    chest = np.array([at[0], CHEST_HEIGHT_M, at[1], *batch.multiply(heading, _about(0, -lean_deg))])
    head_rotation = batch.multiply(heading, _about(0, -head_pitch_deg))
    head = np.concatenate([chest[:3] + batch.rotate(heading, EYES_ABOVE_CHEST), head_rotation])
    arms: dict[Side, ArmState] = {}
    for side, arm in zip(SIDES, (left, right), strict=True):
        poses: dict[str, Any] = _right_arm(arm)
        if side == "left":
            poses = {name: _on_the_left(name, pose) for name, pose in poses.items()}
        bones = Bones(**{name: _pose(batch.compose(chest, pose)) for name, pose in poses.items()})
        arms[side] = _state(arm, bones, tracking)
    return ArmsState(
        version=VERSION,
        avatar=avatar,
        seq=seq,
        sample_time_ns=sample_time_ns,
        receive_time_ns=sample_time_ns + 1_000_000,
        solve_time_ns=20_000,
        publish_time_ns=sample_time_ns + 1_100_000,
        chest=_pose(chest),
        head=_pose(head),
        left=arms["left"],
        right=arms["right"],
    )


def frame_of(state: ArmsState) -> ControllerFrame:
    """Return a frame that the state could answer: the hands' poses are the controllers'."""
    left, right = state.left.bones.hand, state.right.bones.hand
    return ControllerFrame(
        version=VERSION,
        seq=state.seq,
        sample_time_ns=state.sample_time_ns,
        publish_time_ns=state.sample_time_ns,
        space="stage",
        head=TrackedPose(state.head.position, state.head.orientation),
        left=TrackedPose(left.position, left.orientation),
        right=TrackedPose(right.position, right.orientation),
    )


def motion(count: int, *, avatar: str = "ann", hz: float = 90.0) -> list[ArmsState]:
    """Return states of a person who waves and turns with everything that can move."""
    states = []
    for k in range(count):
        a, b = np.sin(0.05 * k), np.cos(0.031 * k)
        arm = Arm(60 + 50 * a, 40 * b, 30 * a, 60 + 55 * b, -5 + 5 * a, 90 + 70 * a, 30 * b, 10 * a, 5 * b)
        other = Arm(30 + 20 * b, 70 * a, -40 * b, 70 + 60 * a, -3, 80 + 60 * b, -30 * a, 15 * b, -5 * a)
        states.append(
            person(
                arm,
                other,
                at=(0.3 * a, 0.2 * b),
                yaw_deg=3.0 * k,
                lean_deg=10 * b,
                head_pitch_deg=30 * a,
                avatar=avatar,
                seq=k,
                sample_time_ns=1_000_000_000 + round(k * 1e9 / hz),
            )
        )
    return states
