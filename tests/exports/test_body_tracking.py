"""XR_FB_body_tracking: OpenXR's own names and numbers, in a file that any JSON reader takes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from mcap.reader import make_reader
from postures import BENT, HANGING, RAISED, Arm, T, motion, person

from arm_ik_service.exports.mcap_files import BodyTrackingWriter
from arm_ik_service.exports.mirror import mirrored
from arm_ik_service.wire.messages import ArmsState

NUMBERS = {  # XrBodyJointFB as the OpenXR registry lists it
    "LEFT_SHOULDER": 8,
    "LEFT_SCAPULA": 9,
    "LEFT_ARM_UPPER": 10,
    "LEFT_ARM_LOWER": 11,
    "LEFT_HAND_WRIST_TWIST": 12,
    "RIGHT_SHOULDER": 13,
    "RIGHT_SCAPULA": 14,
    "RIGHT_ARM_UPPER": 15,
    "RIGHT_ARM_LOWER": 16,
    "RIGHT_HAND_WRIST_TWIST": 17,
    "LEFT_HAND_PALM": 18,
    "LEFT_HAND_WRIST": 19,
    "RIGHT_HAND_PALM": 44,
    "RIGHT_HAND_WRIST": 45,
}


def read(path: Path, state: ArmsState) -> dict[str, Any]:
    """Write a state and return its joints by short name, as JSON has them."""
    writer = BodyTrackingWriter(path)
    writer.add(state)
    writer.close()
    with path.open("rb") as file:
        ((schema, channel, message),) = make_reader(file).iter_messages()
    assert schema is not None
    assert (schema.name, channel.topic) == ("arm_ik.BodyJoints", "avatar/ann/xr_fb_body_tracking")
    return {
        joint["name"].removeprefix("XR_BODY_JOINT_").removesuffix("_FB"): joint
        for joint in json.loads(message.data)["joints"]
    }


def columns(joint: dict[str, Any]) -> np.ndarray:
    x, y, z, w = joint["orientation"]
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, np.array([w, x, y, z]))
    return matrix.reshape(3, 3).T


def test_names_and_numbers_are_openxrs_and_in_ascending_order(tmp_path: Path) -> None:
    joints = read(tmp_path / "names.mcap", person())
    assert {name: joint["index"] for name, joint in joints.items()} == NUMBERS
    assert [joint["index"] for joint in joints.values()] == sorted(NUMBERS.values())


def test_joints_are_where_the_bones_are_published(tmp_path: Path) -> None:
    state = motion(25)[24]
    joints = read(tmp_path / "places.mcap", state)
    for side, arm in (("LEFT", state.left), ("RIGHT", state.right)):
        for name, pose in (
            ("SHOULDER", arm.bones.clavicle),
            ("ARM_UPPER", arm.bones.upper_arm),
            ("ARM_LOWER", arm.bones.forearm),
            ("HAND_WRIST_TWIST", arm.bones.hand),
            ("HAND_WRIST", arm.bones.hand),
        ):
            np.testing.assert_allclose(joints[f"{side}_{name}"]["position"], pose.position, atol=1e-12)


def test_a_raised_right_arm_is_a_raised_right_arm_and_a_left_one_in_the_mirror(tmp_path: Path) -> None:
    state = person(HANGING, RAISED)
    x, y, _ = read(tmp_path / "raised.mcap", state)["RIGHT_HAND_PALM"]["position"]
    assert x > 0.1
    assert y > 1.85
    x, y, _ = read(tmp_path / "seen.mcap", mirrored(state))["LEFT_HAND_PALM"]["position"]
    assert x < -0.1
    assert y > 1.85


def test_x_runs_along_the_arm_to_the_right_on_both_sides(tmp_path: Path) -> None:
    joints = read(tmp_path / "t.mcap", person(T, T))
    for name, joint in joints.items():
        if "SHOULDER" not in name and "SCAPULA" not in name:
            np.testing.assert_allclose(columns(joint)[0], (1.0, 0.0, 0.0), atol=1e-12)
    right, left = columns(joints["RIGHT_HAND_WRIST"]), columns(joints["LEFT_HAND_WRIST"])
    np.testing.assert_allclose(right[1], (0.0, 1.0, 0.0), atol=1e-12)  # out of the back of the hand
    np.testing.assert_allclose(left[1], (0.0, -1.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(columns(joints["RIGHT_ARM_LOWER"])[2], (0.0, -1.0, 0.0), atol=1e-12)


def test_the_wrist_twist_has_the_pronation_that_the_lower_arm_has_not(tmp_path: Path) -> None:
    palm_up = Arm(abduction=90.0, elbow=90.0, pronation=10.0)
    twisted, level = (read(tmp_path / f"{n}.mcap", person(HANGING, arm)) for n, arm in enumerate((palm_up, BENT)))
    np.testing.assert_allclose(columns(twisted["RIGHT_ARM_LOWER"]), columns(level["RIGHT_ARM_LOWER"]), atol=1e-9)
    cosine = columns(twisted["RIGHT_HAND_WRIST_TWIST"])[1] @ columns(level["RIGHT_HAND_WRIST_TWIST"])[1]
    np.testing.assert_allclose(np.degrees(np.arccos(cosine)), 80.0, atol=1e-6)


def test_flags_say_what_is_tracked(tmp_path: Path) -> None:
    for tracking, flags in (("tracked", 15), ("inferred", 3), ("held", 3), ("lost", 0)):
        joints = read(tmp_path / f"{tracking}.mcap", person(tracking=tracking))  # type: ignore[arg-type]
        assert {joint["flags"] for joint in joints.values()} == {flags}
