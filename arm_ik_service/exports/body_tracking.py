"""OpenXR's own vocabulary: the joints of XR_FB_body_tracking that an arm has, by name and index, with location flags.

World axes are OpenXR's already. Bone axes are those of Meta's runtimes (`axes.py`). ARM_LOWER is the forearm as the
elbow holds it, HAND_WRIST_TWIST the same bone at the wrist with all of the pronation. The scapula moves with the
clavicle here, and lies at the shoulder joint. PALM is halfway along the hand.
"""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from arm_ik_service.exports.axes import FB_ARM, FB_HAND
from arm_ik_service.exports.posture import Joint, posture_of
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Quaternion, Vector
from arm_ik_service.wire.messages import (
    FULLY_TRACKED,
    ORIENTATION_TRACKED,
    ORIENTATION_VALID,
    POSITION_TRACKED,
    POSITION_VALID,
    VERSION,
    ArmsState,
    ArmState,
    Side,
)

PALM_M = 0.075  # wrist joint to palm centroid along the hand, as for the grip pose

# XrBodyJointFB, OpenXR 1.1 registry
INDICES: dict[Side, dict[str, int]] = {
    "left": {
        "SHOULDER": 8,
        "SCAPULA": 9,
        "ARM_UPPER": 10,
        "ARM_LOWER": 11,
        "HAND_WRIST_TWIST": 12,
        "HAND_PALM": 18,
        "HAND_WRIST": 19,
    },
    "right": {
        "SHOULDER": 13,
        "SCAPULA": 14,
        "ARM_UPPER": 15,
        "ARM_LOWER": 16,
        "HAND_WRIST_TWIST": 17,
        "HAND_PALM": 44,
        "HAND_WRIST": 45,
    },
}


class BodyJoint(msgspec.Struct, frozen=True):
    """One joint location, as XrBodyJointLocationFB has it."""

    index: int
    name: str  # XR_BODY_JOINT_..._FB
    flags: int  # XrSpaceLocationFlags
    position: Vector
    orientation: Quaternion


class BodyJoints(msgspec.Struct, frozen=True):
    """The joints of one state, on `avatar/<id>/xr_fb_body_tracking`, in world axes."""

    version: int
    avatar: str
    seq: int
    sample_time_ns: int
    joints: tuple[BodyJoint, ...]


def body_joints(state: ArmsState) -> BodyJoints:
    """Name the joints of one state, by index in ascending order."""
    joints = sorted(_joints(state), key=lambda joint: joint.index)
    return BodyJoints(VERSION, state.avatar, state.seq, state.sample_time_ns, tuple(joints))


def _joints(state: ArmsState) -> Iterator[BodyJoint]:
    full, bare = posture_of(state), posture_of(state, lower_arm_twist=0.0)
    states: dict[Side, ArmState] = {"left": state.left, "right": state.right}
    for (side, arm), (_, as_held) in zip(full.arms(), bare.arms(), strict=True):
        arm_axes, hand_axes = FB_ARM[side], FB_HAND[side]
        wrist = Joint(arm.hand.position, g.multiply(arm.hand.rotation, hand_axes))
        along = PALM_M if side == "right" else -PALM_M  # +X to the fingers on the right, away from them on the left
        palm = g.add(wrist.position, g.rotate(wrist.rotation, (along, 0.0, 0.0)))
        girdle = g.multiply(arm.clavicle.rotation, arm_axes)
        placed = {
            "SHOULDER": Joint(arm.clavicle.position, girdle),
            "SCAPULA": Joint(arm.upper_arm.position, girdle),
            "ARM_UPPER": Joint(arm.upper_arm.position, g.multiply(arm.upper_arm.rotation, arm_axes)),
            "ARM_LOWER": Joint(arm.lower_arm.position, g.multiply(as_held.lower_arm.rotation, arm_axes)),
            "HAND_WRIST_TWIST": Joint(arm.hand.position, g.multiply(arm.lower_arm.rotation, arm_axes)),
            "HAND_PALM": Joint(palm, wrist.rotation),
            "HAND_WRIST": wrist,
        }
        flags = _flags(states[side])
        for name, index in INDICES[side].items():
            joint = placed[name]
            yield BodyJoint(index, f"XR_BODY_JOINT_{side.upper()}_{name}_FB", flags, joint.position, joint.rotation)


def _flags(arm: ArmState) -> int:
    """XrSpaceLocationFlags of an arm: only a tracked hand makes a tracked arm, only a lost one an invalid one."""
    flags = FULLY_TRACKED
    if arm.position_tracking != "tracked":
        flags &= ~POSITION_TRACKED
    if arm.position_tracking == "lost":
        flags &= ~POSITION_VALID
    if arm.orientation_tracking != "tracked":
        flags &= ~ORIENTATION_TRACKED
    if arm.orientation_tracking == "lost":
        flags &= ~ORIENTATION_VALID
    return flags


SCHEMA_NAME = "arm_ik.BodyJoints"


def key(avatar: str, prefix: str = "") -> str:
    """Return the key expression and the topic of an avatar's body joints."""
    under = f"{prefix}/" if prefix else ""
    return f"{under}avatar/{avatar}/xr_fb_body_tracking"


def encode(joints: BodyJoints) -> bytes:
    """Return the message as JSON."""
    return msgspec.json.encode(joints)


def json_schema() -> bytes:
    """Return the JSON Schema of the message."""
    return msgspec.json.encode(msgspec.json.schema(BodyJoints))
