"""What the adapters share: the arm of nine hinges, the result as configurations of ours."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from arm_ik_service.bench.arm_tasks import ArmTask
from arm_ik_service.bench.contender import Tolerances
from arm_ik_service.bench.hinge_arm import HingeArm
from arm_ik_service.geometry.batch import Array
from arm_ik_service.ik.solver import Counts

BUDGET = 32  # iterations a frame, that of our default solver


class HingeRun(ABC):
    """A peer on one task. Models and targets are built before the clock runs; `follow` is what is timed."""

    def __init__(self, task: ArmTask, tolerances: Tolerances, start: Array) -> None:
        self.hinges = HingeArm(task.arm)
        self.tolerances = tolerances
        self.period_s = 1.0 / task.rate_hz
        self._angles = np.empty((len(task.targets), 9))
        self._iterations = np.zeros(len(task.targets), np.int64)
        self.build(task, self.hinges.angles(start)[0], self.hinges.angles(task.arm.rest)[0])

    @abstractmethod
    def build(self, task: ArmTask, start: Array, rest: Array) -> None:
        """Load the model, convert all targets, and stand at the hinge angles `start` (9,)."""

    @abstractmethod
    def follow(self, index: int) -> tuple[Array, int]:
        """Solve target `index` from where it is; return hinge angles (9,) and the iterations taken."""

    def advance(self, first: int, last: int) -> None:
        """Solve targets in order."""
        for index in range(first, last):
            self._angles[index], self._iterations[index] = self.follow(index)

    def result(self) -> tuple[Array, Counts]:
        """Return configurations (N, 10) and iterations (N,)."""
        return self.hinges.configurations(self._angles), self._iterations

    def met(self, error: Array) -> bool:
        """Whether a twist (6,), position [m] then rotation [rad], is within the tolerances."""
        position_m, orientation_rad = self.tolerances
        position, rotation = error[:3], error[3:]
        return bool(position @ position < position_m**2 and rotation @ rotation < orientation_rad**2)
