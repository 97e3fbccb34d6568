"""Arm lengths from someone who moves about: the elbow stays at one distance from the shoulder.

The elbow is a fixed point e of the hand's frame as long as the wrist is straight, on the forearm's axis. Its distance
to the shoulder s is the length u of the upper arm, whatever the arm does: |h + R e - s| = u for a hand at h, rotated by
R, in the chest's frame. That is one equation a hand and sample for seven unknowns. The farthest reach is two more: no
arm goes beyond its length, and few people never stretch theirs. Wrists bend and chests are estimates, so an equation is
off by centimetres, and what the data do not say the proportions of people do: a maximum a posteriori fit, by
Gauss-Newton. Where the equations are off by much, as with sabers that are swung from the wrist, the proportions decide
nearly all.

Squared, an equation is the product of 17 numbers of the sample with 17 of the arm:

    h.h + 2 e.R'h - 2 s.h - 2 s.R e + (e.e + s.s - u u) = 0

So the mean outer product of the former, `moments`, holds all that any number of samples say: none is kept, and an arm
is fitted while it moves as well as afterwards. Over 2 u it is off by what the distance is off by, in first order.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from arm_ik_service.body.profile import SHOULDER_WIDTH_PER_STATURE
from arm_ik_service.compiled import Record, compiled, inlined, record_dtype
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Quaternion, Vector

# Upper arm and forearm over stature: between Drillis & Contini (1966), 0.332, and the distances between joint centres
# of de Leva (1996), 0.314. Upper arm over forearm: between the same, 1.27 (in Winter, table 4.1) and 1.04 (table 4);
# where, the CMU and Xia recordings say.
ARM_PER_STATURE = 0.324
SEGMENTS = 1.2
_FOREARM_PER_STATURE = ARM_PER_STATURE / (1.0 + SEGMENTS)
_UPPER_ARM_PER_STATURE = ARM_PER_STATURE - _FOREARM_PER_STATURE
HALF_WIDTH_PER_STATURE = 0.5 * SHOULDER_WIDTH_PER_STATURE

# standard deviations, chosen so that the mocap recordings are as far off as they say
SHOULDER_M: Vector = (0.015, 0.03, 0.05)  # to the side, up, back: trunks turn and lean into a reach
ARM_LENGTH_PART = 0.1  # skeletons of mocap differ by so much, people by half of it
LOG_SEGMENTS = 0.06  # of upper arm over forearm
AXIS_M = 0.03  # where the elbow may be beside the hand's axis
LEAST_ERROR_M = 0.05  # of an equation
ERROR_PER_RESIDUAL = 2.0  # more where residuals are large: what makes them so is no noise that averages out
SQUARES_HOLD_M = 0.05  # ... and more still beyond this residual, where squares are no longer as good as distances
INDEPENDENT_PER_S, MOST_INDEPENDENT = 6.0, 60.0  # equations that movement is worth: errors last, and repeat
REACH_ERROR_M = 0.01
GIRDLE_GIVES = 1.025  # reach over arm length of a stretched arm, seen from a shoulder that stays
# what somebody reaches who moves about for long (the first fitted to the CMU and Xia recordings, flat below 0.96)
STRETCHED, STRETCHED_PART, STRETCHES_AFTER_S = 0.95, 0.045, 10.0

MEMORY_S = 300.0  # of movement: what is older fades
LARGEST_STEP_M = 0.1  # of an unknown, in a step of Gauss-Newton
BONES_RANGE = (0.7, 1.4)  # over what was expected: whatever is seen, these are the lengths of a person

# unknowns: shoulder in the chest's frame, elbow in the hand's, upper arm [m]; of the right arm, the left is its mirror
SHOULDER, ELBOW, UPPER_ARM, UNKNOWNS = 0, 3, 6, 7
# the numbers of a sample: h.h, R'h, h, R, 1
SQUARE, IN_HAND, IN_CHEST, ROTATION, ONE, FEATURES = 0, 1, 4, 7, 16, 17

ARM_FIT = record_dtype(
    [
        ("x", np.float64, (UNKNOWNS,)),
        ("moments", np.float64, (FEATURES, FEATURES)),
        ("seconds", np.float64),  # of movement that they are made of
        ("reach", np.float64),  # of the farthest samples, from the shoulder [m] ...
        ("towards", np.float64, (3,)),  # ... and the mean direction to them
        ("residual_m", np.float64),  # root mean square of the equations
        ("error_m", np.float64),  # what each of them is taken to be off by
        # what is expected of people
        ("upper_arm", np.float64),  # [m]
        ("forearm", np.float64),
        ("half_width", np.float64),  # of the shoulders
        ("length_part", np.float64),  # standard deviation of the arm's length over that length
        ("axis_m", np.float64),  # standard deviation of the elbow from the hand's axis
        # scratch
        ("features", np.float64, (2, FEATURES)),
        ("factors", np.float64, (FEATURES,)),
        ("slopes", np.float64, (UNKNOWNS, FEATURES)),  # of the factors over the unknowns
        ("pulled", np.float64, (FEATURES,)),
        ("normal", np.float64, (UNKNOWNS, UNKNOWNS)),
        ("gradient", np.float64, (UNKNOWNS,)),
    ]
)


@inlined
def shoulder(fit: Record) -> Vector:
    """Where the right shoulder rests in the chest's frame [m]."""
    return (fit.x[SHOULDER], fit.x[SHOULDER + 1], fit.x[SHOULDER + 2])


@inlined
def elbow(fit: Record) -> Vector:
    """Where the right elbow is in the frame of its hand [m]."""
    return (fit.x[ELBOW], fit.x[ELBOW + 1], fit.x[ELBOW + 2])


@inlined
def average(stature_m: float) -> Vector:
    """Upper arm, forearm and half the shoulders' width [m] of an average person."""
    return (_UPPER_ARM_PER_STATURE * stature_m, _FOREARM_PER_STATURE * stature_m, HALF_WIDTH_PER_STATURE * stature_m)


@inlined
def expect(fit: Record, lengths: Vector) -> None:
    """Say what the samples are weighed against: `average` lengths, or known ones."""
    fit.upper_arm, fit.forearm, fit.half_width = lengths


def begin(fit: Record, expected: Vector, *, length_part: float = ARM_LENGTH_PART, axis_m: float = AXIS_M) -> None:
    """Forget all samples: the arm is the expected one, as surely as the two standard deviations say."""
    expect(fit, expected)
    fit["length_part"], fit["axis_m"] = length_part, axis_m
    fit["moments"] = 0.0
    fit["seconds"] = 0.0
    fit["error_m"] = LEAST_ERROR_M
    fit["x"] = (fit["half_width"], 0.0, 0.0, 0.0, 0.0, fit["forearm"], fit["upper_arm"])
    fit["reach"] = STRETCHED * (fit["upper_arm"] + fit["forearm"])
    fit["towards"] = (0.0, -1.0, 0.0)


# --- samples ---------------------------------------------------------------------------------------------------------


@compiled
def show(fit: Record, k: int, hand: Vector, rotation: Quaternion) -> None:
    """Write down a sample of one hand, `k` 0 or 1, in the chest's frame; a left one mirrored."""
    x, y, z = g.rotate(rotation, g.X), g.rotate(rotation, g.Y), g.rotate(rotation, g.Z)
    features = fit.features[k]
    features[SQUARE] = g.dot(hand, hand)
    in_hand = g.components((x, y, z), hand)
    for i in range(3):
        features[IN_HAND + i] = in_hand[i]
        features[IN_CHEST + i] = hand[i]
        features[ROTATION + 3 * i] = x[i]
        features[ROTATION + 3 * i + 1] = y[i]
        features[ROTATION + 3 * i + 2] = z[i]
    features[ONE] = 1.0


@compiled
def take(fit: Record, left_s: float, right_s: float) -> None:
    """Take the samples of both hands in, each for so many seconds of movement; for 0 s, one that was not shown."""
    seconds = left_s + right_s
    if seconds < 1e-6:
        return
    fit.seconds += 0.5 * seconds
    share = 0.5 / min(fit.seconds, MEMORY_S)
    keeps = 1.0 - share * seconds
    left, right = fit.features[0], fit.features[1]
    for i in range(FEATURES):
        for j in range(i + 1):  # a sum of two first: left is the mirror of right, to the bit
            both = left_s * left[i] * left[j] + right_s * right[i] * right[j]
            fit.moments[i, j] = keeps * fit.moments[i, j] + share * both
            fit.moments[j, i] = fit.moments[i, j]


# --- the fit ---------------------------------------------------------------------------------------------------------


@compiled
def _linearise(fit: Record) -> None:
    """Work out the numbers of the arm, and their slopes over the unknowns once they are divided by 2 u."""
    s, e, u = shoulder(fit), elbow(fit), fit.x[UPPER_ARM]
    factors, slopes = fit.factors, fit.slopes
    factors[SQUARE] = 1.0
    factors[ONE] = g.dot(e, e) + g.dot(s, s) - u * u
    for i in range(3):
        factors[IN_HAND + i] = 2.0 * e[i]
        factors[IN_CHEST + i] = -2.0 * s[i]
        slopes[ELBOW + i, IN_HAND + i] = 2.0
        slopes[SHOULDER + i, IN_CHEST + i] = -2.0
        slopes[ELBOW + i, ONE] = 2.0 * e[i]
        slopes[SHOULDER + i, ONE] = 2.0 * s[i]
        for j in range(3):
            factors[ROTATION + 3 * i + j] = -2.0 * s[i] * e[j]
            slopes[SHOULDER + i, ROTATION + 3 * i + j] = -2.0 * e[j]
            slopes[ELBOW + j, ROTATION + 3 * i + j] = -2.0 * s[i]
    for j in range(FEATURES):
        slopes[UPPER_ARM, j] = -factors[j] / u
    slopes[UPPER_ARM, ONE] -= 2.0 * u


@compiled
def _pull(fit: Record, numbers: Any) -> None:
    for i in range(FEATURES):
        total = 0.0
        for j in range(FEATURES):
            total += fit.moments[i, j] * numbers[j]
        fit.pulled[i] = total


@compiled
def _pulled_along(fit: Record, numbers: Any) -> float:
    total = 0.0
    for i in range(FEATURES):
        total += numbers[i] * fit.pulled[i]
    return total


@compiled
def _add_equations(fit: Record) -> None:
    _linearise(fit)
    _pull(fit, fit.factors)
    per_m = 0.5 / fit.x[UPPER_ARM]
    fit.residual_m = per_m * math.sqrt(max(_pulled_along(fit, fit.factors), 0.0))
    independent = min(INDEPENDENT_PER_S * fit.seconds, MOST_INDEPENDENT)
    weight = independent * (per_m / fit.error_m) * (per_m / fit.error_m)
    for a in range(UNKNOWNS):
        fit.gradient[a] += weight * _pulled_along(fit, fit.slopes[a])
    for a in range(UNKNOWNS):
        _pull(fit, fit.slopes[a])
        for b in range(UNKNOWNS):
            fit.normal[a, b] += weight * _pulled_along(fit, fit.slopes[b])


@compiled
def _add(fit: Record, residual: float, to_shoulder: Vector, to_elbow: Vector, to_upper_arm: float) -> None:
    """Add one residual over its standard deviation, with its slopes over the unknowns."""
    slopes = (*to_shoulder, *to_elbow, to_upper_arm)
    for a in range(UNKNOWNS):
        fit.gradient[a] += slopes[a] * residual
        for b in range(UNKNOWNS):
            fit.normal[a, b] += slopes[a] * slopes[b]


@compiled
def _add_reach(fit: Record, along_forearm: Vector, length: float) -> None:
    towards = g.vector(fit.towards)
    too_far = (fit.reach - GIRDLE_GIVES * length) / REACH_ERROR_M
    if too_far > 0.0:
        slope = -GIRDLE_GIVES / REACH_ERROR_M
        _add(fit, too_far, g.scale(-1.0 / REACH_ERROR_M, towards), g.scale(slope, along_forearm), slope)
    never_stretched = STRETCHED - fit.reach / length
    if never_stretched > 0.0 and fit.seconds > 0.0:
        weight = 1.0 / (STRETCHED_PART * math.sqrt(1.0 + STRETCHES_AFTER_S / fit.seconds))
        slope = weight * fit.reach / (length * length)
        _add(fit, weight * never_stretched, g.scale(weight / length, towards), g.scale(slope, along_forearm), slope)


@compiled
def _add_expectations(fit: Record, along_forearm: Vector, forearm: float, length: float) -> None:
    expected = fit.upper_arm + fit.forearm
    weight = 1.0 / (fit.length_part * expected)
    _add(fit, weight * (length - expected), (0.0, 0.0, 0.0), g.scale(weight, along_forearm), weight)
    upper_arm, weight = fit.x[UPPER_ARM], 1.0 / LOG_SEGMENTS
    segments = math.log(upper_arm * fit.forearm / (forearm * fit.upper_arm))
    _add(fit, weight * segments, (0.0, 0.0, 0.0), g.scale(-weight / forearm, along_forearm), weight / upper_arm)
    at_rest = (fit.half_width, 0.0, 0.0)
    for i in range(3):
        weight = 1.0 / (SHOULDER_M[i] * SHOULDER_M[i])
        fit.gradient[SHOULDER + i] += weight * (fit.x[SHOULDER + i] - at_rest[i])
        fit.normal[SHOULDER + i, SHOULDER + i] += weight
    weight = 1.0 / (fit.axis_m * fit.axis_m)
    for i in range(2):
        fit.gradient[ELBOW + i] += weight * fit.x[ELBOW + i]
        fit.normal[ELBOW + i, ELBOW + i] += weight


@compiled
def linearise(fit: Record) -> None:
    """Set `normal`, the inverse of the unknowns' covariance, and `gradient` for the arm as it is."""
    for a in range(UNKNOWNS):
        fit.gradient[a] = 0.0
        for b in range(UNKNOWNS):
            fit.normal[a, b] = 0.0
    forearm = g.norm(elbow(fit))
    along_forearm = g.scale(1.0 / forearm, elbow(fit))
    length = fit.x[UPPER_ARM] + forearm
    _add_equations(fit)
    _add_reach(fit, along_forearm, length)
    _add_expectations(fit, along_forearm, forearm, length)


@compiled
def _solve(a: Any, b: Any) -> None:
    """Put the solution of a x = b into b, by elimination: what is expected makes `a` positive definite. Spoils `a`."""
    for k in range(UNKNOWNS):
        for i in range(k + 1, UNKNOWNS):
            part = a[i, k] / a[k, k]
            b[i] -= part * b[k]
            for j in range(k, UNKNOWNS):
                a[i, j] -= part * a[k, j]
    for i in range(UNKNOWNS - 1, -1, -1):
        for j in range(i + 1, UNKNOWNS):
            b[i] -= a[i, j] * b[j]
        b[i] /= a[i, i]


@inlined
def _as_persons(length_m: float, expected_m: float) -> float:
    return g.clip(length_m, BONES_RANGE[0] * expected_m, BONES_RANGE[1] * expected_m)


@compiled
def improve(fit: Record) -> None:
    """Bring the arm nearer to what the samples and the expectations say: one step of Gauss-Newton."""
    linearise(fit)
    _solve(fit.normal, fit.gradient)
    before = shoulder(fit)
    for a in range(UNKNOWNS):
        fit.x[a] -= g.clip(fit.gradient[a], -LARGEST_STEP_M, LARGEST_STEP_M)
    fit.x[SHOULDER] = _as_persons(fit.x[SHOULDER], fit.half_width)
    fit.x[UPPER_ARM] = _as_persons(fit.x[UPPER_ARM], fit.upper_arm)
    forearm = g.norm(elbow(fit))
    if forearm < 1e-3:  # no direction to speak of
        fit.x[ELBOW + 2], forearm = fit.forearm, fit.forearm
    longer = _as_persons(forearm, fit.forearm) / forearm
    for i in range(3):
        fit.x[ELBOW + i] *= longer
    fit.reach -= g.dot(g.vector(fit.towards), g.subtract(shoulder(fit), before))
    grows = max(1.0, fit.residual_m / SQUARES_HOLD_M)
    fit.error_m = max(LEAST_ERROR_M, ERROR_PER_RESIDUAL * fit.residual_m * grows)
