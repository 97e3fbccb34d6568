"""Legs for the picture: feet on a key-framed cycle, on the floor while they stand, and knees that follow from them."""

from __future__ import annotations

import math

import numpy as np

from arm_ik_service.geometry import batch
from arm_ik_service.programs.grab.walk import Floats, along_cycle

ANKLE_PER_STATURE, HIP_PER_STATURE, SHANK_PER_STATURE = 0.039, 0.53, 0.246  # Drillis & Contini, in Winter
THIGH_PER_STATURE = HIP_PER_STATURE - ANKLE_PER_STATURE - SHANK_PER_STATURE
FOOT_M, HALF_HIPS_M = 0.17, 0.09  # ankle to toe; hips from the middle

# The right foot at eight instants from one of its heel strikes to the next: ankle before the hips [m], above where it
# stands [m], foot turned toe down [deg]. In the first half it stands, so it goes back as fast as the body goes on, an
# eighth of the cycle's way a key; in the second it swings.
_KEYS = np.array(
    [
        (0.250, 0.000, -14.0),
        (0.081, 0.000, 0.0),
        (-0.088, 0.000, 0.0),
        (-0.256, 0.025, 10.0),
        (-0.425, 0.105, 40.0),
        (-0.330, 0.160, 38.0),
        (0.000, 0.090, 5.0),
        (0.240, 0.040, -14.0),
    ]
)


def legs(place: Floats, heading: float, height: float, stature_m: float, phase: float, stride: float) -> Floats:
    """Hip, knee, ankle and toe of left and right (2,4,3) [m] of somebody whose hips are at `place` (x, z).

    `height` [m] is that of the hips above upright standing; `stride` 0 stands, 1 walks. Where a leg is too short for
    its foot, the foot is lifted.
    """
    ahead = np.array([-math.sin(heading), 0.0, -math.cos(heading)])
    right, up = np.array([-ahead[2], 0.0, ahead[0]]), np.array([0.0, 1.0, 0.0])
    thigh, shank = THIGH_PER_STATURE * stature_m, SHANK_PER_STATURE * stature_m
    middle = np.array([place[0], HIP_PER_STATURE * stature_m + height, place[1]])
    joints = np.empty((2, 4, 3))
    for k, (sign, late) in enumerate(((-1.0, 0.5), (1.0, 0.0))):
        forward, lift, pitch = stride * along_cycle(_KEYS, phase + late)
        hip = middle + sign * HALF_HIPS_M * right
        ankle = hip + forward * ahead
        ankle[1] = ANKLE_PER_STATURE * stature_m + lift
        line = ankle - hip
        distance = min(float(np.linalg.norm(line)), 0.999 * (thigh + shank))
        line = batch.normalized(line)
        along = (thigh**2 - shank**2 + distance**2) / (2.0 * distance)
        out = np.cross(right, line)  # where knees bend to
        knee = hip + along * line + math.sqrt(max(thigh**2 - along**2, 0.0)) * batch.normalized(out)
        ankle = hip + distance * line
        turn = math.radians(pitch)
        toe = ankle + FOOT_M * (math.cos(turn) * ahead - math.sin(turn) * up) - 0.6 * ANKLE_PER_STATURE * stature_m * up
        joints[k] = hip, knee, ankle, toe
    return joints
