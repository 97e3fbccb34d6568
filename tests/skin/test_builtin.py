"""The arms that we ship: a closed surface, the same every time, with weights that bend at the joints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from arm_ik_service.skin.builtin import __main__ as command
from arm_ik_service.skin.builtin import built_in_arms
from arm_ik_service.skin.gltf import read_gltf
from arm_ik_service.skin.names import find_roles


def test_the_surface_is_closed_and_its_outside_is_outside() -> None:
    mesh = built_in_arms()
    there = np.concatenate([mesh.triangles[:, [i, (i + 1) % 3]] for i in range(3)]).astype(np.int64)
    back = there[:, ::-1]
    size = len(mesh.vertices)
    assert np.array_equal(np.sort(there @ [size, 1]), np.sort(back @ [size, 1])), "every edge is met by its other side"
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0
    assert 0.006 < volume < 0.012, "two arms of a person are 5 % of the body each, of 75 l"
    faces = np.cross(b - a, c - a)
    agree = np.einsum("ij,ij->i", faces, mesh.normals[mesh.triangles].sum(axis=1)) > 0.0
    assert agree.mean() > 0.998


def test_it_is_the_same_every_time_it_is_made() -> None:
    again = built_in_arms.__wrapped__()
    for field in ("vertices", "normals", "triangles", "bones", "weights", "joints"):
        np.testing.assert_array_equal(getattr(again, field), getattr(built_in_arms(), field))


def test_the_left_arm_is_the_mirror_image_of_the_right() -> None:
    mesh = built_in_arms()
    right, left = np.split(mesh.vertices, 2)
    np.testing.assert_array_equal(left, right * [-1.0, 1.0, 1.0])
    assert (right[:, 0] > 0.0).all()


def test_the_hand_is_of_its_hand_s_bone_alone_and_the_shoulder_of_the_upper_arm() -> None:
    mesh = built_in_arms()
    roles = find_roles(mesh.names)
    hand = mesh.bones[:, 0] == roles["rightHand"]
    wrist = mesh.joints[roles["rightHand"]]
    far = np.linalg.norm(mesh.vertices - wrist, axis=1) > 0.06
    assert (mesh.weights[hand & far, 0] > 1.0 - 1e-12).all()
    assert np.count_nonzero(hand & far) > 3000
    shoulder = np.linalg.norm(mesh.vertices - mesh.joints[roles["rightUpperArm"]], axis=1) < 0.1
    assert (mesh.bones[shoulder, 0] == roles["rightUpperArm"]).all()


def test_the_command_writes_a_file_that_reads_back_as_the_same_arms(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "arms.glb"
    assert command.main([str(path)]) == 0
    assert "14712 vertices" in capsys.readouterr().out
    mesh, ours = read_gltf(path)[0], built_in_arms()
    np.testing.assert_allclose(mesh.vertices, ours.vertices, atol=1e-6)
    np.testing.assert_allclose(mesh.joints[: len(ours.names)], ours.joints, atol=1e-7)
    np.testing.assert_allclose(mesh.weights, ours.weights, atol=1e-6)
    np.testing.assert_array_equal(mesh.triangles, ours.triangles)
    assert mesh.names[: len(ours.names)] == ours.names


def test_the_command_says_how_it_is_called(capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main([]) == 2
    assert "usage" in capsys.readouterr().err
