"""People in postures given by their joint angles: the poses that a puppet follows, from the arm model itself."""

from __future__ import annotations

import numpy as np

from arm_ik_service.arm.chain import bone_from_arm
from arm_ik_service.arm.model import ArmModel
from arm_ik_service.geometry import batch
from arm_ik_service.skin.fit import ArmMeasures
from arm_ik_service.skin.mesh import Floats
from arm_ik_service.wire.messages import SIDES

MEASURES = ArmMeasures(stature=1.75, upper_arm=0.31, forearm=0.26, shoulder_width=0.36)
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])
CHEST = np.array([0.1, 1.4, -0.2, *LEVEL])


def configuration(
    *, abduction: float = 0.0, flexion: float = 0.0, elbow: float = 0.0, pronation: float = 85.0, wrist: float = 0.0
) -> Floats:
    """Configuration (10,) of angles [deg]; what is not named is 0, pronation the middle of its range."""
    swing = batch.exp(np.radians([-abduction, 0.0, flexion]))
    return np.concatenate([swing, np.radians([elbow, 0.0, pronation, wrist, 0.0, 0.0])])


def poses(*configurations: Floats, chest: Floats = CHEST) -> dict[str, Floats]:
    """World poses (N,7) of a person whose arms have the same configurations (10,) on both sides."""
    count = len(configurations)
    world = {"chest": np.tile(chest, (count, 1))}
    world["head"] = batch.compose(world["chest"], np.array([0.0, 0.25, -0.1, *LEVEL]))
    for side, sign in zip(SIDES, (-1.0, 1.0), strict=True):
        model = ArmModel.load(side, MEASURES.upper_arm, MEASURES.forearm)
        shoulder = np.array([0.5 * sign * MEASURES.shoulder_width, 0.0, 0.0, *LEVEL])
        found = model.forward(np.stack(configurations))
        humeri = np.array([bone_from_arm(model.chains[0], tuple(c[:4])) for c in configurations])
        local = {
            "upper_arm": np.concatenate([np.zeros((count, 3)), humeri], axis=1),
            "forearm": found["elbow"],
            "hand": found["hand"],
        }
        for bone, pose in local.items():
            world[f"{side}/{bone}"] = batch.compose(world["chest"], batch.compose(shoulder, pose))
    return world
