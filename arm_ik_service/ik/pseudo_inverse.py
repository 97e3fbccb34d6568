"""The pseudo-inverse: the smallest step that removes the residual of the linearised problem.

Whitney, Resolved motion rate control of manipulators and human prostheses, IEEE Transactions on Man-Machine Systems
10(2), 1969. Gauss-Newton, so it converges in a few steps away from singularities. At one, the smallest singular
values are inverted into huge steps; here they are cut off at `LARGEST_STEP` in length, which keeps the arm in one piece
and leaves the method's trembling there as it is.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import pinocchio as pin

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.ik.pinocchio_loop import Array, JacobianSolver

RANK = 1e-6  # singular values below this share of the largest one are noise, not a direction


class PseudoInverse(JacobianSolver):
    """dq = gain J^+ e.

    `jacobian` "analytic" takes Pinocchio's; "finite_differences" moves each joint by `difference_rad` and measures, as
    one does on an arm whose kinematics one can only run. `gain` 1 takes the whole step, less damps it.
    """

    def __init__(
        self,
        arm: ArmModel,
        iterations: int = 32,
        position_tolerance_m: float = 5e-4,
        orientation_tolerance_rad: float = 5e-3,
        *,
        rotation_weight_m: float = 0.14,
        time_limit_us: float = 0.0,
        jacobian: Literal["analytic", "finite_differences"] = "analytic",
        difference_rad: float = 1e-4,
        gain: float = 1.0,
    ) -> None:
        super().__init__(
            arm,
            iterations,
            position_tolerance_m,
            orientation_tolerance_rad,
            rotation_weight_m=rotation_weight_m,
            time_limit_us=time_limit_us,
        )
        if not 0.0 < gain <= 1.0:
            raise ValueError(f"gain = {gain}: a number above 0 and at most 1 is needed")
        if not 0.0 < difference_rad <= 0.1:
            raise ValueError(f"difference_rad = {difference_rad}: a number above 0 and at most 0.1 is needed")
        self.measured = jacobian == "finite_differences"
        self.difference_rad, self.gain = difference_rad, gain

    def step(self, jacobian: Array, residual: Array) -> Array:
        """Return gain J^+ e (9,) [rad]."""
        return np.asarray(self.gain * (np.linalg.pinv(jacobian, rcond=RANK) @ residual))

    def jacobian_at(self, configuration: Array, target: pin.SE3, residual: Array) -> Array:
        """Analytic, or how the residual falls when each joint in turn moves a little (forward differences)."""
        if not self.measured:
            return self.jacobian(configuration)
        columns = [
            (residual - self.residual(pin.integrate(self.model, configuration, move), target)) / self.difference_rad
            for move in self.difference_rad * np.eye(9)
        ]
        return np.stack(columns, axis=1)
