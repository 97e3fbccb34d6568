"""ROS 2: CDR and MCAP written with one library say the same when read with others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import zenoh.ext
from mcap.reader import make_reader
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from postures import FORWARD, HANGING, RAISED, T, motion, person

from arm_ik_service.exports import ros2
from arm_ik_service.exports.joints import JOINT_NAMES
from arm_ik_service.exports.mcap_files import Ros2Writer
from arm_ik_service.exports.mirror import mirrored
from arm_ik_service.wire.messages import ArmsState


def decoded(kind: str, payload: bytes) -> Any:
    schema = Schema(id=1, name=kind, encoding="ros2msg", data=ros2.definition(kind).encode())
    decoder = DecoderFactory().decoder_for("cdr", schema)
    assert decoder is not None
    return decoder(payload)


def tree(message: Any) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """World positions and rotation matrices of every frame of a TFMessage, with MuJoCo's quaternions (w x y z)."""
    world = {"world": (np.zeros(3), np.eye(3))}
    for transform in message.transforms:
        position, rotation = world[transform.header.frame_id]
        t, q = transform.transform.translation, transform.transform.rotation
        matrix = np.zeros(9)
        mujoco.mju_quat2Mat(matrix, np.array([q.w, q.x, q.y, q.z]))
        placed = position + rotation @ (t.x, t.y, t.z), rotation @ matrix.reshape(3, 3)
        world[transform.child_frame_id] = placed
    return {name.rpartition("/")[2]: placed for name, placed in world.items()}


def in_ros(position: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = position
    return (-z, -x, y)


def test_joint_states_are_the_published_angles_and_rates() -> None:
    state = motion(30)[29]
    message = decoded(ros2.JOINT_STATE, ros2.joint_state(state, state.sample_time_ns))
    assert tuple(message.name) == JOINT_NAMES
    assert JOINT_NAMES[0] == "left_shoulder_flexion"
    named = dict(zip(message.name, message.position, strict=True))
    assert named["right_elbow_flexion"] == state.right.angles.elbow_flexion
    assert named["left_pronation"] == state.left.angles.pronation
    rates = dict(zip(message.name, message.velocity, strict=True))
    assert rates["right_wrist_axial"] == state.right.angle_rates.wrist_axial
    assert len(message.position) == len(message.velocity) == 18
    assert list(message.effort) == []
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == divmod(state.sample_time_ns, 10**9)


@pytest.mark.parametrize("mirror", [False, True])
def test_frames_chained_from_the_world_are_the_published_joints(mirror: bool) -> None:
    for person_in_motion in motion(40)[::5]:
        state = mirrored(person_in_motion) if mirror else person_in_motion
        frames = tree(decoded(ros2.TF_MESSAGE, ros2.transforms(state, 0)))
        np.testing.assert_allclose(frames["head"][0], in_ros(state.head.position), atol=1e-9)
        for side, arm in (("left", state.left), ("right", state.right)):
            for bone in ("clavicle", "upper_arm", "forearm", "hand"):
                pose = getattr(arm.bones, bone)
                np.testing.assert_allclose(frames[f"{side}_{bone}"][0], in_ros(pose.position), atol=1e-9)


def test_a_raised_right_arm_is_up_and_to_the_negative_y() -> None:
    frames = tree(decoded(ros2.TF_MESSAGE, ros2.transforms(person(HANGING, RAISED), 0)))
    assert frames["right_hand"][0][1] < -0.1
    assert frames["right_hand"][0][2] > 1.8
    assert frames["left_hand"][0][1] > 0.1
    assert frames["left_hand"][0][2] < 1.0


def test_an_arm_to_the_front_is_along_x_and_its_frame_points_with_minus_y() -> None:
    frames = tree(decoded(ros2.TF_MESSAGE, ros2.transforms(person(FORWARD, FORWARD), 0)))
    for side, outwards in (("right", -1.0), ("left", 1.0)):
        reach = frames[f"{side}_hand"][0] - frames[f"{side}_upper_arm"][0]
        np.testing.assert_allclose(reach, (0.56, 0.0, 0.0), atol=1e-9)
        np.testing.assert_allclose(frames[f"{side}_forearm"][1][:, 1] * outwards, (1.0, 0.0, 0.0), atol=1e-9)


def test_in_a_t_pose_all_frames_are_parallel_to_the_world() -> None:
    for _, rotation in tree(decoded(ros2.TF_MESSAGE, ros2.transforms(person(T, T), 0))).values():
        np.testing.assert_allclose(rotation, np.eye(3), atol=1e-9)


def test_names_are_such_as_ros_allows() -> None:
    assert ros2.joint_topic("7") == "/avatar_7/joint_states"
    assert ros2.joint_topic("ann-b.c") == "/avatar_ann_b_c/joint_states"


def test_keys_are_those_of_rmw_zenoh_and_of_the_bridge() -> None:
    topic = "/avatar_ann/joint_states"
    assert ros2.bridge_key(topic) == "avatar_ann/joint_states"
    # the hash is what a ROS 2 graph shows for JointState; the form is that of rmw_zenoh's design document
    assert ros2.rmw_zenoh_key(topic, ros2.JOINT_STATE, 3) == (
        "3/avatar_ann/joint_states/sensor_msgs::msg::dds_::JointState_/"
        "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"
    )
    token = ros2.RmwNode("abc").publisher_token(1, topic, ros2.JOINT_STATE)
    assert token.startswith("@ros2_lv/0/abc/0/1/MP/%/%/arm_ik/%avatar_ann%joint_states/sensor_msgs::msg::dds_::")
    zenoh.KeyExpr(token)


def test_the_attachment_reads_back_with_zenohs_own_deserializer() -> None:
    data = zenoh.ZBytes(ros2.attachment(7, 123_456_789_012, "token"))
    kind: Any = tuple[str, zenoh.ext.Int64, str, zenoh.ext.Int64, str, bytes]
    names: Any = zenoh.ext.z_deserialize(kind, data)
    assert (names[0], names[2], names[4]) == ("sequence_number", "source_timestamp", "source_gid")
    assert (int(names[1]), int(names[3]), len(names[5])) == (7, 123_456_789_012, 16)


def test_a_file_has_the_ros2_profile_and_reads_back_in_order(tmp_path: Path) -> None:
    path = tmp_path / "ros2.mcap"
    states: list[ArmsState] = motion(50)
    writer = Ros2Writer(path)
    for state in states:
        writer.add(state)
    writer.close()
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        messages = list(reader.iter_decoded_messages())
    joints = [(m, d) for s, c, m, d in messages if c.topic == "/avatar_ann/joint_states"]
    frames = [d for s, c, m, d in messages if c.topic == "/tf" and s and s.name == "tf2_msgs/msg/TFMessage"]
    assert len(joints) == len(frames) == 50
    for state, (message, joint_state), transforms in zip(states, joints, frames, strict=True):
        assert message.log_time == state.sample_time_ns
        assert joint_state.position[9 + 3] == state.right.angles.elbow_flexion
        np.testing.assert_allclose(tree(transforms)["left_hand"][0], in_ros(state.left.bones.hand.position), atol=1e-9)
