"""The person of the scene: a trunk that is posed, and two arms that a solver of the project poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from arm_ik_service.arm import tangent
from arm_ik_service.arm.angles import isb_shoulder, joint_angles
from arm_ik_service.arm.chain import bone_from_arm
from arm_ik_service.arm.configuration import difference, read_configuration
from arm_ik_service.arm.model import ArmModel
from arm_ik_service.body.profile import Profile
from arm_ik_service.body.shoulders import STERNOCLAVICULAR
from arm_ik_service.geometry import batch
from arm_ik_service.geometry import scalar as g
from arm_ik_service.ik.registry import SolverChoice, make_solver
from arm_ik_service.ik.step import limits_at
from arm_ik_service.output.message import read_output
from arm_ik_service.output.record import OUTPUT
from arm_ik_service.wire.messages import (
    SIDES,
    VERSION,
    ArmsHeader,
    ArmsState,
    ControllerFrame,
    Side,
    TrackedPose,
)

Floats = npt.NDArray[np.float64]

CHEST_PER_STATURE, HIP_PER_STATURE = 0.818, 0.53  # heights of shoulders and hips: Drillis & Contini, in Winter
NECK_ABOVE_CHEST_M, EYES_FROM_NECK = 0.107, np.array([0.0, 0.10, -0.09])
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])
TRACKED = 3


@dataclass(frozen=True)
class Trunk:
    """How the trunk stands: `place` (x, z) [m], angles [rad], lengths [m]."""

    place: Floats
    heading: float
    turn: float = 0.0  # of the shoulders from the heading, to the left
    lean: float = 0.0
    height: float = 0.0  # above upright standing
    gaze: tuple[float, float] = (0.0, 0.0)  # yaw and pitch of the head from the heading


def about(axis: int, angle: float) -> Floats:
    """Rotation (4,) about an axis."""
    return batch.exp(angle * np.eye(3)[axis])


class Figure:
    """Poses the trunk, lets the solver find both arms, and says it as messages."""

    def __init__(self, profile: Profile, choice: SolverChoice, avatar: str) -> None:
        """Raises ModelError or SettingsError."""
        body = profile.body
        self.profile, self.avatar = profile, avatar
        self.arm_length = body.upper_arm + body.forearm
        self.half_width = 0.5 * body.shoulder_width
        self.arms = {
            side: ArmModel.load(side, body.upper_arm, body.forearm, body.hand, limits=profile.limits_deg.in_radians())
            for side in SIDES
        }
        self._solvers = {side: make_solver(choice.name, arm, **choice.options) for side, arm in self.arms.items()}
        self._configurations = {side: arm.rest.copy() for side, arm in self.arms.items()}
        self._output = np.zeros(1, OUTPUT)

    def chest(self, trunk: Trunk) -> Floats:
        """World pose (7,) of the chest frame, midway between the shoulders."""
        stature = self.profile.body.stature_m
        hip_height = HIP_PER_STATURE * stature + trunk.height
        spine = g.multiply(g.rotation_y(trunk.heading), g.rotation_x(-trunk.lean))
        up = g.rotate(spine, (0.0, (CHEST_PER_STATURE - HIP_PER_STATURE) * stature, 0.0))
        hip = (float(trunk.place[0]), hip_height, float(trunk.place[1]))
        return np.array([*g.add(hip, up), *g.multiply(spine, g.rotation_y(trunk.turn))])

    def shoulder(self, chest: Floats, side: Side, advance: Floats | None = None) -> Floats:
        """World pose (7,) of a shoulder frame; `advance` (3) [m] is what the clavicle adds, in world axes."""
        outwards = (self.half_width if side == "right" else -self.half_width, 0.0, 0.0)
        pose = chest.copy()
        pose[:3] += g.rotate(g.quaternion(chest[3:]), outwards)
        if advance is not None:
            pose[:3] += advance
        return pose

    def swing(self, side: Side, flexion_deg: float, elbow_deg: float) -> Floats:
        """Pose (7,) in the shoulder frame of a hand that swings along, the arm hanging at these angles."""
        configuration = self.arms[side].rest.copy()
        configuration[:4] = batch.exp([np.radians(-6.0), 0.0, np.radians(flexion_deg)])
        configuration[4] = np.radians(elbow_deg)
        return self.arms[side].forward(configuration)["hand"]

    def pose(
        self, trunk: Trunk, hands: dict[Side, Floats], advances: dict[Side, Floats], seq: int, time_ns: int, dt: float
    ) -> tuple[ControllerFrame, ArmsState]:
        """Solve both arms for world poses (7,) of the hands; returns the frame that asks for it and the answer."""
        chest = self.chest(trunk)
        neck = chest[:3] + batch.rotate(chest[3:], [0.0, NECK_ABOVE_CHEST_M, 0.0])
        look = batch.multiply(about(1, trunk.heading + trunk.gaze[0]), about(0, trunk.gaze[1]))
        head = np.concatenate([neck + batch.rotate(look, EYES_FROM_NECK), look])
        out = self._output[0]
        out.chest[:], out.head[:] = chest, head
        for k, side in enumerate(SIDES):
            self._pose_arm(out.arms[k], side, chest, hands[side], advances[side], dt)
        left, right = self.profile.grip.left, self.profile.grip.right
        frame = ControllerFrame(
            *(VERSION, seq, time_ns, time_ns, "stage", _tracked(head)),
            _tracked(batch.compose(hands["left"], [*left.position_m, *left.orientation_xyzw])),
            _tracked(batch.compose(hands["right"], [*right.position_m, *right.orientation_xyzw])),
        )
        return frame, read_output(self._output, ArmsHeader(VERSION, self.avatar, seq, time_ns, time_ns, 0, 0))

    def _pose_arm(self, out: np.record, side: Side, chest: Floats, hand: Floats, advance: Floats, dt: float) -> None:
        model, before = self.arms[side], self._configurations[side]
        shoulder = self.shoulder(chest, side, advance)
        target = batch.compose(batch.inverse(shoulder), hand)
        target[3:] = batch.normalized(target[3:])
        solution = self._solvers[side].solve(target, start=before)
        found = model.forward(solution.configuration)
        humerus = bone_from_arm(model.chains[0], tuple(solution.configuration[:4]))
        root = batch.compose(chest, self._clavicle_root(side))[:3]
        out.clavicle[:] = np.concatenate([root, self._clavicle(side, chest, shoulder[:3] - root)])
        out.upper_arm[:] = batch.compose(shoulder, [0.0, 0.0, 0.0, *humerus])
        out.forearm[:] = batch.compose(shoulder, found["elbow"])
        out.hand[:] = batch.compose(shoulder, found["hand"])
        out.position_error_m = np.linalg.norm(out.hand[:3] - hand[:3])
        out.orientation_error_rad = batch.angle_between(out.hand[3:], hand[3:])
        out.configuration[:] = solution.configuration
        motion = difference(read_configuration(before), read_configuration(solution.configuration))
        tangent.store(out.velocity, tangent.scale(1.0 / dt, motion))
        joint_angles(out.configuration, out.velocity, out.angles, out.angle_rates)
        out.isb_singular = isb_shoulder(out.configuration, out.isb)
        out.limits = limits_at(model.chains[0], solution.configuration)
        out.reach_ratio = np.linalg.norm(target[:3]) / self.arm_length
        out.state = out.position_state = out.rotation_state = TRACKED
        out.iterations = solution.iterations
        self._configurations[side] = solution.configuration

    def _clavicle_root(self, side: Side) -> Floats:
        x, y, z = STERNOCLAVICULAR
        return np.array([*(self.half_width * np.array([x if side == "right" else -x, y, z])), *LEVEL])

    def _clavicle(self, side: Side, chest: Floats, bone: Floats) -> Floats:
        """ISB axes: z along the bone to the person's right, x anterior, level in the chest."""
        z = batch.normalized(bone if side == "right" else -bone)
        x = batch.normalized(np.cross(batch.rotate(chest[3:], [0.0, 1.0, 0.0]), z))
        return batch.from_matrix(np.stack([x, np.cross(z, x), z], axis=-1))


def _tracked(pose: Floats) -> TrackedPose:
    x, y, z, qx, qy, qz, qw = pose.tolist()
    return TrackedPose((x, y, z), (qx, qy, qz, qw))
