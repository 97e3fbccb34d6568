"""The T-pose is the identity in every dialect, and the axes are those that each dialect's makers describe."""

from __future__ import annotations

from collections import defaultdict
from itertools import islice

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from postures import BENT, HANGING, RAISED, Arm, T, person

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.body.profile import Profile
from arm_ik_service.body.shoulders import STERNOCLAVICULAR
from arm_ik_service.exports.axes import OPENXR, ROS, UNITY, Axes, bvh_euler_deg, unity_euler_deg
from arm_ik_service.exports.mirror import mirrored
from arm_ik_service.exports.posture import posture_of
from arm_ik_service.geometry import batch
from arm_ik_service.io.session import open_session
from arm_ik_service.programs.demo import bundled_session
from arm_ik_service.programs.offline import solve_frames
from arm_ik_service.settings import Settings
from arm_ik_service.wire.messages import SIDES

angle = st.floats(-179.0, 179.0)
unit = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: sum(x * x for x in q) > 0.1)


def about(axis: int, angle_deg: float) -> np.ndarray:
    """The matrix of a rotation, written out: what the quaternions are held to."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    m = np.eye(3)
    m[i, i] = m[j, j] = c
    m[i, j], m[j, i] = -s, s
    return m


def test_a_person_in_a_t_pose_has_turned_no_bone() -> None:
    posture = posture_of(person(T, T))
    for joint in (posture.chest, posture.head, *posture.left, *posture.right):
        np.testing.assert_allclose(np.abs(joint.rotation), (0.0, 0.0, 0.0, 1.0), atol=1e-12)


def test_the_postures_of_these_tests_are_those_of_the_arm_model() -> None:
    arm = Arm(abduction=50, flexion=30, twist=20, elbow=70, carrying=-8, pronation=120, wrist_flexion=-30, deviation=12)
    state = person(arm, arm)
    swing = batch.exp(np.radians([-arm.abduction, 0.0, arm.flexion]))
    quaternion = batch.multiply(swing, batch.exp(np.radians([0.0, arm.twist, 0.0])))
    hinges = [arm.elbow, arm.carrying, arm.pronation, arm.wrist_flexion, arm.deviation, arm.axial]
    for side, published in zip(SIDES, (state.left, state.right), strict=True):
        model = ArmModel.load(side, upper_arm_m=0.30, forearm_m=0.26)
        poses = model.forward(np.concatenate([quaternion, np.radians(hinges)])[None])
        hand = poses["hand"][0]
        bones = published.bones
        asked = np.subtract(bones.hand.position, bones.upper_arm.position)
        np.testing.assert_allclose(hand[:3], asked, atol=1e-9)
        assert batch.angle_between(hand[3:], bones.hand.orientation) < 1e-7
        elbow = np.subtract(bones.forearm.position, bones.upper_arm.position)
        np.testing.assert_allclose(poses["elbow"][0][:3], elbow, atol=1e-9)
        assert batch.angle_between(poses["elbow"][0][3:], bones.forearm.orientation) < 1e-7


def test_a_solved_persons_bones_point_where_their_rotations_since_the_t_pose_say() -> None:
    frames = islice(open_session(bundled_session("boxing")).frames(), 0, 900, 30)
    for _, state in solve_frames(frames, defaultdict(Profile), Settings()):
        for side, arm in posture_of(state).arms():
            outwards = 1.0 if side == "right" else -1.0
            for joint, following in (
                (arm.upper_arm, arm.lower_arm),
                (arm.lower_arm, arm.hand),
            ):
                bone = np.subtract(following.position, joint.position)
                pointing = batch.rotate(joint.rotation, (outwards, 0.0, 0.0))
                np.testing.assert_allclose(bone / np.linalg.norm(bone), pointing, atol=1e-6)
            x, y, z = (outwards, 1.0, 1.0) * (np.array([1.0, 0.0, 0.0]) - STERNOCLAVICULAR)
            bone = np.subtract(arm.upper_arm.position, arm.clavicle.position)
            along = batch.rotate(arm.clavicle.rotation, batch.normalized((x, y, z)))
            np.testing.assert_allclose(bone / np.linalg.norm(bone), along, atol=1e-6)
            bend = batch.rotate(arm.upper_arm.rotation, (0.0, 1.0, 0.0))  # elbows bend about what is up in the T-pose
            forearm = batch.rotate(arm.lower_arm.rotation, (outwards, 0.0, 0.0))
            assert abs(bend @ forearm) < np.sin(np.radians(16.0))  # the carrying angle
            assert batch.rotate(arm.upper_arm.rotation, (0.0, 0.0, -1.0)) @ forearm > -0.01  # and to the front only


@pytest.mark.parametrize("axes", [OPENXR, UNITY, ROS])
@given(q=unit, v=st.tuples(*[st.floats(-2.0, 2.0)] * 3))
def test_turning_and_changing_axes_commute(axes: Axes, q: tuple[float, ...], v: tuple[float, float, float]) -> None:
    x, y, z, w = (float(c) for c in batch.normalized(q))
    turned = tuple(float(c) for c in batch.rotate((x, y, z, w), v))
    np.testing.assert_allclose(
        batch.rotate(axes.rotation((x, y, z, w)), axes.vector(v)),
        axes.vector((turned[0], turned[1], turned[2])),
        atol=1e-12,
    )


def test_unity_is_left_handed_with_z_forward_and_ros_has_x_forward_y_left() -> None:
    right, up, forward = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)
    assert [UNITY.vector(v) for v in (right, up, forward)] == [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    assert [ROS.vector(v) for v in (right, up, forward)] == [(0, -1, 0), (0, 0, 1), (1, 0, 0)]
    assert UNITY.rotation((0.1, 0.2, 0.3, 0.9)) == (-0.1, -0.2, 0.3, 0.9)


@given(z=angle, x=st.floats(-89.0, 89.0), y=angle)
def test_unity_euler_angles_turn_z_first_then_x_then_y(z: float, x: float, y: float) -> None:
    q = batch.from_matrix(about(1, y) @ about(0, x) @ about(2, z))
    np.testing.assert_allclose(unity_euler_deg((q[0], q[1], q[2], q[3])), (x, y, z), atol=1e-4)


@given(z=angle, x=st.floats(-89.0, 89.0), y=angle)
def test_bvh_angles_are_the_product_of_z_x_and_y(z: float, x: float, y: float) -> None:
    q = batch.from_matrix(about(2, z) @ about(0, x) @ about(1, y))
    np.testing.assert_allclose(bvh_euler_deg((q[0], q[1], q[2], q[3])), (z, x, y), atol=1e-4)


@pytest.mark.parametrize("x", [90.0, -90.0])
def test_euler_angles_are_right_where_two_axes_fall_together(x: float) -> None:
    unity = unity_euler_deg(tuple(batch.from_matrix(about(1, 30) @ about(0, x) @ about(2, 50))))
    bvh = bvh_euler_deg(tuple(batch.from_matrix(about(2, 30) @ about(0, x) @ about(1, 50))))
    np.testing.assert_allclose(
        about(1, unity[1]) @ about(0, unity[0]) @ about(2, unity[2]),
        about(1, 30) @ about(0, x) @ about(2, 50),
        atol=1e-6,
    )
    np.testing.assert_allclose(
        about(2, bvh[0]) @ about(0, bvh[1]) @ about(1, bvh[2]), about(2, 30) @ about(0, x) @ about(1, 50), atol=1e-6
    )


def test_the_mirror_swaps_the_arms_and_twice_is_the_person_again() -> None:
    state = person(HANGING, RAISED, at=(0.2, 0.4), yaw_deg=25.0)
    seen = mirrored(state)
    assert seen.left.angles == state.right.angles
    assert seen.left.bones.hand.position[1] > 1.8
    assert seen.chest.position[0] == -0.2
    expected = person(RAISED, HANGING, at=(-0.2, 0.4), yaw_deg=-25.0)
    for bone in ("clavicle", "upper_arm", "forearm", "hand"):
        got, wanted = getattr(seen.left.bones, bone), getattr(expected.left.bones, bone)
        np.testing.assert_allclose(got.position, wanted.position, atol=1e-12)
        assert batch.angle_between(got.orientation, wanted.orientation) < 1e-7
    assert mirrored(seen) == state


@given(pronation=st.floats(0.0, 175.0), share=st.floats(0.0, 1.0))
def test_a_lower_arm_with_part_of_its_twist_still_points_where_it_pointed(pronation: float, share: float) -> None:
    state = person(BENT, Arm(flexion=40, elbow=80, pronation=pronation))
    full, part = posture_of(state), posture_of(state, share)
    bone = (1.0, 0.0, 0.0)
    np.testing.assert_allclose(
        batch.rotate(part.right.lower_arm.rotation, bone), batch.rotate(full.right.lower_arm.rotation, bone), atol=1e-9
    )
    twist = np.degrees(batch.angle_between(part.right.lower_arm.rotation, full.right.lower_arm.rotation))
    assert twist == pytest.approx((1.0 - share) * abs(pronation - 90.0), abs=1e-5)
    assert part.right.hand == full.right.hand


def test_both_elbows_are_untwisted_alike() -> None:
    arm = Arm(abduction=30, flexion=40, elbow=80, pronation=150)
    posture = posture_of(person(arm, arm), 0.25)
    np.testing.assert_allclose(
        batch.mirror_pose([*posture.left.lower_arm.position, *posture.left.lower_arm.rotation]),
        [*posture.right.lower_arm.position, *posture.right.lower_arm.rotation],
        atol=1e-12,
    )
