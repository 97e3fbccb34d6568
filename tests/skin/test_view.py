"""A skinned person in the Rerun view: read back, the skin is where the bones are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from arm_poses import MEASURES
from harness import Running
from people import SKELETON, answer
from rerun.chunk import RrdReader

from arm_ik_service.io.rerun_view import Skin, write_recording
from arm_ik_service.skin.fit import ArmMeasures
from arm_ik_service.skin.load import load_avatar, load_built_in_arms
from arm_ik_service.skin.mesh import Floats
from arm_ik_service.skin.puppet import Puppet, poses_of
from arm_ik_service.wire.messages import SIDES

pytestmark = pytest.mark.slow  # real processes, one after the other: the default run has three minutes

ROOT = "/avatar/ann"


def read(path: Path) -> dict[tuple[str, str], list[Any]]:
    """(entity, component) -> values in the order in which they were logged."""
    found: dict[tuple[str, str], list[Any]] = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for k, field in enumerate(batch.schema):
            if ":" in field.name:
                values = [value for value in batch.column(k).to_pylist() if value is not None]
                found.setdefault((chunk.entity_path, field.name.rsplit("/", 1)[-1]), []).extend(values)
    return found


def farthest(points: Floats, places: Floats) -> float:
    """Largest distance [m] of a place from the nearest of the points."""
    return float(max(np.linalg.norm(points - place, axis=1).min() for place in places))


def test_a_skin_grows_with_arms_whose_length_is_learnt(tmp_path: Path) -> None:
    path = tmp_path / "arms.rrd"
    short = msgspec.structs.replace(SKELETON, upper_arm_m=0.25, forearm_m=0.22)
    write_recording(path, [answer(0)], short, skin=Skin(load_built_in_arms()))
    seen = np.array(read(path)[f"{ROOT}/skin/bending", "Mesh3D:vertex_positions"][0])
    lengths = ArmMeasures(SKELETON.stature_m, SKELETON.upper_arm_m, SKELETON.forearm_m, SKELETON.shoulder_width_m)
    puppet = Puppet(load_built_in_arms(), lengths)
    whole = puppet.skin(puppet.motions(poses_of(answer(0)[1]))[0])[0]
    assert farthest(whole, seen[::100]) < 1e-6


def test_arms_alone_take_the_place_of_the_solid_arms_and_bend_with_the_bones(tmp_path: Path) -> None:
    answers = [answer(seq) for seq in range(70)]  # more than is sent in one piece
    path = tmp_path / "arms.rrd"
    assert write_recording(path, answers, SKELETON, skin=Skin(load_built_in_arms())) == 70
    log = read(path)
    assert (f"{ROOT}/left/forearm", "Mesh3D:vertex_positions") not in log
    assert (f"{ROOT}/chest", "Mesh3D:vertex_positions") in log
    assert (f"{ROOT}/left/hand", "Mesh3D:albedo_factor") in log, "the hand still tells the tracking state"
    bending = log[f"{ROOT}/skin/bending", "Mesh3D:vertex_positions"]
    assert len(bending) == 70

    lengths = ArmMeasures(SKELETON.stature_m, SKELETON.upper_arm_m, SKELETON.forearm_m, SKELETON.shoulder_width_m)
    puppet = Puppet(load_built_in_arms(), lengths)
    for k in (0, 69):
        whole = puppet.skin(puppet.motions(poses_of(answers[k][1]))[0])[0]
        seen = np.array(bending[k])
        assert farthest(whole, seen[::100]) < 1e-6, "what is sent is the skinned arm"
        bones = answers[k][1].right.bones
        forearm = np.linspace(bones.forearm.position, bones.hand.position, 5)
        assert farthest(seen, forearm) < 0.06, "the skin surrounds the bone"


def test_a_whole_body_leaves_only_the_targets_of_the_solids(tmp_path: Path, recordings: Path) -> None:
    character = load_avatar(recordings / "mesh" / "makehuman_hm08_gameengine.glb")
    path = tmp_path / "body.rrd"
    write_recording(path, [answer(seq) for seq in range(3)], SKELETON, skin=Skin(character, "linear"))
    log = read(path)
    solids = {entity for entity, component in log if component == "Mesh3D:vertex_positions"}
    parts = {f"{ROOT}/skin/{part}" for part in ("bending", "hips", "head", "chest", "leftHand", "rightHand")}
    assert {f"{ROOT}/{side}/target" for side in SIDES} <= solids
    assert parts <= solids
    assert not any(f"{ROOT}/{name}" in solids for name in ("chest", "head", "neck", "left/forearm", "right/hand"))
    assert not any(component == "Mesh3D:albedo_factor" for _, component in log), "nobody's own hands are tinted"
    assert len(log[f"{ROOT}/skin/leftHand", "Transform3D:translation"]) == 3


def test_the_file_s_misplaced_arms_are_mended_and_its_hands_are_at_the_published_wrists(recordings: Path) -> None:
    """The bones of this file's arms lie 5.5 cm beside its mesh; a wrist must still be inside the wrist."""
    character = load_avatar(recordings / "mesh" / "makehuman_hm08_gameengine.glb")
    assert [note.split(" lie ")[0] for note in character.notes] == [
        "the bones of its left arm",
        "the bones of its right arm",
    ]
    assert len(character.mesh.vertices) == 13_380
    puppet = Puppet(character, MEASURES)
    arms = answer(5)[1]
    vertices, _ = puppet.skin(puppet.motions(poses_of(arms))[0])
    for arm in (arms.left, arms.right):
        for joint, radius in ((arm.bones.hand.position, 0.035), (arm.bones.forearm.position, 0.055)):
            near = vertices[np.linalg.norm(vertices - np.array(joint), axis=1) < 2.0 * radius]
            assert np.linalg.norm(near.mean(axis=0) - joint) < radius, "the joint is in the middle of what is around it"


@pytest.mark.parametrize("command", [("view", "--save", "x.rrd"), ("demo", "--save", "x.rrd"), ("grab", "--fast")])
def test_an_avatar_that_cannot_be_used_is_one_line_before_anything_starts(
    tmp_path: Path, command: tuple[str, ...]
) -> None:
    path = tmp_path / "person.glb"
    path.write_bytes(b"not a person")
    running = Running(*command, "--avatar", str(path))
    assert running.finish() == 2
    assert len([line for line in running.lines if line.startswith("arm-ik:")]) == 1
    assert running.lines[-1].startswith(f"arm-ik: {path}: not a glTF")
    assert not Path("x.rrd").exists()


def test_our_own_arms_need_no_mending() -> None:
    assert load_built_in_arms().notes == ()


@pytest.mark.parametrize("count", [0, 1])
def test_a_recording_of_nearly_nothing_is_written(tmp_path: Path, count: int) -> None:
    skin = Skin(load_built_in_arms())
    assert write_recording(tmp_path / "x.rrd", [answer(0)][:count], SKELETON, skin=skin) == count
