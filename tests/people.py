"""People whose arms stand where the caller says: frames and answers that need no solver."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from arm_ik_service.geometry import batch
from arm_ik_service.io.rerun_view.entities import grips_of
from arm_ik_service.wire.messages import (
    VERSION,
    ArmsState,
    ArmState,
    Bones,
    ControllerFrame,
    IsbShoulder,
    JointAngles,
    JointLimit,
    Pose,
    Quaternion,
    Side,
    Skeleton,
    TrackedPose,
    TrackingState,
    Vector,
)

Answer = tuple[ControllerFrame, ArmsState]
MILLISECOND = 1_000_000
STEP_NS = 11 * MILLISECOND
SKELETON = Skeleton(
    version=VERSION,
    avatar="ann",
    stature_m=1.75,
    shoulder_width_m=0.36,
    upper_arm_m=0.30,
    forearm_m=0.26,
    hand_m=0.19,
    joint_limits=(JointLimit("elbow_flexion", 0.0, 2.6),),
    limit_names=(),
)


def _turned(axis: Vector, angle: float) -> Quaternion:
    x, y, z, w = batch.exp(np.array(axis) * angle)
    return (float(x), float(y), float(z), float(w))


def _posed(position: Any, rotation: Quaternion) -> Pose:
    x, y, z = (float(value) for value in position)
    return Pose((x, y, z), rotation)


def _arm(side: Side, lift: float, state: TrackingState = "tracked") -> ArmState:
    """A straight arm lifted sideways by `lift` [rad] from hanging."""
    sign = 1.0 if side == "right" else -1.0
    rotation = _turned((0.0, 0.0, 1.0), sign * lift)
    shoulder = np.array([0.18 * sign, 1.4, 0.0])
    elbow = shoulder + batch.rotate(rotation, (0.0, -SKELETON.upper_arm_m, 0.0))
    wrist = elbow + batch.rotate(rotation, (0.0, -SKELETON.forearm_m, 0.0))
    down = _turned((1.0, 0.0, 0.0), -0.5 * math.pi)  # the hand's -Z to where the arm's -Y points
    x, y, z, w = batch.multiply(rotation, down)
    bones = Bones(
        clavicle=Pose((0.03 * sign, 1.38, -0.06), rotation),
        upper_arm=_posed(shoulder, rotation),
        forearm=_posed(elbow, rotation),
        hand=_posed(wrist, (float(x), float(y), float(z), float(w))),
    )
    angles = [lift + 0.1 * k for k in range(9)]
    return ArmState(
        tracking=state,
        position_tracking=state,
        orientation_tracking="tracked",
        configuration=(0.0,) * 10,
        velocity=(0.0,) * 9,
        angles=JointAngles(*angles),
        angle_rates=JointAngles(*(-angle for angle in angles)),
        isb_shoulder=IsbShoulder(0.0, 0.0, 0.0, singular=False),
        bones=bones,
        position_error_m=0.001 * lift,
        orientation_error_rad=0.0,
        reach_ratio=0.9,
        iterations=5,
        limits=(),
        elbow_confidence=1.0,
    )


def _grip(side: Side, arm: ArmState, error: Vector = (0.0, 0.0, 0.0)) -> TrackedPose:
    grip, hand = grips_of(SKELETON)[side], arm.bones.hand
    pose = batch.compose([*hand.position, *hand.orientation], [*grip.position, *grip.orientation])
    x, y, z = (float(v) for v in pose[:3] + np.array(error))
    a, b, c, d = (float(v) for v in pose[3:])
    return TrackedPose((x, y, z), (a, b, c, d))


def answer(
    seq: int, *, avatar: str = "ann", lifts: tuple[float, float] | None = None, right: TrackingState = "tracked"
) -> Answer:
    """A frame and its answer; the right hand asks for 2 cm more height than it gets. Lifts of left and right [rad]."""
    lifts = lifts or (0.2 + 0.01 * seq, 0.1 + 0.005 * seq)
    left_arm, right_arm = _arm("left", lifts[0]), _arm("right", lifts[1], right)
    sample = 5_000_000_000 + seq * STEP_NS
    head = Pose((0.0, 1.64, -0.09), (0.0, 0.0, 0.0, 1.0))
    frame = ControllerFrame(
        version=VERSION,
        seq=seq,
        sample_time_ns=sample,
        publish_time_ns=10**18,
        space="stage",
        head=TrackedPose(head.position, head.orientation),
        left=_grip("left", left_arm),
        right=_grip("right", right_arm, (0.0, 0.02, 0.0)),
    )
    arms = ArmsState(
        version=VERSION,
        avatar=avatar,
        seq=seq,
        sample_time_ns=sample,
        receive_time_ns=10**18 + 2 * MILLISECOND,
        solve_time_ns=MILLISECOND // 4,
        publish_time_ns=10**18 + 3 * MILLISECOND,
        chest=Pose((0.0, 1.4, 0.0), (0.0, 0.0, 0.0, 1.0)),
        head=head,
        left=left_arm,
        right=right_arm,
    )
    return frame, arms
