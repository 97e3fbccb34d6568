"""The Jacobian transpose as it was published: a step along J^T e, of fixed gain or of the length that Buss gives it.

Wolovich & Elliott, A computational technique for inverse kinematics, CDC 1984; Balestrino, De Maria & Sciavicco, Robust
control of robotic manipulators, IFAC 1984. The step rule is Buss, Introduction to inverse kinematics with Jacobian
transpose, pseudoinverse and damped least squares methods, 2004, section 4.

J^T e is the gradient of half the squared residual, so this is steepest descent: it cannot blow up at a singularity,
and it crawls wherever the Jacobian's columns differ much in length. It is here to show what `conjugate` gains.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.ik.pinocchio_loop import Array, JacobianSolver


class JacobianTransposePlain(JacobianSolver):
    """dq = alpha J^T e.

    `rule` "buss": alpha = <e, J J^T e> / <J J^T e, J J^T e>, the minimum along the step of the linearised problem.
    `rule` "fixed": alpha = `gain` [rad per m^2 of J^T e]; stable below 2 / sigma_max(J)^2, which a stretched adult arm
    brings down to 4, a tall one to 3.
    """

    def __init__(
        self,
        arm: ArmModel,
        iterations: int = 256,
        position_tolerance_m: float = 5e-4,
        orientation_tolerance_rad: float = 5e-3,
        *,
        rotation_weight_m: float = 0.14,
        time_limit_us: float = 0.0,
        rule: Literal["buss", "fixed"] = "buss",
        gain: float = 3.0,
    ) -> None:
        super().__init__(
            arm,
            iterations,
            position_tolerance_m,
            orientation_tolerance_rad,
            rotation_weight_m=rotation_weight_m,
            time_limit_us=time_limit_us,
        )
        if gain <= 0.0:
            raise ValueError(f"gain = {gain}: a positive number is needed")
        self.rule, self.gain = rule, gain

    def step(self, jacobian: Array, residual: Array) -> Array:
        """Return alpha J^T e (9,) [rad]."""
        gradient = jacobian.T @ residual
        if self.rule == "fixed":
            return np.asarray(self.gain * gradient)
        moved = jacobian @ gradient
        return np.asarray((residual @ moved) / max(float(moved @ moved), 1e-18) * gradient)
