"""Which bone is which, by the names that programs give them."""

from __future__ import annotations

import pytest

from arm_ik_service.errors import SkinError
from arm_ik_service.skin.names import find_roles, role_of

# family: what every name begins with, and clavicle, upper arm, forearm, hand of the left, upper arm of the right
FAMILIES = {
    "VRM and Unity": ("", "LeftShoulder|LeftUpperArm|LeftLowerArm|LeftHand|RightUpperArm"),
    "Mixamo": ("mixamorig:", "LeftShoulder|LeftArm|LeftForeArm|LeftHand|RightArm"),
    "Mixamo, numbered": ("mixamorig9:", "LeftShoulder|LeftArm|LeftForeArm|LeftHand|RightArm"),
    "Ready Player Me": ("", "LeftShoulder|LeftArm|LeftForeArm|LeftHand|RightArm"),
    "Unreal": ("", "clavicle_l|upperarm_l|lowerarm_l|hand_l|upperarm_r"),
    "Rigify": ("", "shoulder.L|upper_arm.L|forearm.L|hand.L|upper_arm.R"),
    "Rigify, deforming": ("DEF-", "shoulder.L|upper_arm.L|forearm.L|hand.L|upper_arm.R"),
    "Biped": ("Bip001 ", "L Clavicle|L UpperArm|L Forearm|L Hand|R UpperArm"),
    "VRoid": ("J_Bip_", "L_Shoulder|L_UpperArm|L_LowerArm|L_Hand|R_UpperArm"),
    "Character Creator": ("CC_Base_", "L_Clavicle|L_Upperarm|L_Forearm|L_Hand|R_Upperarm"),
    "Daz": ("", "lCollar|lShldrBend|lForearmBend|lHand|rShldrBend"),
    "Source": ("ValveBiped.Bip01_", "L_Clavicle|L_UpperArm|L_Forearm|L_Hand|R_UpperArm"),
}
OTHERS = "upperarm_twist_01_l|Bip001 L Finger11|LeftHandIndex2|thigh_l|index_03_l|LeftArmRoll|body|"


@pytest.mark.parametrize("family", FAMILIES)
def test_an_arm_is_found_by_the_names_of(family: str) -> None:
    prefix, names = FAMILIES[family]
    roles = [role_of(prefix + name) for name in names.split("|")]
    assert roles == ["leftShoulder", "leftUpperArm", "leftLowerArm", "leftHand", "rightUpperArm"]


@pytest.mark.parametrize("name", OTHERS.split("|"))
def test_a_bone_that_is_something_else_is_none_of_ours(name: str) -> None:
    assert role_of(name) is None


def test_knuckles_are_told_from_the_other_joints_of_fingers() -> None:
    assert role_of("index_01_l") == "leftIndexProximal"
    assert role_of("RightHandPinky1") == "rightLittleProximal"
    assert role_of("Bip001 R Finger2") == "rightMiddleProximal"


def test_the_file_s_own_map_wins_over_names() -> None:
    names = ["a", "b", "c", "d", "e", "f", "LeftUpperArm"]
    declared = {
        f"{side}{part}": 3 * k + i
        for k, side in enumerate(("left", "right"))
        for i, part in enumerate(("UpperArm", "LowerArm", "Hand"))
    }
    assert find_roles(names, declared)["leftUpperArm"] == 0


def test_a_skeleton_of_no_human_is_refused_with_what_is_missing_and_what_is_there() -> None:
    with pytest.raises(SkinError, match=r"no bone found for leftUpperArm, .*rightHand among 2 \(root, tail\)"):
        find_roles(["root", "tail"])
