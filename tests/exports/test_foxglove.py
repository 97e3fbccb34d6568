"""Foxglove: the protobuf that its own library writes, read with Google's, gives the published state."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from postures import HANGING, RAISED, motion, person

from arm_ik_service.exports.mcap_files import FoxgloveWriter
from arm_ik_service.exports.mirror import mirrored
from arm_ik_service.wire.messages import ArmsState


def read(path: Path, states: list[ArmsState]) -> dict[str, list[Any]]:
    """Write states and return the decoded messages by schema name."""
    writer = FoxgloveWriter(path)
    for state in states:
        writer.add(state)
    writer.close()
    found: dict[str, list[Any]] = {}
    with path.open("rb") as file:
        for schema, _, _, message in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            assert schema is not None
            found.setdefault(schema.name, []).append(message)
    return found


def places(message: Any) -> dict[str, np.ndarray]:
    world = {"world": (np.zeros(3), np.eye(3))}
    for transform in message.transforms:
        position, rotation = world[transform.parent_frame_id]
        t, q = transform.translation, transform.rotation
        matrix = np.zeros(9)
        mujoco.mju_quat2Mat(matrix, np.array([q.w, q.x, q.y, q.z]))
        placed = position + rotation @ (t.x, t.y, t.z), rotation @ matrix.reshape(3, 3)
        world[transform.child_frame_id] = placed
    return {name.rpartition("/")[2]: position for name, (position, _) in world.items()}


def test_the_three_schemas_have_foxgloves_names_and_the_published_values(tmp_path: Path) -> None:
    states = motion(60)
    found = read(tmp_path / "foxglove.mcap", states)
    assert set(found) == {"foxglove.FrameTransforms", "foxglove.JointStates", "foxglove.SceneUpdate"}
    assert len(found["foxglove.FrameTransforms"]) == len(found["foxglove.JointStates"]) == 60
    for state, transforms, joints in zip(
        states, found["foxglove.FrameTransforms"], found["foxglove.JointStates"], strict=True
    ):
        where = places(transforms)
        for side, arm in (("left", state.left), ("right", state.right)):
            x, y, z = arm.bones.hand.position
            np.testing.assert_allclose(where[f"{side}_hand"], (-z, -x, y), atol=1e-9)
        named = {joint.name: joint for joint in joints.joints}
        assert named["right_elbow_flexion"].position == state.right.angles.elbow_flexion
        assert named["left_wrist_deviation"].velocity == state.left.angle_rates.wrist_deviation
        assert joints.timestamp.ToNanoseconds() == state.sample_time_ns


@pytest.mark.parametrize(("mirror", "raised", "sign"), [(False, "right", -1.0), (True, "left", 1.0)])
def test_a_raised_right_arm_is_up_and_on_the_right(tmp_path: Path, mirror: bool, raised: str, sign: float) -> None:
    state = person(HANGING, RAISED)
    found = read(tmp_path / "raised.mcap", [mirrored(state) if mirror else state])
    _, y, z = places(found["foxglove.FrameTransforms"][0])[f"{raised}_hand"]
    assert sign * y > 0.1
    assert z > 1.8


def test_the_body_is_locked_to_its_frames_and_each_bone_reaches_the_next_one(tmp_path: Path) -> None:
    found = read(tmp_path / "body.mcap", motion(3))
    update, frames = found["foxglove.SceneUpdate"][0], found["foxglove.FrameTransforms"][0]
    children = {transform.child_frame_id: transform for transform in frames.transforms}
    assert len(update.entities) == 9
    for entity in update.entities:
        assert entity.frame_locked
        assert entity.frame_id in children
    upper_arm = next(entity for entity in update.entities if entity.id.endswith("right_upper_arm"))
    cylinder, forearm = upper_arm.cylinders[0], children["avatar_ann/right_forearm"].translation
    centre = cylinder.pose.position
    np.testing.assert_allclose((2 * centre.x, 2 * centre.y, 2 * centre.z), (forearm.x, forearm.y, forearm.z), atol=1e-9)
    assert cylinder.size.z == pytest.approx(0.30)


def test_the_body_comes_again_each_second_and_when_tracking_is_lost(tmp_path: Path) -> None:
    assert len(read(tmp_path / "long.mcap", motion(271))["foxglove.SceneUpdate"]) == 4
    changing = [person(sample_time_ns=k * 11_000_000, tracking="tracked" if k < 5 else "lost") for k in range(10)]
    updates = read(tmp_path / "lost.mcap", changing)["foxglove.SceneUpdate"]
    assert len(updates) == 2
    colours = [next(e for e in u.entities if e.id.endswith("left_forearm")).cylinders[0].color.a for u in updates]
    assert colours == [1.0, pytest.approx(0.6)]


def test_several_people_have_frames_of_their_own(tmp_path: Path) -> None:
    found = read(tmp_path / "two.mcap", [person(avatar="ann"), person(avatar="bob")])
    children = {t.child_frame_id for m in found["foxglove.FrameTransforms"] for t in m.transforms}
    assert {"avatar_ann/right_hand", "avatar_bob/right_hand"} <= children
