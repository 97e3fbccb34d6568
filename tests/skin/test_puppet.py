"""A character on the published bones: it stands where they stand, whatever pose it was modelled in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from arm_poses import CHEST, MEASURES, configuration, poses

from arm_ik_service.geometry import batch
from arm_ik_service.skin.blend import Skinning, skin
from arm_ik_service.skin.builtin import built_in_arms
from arm_ik_service.skin.character import PARTS, Character, character_of
from arm_ik_service.skin.load import load_built_in_arms
from arm_ik_service.skin.mesh import Floats, SkinnedMesh
from arm_ik_service.skin.names import find_roles
from arm_ik_service.skin.puppet import Puppet
from arm_ik_service.skin.twist import along
from arm_ik_service.wire.messages import SIDES, Side

REACHING = configuration(abduction=40.0, flexion=50.0, elbow=70.0, pronation=120.0, wrist=20.0)
HANGING = configuration()


def on_hand(mesh: SkinnedMesh, side: Side) -> npt.NDArray[np.bool_]:
    return np.asarray((mesh.bones[:, 0] == PARTS.index(f"{side}Hand")) & (mesh.weights[:, 0] > 1.0 - 1e-12))


def at_rest(puppet: Puppet) -> dict[str, Floats]:
    """The poses of a person who stands as the character was modelled."""
    rest = {"chest": np.array([[0.0, 0, 0, 0, 0, 0, 1]]), "head": np.array([[0.0, 0.3, -0.1, 0, 0, 0, 1]])}
    for side, arm in puppet.arms.items():
        for bone, joint in (("upper_arm", arm.shoulder), ("forearm", arm.elbow), ("hand", arm.wrist)):
            rest[f"{side}/{bone}"] = np.array([[*joint, *getattr(arm, bone)]])
    return rest


def test_a_person_who_stands_as_the_character_rests_leaves_the_mesh_as_it_is() -> None:
    puppet = Puppet(load_built_in_arms(), MEASURES)
    vertices, normals = puppet.skin(puppet.motions(at_rest(puppet))[0])
    np.testing.assert_allclose(vertices, puppet.mesh.vertices, atol=1e-12)
    np.testing.assert_allclose(normals, puppet.mesh.normals, atol=1e-12)


@pytest.mark.parametrize("how", ["linear", "dual_quaternion"])
def test_hands_are_carried_rigidly_by_the_published_hands(how: Skinning) -> None:
    puppet = Puppet(load_built_in_arms(), MEASURES, how)
    followed = poses(HANGING, REACHING)
    motions = puppet.motions(followed)
    for side in SIDES:
        hand = on_hand(puppet.mesh, side)
        seen = []
        for k in range(2):
            back = batch.inverse(followed[f"{side}/hand"][k])
            seen.append(back[:3] + batch.rotate(back[3:], puppet.skin(motions[k])[0][hand]))
        np.testing.assert_allclose(seen[0], seen[1], atol=1e-12)
        # OpenXR wrist axes: fingers along -z, and the thumb of a right hand at the left of its back
        assert seen[0][:, 2].min() < -0.12
        assert seen[0][:, 2].max() < 0.04
        outward = 1.0 if side == "right" else -1.0
        assert (seen[0][:, 0] * outward).min() < -0.045, "the thumb"
        assert (seen[0][:, 0] * outward).max() < 0.048


def test_the_arm_has_the_person_s_lengths_and_its_joints_are_where_the_bones_meet() -> None:
    puppet = Puppet(load_built_in_arms(), MEASURES)
    followed = poses(REACHING)
    motions = puppet.motions(followed)[0]
    for side, arm in puppet.arms.items():
        assert np.isclose(np.linalg.norm(arm.shoulder - arm.elbow), MEASURES.upper_arm)
        assert np.isclose(np.linalg.norm(arm.elbow - arm.wrist), MEASURES.forearm)
        for joint, carriers, published in (
            (arm.elbow, ("UpperArm", "LowerArm"), "forearm"),
            (arm.wrist, ("LowerArm", "Hand"), "hand"),
        ):
            for part in carriers:
                motion = motions[PARTS.index(side + part)]
                place = motion[:3] + batch.rotate(motion[3:], joint)
                np.testing.assert_allclose(place, followed[f"{side}/{published}"][0, :3], atol=1e-9)


def re_posed(mesh: SkinnedMesh, cfg: Floats) -> SkinnedMesh:
    """The built-in arms as if they had been modelled in another pose: their mesh and joints moved."""
    character = load_built_in_arms()
    puppet = Puppet(character, MEASURES, segments=1)
    motions = puppet.motions(poses(cfg, chest=np.array([0.0, 0, 0, 0, 0, 0, 1])))[0]
    vertices, normals = skin(puppet.mesh, motions)
    roles = find_roles(mesh.names)
    joints = mesh.joints.copy()
    for name, bone in roles.items():
        side: Side = "left" if name.startswith("left") else "right"
        carrier = name if name in PARTS else f"{side}Hand"
        motion = motions[PARTS.index(carrier)]
        arm = puppet.arms[side]
        rest = {"UpperArm": arm.shoulder, "LowerArm": arm.elbow, "Hand": arm.wrist}.get(name.removeprefix(side))
        if rest is None:  # a knuckle keeps its place on the hand, which is scaled with all of it
            old = character.mesh.joints[PARTS.index(f"{side}Hand")]
            scale = (MEASURES.upper_arm + MEASURES.forearm) / (0.186 * 1.75 + 0.146 * 1.75)
            rest = arm.wrist + scale * (mesh.joints[bone] - old)
        joints[bone] = motion[:3] + batch.rotate(motion[3:], rest)
    return replace(mesh, vertices=vertices, normals=normals, joints=joints)


def character_resting(cfg: Floats) -> Character:
    mesh = re_posed(built_in_arms(), cfg)
    return character_of(mesh, find_roles(mesh.names))


@pytest.mark.parametrize(
    "rest",
    [
        configuration(abduction=90.0),
        configuration(abduction=45.0),
        configuration(abduction=60.0, elbow=40.0, pronation=110.0),
        configuration(abduction=10.0, pronation=60.0),
    ],
    ids=["T", "A", "A with bent elbows", "arms at the sides"],
)
def test_the_rest_pose_of_a_character_does_not_show(rest: Floats) -> None:
    """Modelled in another pose it is driven to the same place: hands exactly, the rest but for how its joints blend."""
    ours, other = Puppet(load_built_in_arms(), MEASURES), Puppet(character_resting(rest), MEASURES)
    for wanted in (REACHING, HANGING):
        motions = (one.motions(poses(wanted))[0] for one in (ours, other))
        (a, _), (b, _) = (one.skin(m) for one, m in zip((ours, other), motions, strict=True))
        hands = on_hand(ours.mesh, "left") | on_hand(ours.mesh, "right")
        np.testing.assert_allclose(a[hands], b[hands], atol=1e-9)
        assert np.linalg.norm(a - b, axis=1).mean() < 0.004


def test_pronation_grows_along_the_forearm_and_the_elbow_s_skin_stays() -> None:
    puppet = Puppet(load_built_in_arms(), MEASURES)
    followed = poses(configuration(elbow=60.0, pronation=10.0), configuration(elbow=60.0, pronation=170.0))
    motions = puppet.motions(followed)
    mesh, arm = puppet.mesh, puppet.arms["right"]
    place = along(mesh.vertices, arm.elbow, arm.wrist)
    forearm = followed["right/forearm"]
    turned = []
    for low, high in ((0.25, 0.3), (0.45, 0.55), (0.8, 0.85)):
        ring = (mesh.vertices[:, 0] > 0.0) & (place > low) & (place < high)
        local = []
        for k in range(2):
            back = batch.inverse([*forearm[0, :3], *forearm[0, 3:]])
            local.append(back[:3] + batch.rotate(back[3:], puppet.skin(motions[k])[0][ring]))
        angle = [np.unwrap(np.arctan2(one[:, 0], one[:, 2])) for one in local]
        turn = np.angle(np.exp(1j * (angle[1] - angle[0])))
        turned.append(np.degrees(np.mean(turn)))
    middles = np.array([0.275, 0.5, 0.825])
    np.testing.assert_allclose(turned, 160.0 * middles, atol=8.0)


def test_head_and_hips_follow_in_their_own_way() -> None:
    """A chest that leans takes the hips along in heading only; the neck turns half as far as the head."""
    mesh = built_in_arms()
    names = ("hips", "neck", "head")
    whole = replace(
        mesh,
        names=(*mesh.names, *names),
        parents=(len(mesh.names), *mesh.parents[1:], -1, 0, len(mesh.names) + 1),
        joints=np.concatenate([mesh.joints, [[0.0, -0.4, 0.0], [0.0, 0.08, 0.0], [0.0, 0.18, 0.0]]]),
    )
    puppet = Puppet(character_of(whole, find_roles(whole.names)), MEASURES)
    yaw, lean, look = (batch.exp(np.array(w)) for w in ([0.0, 0.5, 0.0], [-0.3, 0.0, 0.0], [0.0, 0.6, 0.0]))
    chest = np.array([*CHEST[:3], *batch.multiply(yaw, lean)])
    followed = poses(HANGING, chest=chest)
    followed["head"][:, 3:] = batch.multiply(chest[3:], look)
    motions = puppet.motions(followed)[0]
    hips, neck, head = (motions[PARTS.index(name)] for name in names)
    np.testing.assert_allclose(hips[3:], yaw, atol=1e-9)
    waist = puppet.mesh.joints[PARTS.index("hips")]
    np.testing.assert_allclose(
        hips[:3] + batch.rotate(hips[3:], waist), chest[:3] + batch.rotate(chest[3:], waist), atol=1e-9
    )
    np.testing.assert_allclose(batch.angle_between(chest[3:], neck[3:]), 0.3, atol=1e-9)
    np.testing.assert_allclose(head[3:], followed["head"][0, 3:])
