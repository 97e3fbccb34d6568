"""The same arm for solvers that know hinges only: nine of them, written as URDF and as MJCF from an ArmModel.

The ball becomes three hinges about Z, X, Y of the humerus (flexion, abduction, rotation), in that order, which put the
triple's singularity where the arm is straight out to the side: the sequences X-Z-Y and Y-X-Y have theirs where people
use the arm most, straight ahead and hanging. The other six hinges are the model's own, with its own limits.

The shoulder's region is not a box of three angles. The peers get the box around it, so that they may do everything our
arm may and somewhat more: flexion and rotation go all the way round, and abduction has one real bound, that of the arm
across the body. Its other bound is the same one seen from behind the singularity: every direction can be written with
abduction a or -180 deg - a, and a wall at -90 deg, where the two meet, would stop an arm where no person's stops.
"""

from __future__ import annotations

import math
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import numpy.typing as npt

from arm_ik_service.arm.model import HINGES, ArmModel
from arm_ik_service.geometry import batch
from arm_ik_service.geometry.batch import Array

NAMES = ("shoulder_flexion", "shoulder_abduction", "shoulder_rotation", *HINGES)
AXES = "ZXYZXYZXY"
VECTORS = {"X": "1 0 0", "Y": "0 1 0", "Z": "0 0 1"}
ROUND = 2.0 * math.pi  # range of a hinge that may go all the way round, with no seam where people's arms are
SAMPLES = 20_000  # of the shoulder's region, to find the box around it
MARGIN = 0.02  # [rad] for what lies between the samples
# a token body: kinematics alone is asked for, but readers want inertia
_MASS_KG, _INERTIA = 0.1, 1e-3


class HingeArm:
    """Nine hinges in place of an ArmModel: `lower` and `upper` (9,) [rad], order NAMES. Always the right arm."""

    def __init__(self, arm: ArmModel) -> None:
        chain = arm.chains[0]
        self.arm = arm
        self.shoulder_from_isb = np.array(chain.shoulder_from_isb)
        self.bone_from_hand = np.array(chain.bone_from_hand)
        region = self.shoulder_angles(arm.random_configurations(SAMPLES, np.random.default_rng(0))[:, :4])
        across = float(region[:, 1].max()) + MARGIN
        self.lower = np.array([-ROUND, -math.pi - across, -ROUND, *arm.lower])
        self.upper = np.array([ROUND, across, ROUND, *arm.upper])

    @staticmethod
    def shoulder_angles(rotations: npt.ArrayLike) -> Array:
        """Split shoulder quaternions (N, 4) into the triple (N, 3) [rad]: Rz(flexion) Rx(abduction) Ry(rotation)."""
        m = batch.matrix(rotations)
        flexion = np.arctan2(-m[:, 0, 1], m[:, 1, 1])
        abduction = np.arcsin(np.clip(m[:, 2, 1], -1.0, 1.0))
        return np.stack([flexion, abduction, np.arctan2(-m[:, 2, 0], m[:, 2, 2])], axis=-1)

    def angles(self, configurations: npt.ArrayLike) -> Array:
        """Hinge angles (N, 9), inside their ranges, of configurations (N, 10)."""
        q = np.atleast_2d(np.asarray(configurations, float))
        angles = np.concatenate([self.shoulder_angles(q[:, :4]), q[:, 4:]], axis=1)
        return np.asarray(np.clip(angles, self.lower, self.upper))

    @staticmethod
    def configurations(angles: npt.ArrayLike) -> Array:
        """Configurations (N, 10) of hinge angles (N, 9)."""
        a = np.atleast_2d(np.asarray(angles, float))
        flexion, abduction, rotation = (
            batch.exp(a[:, i : i + 1] * np.eye(3)[axis]) for i, axis in enumerate((2, 0, 1))
        )
        return np.concatenate([batch.multiply(flexion, batch.multiply(abduction, rotation)), a[:, 3:]], axis=1)

    def targets(self, shoulder_from_hands: Array) -> Array:
        """Targets (N, 7) of the arm's own side as those of the right arm that stands for it."""
        return batch.mirror_pose(shoulder_from_hands) if self.arm.side == "left" else np.asarray(shoulder_from_hands)

    def matrices(self, shoulder_from_hands: Array) -> Array:
        """Targets as homogeneous matrices (N, 4, 4), right arm."""
        poses = self.targets(shoulder_from_hands)
        out = np.zeros((len(poses), 4, 4))
        out[:, :3, :3], out[:, :3, 3], out[:, 3, 3] = batch.matrix(poses[:, 3:]), poses[:, :3], 1.0
        return out

    def urdf(self) -> str:
        """Links `shoulder` (root), one a hinge, and `hand`, the OpenXR wrist frame."""
        inertial = (
            f'<inertial><mass value="{_MASS_KG}"/>'
            f'<inertia ixx="{_INERTIA}" iyy="{_INERTIA}" izz="{_INERTIA}" ixy="0" ixz="0" iyz="0"/></inertial>'
        )
        lines = ['<robot name="human_arm">', '<link name="shoulder"/>']
        parent = "shoulder"
        for i, name in enumerate(NAMES):
            roll_pitch_yaw = _roll_pitch_yaw(self.shoulder_from_isb) if i == 0 else np.zeros(3)
            drop = {3: self.arm.upper_arm_m, 6: self.arm.forearm_m}.get(i, 0.0)
            link = quoteattr(f"{name}_link")
            lines += [
                f"<link name={link}>{inertial}</link>",
                f'<joint name={quoteattr(name)} type="revolute">',
                f'<parent link={quoteattr(parent)}/><child link={link}/><axis xyz="{VECTORS[AXES[i]]}"/>',
                f'<origin xyz="0 {-drop!r} 0" rpy="{_text(roll_pitch_yaw)}"/>',
                f'<limit lower="{float(self.lower[i])!r}" upper="{float(self.upper[i])!r}" effort="100" '
                f'velocity="{float(self.arm.speed_limit[i])!r}"/></joint>',
            ]
            parent = f"{name}_link"
        lines += [
            '<link name="hand"/>',
            f'<joint name="hand_joint" type="fixed"><parent link={quoteattr(parent)}/><child link="hand"/>',
            f'<origin xyz="0 0 0" rpy="{_text(_roll_pitch_yaw(self.bone_from_hand))}"/></joint>',
            "</robot>",
        ]
        return "\n".join(lines)

    def mjcf(self) -> str:
        """Three bodies of three hinges, and the site `hand`, the OpenXR wrist frame."""
        inertial = f'<inertial pos="0 0 0" mass="{_MASS_KG}" diaginertia="{_text([_INERTIA] * 3)}"/>'

        def hinges(first: int) -> str:
            return "".join(
                f"<joint name={quoteattr(NAMES[i])} type='hinge' axis='{VECTORS[AXES[i]]}' "
                f"range='{_text([self.lower[i], self.upper[i]])}'/>"
                for i in range(first, first + 3)
            )

        return (
            '<mujoco model="human_arm"><compiler angle="radian" autolimits="true"/><worldbody>'
            f'<body name="upper_arm" quat="{_text(np.roll(self.shoulder_from_isb, 1))}">{inertial}{hinges(0)}'
            f'<body name="forearm" pos="0 {-self.arm.upper_arm_m!r} 0">{inertial}{hinges(3)}'
            f'<body name="palm" pos="0 {-self.arm.forearm_m!r} 0">{inertial}{hinges(6)}'
            f'<site name="hand" quat="{_text(np.roll(self.bone_from_hand, 1))}"/>'
            "</body></body></body></worldbody></mujoco>"
        )


def _text(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)


def _roll_pitch_yaw(q: Array) -> Array:
    """URDF's fixed-axis angles (3,) [rad] of a quaternion, also where pitch is a right angle and roll is taken as 0."""
    m = batch.matrix(q)
    pitch = math.asin(min(max(-m[2, 0], -1.0), 1.0))
    if abs(m[2, 0]) > 1.0 - 1e-9:
        return np.array([0.0, pitch, math.atan2(-m[0, 1], m[1, 1])])
    return np.array([math.atan2(m[2, 1], m[2, 2]), pitch, math.atan2(m[1, 0], m[0, 0])])
