"""The loop of `conjugate`, written with Pinocchio: the Jacobian is computed, every product is a matrix product.

Slower by a factor of some hundreds and easier to believe; tests hold the compiled loop to the same iterates. It is also
the way to run the iteration on a model that the compiled loop is not written for: only the limits are the arm's.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from arm_ik_service.arm.chain import columns_of
from arm_ik_service.arm.limits import swing_excess, swing_gradient, twist_excess, twist_gradient, twist_of
from arm_ik_service.arm.model import ArmModel
from arm_ik_service.geometry.batch import mirror_pose
from arm_ik_service.ik.conjugate import MAX_STEP, RETREATS, STATIONARY
from arm_ik_service.ik.held import AT_LIMIT
from arm_ik_service.ik.jacobian import MOBILITY
from arm_ik_service.ik.solver import Array, Solution, Status

_MOBILITY = np.array(MOBILITY).ravel()


class PinocchioReference:
    """The conjugate Jacobian-transpose loop on a Pinocchio model, one target from one start, no comfort, no rescue."""

    def __init__(
        self,
        arm: ArmModel,
        iterations: int = 32,
        position_tolerance_m: float = 5e-4,
        orientation_tolerance_rad: float = 5e-3,
        *,
        rotation_weight_m: float = 0.14,
    ) -> None:
        self.arm = arm
        self.iterations = iterations
        self.position_tolerance_m = position_tolerance_m
        self.orientation_tolerance_rad = orientation_tolerance_rad
        self._lam = rotation_weight_m**2
        self._weights = np.array([1.0, 1.0, 1.0, self._lam, self._lam, self._lam])
        self._data = arm.pinocchio.createData()

    def solve(self, shoulder_from_hand: npt.ArrayLike, start: npt.ArrayLike | None = None) -> Solution:
        """Solve one target (7,) in the shoulder frame of the arm's side, from `start` (10,) or the arm's rest."""
        target = np.asarray(shoulder_from_hand, float)
        if self.arm.side == "left":
            target = mirror_pose(target)
        wanted = pin.Quaternion(target[3:]).normalized().toRotationMatrix()
        q = np.array(self.arm.rest if start is None else start, float)
        before, direction, last_gradient = q, np.zeros(9), np.zeros(9)
        held, retreats, best, length, last_slope = -1, 0, math.inf, 0.0, 0.0
        shown = (math.inf, math.inf)
        iteration = 0
        while True:
            error, jacobian = self._linearise(q, target[:3], wanted)
            position_error, orientation_error = float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))
            size = float(error @ (self._weights * error))
            if position_error < self.position_tolerance_m and orientation_error < self.orientation_tolerance_rad:
                return Solution(q, iteration, position_error, orientation_error, Status.SOLVED)
            if size > best:
                q = before
                retreats += 1
                if retreats > RETREATS:
                    return Solution(q, iteration, *shown, Status.NEAREST)
                if iteration >= self.iterations:
                    return Solution(q, iteration, *shown, Status.OUT_OF_ITERATIONS)
                length *= 0.25
                iteration += 1
                q = self._move(before, length * direction)
                continue
            shown = (position_error, orientation_error)
            if iteration >= self.iterations:
                return Solution(q, iteration, *shown, Status.OUT_OF_ITERATIONS)
            best = size
            iteration += 1

            gradient = jacobian.T @ (self._weights * error)
            inverse = _MOBILITY / (self._weights @ jacobian**2)
            step, now_held = self._hold(q, inverse * gradient, inverse)
            slope = float(gradient @ step)
            if slope < STATIONARY * size:
                return Solution(q, iteration, *shown, Status.NEAREST)
            beta = 0.0
            if now_held == held and retreats == 0:
                beta = max(0.0, float((gradient - last_gradient) @ step) / last_slope)
            held, last_slope, last_gradient, retreats = now_held, slope, gradient, 0
            direction = step + beta * direction
            if beta > 0.0 and held:
                direction, _ = self._hold(q, direction, inverse)
            if gradient @ direction <= 0.0:
                direction = step
            moved = jacobian @ direction
            length = float(moved @ (self._weights * error) / (moved @ (self._weights * moved) + 1e-14))
            length = min(length, MAX_STEP / float(np.abs(direction).max()))
            before = q
            q = self._move(q, length * direction)

    def _linearise(self, q: Array, position: Array, rotation: Array) -> tuple[Array, Array]:
        """Return the error (6,) and the Jacobian (6, 9) of the hand in the axes of the shoulder frame."""
        model, frame = self.arm.pinocchio, self.arm.hand_frame_id
        pin.framesForwardKinematics(model, self._data, q)
        hand = self._data.oMf[frame]
        error = np.concatenate([position - hand.translation, pin.log3(rotation @ hand.rotation.T)])
        jacobian = pin.computeFrameJacobian(model, self._data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        return error, np.array(jacobian)

    def _move(self, q: Array, tangent: Array) -> Array:
        return self.arm.clamp(pin.integrate(self.arm.pinocchio, q, tangent))

    def _hold(self, q: Array, step: Array, inverse: Array) -> tuple[Array, int]:
        """Remove from a step what would leave the limits that q rests on; return it and the bit mask of those."""
        chain, step, held = self.arm.chains[0], step.copy(), 0
        for i in range(6):
            at_lower, at_upper = q[4 + i] <= chain.lower[i] + AT_LIMIT, q[4 + i] >= chain.upper[i] - AT_LIMIT
            if (at_lower and step[3 + i] < 0.0) or (at_upper and step[3 + i] > 0.0):
                step[3 + i] = 0.0
                held |= 4 << i
        quaternion = (q[0], q[1], q[2], q[3])
        bone = columns_of(quaternion)
        metric, tangents = inverse[:3], []
        if swing_excess(chain, (-bone[1][0], -bone[1][1], -bone[1][2])) > -AT_LIMIT:
            normal = np.array(swing_gradient(chain, bone))
            if normal @ step[:3] > 0.0:
                tangents.append(normal)
                step[:3] -= metric * normal * (normal @ step[:3]) / (normal @ (metric * normal))
                held |= 1
        twist, height = twist_of(bone), -bone[1][1]
        over, under = twist_excess(chain, twist + AT_LIMIT, height), twist_excess(chain, twist - AT_LIMIT, height)
        if over > 0.0 or under < 0.0:
            normal = np.array(twist_gradient(quaternion)) * (-1.0 if under < 0.0 else 1.0)
            if normal @ step[:3] > 0.0:
                for other in tangents:
                    normal = normal - other * (normal @ (metric * other)) / (other @ (metric * other))
                step[:3] -= metric * normal * (normal @ step[:3]) / (normal @ (metric * normal))
                held |= 2
        return step, held
