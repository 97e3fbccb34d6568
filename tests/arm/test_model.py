"""The arm: the file as Pinocchio and MuJoCo read it, scaled to a person, mirrored for the left, limits as data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from arm_ik_service.arm.model import HINGES, ArmModel
from arm_ik_service.errors import ModelError
from arm_ik_service.geometry import batch
from arm_ik_service.resources import resource_folder

MODEL = resource_folder("models") / "human_arm.xml"
RIGHT = ArmModel.load()


def anywhere(count: int, seed: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Configurations inside and outside the limits."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-3.0, 3.0, (count, 10))
    q[:, :4] = batch.normalized(rng.normal(size=(count, 4)))
    return q


def turned(**degrees: float) -> dict[str, np.ndarray[Any, np.dtype[np.float64]]]:
    """Poses of the arm hanging with the palm to the front, some hinges turned."""
    q = np.zeros(10)
    q[3] = 1.0
    for name, angle in degrees.items():
        q[4 + HINGES.index(name)] = np.radians(angle)
    return RIGHT.forward(q)


def test_pinocchio_finds_one_ball_and_two_groups_of_three_hinges() -> None:
    model = RIGHT.pinocchio
    assert (model.nq, model.nv) == (10, 9)
    assert [joint.shortname() for joint in model.joints][1:] == [
        "JointModelSpherical",
        "JointModelComposite",
        "JointModelComposite",
    ]


def test_forward_kinematics_are_pinocchios() -> None:
    data = RIGHT.pinocchio.createData()
    q = anywhere(200, 0)
    hands = RIGHT.forward(q)["hand"]
    for row, hand in zip(q, hands, strict=True):
        pin.framesForwardKinematics(RIGHT.pinocchio, data, row)
        placement = data.oMf[RIGHT.hand_frame_id]
        np.testing.assert_allclose(hand[:3], placement.translation, atol=1e-14)
        np.testing.assert_allclose(batch.matrix(hand[3:]), placement.rotation, atol=1e-13)


def test_mujoco_reads_the_same_file_and_finds_the_same_forward_kinematics() -> None:
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(MODEL))
    data = mujoco.MjData(model)
    q = anywhere(100, 1)
    poses = RIGHT.forward(q)
    for n, row in enumerate(q):
        data.qpos[:] = [row[3], *row[:3], *row[4:]]  # MuJoCo's quaternions are w x y z
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(data.body("forearm").xpos, poses["elbow"][n, :3], atol=1e-12)
        np.testing.assert_allclose(data.site("hand").xpos, poses["hand"][n, :3], atol=1e-12)
        np.testing.assert_allclose(data.site("hand").xmat.reshape(3, 3), batch.matrix(poses["hand"][n, 3:]), atol=1e-12)


def test_ranges_in_mujoco_are_those_of_the_arm() -> None:
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(MODEL))
    for index, name in enumerate(HINGES):
        np.testing.assert_allclose(model.joint(name).range, [RIGHT.lower[index], RIGHT.upper[index]])


def test_signs_are_those_of_the_contract() -> None:
    straight = turned()
    np.testing.assert_allclose(straight["hand"][:3], [0.0, -RIGHT.upper_arm_m - RIGHT.forearm_m, 0.0], atol=1e-12)
    fingers, back = batch.rotate(straight["hand"][3:], [[0, 0, -1.0], [0, 1.0, 0]])
    np.testing.assert_allclose(fingers, [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(back, [0, 0, 1], atol=1e-12)  # the palm is to the front, which is -z
    assert turned(elbow_flexion=90)["hand"][2] < -0.2  # forward
    assert turned(elbow_carrying=-15)["hand"][0] > 0.05  # valgus: away from the body
    thumb = batch.rotate(turned(pronation=90)["hand"][3:], [-1.0, 0, 0])  # -x of a right OpenXR wrist
    np.testing.assert_allclose(thumb, [0, 0, -1], atol=1e-12)  # 90 degrees: thumb forward
    assert batch.rotate(turned(wrist_flexion=45)["hand"][3:], [0, 0, -1.0])[2] < -0.5  # to the palm
    assert batch.rotate(turned(wrist_deviation=30)["hand"][3:], [0, 0, -1.0])[0] < -0.4  # away from the thumb


def test_left_is_the_exact_mirror_of_right() -> None:
    left = ArmModel.load("left", upper_arm_m=0.31, forearm_m=0.24)
    right = ArmModel.load("right", upper_arm_m=0.31, forearm_m=0.24)
    q = anywhere(100, 2)
    a, b = left.forward(q), right.forward(q)
    np.testing.assert_array_equal(a["hand"], batch.mirror_pose(b["hand"]))
    np.testing.assert_array_equal(a["elbow"][:, :3], b["elbow"][:, :3] * [-1, 1, 1])
    # bone axes are ISB's on both sides: y along the bone, z to the person's right
    np.testing.assert_allclose(
        batch.rotate(a["elbow"][:, 3:], [0, 1.0, 0]),
        batch.rotate(b["elbow"][:, 3:], [0, 1.0, 0]) * [-1, 1, 1],
        atol=1e-12,
    )


@pytest.mark.parametrize(("upper", "lower"), [(0.20, 0.16), (0.38, 0.30)])
def test_bones_have_the_lengths_asked_for_and_mass_follows(upper: float, lower: float) -> None:
    arm = ArmModel.load(upper_arm_m=upper, forearm_m=lower)
    poses = arm.forward(arm.random_configurations(20, np.random.default_rng(3)))
    np.testing.assert_allclose(np.linalg.norm(poses["elbow"][:, :3], axis=1), upper)
    np.testing.assert_allclose(np.linalg.norm(poses["wrist"][:, :3] - poses["elbow"][:, :3], axis=1), lower)
    for index, stretch in ((1, upper / RIGHT.upper_arm_m), (2, lower / RIGHT.forearm_m)):
        mine, average = arm.pinocchio.inertias[index], RIGHT.pinocchio.inertias[index]
        assert mine.mass == pytest.approx(average.mass * stretch**3)
        np.testing.assert_allclose(mine.inertia, average.inertia * stretch**5)


def test_rest_and_random_configurations_keep_every_limit() -> None:
    assert not RIGHT.excess(RIGHT.rest).any()
    assert not RIGHT.excess(RIGHT.random_configurations(2000, np.random.default_rng(4))).any()


def test_clamping_brings_any_configuration_inside_and_leaves_those_inside_alone() -> None:
    q = anywhere(2000, 5)
    assert (RIGHT.excess(q) != 0).any(axis=0).all()  # every limit is broken by some
    clamped = RIGHT.clamp(q)
    assert np.abs(RIGHT.excess(clamped)).max() < 1e-12
    np.testing.assert_allclose(RIGHT.clamp(clamped), clamped, atol=1e-12)


def test_limits_can_be_replaced_by_name() -> None:
    arm = ArmModel.load(limits={"elbow_flexion": (0.1, 2.0), "shoulder_twist": (-1.0, 1.0)})
    assert (arm.lower[0], arm.upper[0]) == (0.1, 2.0)
    assert arm.twist_range == pytest.approx((-1.0, 1.0))
    assert arm.rest[4] >= 0.1


@pytest.mark.parametrize("name", ["upper_arm_m", "forearm_m", "hand_m"])
@pytest.mark.parametrize("length", [0.0, -0.3, 2.5, float("nan"), float("inf")])
def test_a_length_that_no_arm_has_is_refused_by_name(name: str, length: float) -> None:
    with pytest.raises(ModelError, match=name):
        ArmModel.load(**{name: length})  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["elbow_flexion", "wrist_axial", "shoulder_twist"])
def test_a_lower_limit_above_the_upper_is_refused_by_name(name: str) -> None:
    with pytest.raises(ModelError, match=f"{name} has its lower limit 57.3 above its upper 28.6"):
        ArmModel.load(limits={name: (1.0, 0.5)})


def test_an_unknown_limit_and_an_unknown_side_are_refused() -> None:
    with pytest.raises(ModelError, match="knee"):
        ArmModel.load(limits={"knee": (0.0, 1.0)})
    with pytest.raises(ModelError, match="middle"):
        ArmModel.load("middle")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("old", "new", "cause"),
    [
        ('type="ball"', 'type="hinge"', "ball joint"),
        ('axis="0 0 1" range="0 154"', 'axis="1 0 0" range="0 154"', "Z, X, Y"),
        ('name="forearm" pos="0 -0.3255 0"', 'name="forearm" pos="0.1 -0.3255 0"', "-y axis"),
        ('site name="hand"', 'site name="fist"', "site named 'hand'"),
        ('site name="hand" pos="0 0 0"', 'site name="hand" pos="0 -0.1 0"', "at the wrist"),
        ('data="-105 95"', 'data="-105"', "shoulder_twist_range"),
        ('data="-105 95"', 'data="95 -105"', "shoulder_twist has its lower limit"),
        ('name="shoulder_swing_centre" data="1 0 1"', 'name="shoulder_swing_centre" data="1 1 1"', "horizontal"),
        ('range="0 154"', "", "elbow_flexion"),
        ("</mujoco>", "", "human_arm.xml"),
    ],
)
def test_a_file_of_another_structure_is_refused_with_its_cause(tmp_path: Path, old: str, new: str, cause: str) -> None:
    text = MODEL.read_text()
    assert text.count(old) == 1
    path = tmp_path / "human_arm.xml"
    path.write_text(text.replace(old, new))
    with pytest.raises(ModelError, match=cause):
        ArmModel.load(path=path)


def test_a_missing_file_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"nowhere\.xml"):
        ArmModel.load(path=tmp_path / "nowhere.xml")


def test_forward_refuses_rows_of_another_length() -> None:
    with pytest.raises(ValueError, match=r"\(10,\) or \(N, 10\)"):
        RIGHT.forward(np.zeros(9))
