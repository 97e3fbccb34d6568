"""Damped least squares: the pseudo-inverse made calm at singularities by a price on the step.

Nakamura & Hanafusa, Inverse kinematic solutions with singularity robustness for robot manipulator control, Journal of
Dynamic Systems, Measurement and Control 108, 1986; Wampler, Manipulator inverse kinematic solutions based on vector
formulations and damped least-squares methods, IEEE Transactions on Systems, Man and Cybernetics 16, 1986. The
error-scaled damping is Sugihara, Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method, IEEE
Transactions on Robotics 27(5), 2011.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.ik.pinocchio_loop import Array, JacobianSolver


class DampedLeastSquares(JacobianSolver):
    """dq = J^T (J J^T + mu I)^-1 e: minimises |e - J dq|^2 + mu |dq|^2 (Tikhonov).

    `damping` "fixed": mu = `damping_m`^2. "error_scaled": mu = |e|^2 / 2 + `damping_m`^2, so that it is careful far
    from the target, where the linearisation is poor, and quick near it. Every row of J is in metres a radian, so mu is
    a squared length: singular directions whose lever is shorter than `damping_m` are left alone.
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
        damping: Literal["fixed", "error_scaled"] = "error_scaled",
        damping_m: float = 0.01,
    ) -> None:
        super().__init__(
            arm,
            iterations,
            position_tolerance_m,
            orientation_tolerance_rad,
            rotation_weight_m=rotation_weight_m,
            time_limit_us=time_limit_us,
        )
        if damping_m <= 0.0:
            raise ValueError(f"damping_m = {damping_m}: a positive length is needed")
        self.damping, self.damping_m = damping, damping_m

    def step(self, jacobian: Array, residual: Array) -> Array:
        """Return the damped step (9,) [rad]."""
        mu = self.damping_m**2
        if self.damping == "error_scaled":
            mu += 0.5 * float(residual @ residual)
        return np.asarray(jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + mu * np.eye(6), residual))
