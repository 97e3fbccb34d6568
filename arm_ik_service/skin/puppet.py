"""A character moved by the published state of a person's arms."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arm_ik_service.geometry import batch
from arm_ik_service.skin.blend import Skinning, skin
from arm_ik_service.skin.character import PARTS, Character
from arm_ik_service.skin.fit import ArmMeasures, fit
from arm_ik_service.skin.mesh import Floats, SkinnedMesh
from arm_ik_service.skin.twist import SEGMENTS, TwistSegments, share_twist, split
from arm_ik_service.wire.messages import SIDES, ArmsState, Side


def poses_of(arms: ArmsState) -> dict[str, Floats]:
    """The poses that a puppet follows, (1,7) each, by name: chest, head, and of each side upper_arm, forearm, hand."""
    poses = {"chest": arms.chest, "head": arms.head}
    for side, arm in (("left", arms.left), ("right", arms.right)):
        bones = arm.bones
        poses |= {f"{side}/upper_arm": bones.upper_arm, f"{side}/forearm": bones.forearm, f"{side}/hand": bones.hand}
    return {name: np.array([[*pose.position, *pose.orientation]]) for name, pose in poses.items()}


class Puppet:
    """A character of a person's measures.

    >>> puppet = Puppet(load_avatar(Path("person.vrm")), ArmMeasures(1.75, 0.33, 0.26, 0.36))
    >>> vertices, normals = puppet.skin(puppet.motions(poses_of(arms))[0])

    Hands, elbows and shoulders lie where the published ones are. Clavicles point to the shoulders, head and chest turn
    as published, the neck half as far as the head, hips and legs follow the chest's heading and stay upright.
    """

    def __init__(
        self,
        character: Character,
        measures: ArmMeasures,
        skinning: Skinning = "dual_quaternion",
        *,
        segments: int = SEGMENTS,
    ) -> None:
        """Fit the character to the measures and spread the twist of its arms over `segments` (1: not at all)."""
        fitted = fit(character, measures)
        self.mesh: SkinnedMesh = fitted.mesh
        self.skinning: Skinning = skinning
        self.arms = fitted.arms  # at rest
        self._has = fitted.has
        self._segments: dict[tuple[Side, str], TwistSegments] = {}
        for side, arm in fitted.arms.items():
            for part, end in (("UpperArm", arm.elbow), ("LowerArm", arm.wrist)):
                self.mesh, made = split(self.mesh, PARTS.index(side + part), end, segments)
                self._segments[side, part] = made

    def skin(self, motions: Floats) -> tuple[Floats, Floats]:
        """Vertices and normals (V,3) in world axes for the motions (B,7) of one instant."""
        return skin(self.mesh, motions, self.skinning)

    def motions(self, poses: Mapping[str, Floats]) -> Floats:
        """Motions from rest (N,B,7) for world poses (N,7) by the names that `poses_of` gives."""
        chest, head = poses["chest"], poses["head"]
        motions = np.repeat(chest[:, None, :], len(self.mesh.names), axis=1)
        if "hips" in self._has:
            upright = batch.normalized(chest[:, 3:] * [0.0, 1.0, 0.0, 1.0])  # its turn about y, as it never lies down
            waist = self._joint("hips")
            motions[:, PARTS.index("hips")] = _about(waist, _moved(chest, waist), upright)
        self._turn_head(motions, chest, head)
        for side in SIDES:
            self._move_arm(motions, side, chest, poses)
        return motions

    def _joint(self, part: str) -> Floats:
        return np.asarray(self.mesh.joints[PARTS.index(part)])

    def _turn_head(self, motions: Floats, chest: Floats, head: Floats) -> None:
        carrier = chest
        if "neck" in self._has:
            aligned = head[:, 3:] * np.where(np.sum(head[:, 3:] * chest[:, 3:], axis=1, keepdims=True) < 0, -1, 1)
            half = batch.normalized(chest[:, 3:] + aligned)
            carrier = _about(self._joint("neck"), _moved(chest, self._joint("neck")), half)
            motions[:, PARTS.index("neck")] = carrier
        if "head" in self._has:
            motions[:, PARTS.index("head")] = _about(
                self._joint("head"), _moved(carrier, self._joint("head")), head[:, 3:]
            )

    def _move_arm(self, motions: Floats, side: Side, chest: Floats, poses: Mapping[str, Floats]) -> None:
        arm = self.arms[side]
        upper, fore, hand = (poses[f"{side}/{name}"] for name in ("upper_arm", "forearm", "hand"))
        girdle = chest[:, 3:]
        if arm.clavicle is not None:
            root = _moved(chest, arm.clavicle)
            rest = batch.rotate(girdle, arm.shoulder - arm.clavicle)
            now = upper[:, :3] - root
            girdle = batch.multiply(_between(batch.normalized(rest), batch.normalized(now)), girdle)
            motions[:, PARTS.index(f"{side}Shoulder")] = _about(arm.clavicle, root, girdle)
        upper_turn = batch.multiply(upper[:, 3:], batch.conjugate(arm.upper_arm))
        fore_turn = batch.multiply(fore[:, 3:], batch.conjugate(arm.forearm))
        hand_turn = batch.multiply(hand[:, 3:], batch.conjugate(arm.hand))
        for part, joint, place, parent, turn, end in (
            ("UpperArm", arm.shoulder, upper[:, :3], girdle, upper_turn, arm.elbow),
            ("LowerArm", arm.elbow, fore[:, :3], upper_turn, fore_turn, arm.wrist),
        ):
            segments = self._segments[side, part]
            turns = share_twist(parent, turn, batch.normalized(end - joint), segments.shares)
            motions[:, segments.bones] = _about(joint, place[:, None, :], turns)
        motions[:, PARTS.index(f"{side}Hand")] = _about(arm.wrist, hand[:, :3], hand_turn)


def _moved(motion: Floats, point: Floats) -> Floats:
    return np.asarray(motion[:, :3] + batch.rotate(motion[:, 3:], point))


def _about(joint: Floats, place: Floats, turn: Floats) -> Floats:
    """Motions (..., 7) that turn by (..., 4) and take the point `joint` (3) to `place` (..., 3)."""
    offset = place - batch.rotate(turn, joint)
    return np.concatenate([offset, turn], axis=-1)


def _between(a: Floats, b: Floats) -> Floats:
    """Shortest rotations (N,4) from unit vectors a to b (N,3), which are never nearly opposite here."""
    w = np.maximum(1.0 + np.sum(a * b, axis=-1, keepdims=True), 1e-9)
    return batch.normalized(np.concatenate([np.cross(a, b), w], axis=-1))
