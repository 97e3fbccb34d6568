"""VMC and VRChat: what a receiver built from the protocol's own library makes of it is the published state."""

from __future__ import annotations

import socket
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from postures import BENT, FORWARD, HANGING, RAISED, T, frame_of, motion, person
from pythonosc.osc_packet import OscPacket

from arm_ik_service.exports.mirror import mirrored
from arm_ik_service.exports.osc import Message, OscTarget, bundle
from arm_ik_service.exports.vmc import Vmc
from arm_ik_service.exports.vrchat import messages as vrchat_messages
from arm_ik_service.wire.messages import ArmsState

Array = npt.NDArray[np.float64]
PARENTS = {  # Unity's HumanBodyBones
    "Hips": "root",
    "Spine": "Hips",
    "Chest": "Spine",
    "UpperChest": "Chest",
    "Neck": "UpperChest",
    "Head": "Neck",
    **{
        f"{side}{bone}": parent.format(side=side)
        for side in ("Left", "Right")
        for bone, parent in (
            ("Shoulder", "UpperChest"),
            ("UpperArm", "{side}Shoulder"),
            ("LowerArm", "{side}UpperArm"),
            ("Hand", "{side}LowerArm"),
        )
    },
}


def received(messages: Iterable[Message]) -> list[tuple[str, list[Any]]]:
    """Send messages through a real socket and read them with python-osc's parser."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(5.0)
        target = OscTarget("127.0.0.1", listener.getsockname()[1])
        target.send(messages)
        target.close()
        packet = OscPacket(listener.recv(65536))
    return [(timed.message.address, timed.message.params) for timed in packet.messages]


def unity_matrix(q: Iterable[float]) -> Array:
    """Rotation matrix as Unity makes it of a quaternion: the textbook formula, in its left-handed axes."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


class Receiver:
    """A VMC marionette: it keeps what it hears and chains the bones."""

    def __init__(self, state: ArmsState, twist: float = 1.0) -> None:
        self.bones: dict[str, tuple[Array, Array]] = {}
        self.devices: dict[str, Array] = {}
        self.others: dict[str, list[Any]] = {}
        for messages in Vmc(twist).packets(state, frame_of(state)):
            assert len(bundle(messages)) < 1472  # an Ethernet frame less IP and UDP headers
            for address, params in received(messages):
                if address in ("/VMC/Ext/Bone/Pos", "/VMC/Ext/Root/Pos"):
                    self.bones[params[0]] = (np.array(params[1:4]), unity_matrix(params[4:8]))
                elif address in ("/VMC/Ext/Hmd/Pos", "/VMC/Ext/Con/Pos"):
                    self.devices[params[0]] = np.array(params[1:])
                else:
                    self.others[address] = params

    def world(self, bone: str) -> tuple[Array, Array]:
        position, rotation = self.bones[bone]
        if bone == "root":
            return position, rotation
        parent_position, parent_rotation = self.world(PARENTS[bone])
        return parent_position + parent_rotation @ position, parent_rotation @ rotation


def unity(v: Iterable[float]) -> Array:
    return np.array([*v]) * (1.0, 1.0, -1.0)


def test_a_t_pose_is_identity_rotations_and_straight_arms() -> None:
    receiver = Receiver(person(T, T))
    for bone in PARENTS:
        np.testing.assert_allclose(receiver.bones[bone][1], np.eye(3), atol=1e-6)
    assert receiver.bones["RightLowerArm"][0] == pytest.approx((0.30, 0.0, 0.0), abs=1e-6)
    assert receiver.bones["LeftHand"][0] == pytest.approx((-0.26, 0.0, 0.0), abs=1e-6)


def test_a_raised_right_arm_is_a_raised_right_arm() -> None:
    receiver = Receiver(person(HANGING, RAISED))
    right, left = receiver.world("RightHand")[0], receiver.world("LeftHand")[0]
    assert right[0] > 0.1  # Unity's +x is the person's right
    assert left[0] < -0.1
    assert right[1] > 1.8 > 1.0 > left[1]


def test_an_arm_to_the_front_points_along_unitys_z() -> None:
    receiver = Receiver(person(HANGING, FORWARD))
    hand, shoulder = receiver.world("RightHand")[0], receiver.world("RightUpperArm")[0]
    np.testing.assert_allclose(hand - shoulder, (0.0, 0.0, 0.56), atol=1e-5)


def test_an_elbow_bent_from_the_t_pose_turns_about_the_vertical_so_that_the_hand_comes_forward() -> None:
    receiver = Receiver(person(BENT, BENT))
    for side, sign in (("Right", -1.0), ("Left", 1.0)):
        np.testing.assert_allclose(receiver.bones[f"{side}LowerArm"][1][:, 1], (0.0, 1.0, 0.0), atol=1e-6)
        np.testing.assert_allclose(receiver.bones[f"{side}UpperArm"][1], np.eye(3), atol=1e-6)
        assert receiver.bones[f"{side}LowerArm"][1][0, 2] == pytest.approx(sign)
        assert receiver.world(f"{side}Hand")[0][2] > receiver.world(f"{side}LowerArm")[0][2] + 0.2


@pytest.mark.parametrize("mirror", [False, True])
def test_chained_from_the_root_the_bones_are_the_published_joints(mirror: bool) -> None:
    for person_in_motion in motion(40)[::4]:
        state = mirrored(person_in_motion) if mirror else person_in_motion
        receiver = Receiver(state, twist=0.5)
        for side, arm in (("Left", state.left), ("Right", state.right)):
            for bone, pose in (
                ("Shoulder", arm.bones.clavicle),
                ("UpperArm", arm.bones.upper_arm),
                ("LowerArm", arm.bones.forearm),
                ("Hand", arm.bones.hand),
            ):
                np.testing.assert_allclose(receiver.world(f"{side}{bone}")[0], unity(pose.position), atol=1e-4)


def test_the_hand_is_turned_as_published_whatever_the_lower_arm_shows_of_the_twist() -> None:
    state = motion(30)[29]
    turned = [Receiver(state, twist=twist).world("LeftHand")[1] for twist in (0.0, 0.5, 1.0)]
    np.testing.assert_allclose(turned[0], turned[1], atol=1e-5)
    np.testing.assert_allclose(turned[0], turned[2], atol=1e-5)
    fingers = turned[0] @ (-1.0, 0.0, 0.0)  # a left hand's fingers in the T-pose
    published = unity_matrix(state.left.bones.hand.orientation) @ (0.0, 0.0, -1.0)  # OpenXR: -Z to the fingers
    np.testing.assert_allclose(fingers, unity(published), atol=1e-5)


def test_headset_controllers_availability_and_time_are_there() -> None:
    state = motion(5)[4]
    receiver = Receiver(state)
    assert receiver.others["/VMC/Ext/OK"] == [1, 3, 0]
    assert receiver.others["/VMC/Ext/T"] == [0.0]
    np.testing.assert_allclose(receiver.devices["hmd"][:3], unity(state.head.position), atol=1e-6)
    x, y, z, w = state.right.bones.hand.orientation
    np.testing.assert_allclose(receiver.devices["right"][3:], (-x, -y, z, w), atol=1e-6)
    assert set(receiver.devices) == {"hmd", "left", "right"}


def test_time_counts_from_the_first_state() -> None:
    vmc = Vmc()
    times = [dict(next(iter(vmc.packets(state, None))))["/VMC/Ext/T"] for state in motion(3)]
    assert [time for (time,) in times] == pytest.approx([0.0, 1 / 90, 2 / 90])


def unity_euler_matrix(angles_deg: Iterable[float]) -> Array:
    """Unity's Quaternion.Euler: z first, then x, then y; rotations are clockwise seen along a left-handed axis."""
    x, y, z = np.radians([*angles_deg])
    rx = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    ry = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    rz = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    return np.asarray(ry @ rx @ rz)


def trackers(state: ArmsState, **options: bool) -> dict[str, Array]:
    return {
        address.removeprefix("/tracking/trackers/"): np.array(params)
        for address, params in received(vrchat_messages(state, **options))
    }


def test_vrchat_trackers_stand_upright_in_a_t_pose() -> None:
    tracked = trackers(person(T, T))
    for name in ("1", "2", "head"):
        np.testing.assert_allclose(tracked[f"{name}/rotation"], 0.0, atol=1e-4)
    np.testing.assert_allclose(tracked["2/position"], (0.48, 1.40, 0.0), atol=1e-6)
    assert set(tracked) == {f"{n}/{what}" for n in ("1", "2", "head") for what in ("position", "rotation")}


def test_vrchat_hears_of_a_raised_right_arm_on_the_right() -> None:
    tracked = trackers(person(HANGING, RAISED), chest=True)
    assert tracked["2/position"][0] > 0.1
    assert tracked["2/position"][1] > 1.6
    assert tracked["1/position"][0] < -0.1
    assert tracked["1/position"][1] < 1.2
    assert "3/position" in tracked


def test_a_head_that_looks_to_the_right_has_a_positive_y_and_one_that_looks_down_a_positive_x() -> None:
    assert trackers(person(yaw_deg=-30.0))["head/rotation"] == pytest.approx((0.0, 30.0, 0.0), abs=1e-4)
    assert trackers(person(head_pitch_deg=20.0))["head/rotation"] == pytest.approx((20.0, 0.0, 0.0), abs=1e-4)


def test_vrchats_euler_angles_turn_the_upper_arm_to_where_it_points() -> None:
    for state in motion(40)[::5]:
        tracked = trackers(state)
        for name, arm, outwards in (("1", state.left, -1.0), ("2", state.right, 1.0)):
            bone = np.subtract(arm.bones.forearm.position, arm.bones.upper_arm.position)
            pointing = unity_euler_matrix(tracked[f"{name}/rotation"]) @ (outwards * 0.30, 0.0, 0.0)
            np.testing.assert_allclose(pointing, unity(bone), atol=1e-4)
            np.testing.assert_allclose(tracked[f"{name}/position"], unity(arm.bones.forearm.position), atol=1e-5)
