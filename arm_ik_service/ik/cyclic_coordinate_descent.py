"""Cyclic coordinate descent: one joint at a time turns to where it alone serves the hand best.

Wang & Chen, A combined optimization method for solving the inverse kinematics problems of mechanical manipulators,
IEEE Transactions on Robotics and Automation 7(4), 1991. Both parts of the cost are theirs: squared distance, and how
far the hand's three axes are from the target's. The rotation's part, lam (3 - trace), is lam angle^2 to second order,
the metric of the other solvers.

For a hinge the cost over its angle is a sinusoid, so its best angle within its range is known in closed form. The ball
of the shoulder is one coordinate too: its best rotation is Wahba's problem, solved by a singular value decomposition
(Kabsch, Acta Crystallographica A32, 1976).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from arm_ik_service.arm.model import HINGES, ArmModel
from arm_ik_service.ik.pinocchio_loop import WRIST, Array, PinocchioSolver

BALL = "shoulder"
JOINTS = (BALL, *HINGES)
RETREATS = 4  # times that a turn of the ball is halved where a limit spoils it


class CyclicCoordinateDescent(PinocchioSolver):
    """One iteration is one sweep from the wrist to the shoulder, then `repeats` more over the joints in `priority`.

    The big joints carry the hand, the small ones only trim it, so sweeping the former more often pays: `priority` names
    them, in the order in which they are swept.
    """

    def __init__(
        self,
        arm: ArmModel,
        iterations: int = 128,
        position_tolerance_m: float = 5e-4,
        orientation_tolerance_rad: float = 5e-3,
        *,
        rotation_weight_m: float = 0.14,
        time_limit_us: float = 0.0,
        priority: Sequence[str] = ("elbow_flexion", "shoulder"),
        repeats: int = 1,
    ) -> None:
        """Raises ValueError for a joint that is not one of JOINTS."""
        super().__init__(
            arm,
            iterations,
            position_tolerance_m,
            orientation_tolerance_rad,
            rotation_weight_m=rotation_weight_m,
            time_limit_us=time_limit_us,
        )
        unknown = [name for name in priority if name not in JOINTS]
        if unknown:
            raise ValueError(f"priority {', '.join(unknown)}: the joints are {', '.join(JOINTS)}")
        if repeats < 0:
            raise ValueError(f"repeats = {repeats}: 0 or more is needed")
        self.order = [*reversed(JOINTS), *(list(priority) * repeats)]

    def improve(self, configuration: Array, target: pin.SE3, residual: Array) -> Array:
        """One sweep; every single turn lowers the cost or is not made."""
        q = configuration.copy()
        for name in self.order:
            if name == BALL:
                q = self._turn_ball(q, target)
            else:
                self._turn_hinge(q, HINGES.index(name), target)
        return q

    def _turn_hinge(self, q: Array, hinge: int, target: pin.SE3) -> None:
        """Set one hinge to its best angle within its range, in place."""
        pin.computeJointJacobians(self.model, self.data, q)
        columns = pin.getJointJacobian(self.model, self.data, WRIST, pin.LOCAL_WORLD_ALIGNED)
        axis = columns[3:, 3 + hinge]
        m = self._correlation(2 if hinge < 3 else WRIST, target)
        # a turn by x about the axis leaves of the cost a constant less 2 (along cos x + across sin x)
        along = float(np.trace(m) - axis @ m @ axis)
        across = float(axis @ (m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]))
        best = float(q[4 + hinge]) + math.atan2(across, along)
        chain = self.arm.chains[0]
        q[4 + hinge] = nearest_within(best, chain.lower[hinge], chain.upper[hinge])

    def _turn_ball(self, q: Array, target: pin.SE3) -> Array:
        """Return the configuration with the shoulder at its best rotation, or as near to it as limits let it help."""
        here = self._cost(q, target)
        u, _, vt = np.linalg.svd(self._correlation(1, target))
        turn = pin.log3(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)  # in the shoulder frame
        in_humerus = self.data.oMi[1].rotation.T @ turn
        for k in range(RETREATS):
            step = np.concatenate([0.5**k * in_humerus, np.zeros(6)])
            ahead = self.arm.clamp(pin.integrate(self.model, q, step))
            if self._cost(ahead, target) < here:
                return ahead
        return q

    def _correlation(self, joint: int, target: pin.SE3) -> Array:
        """Sum (3, 3) of there * here^T over the hand's position and axes, weighted, as seen from a joint's centre.

        A rotation R of the joint then changes the cost by -2 trace(R^T M): all that any of them needs to know.
        """
        hand, centre = self.data.oMi[WRIST], self.data.oMi[joint].translation
        rotations = target.rotation @ hand.rotation.T
        positions = np.outer(target.translation - centre, hand.translation - centre)
        return np.asarray(positions + 0.5 * self.rotation_weight_m**2 * rotations)

    def _cost(self, q: Array, target: pin.SE3) -> float:
        """What a sweep lowers [m^2]: squared distance and lam (3 - trace of the rotation that is left)."""
        pin.forwardKinematics(self.model, self.data, q)
        hand = self.data.oMi[WRIST]
        gap = target.translation - hand.translation
        return float(gap @ gap + self.rotation_weight_m**2 * (3.0 - np.sum(target.rotation * hand.rotation)))


def nearest_within(angle: float, lower: float, upper: float) -> float:
    """Return the angle in [lower, upper] whose cosine distance to `angle`, any number of turns away, is least [rad]."""
    middle = 0.5 * (lower + upper)
    offset = math.remainder(angle - middle, 2.0 * math.pi)
    return min(max(middle + offset, lower), upper)
