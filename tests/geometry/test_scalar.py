"""Rotations as tuples: group laws, and agreement with the numpy ones and with Pinocchio."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from arm_ik_service.geometry import batch
from arm_ik_service.geometry import scalar as g

components = st.floats(-1.0, 1.0)


@st.composite
def quaternions(draw: st.DrawFn) -> g.Quaternion:
    q = np.array([draw(components) for _ in range(4)])
    length = float(np.linalg.norm(q))
    if length < 1e-3:
        return g.IDENTITY
    x, y, z, w = (q / length).tolist()
    return (x, y, z, w)


vectors = st.tuples(components, components, components)


@given(quaternions(), quaternions(), vectors)
def test_turning_by_a_product_is_turning_twice(a: g.Quaternion, b: g.Quaternion, v: g.Vector) -> None:
    assert g.rotate(g.multiply(a, b), v) == pytest.approx(g.rotate(a, g.rotate(b, v)), abs=1e-12)


@given(quaternions())
def test_log_and_exp_undo_each_other(q: g.Quaternion) -> None:
    again = g.exp(g.log(q))
    assert abs(np.dot(again, q)) == pytest.approx(1.0, abs=1e-12)
    assert g.norm(g.log(q)) <= math.pi + 1e-12


@given(quaternions())
def test_swing_times_twist_is_the_rotation_and_the_swing_has_no_twist(q: g.Quaternion) -> None:
    swing = g.swing_y(q)
    again = g.multiply(swing, g.rotation_y(g.twist_y(q)))
    assert abs(np.dot(again, q)) == pytest.approx(1.0, abs=1e-12)
    assert swing[1] == pytest.approx(0.0, abs=1e-12)


@given(quaternions())
def test_a_rotation_is_rebuilt_from_its_columns(q: g.Quaternion) -> None:
    again = g.from_columns(g.rotate(q, g.X), g.rotate(q, g.Y), g.rotate(q, g.Z))
    assert abs(np.dot(again, q)) == pytest.approx(1.0, abs=1e-9)


@given(quaternions(), quaternions())
@example(g.IDENTITY, (0.0, 0.0, 0.9999999999995453, 9.536743167995664e-07))
def test_between_takes_one_direction_to_the_other(a: g.Quaternion, b: g.Quaternion) -> None:
    u, v = g.rotate(a, g.X), g.rotate(b, g.X)
    assert g.rotate(g.between(u, v), u) == pytest.approx(v, abs=1e-6)


def test_between_opposite_directions_is_half_a_turn() -> None:
    for axis in (g.X, g.Y, g.Z):
        assert g.rotate(g.between(axis, g.scale(-1.0, axis)), axis) == pytest.approx(g.scale(-1.0, axis), abs=1e-9)


@given(quaternions(), vectors)
def test_mirroring_a_rotation_is_turning_in_the_mirror(q: g.Quaternion, v: g.Vector) -> None:
    in_the_mirror = g.mirror_vector(g.rotate(q, g.mirror_vector(v)))
    assert g.rotate(g.mirror_rotation(q), v) == pytest.approx(in_the_mirror, abs=1e-12)


@given(quaternions(), quaternions(), vectors)
def test_tuples_and_arrays_agree(a: g.Quaternion, b: g.Quaternion, v: g.Vector) -> None:
    assert g.multiply(a, b) == pytest.approx(batch.multiply(a, b), abs=1e-12)
    assert g.rotate(a, v) == pytest.approx(batch.rotate(a, v), abs=1e-12)
    assert g.exp(v) == pytest.approx(batch.exp(v), abs=1e-12)
    assert batch.rotate(batch.exp(batch.log(a)), v) == pytest.approx(g.rotate(a, v), abs=1e-9)


@given(quaternions(), vectors)
def test_quaternions_mean_what_pinocchio_means(q: g.Quaternion, v: g.Vector) -> None:
    theirs = pin.Quaternion(np.array(q))
    assert g.rotate(q, v) == pytest.approx(theirs.toRotationMatrix() @ np.array(v), abs=1e-12)
    assert batch.matrix(q) == pytest.approx(theirs.toRotationMatrix(), abs=1e-12)
    assert abs(np.dot(batch.from_matrix(theirs.toRotationMatrix()), q)) == pytest.approx(1.0, abs=1e-9)


def test_poses_compose_and_invert_over_any_shape() -> None:
    rng = np.random.default_rng(1)
    poses = np.concatenate([rng.normal(size=(5, 2, 3)), batch.normalized(rng.normal(size=(5, 2, 4)))], axis=-1)
    identity = batch.compose(poses, batch.inverse(poses))
    assert identity[..., :3] == pytest.approx(np.zeros((5, 2, 3)), abs=1e-12)
    assert np.abs(identity[..., 6]) == pytest.approx(np.ones((5, 2)), abs=1e-12)
    assert batch.compose(poses[0, 0], poses).shape == (5, 2, 7)
    assert batch.angle_between(poses[..., 3:], poses[..., 3:]) == pytest.approx(np.zeros((5, 2)), abs=1e-7)


def test_mirrored_poses_compose_to_the_mirrored_product() -> None:
    rng = np.random.default_rng(2)
    a, b = (np.concatenate([rng.normal(size=3), batch.normalized(rng.normal(size=4))]) for _ in range(2))
    mirrored = batch.compose(batch.mirror_pose(a), batch.mirror_pose(b))
    assert mirrored == pytest.approx(batch.mirror_pose(batch.compose(a, b)), abs=1e-12)


@pytest.mark.parametrize("angle", [-3 * math.pi + 0.1, -math.pi, -0.5, 0.0, math.pi, math.pi + 0.1, 2.9 * math.pi])
def test_wrapped_angles_lie_in_one_turn_and_mean_the_same(angle: float) -> None:
    wrapped = g.wrap(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle))
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-12)
