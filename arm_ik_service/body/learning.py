"""The running estimate for people who never calibrate: stature from the height of the eyes, arms from how they move.

Stature is a running percentile: a step up or down a frame, in proportion so that it rests where the wanted share of
time lies on either side; the steps shrink as time goes by. So is the farthest reach, which the fit of the arm needs.
Only the samples count, so a replay learns the same.
"""

from __future__ import annotations

import math

import numpy as np

from arm_ik_service.body.arm_fit import (
    ARM_FIT,
    ARM_LENGTH_PART,
    ARM_PER_STATURE,
    AXIS_M,
    FOREARM_PER_STATURE,
    UPPER_ARM,
    UPPER_ARM_PER_STATURE,
    begin,
    elbow,
    expect,
    improve,
    shoulder,
    show,
    take,
)
from arm_ik_service.body.follow import follow
from arm_ik_service.body.profile import BodyMeasures, Profile
from arm_ik_service.compiled import Record, compiled, inlined, record_dtype
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Quaternion, Vector

EYES_PER_STATURE = 0.936  # eye height over stature: Drillis & Contini (1966)
HALF_WIDTH_PER_STATURE = 0.103

EYES_PERCENTILE = 0.75  # people crouch more than they jump
EYES_M_S = 0.3  # speed of the estimate at first ...
EYES_SETTLE_AFTER_S = 5.0  # ... and the time after which it is half of that
STANDING_EYES_M = (1.3, 2.1)  # lower: seated, or a space without a floor, which says nothing of stature

SAMPLES_S = 0.03  # between two samples of the arms
MOVES_M_S = 0.3  # what a slower hand shows counts for less: it is the same for long
FARTHEST_TIME = 0.01  # share of the time that a hand may be farther away than the farthest reach
REACH_M_S = 1.0  # speed of that estimate at first ...
REACH_SETTLES_AFTER_S = 5.0  # ... and the movement after which it is half of that
TOWARDS_TIME_S = 0.3  # in which the farthest hands say where they are
OUT_OF_HAND = 1.45  # a hand so many arm lengths away has let go of the controller
GROWS_IN_S = 0.4  # by which the body trails the estimates
WATCHED_BEFORE_S = 30.0  # by the process that another takes a person over from
TAKEN_OVER_PART = 0.03  # standard deviation of an arm's length that another process learnt, over that length
LENGTH_RANGE = (0.8, 1.3)  # of what stature says: others are not taken over

LEARNING = record_dtype(
    [
        ("stature", np.int64),  # 1 where it is to be learnt
        ("width", np.int64),
        ("arms", np.int64),
        ("watched_s", np.float64),
        ("since_sample_s", np.float64),
        ("eyes", np.float64),  # estimate of their height [m]
        ("upper_arm", np.float64),  # expected, over stature
        ("forearm", np.float64),
        ("fit", ARM_FIT),
    ]
)


def initialise_learning(body: Record, profile: Profile) -> None:
    """Learn what the profile leaves open; a stature that is the default one counts as not stated."""
    measures, learning = profile.body, body["learning"]
    learning["arms"] = measures.upper_arm_m is None and measures.forearm_m is None
    learning["width"] = measures.shoulder_width_m is None
    learning["stature"] = learning["arms"] and measures.stature_m == BodyMeasures().stature_m
    learning["eyes"] = EYES_PER_STATURE * measures.stature_m
    learning["upper_arm"], learning["forearm"] = UPPER_ARM_PER_STATURE, FOREARM_PER_STATURE
    learning["fit"]["length_part"], learning["fit"]["axis_m"] = ARM_LENGTH_PART, AXIS_M
    body["stature"] = measures.stature_m
    _expect(body)
    begin(learning["fit"])
    body["lengths"]["at"] = (measures.upper_arm, measures.forearm, measures.stature_m)


def resume_learning(body: Record, upper_arm_m: float, forearm_m: float, half_width_m: float) -> None:
    """Go on from lengths that another process learnt of the person in a BODY record, so far as they are open.

    Lengths that no person has are not taken.
    """
    learning = body["learning"]
    length_m = upper_arm_m + forearm_m
    if not learning["arms"] or not min(upper_arm_m, forearm_m) > 0.0:
        return
    stature = half_width_m / HALF_WIDTH_PER_STATURE if learning["width"] and learning["stature"] else body["stature"]
    eyes, length = EYES_PER_STATURE * stature, length_m / (ARM_PER_STATURE * stature)
    if not (STANDING_EYES_M[0] <= eyes <= STANDING_EYES_M[1] and LENGTH_RANGE[0] <= length <= LENGTH_RANGE[1]):
        return
    learning["watched_s"] = WATCHED_BEFORE_S
    learning["eyes"] = eyes
    learning["upper_arm"], learning["forearm"] = upper_arm_m / stature, forearm_m / stature
    learning["fit"]["length_part"] = TAKEN_OVER_PART
    body["stature"], body["arm_length"], body["upper_arm"], body["forearm"] = stature, length_m, upper_arm_m, forearm_m
    if learning["width"]:
        body["half_width"] = half_width_m
    _expect(body)
    begin(learning["fit"])
    body["lengths"]["at"] = (upper_arm_m, forearm_m, stature)


@inlined
def _stature(body: Record) -> float:
    """Estimate of the stature [m] as it is by now: what is learnt, or what the profile says."""
    return float(body.learning.eyes / EYES_PER_STATURE)


@inlined
def _expect(body: Record) -> None:
    """Let the arm's fit expect what the stature says."""
    learning, stature = body.learning, _stature(body)
    half_width = HALF_WIDTH_PER_STATURE * stature if learning.width else body.half_width
    expect(learning.fit, learning.upper_arm * stature, learning.forearm * stature, half_width)


@compiled
def _learn_stature(body: Record, eyes_m: float, elapsed_s: float) -> None:
    learning = body.learning
    pace = EYES_M_S * elapsed_s / (1.0 + learning.watched_s / EYES_SETTLE_AFTER_S)
    learning.eyes += pace * (EYES_PERCENTILE if eyes_m > learning.eyes else EYES_PERCENTILE - 1.0)
    learning.eyes = g.clip(learning.eyes, STANDING_EYES_M[0], STANDING_EYES_M[1])


@inlined
def _in_chest(body: Record, k: int) -> tuple[Vector, Quaternion]:
    """Wrist of one side in the frame of a chest whose shoulders never settled, a left one mirrored."""
    chest_from_world = g.conjugate(g.quaternion(body.chest_rotation))
    wrist = body.wrists[k]
    hand = g.rotate(chest_from_world, g.subtract(g.vector(wrist.position), g.vector(body.chest_position)))
    hand = (hand[0], hand[1] - body.settled, hand[2])
    rotation = g.multiply(chest_from_world, g.quaternion(wrist.rotation))
    return (hand, rotation) if k == 1 else (g.mirror_vector(hand), g.mirror_rotation(rotation))


@compiled
def _learn_arms(body: Record, tracking: Record, elapsed_s: float) -> None:
    """Take both hands into the fit of the arm. Each is measured against the same: left is the mirror of right."""
    learning = body.learning
    fit = learning.fit
    learning.since_sample_s += elapsed_s
    sampled = learning.since_sample_s >= SAMPLES_S
    seen, far, towards = 0, 0, (0.0, 0.0, 0.0)
    moved_s = (0.0, 0.0)
    for k in range(2):
        device = tracking.hands[k]
        if device.position_age_s > 0.0 or device.rotation_age_s > 0.0:
            continue
        hand, rotation = _in_chest(body, k)
        away = g.subtract(hand, shoulder(fit))
        distance = g.norm(away)
        if distance > OUT_OF_HAND * body.arm_length:
            continue
        seen += 1
        if distance > fit.reach:
            far += 1
            towards = g.add(towards, g.scale(1.0 / distance, away))
        if not sampled:
            continue
        show(fit, k, hand, rotation)
        seconds = learning.since_sample_s * min(1.0, g.norm(g.vector(device.linear_velocity)) / MOVES_M_S)
        moved_s = (moved_s[0], seconds) if k == 1 else (seconds, moved_s[1])
    pace = REACH_M_S * elapsed_s / (1.0 + fit.seconds / REACH_SETTLES_AFTER_S)
    fit.reach += pace * (far - FARTHEST_TIME * seen)
    share = 1.0 - math.exp(-elapsed_s / TOWARDS_TIME_S)
    before = g.vector(fit.towards)
    g.store(fit.towards, g.add(before, g.scale(share, g.subtract(towards, g.scale(far, before)))))
    if sampled:
        learning.since_sample_s = 0.0
        take(fit, moved_s[0], moved_s[1])
        _expect(body)
        improve(fit)


@inlined
def _grow(body: Record, elapsed_s: float) -> None:
    """Let the body come to its estimates smoothly: those go up or down a step a frame, and arms would tremble by it."""
    learning = body.learning
    asked = (learning.fit.x[UPPER_ARM], g.norm(elbow(learning.fit)), _stature(body))
    body.upper_arm, body.forearm, body.stature = follow(body.lengths, asked, GROWS_IN_S, math.inf, elapsed_s)
    if learning.stature and learning.width:
        body.half_width = HALF_WIDTH_PER_STATURE * body.stature
    body.arm_length = body.upper_arm + body.forearm


@compiled
def learn(body: Record, tracking: Record, elapsed_s: float) -> None:
    """Take one frame into the estimates, and the estimates into the body. Call where `body.learning.arms` is set."""
    if tracking.head.position_age_s > 0.0:
        return
    learning = body.learning
    eyes_m = tracking.head.position[1]
    if learning.stature and STANDING_EYES_M[0] < eyes_m < STANDING_EYES_M[1]:
        _learn_stature(body, eyes_m, elapsed_s)
    _learn_arms(body, tracking, elapsed_s)
    learning.watched_s += elapsed_s
    _grow(body, elapsed_s)
