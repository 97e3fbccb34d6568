"""The person in the mirror: what the left arm did, the right one does, reflected in the world's plane x = 0."""

from __future__ import annotations

import msgspec

from arm_ik_service.exports.axes import Segment, mirrored_segment
from arm_ik_service.geometry import scalar as g
from arm_ik_service.wire.messages import ArmsState, ArmState, Bones, ControllerFrame, Pose, TrackedPose, Vector


def mirrored(state: ArmsState) -> ArmsState:
    """Reflect a state. Joint angles have equal signs on both sides, so they only change sides."""
    return msgspec.structs.replace(
        state, chest=_pose(state.chest), head=_pose(state.head), left=_arm(state.right), right=_arm(state.left)
    )


def mirrored_frame(frame: ControllerFrame) -> ControllerFrame:
    """Reflect the devices that a state answers."""
    return msgspec.structs.replace(
        frame, head=_device(frame.head), left=_device(frame.right), right=_device(frame.left)
    )


def _pose(pose: Pose) -> Pose:
    return Pose(g.mirror_vector(pose.position), g.mirror_rotation(pose.orientation))


def _arm(arm: ArmState) -> ArmState:
    bones = arm.bones
    return msgspec.structs.replace(
        arm,
        bones=Bones(
            clavicle=_segment("clavicle", bones.clavicle),
            upper_arm=_segment("upper_arm", bones.upper_arm),
            forearm=_segment("forearm", bones.forearm),
            hand=_segment("hand", bones.hand),
        ),
    )


def _segment(segment: Segment, pose: Pose) -> Pose:
    return Pose(g.mirror_vector(pose.position), mirrored_segment(segment, pose.orientation))


def _device(pose: TrackedPose | None) -> TrackedPose | None:
    if pose is None:
        return None
    spin = pose.angular_velocity
    return TrackedPose(
        g.mirror_vector(pose.position),
        g.mirror_rotation(pose.orientation),
        pose.flags,
        _optional(pose.linear_velocity),
        None if spin is None else (spin[0], -spin[1], -spin[2]),  # an axial vector
    )


def _optional(v: Vector | None) -> Vector | None:
    return None if v is None else g.mirror_vector(v)
