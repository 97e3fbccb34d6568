"""The arm of someone who moved about: the fit of people without a profile, its farthest reach from all the frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from arm_ik_service.body.arm_fit import (
    ARM_FIT,
    BONES_RANGE,
    ELBOW,
    LEAST_ERROR_M,
    SHOULDER,
    UPPER_ARM,
    average,
    begin,
    improve,
    linearise,
    show,
    take,
)
from arm_ik_service.calibration.observation import Observation
from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import scalar as g

Array = npt.NDArray[np.float64]

REACH_PERCENTILE = 99.0
# of Gauss-Newton: first with small errors, wherever the arm starts, then with those found
TRUSTING_STEPS, STEPS = 12, 20


@dataclass(frozen=True)
class Arm:
    """Right arm; the left one is its mirror image."""

    upper_arm_m: float
    elbow_in_hand: Array  # (3,) [m] in the wrist frame
    shoulder_width_m: float
    plausible: bool  # whether these are lengths that a person of that stature has
    length_deviation_m: float  # standard deviation of forearm and upper arm together

    @property
    def forearm_m(self) -> float:
        """Wrist to elbow."""
        return float(np.linalg.norm(self.elbow_in_hand))


@compiled
def _take_all(fit: Record, wrists: Any, seconds: float) -> None:
    for n in range(len(wrists)):
        for k in range(2):
            show(fit, k, g.vector(wrists[n, k]), g.quaternion(wrists[n, k, 3:]))
        take(fit, seconds, seconds)


def _set_reach(fit: Record, hands: Array) -> None:
    away = hands - fit["x"][SHOULDER:ELBOW]
    distances = np.linalg.norm(away, axis=1)
    fit["reach"] = np.percentile(distances, REACH_PERCENTILE)
    far = distances >= fit["reach"]
    fit["towards"] = np.mean(away[far] / distances[far, None], axis=0)


def fit_arm(observation: Observation, stature_m: float, *, axis_m: float) -> Arm:
    """Fit to an observation; `axis_m` is the standard deviation of the elbow from the hand's own axis.

    Deterministic. Needs a few hundred frames to mean anything; the deviation says how much it does.
    """
    fit = np.zeros(1, ARM_FIT)[0]
    expected = average(stature_m)
    begin(fit, expected, axis_m=axis_m)
    _take_all(fit, observation.wrists, observation.seconds / len(observation))
    hands = observation.wrists[..., :3].reshape(-1, 3)
    for step in range(TRUSTING_STEPS + STEPS):
        if step < TRUSTING_STEPS:
            fit["error_m"] = LEAST_ERROR_M
        _set_reach(fit, hands)
        improve(fit)
    _set_reach(fit, hands)
    linearise(fit)
    elbow = np.array(fit["x"][ELBOW:UPPER_ARM])
    along = np.concatenate([np.zeros(3), elbow / np.linalg.norm(elbow), [1.0]])
    deviation = np.sqrt(along @ np.linalg.solve(fit["normal"], along))
    upper_arm, half_width = float(fit["x"][UPPER_ARM]), float(fit["x"][SHOULDER])
    parts = np.array([upper_arm, np.linalg.norm(elbow), half_width]) / expected
    plausible = bool((parts > 1.001 * BONES_RANGE[0]).all() and (parts < 0.999 * BONES_RANGE[1]).all())
    return Arm(upper_arm, elbow, 2.0 * half_width, plausible, float(deviation))
