"""placo: a C++ QP on Pinocchio, as in its getting-started page: base masked, a soft frame task, joint limits on.

A little regularisation, as its documentation asks for on redundant arms. It is iterated to the tolerances, measured at
the updated kinematics.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import placo

from arm_ik_service.bench.arm_tasks import ArmTask
from arm_ik_service.bench.hinge_arm import NAMES
from arm_ik_service.bench.peers.hinge_run import BUDGET, HingeRun
from arm_ik_service.geometry.batch import Array

REGULARISATION = 1e-6


class PlacoRun(HingeRun):
    """One task through placo."""

    def build(self, task: ArmTask, start: Array, rest: Array) -> None:
        """See HingeRun."""
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "robot.urdf").write_text(self.hinges.urdf())
            self._robot = placo.RobotWrapper(folder, int(placo.Flags.ignore_collisions))
        for name, angle in zip(NAMES, start, strict=True):
            self._robot.set_joint(name, float(angle))
        self._robot.update_kinematics()
        self._solver = placo.KinematicsSolver(self._robot)
        self._solver.mask_fbase(True)
        self._solver.enable_joint_limits(True)
        self._hand = self._solver.add_frame_task("hand", np.eye(4))
        self._hand.configure("hand", "soft", 1.0, 1.0)
        self._solver.add_regularization_task(REGULARISATION)
        self._targets = list(self.hinges.matrices(task.targets))
        self._first = self._robot.get_joint_offset(NAMES[0])

    def follow(self, index: int) -> tuple[Array, int]:
        """See HingeRun."""
        target = self._targets[index]
        self._hand.T_world_frame = target
        robot, k = self._robot, 0
        while k < BUDGET and not self._met(robot.get_T_world_frame("hand"), target):
            try:
                self._solver.solve(True)
            except RuntimeError:  # its QP found no step: it stays where it is
                break
            robot.update_kinematics()
            k += 1
        return robot.state.q[self._first : self._first + 9], k

    def _met(self, hand: Array, target: Array) -> bool:
        gap = target[:3, 3] - hand[:3, 3]
        position_m, orientation_rad = self.tolerances
        if gap @ gap >= position_m**2:
            return False
        # |R - T|^2 = 4 (1 - cos angle), about 2 angle^2
        difference = (target[:3, :3] - hand[:3, :3]).ravel()
        return bool(difference @ difference < 2.0 * orientation_rad**2)
