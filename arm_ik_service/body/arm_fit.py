"""Arm lengths from someone who moves about: the elbow stays at one distance from the shoulder.

The elbow is a fixed point of the hand's frame as long as the wrist is straight: `elbow_in_hand`, on the forearm's axis.
Its distance to the shoulder is the length of the upper arm, whatever the arm does. That is one equation a frame for
the shoulder's place in the chest (2), the shoulders' width (1), the elbow in the hand (3) and the upper arm (1), and
the farthest reach is two more: no arm goes beyond its length, and few people never stretch theirs. Wrists bend and
chests are estimates, so an equation is off by centimetres, and what the data do not say the proportions of people do: a
maximum a posteriori fit, by Gauss-Newton. Where the equations are off by much, as with sabers that are swung from the
wrist, the proportions decide nearly all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from arm_ik_service.body.learning import ARM_PER_STATURE
from arm_ik_service.body.observation import Observation
from arm_ik_service.body.profile import SHOULDER_WIDTH_PER_STATURE
from arm_ik_service.geometry import batch

Array = npt.NDArray[np.float64]

# Upper arm over forearm: between Drillis & Contini (1966; in Winter, table 4.1), 1.27, and the distances between joint
# centres of de Leva (1996, table 4), 1.04; where, the CMU and Xia recordings say.
SEGMENTS = 1.2
# standard deviations, chosen so that the mocap recordings are as far off as they say
SHOULDER_UP_M, SHOULDER_BACK_M, HALF_WIDTH_M = 0.03, 0.05, 0.015  # trunks turn and lean into a reach
ARM_LENGTH_PART = 0.1  # skeletons of mocap differ by so much, people by half of it
LOG_SEGMENTS = 0.06  # of upper arm over forearm
LEAST_ERROR_M = 0.05  # of an equation
ERROR_PER_RESIDUAL = 2.0  # more where residuals are large: what makes them so is no noise that averages out
INDEPENDENT_PER_S, MOST_INDEPENDENT = 6.0, 60.0  # equations that a recording is worth: errors last, and repeat
MOST_EQUATIONS = 1200
REACH_PERCENTILE, REACH_ERROR_M = 99.0, 0.01
GIRDLE_GIVES = 1.025  # reach over arm length of a stretched arm, seen from a shoulder that stays
# what somebody reaches who moves about for long (the first fitted to the CMU and Xia recordings, flat below 0.96)
STRETCHED, STRETCHED_PART, STRETCHES_AFTER_S = 0.95, 0.045, 10.0


@dataclass(frozen=True)
class ArmFit:
    """Right arm; the left one is its mirror image."""

    upper_arm_m: float
    elbow_in_hand: Array  # (3,) [m] in the wrist frame
    half_width_m: float
    arm_length_deviation_m: float  # standard deviation of forearm and upper arm together
    residual_m: float  # root mean square of the equations

    @property
    def forearm_m(self) -> float:
        """Wrist to elbow."""
        return float(np.linalg.norm(self.elbow_in_hand))

    @property
    def arm_length_m(self) -> float:
        """Shoulder to wrist, straight."""
        return self.upper_arm_m + self.forearm_m


def _gauss_newton(residuals: Callable[[Array], Array], x: Array, steps: int = 12) -> tuple[Array, Array, Array]:
    """Minimise a sum of squares; returns the argument, its covariance and the residuals there."""
    h = 1e-6
    covariance: Array = np.eye(len(x))
    for _ in range(steps):
        r = residuals(x)
        jacobian = np.stack([(residuals(x + h * e) - r) / h for e in np.eye(len(x))], axis=1)
        covariance = np.asarray(np.linalg.inv(jacobian.T @ jacobian), float)
        x = x - np.clip(covariance @ (jacobian.T @ r), -0.1, 0.1)
    return x, covariance, residuals(x)


def fit_arm(observation: Observation, stature_m: float, *, axis_deviation_m: float) -> ArmFit:
    """Fit to an observation; `axis_deviation_m` says how far the elbow may be from the hand's own axis.

    Deterministic. Needs a few hundred frames to mean anything; the deviation says how much it does.
    """
    every = max(1, 2 * len(observation) // MOST_EQUATIONS)
    wrists = observation.wrists[::every].reshape(-1, 7)
    hands, rotations = wrists[:, :3], wrists[:, 3:]
    fore = ARM_PER_STATURE * stature_m / (1.0 + SEGMENTS)
    upper = SEGMENTS * fore
    half = 0.5 * SHOULDER_WIDTH_PER_STATURE * stature_m
    weight = np.sqrt(min(INDEPENDENT_PER_S * observation.seconds, MOST_INDEPENDENT) / len(hands))
    stretched_part = STRETCHED_PART * np.sqrt(1.0 + STRETCHES_AFTER_S / observation.seconds)
    error_m = LEAST_ERROR_M

    def residuals(x: Array) -> Array:
        shoulder, elbow_in_hand, upper_arm = np.array([x[2], x[0], x[1]]), x[3:6], x[6]
        forearm = np.linalg.norm(elbow_in_hand)
        length = forearm + upper_arm
        elbows = hands + batch.rotate(rotations, elbow_in_hand)
        equations = weight * (np.linalg.norm(elbows - shoulder, axis=1) - upper_arm) / error_m
        reach = np.percentile(np.linalg.norm(hands - shoulder, axis=1), REACH_PERCENTILE)
        overstretched = max(reach - GIRDLE_GIVES * length, 0.0) / REACH_ERROR_M
        never_stretched = max(STRETCHED - reach / length, 0.0) / stretched_part
        assumed = [
            x[0] / SHOULDER_UP_M,
            x[1] / SHOULDER_BACK_M,
            (x[2] - half) / HALF_WIDTH_M,
            x[3] / axis_deviation_m,
            x[4] / axis_deviation_m,
            (length / (upper + fore) - 1.0) / ARM_LENGTH_PART,
            np.log(upper_arm / forearm / SEGMENTS) / LOG_SEGMENTS,
        ]
        return np.concatenate([equations, [overstretched, never_stretched], assumed])

    x = np.array([0.0, 0.0, half, 0.0, 0.0, fore, upper])
    covariance = np.eye(len(x))
    residual_m = error_m
    for _ in range(3):  # the error of an equation is found from the residuals
        x, covariance, r = _gauss_newton(residuals, x)
        residual_m = float(np.sqrt(np.mean(r[: len(hands)] ** 2)) / weight * error_m)
        error_m = max(LEAST_ERROR_M, ERROR_PER_RESIDUAL * residual_m)
    along = np.concatenate([[0.0, 0.0, 0.0], x[3:6] / np.linalg.norm(x[3:6]), [1.0]])
    deviation = float(np.sqrt(along @ covariance @ along))
    return ArmFit(float(x[6]), x[3:6].copy(), float(x[2]), deviation, residual_m)
