"""A character made as large as a person: its joints come to lie where the published ones will be.

Once, before anything moves: all of it is scaled, a whole body by its stature, arms alone by their length; then the
shoulders are set apart, and upper arms and forearms stretched, each along itself. Afterwards bones move rigidly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from arm_ik_service.geometry import batch
from arm_ik_service.skin.character import PARTS, ArmRest, Character
from arm_ik_service.skin.mesh import Floats
from arm_ik_service.wire.messages import SIDES, Side


@dataclass(frozen=True)
class ArmMeasures:
    """Of the person [m]; `shoulder_width` is between the two glenohumeral joints."""

    stature: float
    upper_arm: float
    forearm: float
    shoulder_width: float


def fit(character: Character, measures: ArmMeasures) -> Character:
    """Return the character with these measures."""
    arms = list(character.arms.values())
    length = np.mean([np.linalg.norm(a.shoulder - a.elbow) + np.linalg.norm(a.elbow - a.wrist) for a in arms])
    scale = (measures.upper_arm + measures.forearm) / length
    if "hips" in character.has:
        scale = measures.stature / float(np.ptp(character.mesh.vertices[:, 1]))
    maps = np.tile(np.concatenate([scale * np.eye(3), np.zeros((3, 1))], axis=1), (len(character.mesh.names), 1, 1))
    # a wider girdle makes the trunk wider, by half as much in proportion: shoulders then do not stand out from it
    half_width = np.mean([abs(arm.shoulder[0]) for arm in arms])
    wider = np.clip(0.5 * measures.shoulder_width / (scale * half_width), 0.7, 1.4)
    maps[PARTS.index("chest"), 0, 0] *= np.sqrt(wider)
    fitted = {side: _fit_arm(side, arm, scale, measures, maps) for side, arm in character.arms.items()}

    mesh = character.mesh
    blended = np.einsum("vk,vkij->vij", mesh.weights, maps[mesh.bones])
    normals = np.linalg.solve(blended[:, :, :3].transpose(0, 2, 1), mesh.normals[..., None])[..., 0]
    joints = scale * mesh.joints
    for side, arm in fitted.items():
        for part, joint in (("UpperArm", arm.shoulder), ("LowerArm", arm.elbow), ("Hand", arm.wrist)):
            joints[PARTS.index(side + part)] = joint
    return replace(
        character,
        mesh=replace(
            mesh,
            vertices=np.einsum("vij,vj->vi", blended[:, :, :3], mesh.vertices) + blended[:, :, 3],
            normals=batch.normalized(normals),
            joints=joints,
        ),
        arms={side: fitted[side] for side in SIDES},
    )


def _fit_arm(side: Side, arm: ArmRest, scale: float, measures: ArmMeasures, maps: Floats) -> ArmRest:
    """Write the maps (3,4) of one arm's parts, from the unscaled character, and return the arm at its new size."""
    sign = 1.0 if side == "right" else -1.0
    shoulder = np.array([0.5 * sign * measures.shoulder_width, 0.0, 0.0])
    elbow = shoulder + measures.upper_arm * batch.normalized(arm.elbow - arm.shoulder)
    wrist = elbow + measures.forearm * batch.normalized(arm.wrist - arm.elbow)
    clavicle = None if arm.clavicle is None else scale * arm.clavicle

    def write(part: str, start: Floats, end: Floats, new_start: Floats, new_end: Floats) -> None:
        axis = batch.normalized(end - start)
        stretch = np.linalg.norm(new_end - new_start) / (scale * np.linalg.norm(end - start))
        linear = scale * (np.eye(3) + (stretch - 1.0) * np.outer(axis, axis))
        maps[PARTS.index(side + part)] = np.column_stack([linear, new_start - linear @ start])

    write("UpperArm", arm.shoulder, arm.elbow, shoulder, elbow)
    write("LowerArm", arm.elbow, arm.wrist, elbow, wrist)
    maps[PARTS.index(f"{side}Hand")] = np.column_stack([scale * np.eye(3), wrist - scale * arm.wrist])
    if arm.clavicle is not None and clavicle is not None:
        across = arm.shoulder[0] - arm.clavicle[0]
        stretch = (shoulder[0] - clavicle[0]) / (scale * across) if abs(across) > 1e-3 else 1.0
        linear = scale * np.diag([max(stretch, 0.2), 1.0, 1.0])
        maps[PARTS.index(f"{side}Shoulder")] = np.column_stack([linear, clavicle - linear @ arm.clavicle])
    return replace(arm, shoulder=shoulder, elbow=elbow, wrist=wrist, clavicle=clavicle)
