"""Virtual Motion Capture protocol (VMC), performer to marionette: a VRM humanoid's bones over OSC, usually port 39539.

Unity axes; local rotations relative to a T-pose (see `axes.py`), which is how VRM models are normalised. Positions are
those of the tracked person, not of the avatar: in a receiver that can apply either, choose rotations only (in EVMC4U
clear BonePositionSynchronize). Chaining positions and rotations from the root gives the published joints again.

The spine is not tracked: its joints are spread between hips and shoulders in proportion (fractions below), the lean of
the chest is all at `Spine`. Specification: protocol.vmc.info, version 2.5 messages for the marionette.
"""

from __future__ import annotations

from collections.abc import Iterator

from arm_ik_service.body.profile import UPPER_ARM_PER_STATURE
from arm_ik_service.exports.axes import UNITY
from arm_ik_service.exports.osc import Message
from arm_ik_service.exports.posture import Joint, Posture, in_parent, posture_of
from arm_ik_service.geometry import scalar as g
from arm_ik_service.wire.messages import ArmsState, ControllerFrame, Side, TrackedPose

LOWER_ARM_TWIST = 0.5  # of the pronation, as Unity spreads it by default; the rest is the hand's
CALIBRATED, NORMAL_MODE = 3, 0

# Shoulder line above the hip joints: 0.818 H - 0.530 H (Drillis & Contini). Joints on the way, as parts of that.
TRUNK_PER_STATURE = 0.288
SPINE, CHEST, UPPER_CHEST, SHOULDERS = 0.2, 0.25, 0.25, 0.3
NECK_PER_STATURE, HEAD_PER_STATURE = 0.02, 0.05  # neck above the shoulder line, head joint above the neck's

SIDE_NAMES: dict[Side, str] = {"left": "Left", "right": "Right"}


def arm_bones(posture: Posture, upper_chest: Joint) -> Iterator[tuple[str, Joint]]:
    """Give Unity's humanoid names and local joints of both arms, in our axes."""
    for side, arm in posture.arms():
        name = SIDE_NAMES[side]
        yield f"{name}Shoulder", in_parent(upper_chest, arm.clavicle)
        yield f"{name}UpperArm", in_parent(arm.clavicle, arm.upper_arm)
        yield f"{name}LowerArm", in_parent(arm.upper_arm, arm.lower_arm)
        yield f"{name}Hand", in_parent(arm.lower_arm, arm.hand)


class Vmc:
    """Turns states of one person into VMC messages; `T` counts from the first."""

    def __init__(self, lower_arm_twist: float = LOWER_ARM_TWIST) -> None:
        self._lower_arm_twist = lower_arm_twist
        self._start_ns: int | None = None

    def packets(self, state: ArmsState, frame: ControllerFrame | None) -> Iterator[list[Message]]:
        """Give the messages of one state in two packets, each small enough for one Ethernet frame.

        The first has availability, time, root, trunk and devices, the second the arms. `frame` is what the state
        answers: without it there is no headset and are no controllers.
        """
        if self._start_ns is None:
            self._start_ns = state.sample_time_ns
        posture = posture_of(state, self._lower_arm_twist)
        root, trunk, upper_chest = _trunk(posture)
        time_s = 1e-9 * (state.sample_time_ns - self._start_ns)
        yield [
            ("/VMC/Ext/OK", (1, CALIBRATED, NORMAL_MODE)),
            ("/VMC/Ext/T", (time_s,)),
            _placed("/VMC/Ext/Root/Pos", "root", root),
            *(_placed("/VMC/Ext/Bone/Pos", name, joint) for name, joint in trunk),
            *_devices(frame),
        ]
        yield [_placed("/VMC/Ext/Bone/Pos", name, joint) for name, joint in arm_bones(posture, upper_chest)]


def _trunk(posture: Posture) -> tuple[Joint, list[tuple[str, Joint]], Joint]:
    """Return the root on the floor, the local joints from hips to head, and the upper chest in the world."""
    arm = posture.right
    upper_arm_m = g.norm(g.subtract(arm.lower_arm.position, arm.upper_arm.position))
    stature_m = upper_arm_m / UPPER_ARM_PER_STATURE
    trunk_m = TRUNK_PER_STATURE * stature_m
    chest = posture.chest

    def above(part: float, joint: Joint) -> Joint:
        offset = g.rotate(joint.rotation, (0.0, part * trunk_m, 0.0))
        return Joint(g.add(joint.position, offset), joint.rotation)

    heading = g.heading(chest.rotation)
    upright = g.between((0.0, 0.0, -1.0), g.scale(1.0 / max(g.norm(heading), 1e-9), heading))
    spine = above(-(CHEST + UPPER_CHEST + SHOULDERS), chest)
    hips = above(-SPINE, Joint(spine.position, upright))
    root = Joint((hips.position[0], 0.0, hips.position[2]), upright)
    level, lean = (0.0, 0.0, 0.0, 1.0), g.multiply(g.conjugate(upright), chest.rotation)
    bones = [
        ("Hips", Joint((0.0, hips.position[1], 0.0), level)),
        ("Spine", Joint((0.0, SPINE * trunk_m, 0.0), lean)),
        ("Chest", Joint((0.0, CHEST * trunk_m, 0.0), level)),
        ("UpperChest", Joint((0.0, UPPER_CHEST * trunk_m, 0.0), level)),
        ("Neck", Joint((0.0, SHOULDERS * trunk_m + NECK_PER_STATURE * stature_m, 0.0), level)),
        (
            "Head",
            Joint(
                (0.0, HEAD_PER_STATURE * stature_m, 0.0),
                g.multiply(g.conjugate(chest.rotation), posture.head.rotation),
            ),
        ),
    ]
    return root, bones, above(-SHOULDERS, chest)


def _devices(frame: ControllerFrame | None) -> Iterator[Message]:
    if frame is None:
        return
    for address, serial, device in (
        ("/VMC/Ext/Hmd/Pos", "hmd", frame.head),
        ("/VMC/Ext/Con/Pos", "left", frame.left),
        ("/VMC/Ext/Con/Pos", "right", frame.right),
    ):
        if device is not None:
            yield _placed(address, serial, _joint(device))


def _joint(device: TrackedPose) -> Joint:
    return Joint(device.position, device.orientation)


def _placed(address: str, name: str, joint: Joint) -> Message:
    return address, (name, *UNITY.vector(joint.position), *UNITY.rotation(joint.rotation))
