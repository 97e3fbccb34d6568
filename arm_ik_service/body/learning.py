"""The running estimate for people who never calibrate: stature from the height of the eyes, arm length from reach.

Both are running percentiles: a step up or down a frame, in proportion so that they rest where the wanted share of
time lies on either side; the steps shrink as time goes by. Only the samples count, so a replay learns the same.
"""

from __future__ import annotations

import math

import numpy as np

from arm_ik_service.body.profile import BodyMeasures, Profile
from arm_ik_service.body.shoulders import away_from_rest
from arm_ik_service.compiled import Record, compiled, inlined, record_dtype
from arm_ik_service.geometry import scalar as g

EYES_PER_STATURE = 0.936  # eye height over stature: Drillis & Contini (1966)
# Upper arm and forearm: between the same, 0.332, and the distances between joint centres of de Leva (1996), 0.314.
ARM_PER_STATURE = 0.324
UPPER_ARM_PER_ARM = 0.56
HALF_WIDTH_PER_STATURE = 0.103

EYES_PERCENTILE = 0.75  # people crouch more than they jump
EYES_M_S = 0.3  # speed of the estimate at first ...
EYES_SETTLE_AFTER_S = 5.0  # ... and the time after which it is half of that
STANDING_EYES_M = (1.3, 2.1)  # lower: seated, or a space without a floor, which says nothing of stature

# Reach over arm length of a stretched arm from where its shoulder rests: girdle and trunk give the rest. On the CMU and
# Xia recordings anything from 1.02 to 1.065 is as good.
OVERSTRETCHED = 1.05
OVERSTRETCHED_TIME = 0.006  # share of the time that a hand may be farther away
LENGTH_PER_S = 0.3  # speed of the estimate, as a part of the length
LENGTH_SETTLES_AFTER_S = 30.0
OUT_OF_HAND = 1.45  # a hand so many arm lengths away has let go of the controller
GROWS_IN_S = 0.3  # the time in which the body follows the estimates
LENGTH_RANGE = (0.94, 1.3)  # of what stature says: people rarely stretch fully, so little is taken away

LEARNING = record_dtype(
    [
        ("stature", np.int64),  # 1 where it is to be learnt
        ("width", np.int64),
        ("arms", np.int64),
        ("watched_s", np.float64),
        ("eyes", np.float64),  # estimate of their height [m]
        ("length", np.float64),  # estimate of the arms, as a part of what stature says
    ]
)


def initialise_learning(body: Record, profile: Profile) -> None:
    """Learn what the profile leaves open; a stature that is the default one counts as not stated."""
    measures, learning = profile.body, body["learning"]
    learning["arms"] = measures.upper_arm_m is None and measures.forearm_m is None
    learning["width"] = measures.shoulder_width_m is None
    learning["stature"] = learning["arms"] and measures.stature_m == BodyMeasures().stature_m
    learning["eyes"] = EYES_PER_STATURE * measures.stature_m
    learning["length"] = 1.0
    body["stature"] = measures.stature_m


def resume_learning(body: Record, upper_arm_m: float, forearm_m: float, half_width_m: float) -> None:
    """Go on from lengths that another process learnt of the person in a BODY record, so far as they are open.

    Lengths that no person has are not taken.
    """
    learning = body["learning"]
    length_m = upper_arm_m + forearm_m
    if not learning["arms"] or not length_m > 0.0:
        return
    stature = half_width_m / HALF_WIDTH_PER_STATURE if learning["width"] and learning["stature"] else body["stature"]
    eyes, length = EYES_PER_STATURE * stature, length_m / (ARM_PER_STATURE * stature)
    if not (STANDING_EYES_M[0] <= eyes <= STANDING_EYES_M[1] and LENGTH_RANGE[0] <= length <= LENGTH_RANGE[1]):
        return
    learning["watched_s"] = LENGTH_SETTLES_AFTER_S
    learning["eyes"], learning["length"] = eyes, length
    body["stature"], body["arm_length"], body["upper_arm"], body["forearm"] = stature, length_m, upper_arm_m, forearm_m
    if learning["width"]:
        body["half_width"] = half_width_m


@inlined
def _stature(body: Record) -> float:
    """Estimate of the stature [m] as it is by now: what is learnt, or what the profile says."""
    return float(body.learning.eyes / EYES_PER_STATURE)


@inlined
def _arm_length(body: Record) -> float:
    """Estimate of the arm's length [m] as it is by now."""
    return float(body.learning.length * ARM_PER_STATURE * _stature(body))


@compiled
def _learn_stature(body: Record, eyes_m: float, elapsed_s: float) -> None:
    learning = body.learning
    pace = EYES_M_S * elapsed_s / (1.0 + learning.watched_s / EYES_SETTLE_AFTER_S)
    learning.eyes += pace * (EYES_PERCENTILE if eyes_m > learning.eyes else EYES_PERCENTILE - 1.0)
    learning.eyes = g.clip(learning.eyes, STANDING_EYES_M[0], STANDING_EYES_M[1])


@compiled
def _learn_length(body: Record, k: int, length_m: float, elapsed_s: float) -> None:
    ratio = g.norm(away_from_rest(body, k)) / length_m
    if ratio > OUT_OF_HAND:
        return
    learning = body.learning
    pace = LENGTH_PER_S * elapsed_s / (1.0 + learning.watched_s / LENGTH_SETTLES_AFTER_S)
    learning.length += pace * (1.0 - OVERSTRETCHED_TIME if ratio > OVERSTRETCHED else -OVERSTRETCHED_TIME)
    learning.length = g.clip(learning.length, LENGTH_RANGE[0], LENGTH_RANGE[1])


@inlined
def _grow(body: Record, elapsed_s: float) -> None:
    """Let the body come to its estimates smoothly: those go up or down a step a frame, and arms would tremble by it."""
    learning, share = body.learning, 1.0 - math.exp(-elapsed_s / GROWS_IN_S)
    body.stature += share * (_stature(body) - body.stature)
    if learning.stature and learning.width:
        body.half_width = HALF_WIDTH_PER_STATURE * body.stature
    body.arm_length += share * (_arm_length(body) - body.arm_length)
    body.upper_arm = UPPER_ARM_PER_ARM * body.arm_length
    body.forearm = body.arm_length - body.upper_arm


@compiled
def learn(body: Record, tracking: Record, elapsed_s: float) -> None:
    """Take one frame into the estimates, and the estimates into the body. Call where `body.learning.arms` is set."""
    if tracking.head.position_age_s > 0.0:
        return
    learning = body.learning
    eyes_m = tracking.head.position[1]
    if learning.stature and STANDING_EYES_M[0] < eyes_m < STANDING_EYES_M[1]:
        _learn_stature(body, eyes_m, elapsed_s)
    length_m = _arm_length(body)  # the same for both hands: left is the mirror of right
    for k in range(2):
        if tracking.hands[k].position_age_s == 0.0:
            _learn_length(body, k, length_m, elapsed_s)
    learning.watched_s += elapsed_s
    _grow(body, elapsed_s)
