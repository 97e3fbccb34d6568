"""pink: weighted tasks under configuration limits, one QP an iteration, as in its README.

A frame task on the hand and a weak posture task at rest; the limits are the configuration limits with pink's own gain.
DAQP solves the QP: of the solvers that qpsolvers offers it is the fastest at this size. As in pink's own inverse
kinematics the velocity is integrated until the frame task's error is within the tolerances.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from pink import Configuration, solve_ik
from pink.exceptions import PinkError
from pink.tasks import FrameTask, PostureTask

from arm_ik_service.bench.arm_tasks import ArmTask
from arm_ik_service.bench.peers.hinge_run import BUDGET, HingeRun
from arm_ik_service.geometry.batch import Array

POSTURE_COST = 1e-3  # README: three orders below the frame task


class PinkRun(HingeRun):
    """One task through pink."""

    def build(self, task: ArmTask, start: Array, rest: Array) -> None:
        """See HingeRun."""
        model = pin.buildModelFromXML(self.hinges.urdf())
        self._configuration = Configuration(model, model.createData(), start)
        self._hand = FrameTask("hand", position_cost=1.0, orientation_cost=1.0)
        posture = PostureTask(cost=POSTURE_COST)
        posture.set_target(rest)
        self._tasks = (self._hand, posture)
        self._limits = (model.configuration_limit,)
        self._targets = [pin.SE3(pin.Quaternion(pose[3:]), pose[:3]) for pose in self.hinges.targets(task.targets)]

    def follow(self, index: int) -> tuple[Array, int]:
        """See HingeRun."""
        self._hand.set_target(self._targets[index])
        configuration, dt = self._configuration, self.period_s
        for k in range(BUDGET):
            if self.met(self._hand.compute_error(configuration)):
                return configuration.q, k
            try:
                velocity = solve_ik(
                    configuration, self._tasks, dt, solver="daqp", limits=self._limits, safety_break=False
                )
            except PinkError:  # its QP found no step: it stays where it is
                return configuration.q, k + 1
            configuration.integrate_inplace(velocity, dt)
        return np.asarray(configuration.q), BUDGET
