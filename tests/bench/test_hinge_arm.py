"""The arm that peers are given is our arm, read by two programs that we did not write."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.bench.hinge_arm import HingeArm
from arm_ik_service.geometry.batch import angle_between

SIDES = ("left", "right")


@pytest.fixture(params=SIDES)
def arm(request: pytest.FixtureRequest) -> ArmModel:
    return ArmModel.load(request.param, upper_arm_m=0.31, forearm_m=0.24)


def test_a_configuration_is_the_same_rotation_as_its_hinges(arm: ArmModel) -> None:
    hinges = HingeArm(arm)
    q = arm.random_configurations(500, np.random.default_rng(0))
    again = hinges.configurations(hinges.angles(q))
    np.testing.assert_allclose(angle_between(again[:, :4], q[:, :4]), 0.0, atol=1e-7)
    np.testing.assert_array_equal(again[:, 4:], q[:, 4:])


def test_the_peers_may_do_all_that_our_limits_allow_and_are_not_held_by_a_seam(arm: ArmModel) -> None:
    hinges = HingeArm(arm)
    raw = hinges.shoulder_angles(arm.random_configurations(5000, np.random.default_rng(1))[:, :4])
    assert (raw > hinges.lower[:3]).all()
    assert (raw < hinges.upper[:3]).all()
    behind = np.stack([raw[:, 0] + np.pi, -np.pi - raw[:, 1], raw[:, 2] + np.pi], axis=1)  # the other way to write it
    same = hinges.configurations(np.concatenate([behind, np.zeros((len(raw), 6))], axis=1))
    straight = hinges.configurations(np.concatenate([raw, np.zeros((len(raw), 6))], axis=1))
    np.testing.assert_allclose(angle_between(same[:, :4], straight[:, :4]), 0.0, atol=1e-7)
    assert (behind[:, 1] > hinges.lower[1]).all()
    np.testing.assert_array_equal(hinges.lower[3:], arm.lower)
    np.testing.assert_array_equal(hinges.upper[3:], arm.upper)


def test_pinocchio_reads_the_urdf_as_our_arm(arm: ArmModel) -> None:
    hinges = HingeArm(arm)
    model = pin.buildModelFromXML(hinges.urdf())
    data = model.createData()
    q = arm.random_configurations(50, np.random.default_rng(2))
    for angles, wanted in zip(hinges.angles(q), hinges.matrices(arm.forward(q)["hand"]), strict=True):
        pin.framesForwardKinematics(model, data, angles)
        np.testing.assert_allclose(data.oMf[model.getFrameId("hand")].homogeneous, wanted, atol=1e-9)
    np.testing.assert_allclose(model.lowerPositionLimit, hinges.lower)
    np.testing.assert_allclose(model.upperPositionLimit, hinges.upper)


def test_mujoco_reads_the_mjcf_as_our_arm(arm: ArmModel) -> None:
    hinges = HingeArm(arm)
    model = mujoco.MjModel.from_xml_string(hinges.mjcf())
    data = mujoco.MjData(model)
    q = arm.random_configurations(50, np.random.default_rng(3))
    for angles, wanted in zip(hinges.angles(q), hinges.matrices(arm.forward(q)["hand"]), strict=True):
        data.qpos[:] = angles
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(data.site("hand").xpos, wanted[:3, 3], atol=1e-9)
        np.testing.assert_allclose(data.site("hand").xmat.reshape(3, 3), wanted[:3, :3], atol=1e-9)
    np.testing.assert_allclose(model.jnt_range, np.stack([hinges.lower, hinges.upper], axis=1))
