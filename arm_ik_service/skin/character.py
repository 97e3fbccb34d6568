"""A stranger's mesh made ours: bones gathered into the parts that we can move, axes OpenXR's, and how its arms rest.

The origin is the middle between the shoulder joints, x to the person's right, y up, z back: the chest frame of the
published state. How far an arm is raised, bent and pronated at rest, as in an A-pose or a T-pose, is measured from the
joints, and expressed in the bone axes of the published state; from there on rest poses no longer matter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from arm_ik_service.errors import SkinError
from arm_ik_service.geometry import batch
from arm_ik_service.skin.mesh import Floats, SkinnedMesh, pack_weights
from arm_ik_service.skin.seams import joints_in_mesh
from arm_ik_service.wire.messages import SIDES, Side

ARM_PARTS = ("Shoulder", "UpperArm", "LowerArm", "Hand")
PARTS = ("hips", "chest", "neck", "head", *(f"{side}{part}" for side in SIDES for part in ARM_PARTS))
BENT = 0.25  # sine of the elbow's angle at rest from which the bend tells where the elbow's hinge is
SHORTEST_M = 1e-4

UP = np.array([0.0, 1.0, 0.0])
FORWARD = np.array([0.0, 0.0, -1.0])
# The OpenXR wrist frame in ISB hand axes: +y out of the back is -x, +z away from the fingers is +y.
ISB_FROM_WRIST = np.array([-0.5, 0.5, 0.5, 0.5])


@dataclass(frozen=True)
class ArmRest:
    """One arm at rest in the character's frame: joints (3) [m], axes of the published bones as quaternions (4)."""

    shoulder: Floats
    elbow: Floats
    wrist: Floats
    upper_arm: Floats
    forearm: Floats
    hand: Floats  # OpenXR wrist frame
    clavicle: Floats | None  # joint (3); None where the skeleton has none


@dataclass(frozen=True)
class Character:
    """A mesh on PARTS, then whatever else was added behind them, and its arms."""

    mesh: SkinnedMesh
    arms: dict[Side, ArmRest]
    has: frozenset[str]  # the PARTS that the skeleton has
    notes: tuple[str, ...] = ()  # what was mended, a line each


def character_of(mesh: SkinnedMesh, roles: Mapping[str, int]) -> Character:
    """Gather the bones of `mesh` into PARTS and measure its arms. Raises SkinError for arms without length."""
    found, notes = joints_in_mesh(mesh, roles)
    joints = _to_chest_frame(found, found, roles)
    labels = _labels(mesh, roles)
    part_joints = np.array([joints[roles[part]] if part in roles else np.zeros(3) for part in PARTS])
    bones, weights = pack_weights(labels[mesh.bones], mesh.weights, len(PARTS))
    turned = replace(
        mesh,
        vertices=_to_chest_frame(mesh.vertices, found, roles),
        normals=mesh.normals @ _chest_axes(found, roles).T,
        names=PARTS,
        parents=tuple(_parent(part) for part in PARTS),
        joints=part_joints,
        bones=bones,
        weights=weights,
    )
    arms = {side: _measure(side, joints, roles, turned) for side in SIDES}
    return Character(turned, arms, frozenset(part for part in PARTS if part in roles), tuple(notes))


def _parent(part: str) -> int:
    above = {"hips": "chest", "chest": "", "neck": "chest", "head": "neck"}
    for side in SIDES:
        above |= {side + b: side + a for a, b in pairwise(ARM_PARTS)}
        above[f"{side}Shoulder"] = "chest"
    return PARTS.index(above[part]) if above[part] else -1


def _chest_axes(joints: Floats, roles: Mapping[str, int]) -> Floats:
    """Rows: the person's right, up and back in the file's axes (glTF and OBJ: y up)."""
    right = (joints[roles["rightUpperArm"]] - joints[roles["leftUpperArm"]]) * [1.0, 0.0, 1.0]
    if np.linalg.norm(right) < SHORTEST_M:
        raise SkinError("its shoulder joints lie in one place or above each other: is it y up, and in its rest pose?")
    right = batch.normalized(right)
    return np.stack([right, UP, np.cross(right, UP)])


def _to_chest_frame(points: Floats, joints: Floats, roles: Mapping[str, int]) -> Floats:
    middle = 0.5 * (joints[roles["rightUpperArm"]] + joints[roles["leftUpperArm"]])
    return np.asarray((points - middle) @ _chest_axes(joints, roles).T)


def _ancestors(parents: Sequence[int], bone: int) -> list[int]:
    above: list[int] = []
    while (bone := parents[bone]) >= 0 and len(above) < len(parents):
        above.append(bone)
    return above


def _labels(mesh: SkinnedMesh, roles: Mapping[str, int]) -> npt.NDArray[np.int64]:
    """Return the part (B,) that carries each bone: its own, else that of the nearest bone above that has one.

    The spine is chest; what hangs on the hips besides it, and the hips, are hips.
    """
    own = {roles[part]: part for part in PARTS if part in roles}
    hips = roles.get("hips", -1)
    for side in SIDES:
        above = _ancestors(mesh.parents, roles[f"{side}UpperArm"])
        if hips in above:
            for bone in above[: above.index(hips)]:
                own.setdefault(bone, "chest")
    labels = np.empty(len(mesh.names), np.int64)
    for bone in range(len(mesh.names)):
        carriers = [own[b] for b in (bone, *_ancestors(mesh.parents, bone)) if b in own]
        outermost = "hips" if hips >= 0 else "chest"  # what lies above the hips moves with them
        labels[bone] = PARTS.index(carriers[0] if carriers else outermost)
    return labels


def _measure(side: Side, joints: Floats, roles: Mapping[str, int], mesh: SkinnedMesh) -> ArmRest:
    shoulder, elbow, wrist = (joints[roles[side + part]] for part in ("UpperArm", "LowerArm", "Hand"))
    for name, length in (("upper arm", shoulder - elbow), ("forearm", elbow - wrist)):
        if np.linalg.norm(length) < SHORTEST_M:
            raise SkinError(f"its {side} {name} has no length: are joints missing or all in one place?")
    y = batch.normalized(shoulder - elbow)
    along = batch.normalized(wrist - elbow)
    bend = (
        along + (along @ -y) * y
    )  # the part of the forearm's direction across the upper arm: to the front of the hinge
    anterior = bend if np.linalg.norm(bend) > BENT else FORWARD - (FORWARD @ y) * y
    upper_arm = _frame(x=anterior, y=y)
    hand = _hand_frame(side, joints, roles, mesh, wrist)
    bone = batch.multiply(hand, batch.conjugate(ISB_FROM_WRIST))
    forearm = batch.multiply(_between(batch.rotate(bone, UP), -along), bone)
    clavicle = joints[roles[f"{side}Shoulder"]] if f"{side}Shoulder" in roles else None
    return ArmRest(shoulder, elbow, wrist, upper_arm, forearm, hand, clavicle)


def _hand_frame(side: Side, joints: Floats, roles: Mapping[str, int], mesh: SkinnedMesh, wrist: Floats) -> Floats:
    """OpenXR wrist axes at rest from the knuckles; without them from the hand's own vertices, palm down or inwards."""
    sign = 1.0 if side == "right" else -1.0
    knuckles = [joints[roles[side + name]] for name in ("IndexProximal", "LittleProximal") if side + name in roles]
    if f"{side}MiddleProximal" in roles:
        fingers = joints[roles[f"{side}MiddleProximal"]] - wrist
    elif len(knuckles) == 2:
        fingers = 0.5 * (knuckles[0] + knuckles[1]) - wrist
    else:
        mine = (mesh.bones == PARTS.index(f"{side}Hand")) & (mesh.weights > 0.5)
        fingers = mesh.vertices[mine.any(axis=1)].mean(axis=0) - wrist if mine.any() else sign * np.array([1.0, 0, 0])
    z = batch.normalized(-fingers)
    if len(knuckles) == 2:
        to_little = knuckles[1] - knuckles[0]
        x = sign * (to_little - (to_little @ z) * z)
    elif f"{side}ThumbMetacarpal" in roles:
        to_thumb = joints[roles[f"{side}ThumbMetacarpal"]] - wrist
        x = -sign * (to_thumb - (to_thumb @ z) * z)
    else:
        back = np.hypot(z[0], z[2]) * UP + abs(z[1]) * np.array([sign, 0.0, 0.0])
        x = np.cross(back, z)
    return _frame(x=x, z=z)


def _frame(*, x: Floats, y: Floats | None = None, z: Floats | None = None) -> Floats:
    """Quaternion with these axes; x is made perpendicular to the other one."""
    if y is not None:
        x = batch.normalized(x - (x @ y) * y)
        z = np.cross(x, y)
    else:
        assert z is not None
        x = batch.normalized(x - (x @ z) * z)
        y = np.cross(z, x)
    return batch.from_matrix(np.stack([x, y, z], axis=-1))


def _between(a: Floats, b: Floats) -> Floats:
    """Shortest rotation (..., 4) from unit vectors a to b (..., 3) that are not opposite."""
    w = 1.0 + np.sum(a * b, axis=-1, keepdims=True)
    return batch.normalized(np.concatenate([np.cross(a, b), np.maximum(w, 1e-9)], axis=-1))
