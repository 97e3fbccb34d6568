"""What the solvers written with Pinocchio calls share: residual, limits, and the loop that keeps the best so far.

These solvers are the field beside the compiled `JacobianTranspose`, written to be read. Each is one way to choose a
step; all of them measure the same residual, hold the same limits, stop at the same tolerances and keep to a budget.

The residual (6,) is in metres: the position error, then the rotation error times `rotation_weight_m`, both in the axes
of the shoulder frame. The Jacobian (6, 9) has its rows weighted the same way, so that every length, step and damping
means the same to every method. A limit is held by taking its direction out of the Jacobian's row space: what is left
cannot push outward, whatever the method then does with it (Baerlocher & Boulic 2004 clamp joints the same way).
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from arm_ik_service.arm.chain import columns_of, hand_to_arm, position_to_arm
from arm_ik_service.arm.limits import (
    swing_excess,
    swing_gradient,
    twist_excess,
    twist_gradient,
    twist_of,
)
from arm_ik_service.arm.model import ArmModel
from arm_ik_service.geometry.scalar import quaternion, scale, vector
from arm_ik_service.ik.clock import monotonic_ns
from arm_ik_service.ik.solver import Solution, Status, Track, as_targets

Array = npt.NDArray[np.float64]

WRIST = 3  # index of the hand's joint in the model: ball, elbow group, wrist group
AT_LIMIT = 1e-6  # [rad] within which a joint counts as resting on its limit
STATIONARY = 1e-7  # [rad] an iteration that moves no joint by more has come to its end
LARGEST_STEP = 0.5  # [rad] of any joint in one iteration: the linearisation means little beyond (Buss 2004, section 7)


class PinocchioSolver(ABC):
    """A bounded loop over `improve`. Subclasses say what one iteration is.

    `iterations` and `time_limit_us` (0: none) bound one target. `rotation_weight_m` is the lever on which a radian of
    rotation weighs as much as a metre of position. One instance serves one thread at a time.
    """

    def __init__(
        self,
        arm: ArmModel,
        iterations: int = 64,
        position_tolerance_m: float = 5e-4,
        orientation_tolerance_rad: float = 5e-3,
        *,
        rotation_weight_m: float = 0.14,
        time_limit_us: float = 0.0,
    ) -> None:
        """Raises ValueError for a number that cannot be used."""
        if iterations < 1:
            raise ValueError(f"iterations = {iterations}: at least 1 is needed")
        if min(position_tolerance_m, orientation_tolerance_rad, rotation_weight_m) <= 0.0:
            raise ValueError("tolerances and rotation_weight_m must be positive")
        self.arm = arm
        self.model, self.data = arm.pinocchio, arm.pinocchio.createData()
        self.iterations = iterations
        self.position_tolerance_m = position_tolerance_m
        self.orientation_tolerance_rad = orientation_tolerance_rad
        self.rotation_weight_m = rotation_weight_m
        self.time_limit_us = time_limit_us

    @abstractmethod
    def improve(self, configuration: Array, target: pin.SE3, residual: Array) -> Array:
        """One iteration: return the next configuration (10,), inside the limits.

        `residual` is that of `configuration`, and `self.data` holds its forward kinematics.
        """

    def solve(self, shoulder_from_hand: npt.ArrayLike, start: npt.ArrayLike | None = None) -> Solution:
        """Solve one target (7,) from `start` (10,), the arm's rest if None. Never worse than the start, clamped."""
        target = self._in_model(np.asarray(shoulder_from_hand, float))
        deadline_ns = monotonic_ns() + int(1e3 * self.time_limit_us) if self.time_limit_us > 0.0 else 0
        q = self.arm.clamp(self.arm.rest if start is None else start)
        best, least, k = q, np.inf, 0
        while True:
            residual = self.residual(q, target)
            cost = float(residual @ residual)
            if self._met(residual):
                best, status = q, Status.SOLVED
                break
            if cost < least:
                best, least = q, cost
            if k >= self.iterations:
                status = Status.OUT_OF_ITERATIONS
                break
            if deadline_ns and monotonic_ns() >= deadline_ns:
                status = Status.OUT_OF_TIME
                break
            k += 1
            ahead = self.improve(q, target, residual)
            if np.abs(pin.difference(self.model, q, ahead)).max() < STATIONARY:
                status = Status.NEAREST
                break
            q = ahead
        residual = self.residual(best, target)
        position, rotation = self._lengths(residual)
        return Solution(best, k, position, rotation, status)

    def track(self, shoulder_from_hands: npt.ArrayLike, start: npt.ArrayLike | None = None) -> Track:
        """Solve targets (N, 7) in order, each from the solution before; the first from rest if there is no `start`."""
        solutions = []
        for target in as_targets(shoulder_from_hands):
            solutions.append(self.solve(target, start))
            start = solutions[-1].configuration
        return Track(
            np.array([one.configuration for one in solutions]).reshape(-1, 10),
            np.array([one.iterations for one in solutions], np.int64),
            np.array([one.position_error_m for one in solutions], float),
            np.array([one.orientation_error_rad for one in solutions], float),
            np.array([one.status for one in solutions], np.int64),
        )

    def residual(self, configuration: Array, target: pin.SE3) -> Array:
        """Weighted error (6,) [m] of a configuration; leaves its forward kinematics in `self.data`."""
        pin.forwardKinematics(self.model, self.data, configuration)
        hand = self.data.oMi[WRIST]
        turn = pin.log3(target.rotation @ hand.rotation.T)
        return np.concatenate([target.translation - hand.translation, self.rotation_weight_m * turn])

    def jacobian(self, configuration: Array) -> Array:
        """Weighted Jacobian (6, 9) [m/rad] of the hand: residual falls by J dq as the configuration moves by dq."""
        pin.computeJointJacobians(self.model, self.data, configuration)
        j = pin.getJointJacobian(self.model, self.data, WRIST, pin.LOCAL_WORLD_ALIGNED).copy()
        j[3:] *= self.rotation_weight_m
        return np.asarray(j)

    def _in_model(self, shoulder_from_hand: Array) -> pin.SE3:
        """Where the hand bone has to go, in the model's world. Left arms are mirrored by the chain, as everywhere."""
        chain = self.arm.chains[0]
        arm_from_bone = pin.Quaternion(*np.roll(hand_to_arm(chain, quaternion(shoulder_from_hand[3:])), 1))
        world_from_arm = self.model.jointPlacements[1].rotation
        position = np.array(position_to_arm(chain, vector(shoulder_from_hand)))
        return pin.SE3(world_from_arm @ arm_from_bone.matrix(), world_from_arm @ position)

    def _lengths(self, residual: Array) -> tuple[float, float]:
        position, rotation = np.linalg.norm(residual[:3]), np.linalg.norm(residual[3:])
        return float(position), float(rotation / self.rotation_weight_m)

    def _met(self, residual: Array) -> bool:
        position, rotation = self._lengths(residual)
        return position < self.position_tolerance_m and rotation < self.orientation_tolerance_rad


class JacobianSolver(PinocchioSolver):
    """Solvers whose iteration is a step in the tangent space, found from Jacobian and residual alone."""

    @abstractmethod
    def step(self, jacobian: Array, residual: Array) -> Array:
        """Return the step (9,) [rad] for a weighted Jacobian (6, 9) and residual (6,)."""

    def improve(self, configuration: Array, target: pin.SE3, residual: Array) -> Array:
        """Step, with the limits that the step would leave taken out of the Jacobian, until it leaves none."""
        jacobian = self.jacobian_at(configuration, target, residual)
        normals = limit_normals(self.arm, configuration)
        held = np.zeros(len(normals), bool)
        while True:
            free = _without(normals[held])
            step = free @ self.step(jacobian @ free, residual)
            outward = ~held & (normals @ step > 1e-12)
            if not outward.any():
                break
            held |= outward
        largest = float(np.abs(step).max())
        if largest > LARGEST_STEP:
            step *= LARGEST_STEP / largest
        return self.arm.clamp(pin.integrate(self.model, configuration, step))

    def jacobian_at(self, configuration: Array, target: pin.SE3, residual: Array) -> Array:
        """Return the Jacobian that `step` is given; the analytic one unless a solver wants another."""
        return self.jacobian(configuration)


def limit_normals(arm: ArmModel, configuration: Array) -> Array:
    """Outward unit normals (K, 9), tangent order, of the limits that a configuration rests on; K may be 0."""
    chain = arm.chains[0]
    q = quaternion(configuration)
    bone = columns_of(q)
    normals = []
    if swing_excess(chain, scale(-1.0, bone[1])) > -AT_LIMIT:
        normals.append([*swing_gradient(chain, bone), *np.zeros(6)])
    twist, height = twist_of(bone), -bone[1][1]
    if twist_excess(chain, twist + AT_LIMIT, height) > 0.0:
        normals.append([*twist_gradient(q), *np.zeros(6)])
    elif twist_excess(chain, twist - AT_LIMIT, height) < 0.0:
        normals.append([*scale(-1.0, twist_gradient(q)), *np.zeros(6)])
    for i in range(6):
        at_lower = configuration[4 + i] <= chain.lower[i] + AT_LIMIT
        at_upper = configuration[4 + i] >= chain.upper[i] - AT_LIMIT
        # a hinge without any range rests on both sides
        normals += [list(sign * np.eye(9)[3 + i]) for sign, there in ((-1.0, at_lower), (1.0, at_upper)) if there]
    rows = np.array(normals).reshape(-1, 9)
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def _without(normals: Array) -> Array:
    """Projector (9, 9) onto the steps that move along none of `normals` (K, 9)."""
    if len(normals) == 0:
        return np.eye(9)
    return np.eye(9) - np.linalg.pinv(normals, rcond=1e-6) @ normals
