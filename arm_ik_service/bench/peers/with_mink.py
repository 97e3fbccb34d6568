"""mink: the same on MuJoCo, as in its examples for arms: frame task with Levenberg-Marquardt damping 1, weak posture
task, global damping 1e-3, DAQP, configuration limits; iterated to the tolerances as their `converge_ik` does.
"""

from __future__ import annotations

import mink
import mujoco
import numpy as np

from arm_ik_service.bench.arm_tasks import ArmTask
from arm_ik_service.bench.peers.hinge_run import BUDGET, HingeRun
from arm_ik_service.geometry.batch import Array

POSTURE_COST = 1e-3
DAMPING = 1e-3


class MinkRun(HingeRun):
    """One task through mink."""

    def build(self, task: ArmTask, start: Array, rest: Array) -> None:
        """See HingeRun."""
        model = mujoco.MjModel.from_xml_string(self.hinges.mjcf())
        self._configuration = mink.Configuration(model, q=start)
        self._hand = mink.FrameTask("hand", "site", position_cost=1.0, orientation_cost=1.0, lm_damping=1.0)
        posture = mink.PostureTask(model, cost=POSTURE_COST)
        posture.set_target(rest)
        self._tasks = [self._hand, posture]
        self._limits = [mink.ConfigurationLimit(model)]
        poses = self.hinges.targets(task.targets)
        self._targets = [mink.SE3(wxyz_xyz=np.array([pose[6], *pose[3:6], *pose[:3]])) for pose in poses]

    def follow(self, index: int) -> tuple[Array, int]:
        """See HingeRun."""
        self._hand.set_target(self._targets[index])
        configuration, dt = self._configuration, self.period_s
        for k in range(BUDGET):
            if self.met(self._hand.compute_error(configuration)):
                return configuration.q, k
            try:
                velocity = mink.solve_ik(
                    configuration, self._tasks, dt, solver="daqp", damping=DAMPING, limits=self._limits
                )
            except mink.NoSolutionFound:  # its QP found no step: it stays where it is
                return configuration.q, k + 1
            configuration.integrate_inplace(velocity, dt)
        return np.asarray(configuration.q), BUDGET
