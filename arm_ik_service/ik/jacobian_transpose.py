"""The default solver: a bounded conjugate Jacobian-transpose loop, compiled."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from arm_ik_service.arm.chain import columns_of, hand_to_arm, position_to_arm, wrist_at
from arm_ik_service.arm.model import ArmModel
from arm_ik_service.compiled import compiled
from arm_ik_service.geometry.scalar import store
from arm_ik_service.ik.frame_step import find_target, first_frame, step_frame
from arm_ik_service.ik.solver import Solution, Status, Track, as_targets
from arm_ik_service.ik.state import new_arm
from arm_ik_service.settings import SolverSettings, to_record

_STATUSES = tuple(Status)


class JacobianTranspose:
    """Conjugate Jacobian transpose with limits, elbow comfort and rescue; see `conjugate` and `frame_step`.

    `iterations` and `time_limit_us` (0: none) bound one frame. `rotation_weight_m` is the lever on which a radian of
    rotation weighs as much as a metre of position. `frame_rate_hz` is the rate of the frames given to `track`: the
    elbow's comfort moves in seconds, not in frames. One instance serves one thread at a time.
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
        frame_rate_hz: float = 90.0,
        settings: SolverSettings | None = None,
    ) -> None:
        self.arm = arm
        self.settings = settings or SolverSettings(
            iterations=iterations,
            position_tolerance_m=position_tolerance_m,
            orientation_tolerance_rad=orientation_tolerance_rad,
            rotation_weight_m=rotation_weight_m,
            time_limit_us=time_limit_us,
        )
        self._settings = np.array([to_record(self.settings)])
        self._period_s = 1.0 / frame_rate_hz
        self._arms = new_arm(arm)
        self._outcome = np.empty(4)
        self._rest = arm.rest

    def set_comfort(self, constants: npt.ArrayLike) -> None:
        """Replace the elbow's comfort: values in the order of `comfort.COMFORT`."""
        self._arms["comfort"] = np.asarray(constants, float)

    def solve(self, shoulder_from_hand: npt.ArrayLike, start: npt.ArrayLike | None = None) -> Solution:
        """Solve one target (7,) from `start` (10,), the arm's rest if None; the elbow stays near the start's.

        Shoulder frame [m], quaternion xyzw of unit length. Never raises on a target of finite numbers.
        """
        configuration = np.empty(10)
        outcome = self._outcome
        _solve(
            self._arms,
            self._settings,
            np.asarray(shoulder_from_hand, float),
            self._rest if start is None else np.asarray(start, float),
            configuration,
            outcome,
        )
        iterations, position_error, orientation_error, status = outcome.tolist()
        return Solution(configuration, int(iterations), position_error, orientation_error, _STATUSES[int(status)])

    def track(self, shoulder_from_hands: npt.ArrayLike, start: npt.ArrayLike | None = None) -> Track:
        """Solve targets (N, 7) in order, one compiled call; without `start` from the most comfortable posture."""
        targets = as_targets(shoulder_from_hands)
        count = len(targets)
        track = Track(
            np.empty((count, 10)),
            np.empty(count, np.int64),
            np.empty(count),
            np.empty(count),
            np.empty(count, np.int64),
        )
        first = self._rest if start is None else np.asarray(start, float)
        _track(self._arms, self._settings, targets, first, start is not None, self._period_s, *track)
        return track


@compiled
def _solve(arms: Any, settings: Any, target: Any, start: Any, configuration: Any, outcome: Any) -> None:
    arm = arms[0]
    chain, work = arm.chain, arm.work
    for i in range(10):
        arm.configuration[i] = start[i]
    position = position_to_arm(chain, (target[0], target[1], target[2]))
    rotation = columns_of(hand_to_arm(chain, (target[3], target[4], target[5], target[6])))
    find_target(arm, settings[0], position, rotation)
    for i in range(10):
        configuration[i] = arm.configuration[i]
    outcome[0], outcome[1], outcome[2] = work.iterations, arm.position_error_m, arm.orientation_error_rad
    outcome[3] = arm.status


@compiled
def _track(
    arms: Any,
    settings: Any,
    targets: Any,
    start: Any,
    started: bool,
    dt_s: float,
    configurations: Any,
    iterations: Any,
    position_errors: Any,
    orientation_errors: Any,
    statuses: Any,
) -> None:
    arm, setting = arms[0], settings[0]
    chain, work = arm.chain, arm.work
    arm.swivel_speed, arm.escape, arm.steady = 0.0, 0.0, 0
    store(arm.carried, (0.0, 0.0, 0.0))
    store(arm.carried_spin, (0.0, 0.0, 0.0))
    arm.position_error_m, work.position_error_m = 0.0, 0.0
    for i in range(len(arm.habit)):
        arm.habit[i] = 0.0
    for i in range(10):
        arm.configuration[i] = start[i]
    store(arm.asked, wrist_at(chain, arm.configuration))
    for n in range(len(targets)):
        position = position_to_arm(chain, (targets[n, 0], targets[n, 1], targets[n, 2]))
        rotation = columns_of(hand_to_arm(chain, (targets[n, 3], targets[n, 4], targets[n, 5], targets[n, 6])))
        if n == 0 and not started:
            first_frame(arm, setting, position, rotation)
        else:
            step_frame(arm, setting, position, rotation, dt_s)
        for i in range(10):
            configurations[n, i] = arm.configuration[i]
        iterations[n] = work.iterations
        position_errors[n], orientation_errors[n] = arm.position_error_m, arm.orientation_error_rad
        statuses[n] = arm.status
