"""roboticstoolbox: its C++ Levenberg-Marquardt (`ETS.ik_LM` with its default damping), one search from the last frame.

It knows joint limits only by throwing solutions away and starting at random, which is no way to follow a hand: they are
off. Its tolerance is on half the weighted squared residual; weighted by the tolerances, below it both are met.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from roboticstoolbox import ET, ETS

from arm_ik_service.bench.arm_tasks import ArmTask
from arm_ik_service.bench.hinge_arm import AXES
from arm_ik_service.bench.peers.hinge_run import BUDGET, HingeRun
from arm_ik_service.geometry import batch
from arm_ik_service.geometry.batch import Array

HINGE = {"X": ET.Rx, "Y": ET.Ry, "Z": ET.Rz}


class RoboticsToolboxRun(HingeRun):
    """One task through roboticstoolbox."""

    def build(self, task: ArmTask, start: Array, rest: Array) -> None:
        """See HingeRun."""
        arm = self.hinges
        new_chain: Any = ETS  # the package's types have the module of that name instead
        chain = new_chain([ET.SE3(_turn(arm.shoulder_from_isb))])
        for i, axis in enumerate(AXES):
            if (drop := {3: task.arm.upper_arm_m, 6: task.arm.forearm_m}.get(i)) is not None:
                chain *= ET.ty(-drop)
            chain *= HINGE[axis](qlim=[arm.lower[i], arm.upper[i]])
        self._chain = chain * ET.SE3(_turn(arm.bone_from_hand))
        self._targets = list(arm.matrices(task.targets))
        weight = self.tolerances.position_m / self.tolerances.orientation_rad
        self._mask = np.array([1.0, 1.0, 1.0, *[weight**2] * 3])
        self._tolerance = 0.5 * self.tolerances.position_m**2
        self._angles_now = start

    def follow(self, index: int) -> tuple[Array, int]:
        """See HingeRun."""
        solution = self._chain.ik_LM(
            self._targets[index],
            q0=self._angles_now,
            ilimit=BUDGET,
            slimit=1,
            tol=self._tolerance,
            mask=self._mask,
            joint_limits=False,
        )
        self._angles_now = solution.q
        return solution.q, int(solution.iterations)


def _turn(q: Array) -> Array:
    pose = np.eye(4)
    pose[:3, :3] = batch.matrix(q)
    return pose
