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
    BONES_RANGE,
    HALF_WIDTH_PER_STATURE,
    UPPER_ARM,
    average,
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
from arm_ik_service.body.shoulders import wrist_in_chest
from arm_ik_service.compiled import Record, compiled, inlined, record_dtype
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Quaternion, Vector

EYES_PER_STATURE = 0.936  # eye height over stature: Drillis & Contini (1966)

EYES_PERCENTILE = 0.75  # people crouch more than they jump
EYES_M_S = 0.3  # speed of the estimate at first ...
EYES_SETTLE_AFTER_S = 5.0  # ... and the time after which it is half of that
STANDING_EYES_M = (1.3, 2.1)  # lower: seated, or a space without a floor, which says nothing of stature

SAMPLES_S = 0.03  # between two samples of the arms
MOVES_M_S = 0.1  # what a slower hand shows counts for less time, by the square: at rest it is the same for long
FARTHEST_TIME = 0.01  # share of the time in which they move that hands may be farther away than the farthest reach
REACH_M_S = 1.0  # speed of that estimate at first ...
REACH_SETTLES_AFTER_S = 5.0  # ... and the movement after which it is half of that
TOWARDS_TIME_S = 0.3  # in which the farthest hands say where they are
OUT_OF_HAND = 1.45  # a hand so many expected arm lengths away has let go of the controller
GROWS_IN_S = 0.4  # by which the body trails the estimates
WATCHED_BEFORE_S = 30.0  # by the process that another takes a person over from
TAKEN_OVER_PART = 0.04  # standard deviation of an arm's length that it learnt, over that length

LEARNING = record_dtype(
    [
        ("stature", np.int64),  # 1 where it is to be learnt
        ("width", np.int64),
        ("arms", np.int64),
        ("watched_s", np.float64),
        ("since_sample_s", np.float64),
        ("eyes", np.float64),  # estimate of their height [m]
        ("by_stature", np.int64),  # 1 where stature says what arms to expect, 0 where they were taken over
        ("fit", ARM_FIT),
    ]
)


def initialise_learning(body: Record, profile: Profile) -> None:
    """Learn what the profile leaves open, unless it states a bone of the arm; the default stature is none stated."""
    measures, learning = profile.body, body["learning"]
    learning["arms"] = measures.upper_arm_m is None and measures.forearm_m is None
    learning["width"] = measures.shoulder_width_m is None
    learning["stature"] = learning["arms"] and measures.stature_m == BodyMeasures().stature_m
    learning["eyes"] = EYES_PER_STATURE * measures.stature_m
    learning["by_stature"] = 1
    body["stature"] = measures.stature_m
    begin(learning["fit"], _expected(body))
    body["lengths"]["at"] = (measures.upper_arm, measures.forearm, measures.stature_m)


def resume_learning(body: Record, upper_arm_m: float, forearm_m: float, half_width_m: float) -> None:
    """Go on from lengths that another process learnt of the person in a BODY record, so far as they are open.

    Lengths that no person has are not taken.
    """
    learning = body["learning"]
    if not learning["arms"]:
        return
    stature = half_width_m / HALF_WIDTH_PER_STATURE if learning["width"] and learning["stature"] else body["stature"]
    expected = average(stature)
    taken = (upper_arm_m, forearm_m, half_width_m if learning["width"] else expected[2])
    lower, upper = BONES_RANGE
    if not all(lower * e <= t <= upper * e for t, e in zip(taken, expected, strict=True)):
        return
    if learning["stature"] and not STANDING_EYES_M[0] <= EYES_PER_STATURE * stature <= STANDING_EYES_M[1]:
        return
    learning["watched_s"] = WATCHED_BEFORE_S if learning["width"] else 0.0
    learning["eyes"] = EYES_PER_STATURE * stature
    learning["by_stature"] = 0
    if learning["width"]:
        body["half_width"] = half_width_m
    begin(learning["fit"], (upper_arm_m, forearm_m, float(body["half_width"])), length_part=TAKEN_OVER_PART)
    body["stature"] = stature
    body["upper_arm"], body["forearm"], body["arm_length"] = upper_arm_m, forearm_m, upper_arm_m + forearm_m
    body["lengths"]["at"] = (upper_arm_m, forearm_m, stature)


@inlined
def _stature(body: Record) -> float:
    """Estimate of the stature [m] as it is by now: what is learnt, or what the profile says."""
    return float(body.learning.eyes / EYES_PER_STATURE)


@inlined
def _expected(body: Record) -> Vector:
    """Upper arm, forearm and half width [m] that are expected: what the stature says, so far as they are not known."""
    learning = body.learning
    upper_arm, forearm, half_width = average(_stature(body))
    if not learning.by_stature:
        upper_arm, forearm = learning.fit.upper_arm, learning.fit.forearm
    return (upper_arm, forearm, half_width if learning.width else body.half_width)


@compiled
def _learn_stature(body: Record, eyes_m: float, elapsed_s: float) -> None:
    learning = body.learning
    pace = EYES_M_S * elapsed_s / (1.0 + learning.watched_s / EYES_SETTLE_AFTER_S)
    learning.eyes += pace * (EYES_PERCENTILE if eyes_m > learning.eyes else EYES_PERCENTILE - 1.0)
    learning.eyes = g.clip(learning.eyes, STANDING_EYES_M[0], STANDING_EYES_M[1])


@inlined
def _in_chest(body: Record, k: int) -> tuple[Vector, Quaternion]:
    """Wrist of one side in the frame of a chest whose shoulders never settled, a left one mirrored."""
    hand = g.subtract(wrist_in_chest(body, k), (0.0, body.settled, 0.0))
    rotation = g.multiply(g.conjugate(g.quaternion(body.chest_rotation)), g.quaternion(body.wrists[k].rotation))
    return (hand, rotation) if k == 1 else (g.mirror_vector(hand), g.mirror_rotation(rotation))


@compiled
def _learn_arms(body: Record, tracking: Record, elapsed_s: float) -> None:
    """Take both hands into the fit of the arm. Each is measured against the same: left is the mirror of right."""
    learning = body.learning
    fit = learning.fit
    learning.since_sample_s += elapsed_s
    sampled = learning.since_sample_s >= SAMPLES_S
    seen_s, far_s, towards, sampled_s = 0.0, 0.0, (0.0, 0.0, 0.0), (0.0, 0.0)
    for k in range(2):
        device = tracking.hands[k]
        if device.position_age_s > 0.0 or device.rotation_age_s > 0.0:
            continue
        hand, rotation = _in_chest(body, k)
        away = g.subtract(hand, shoulder(fit))
        distance = g.norm(away)
        if distance > OUT_OF_HAND * (fit.upper_arm + fit.forearm):
            continue
        velocity = g.vector(device.linear_velocity)
        moves = min(1.0, g.dot(velocity, velocity) / (MOVES_M_S * MOVES_M_S))
        seen_s += moves * elapsed_s
        if distance > fit.reach:
            far_s += moves * elapsed_s
            towards = g.add(towards, g.scale(moves * elapsed_s / distance, away))
        if sampled:
            show(fit, k, hand, rotation)
            moved_s = moves * learning.since_sample_s
            sampled_s = (sampled_s[0], moved_s) if k == 1 else (moved_s, sampled_s[1])
    pace = REACH_M_S / (1.0 + fit.seconds / REACH_SETTLES_AFTER_S)
    fit.reach += pace * (far_s - FARTHEST_TIME * seen_s)
    before = g.vector(fit.towards)
    turn = g.subtract(towards, g.scale(far_s, before))
    g.store(fit.towards, g.add(before, g.scale(1.0 / (TOWARDS_TIME_S + far_s), turn)))
    if sampled:
        learning.since_sample_s = 0.0
        take(fit, sampled_s[0], sampled_s[1])
        expect(fit, _expected(body))
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
    if tracking.head.position_age_s > 0.0 or tracking.head.rotation_age_s > 0.0:
        return
    learning = body.learning
    eyes_m = tracking.head.position[1]
    if learning.stature and STANDING_EYES_M[0] < eyes_m < STANDING_EYES_M[1]:
        _learn_stature(body, eyes_m, elapsed_s)
    _learn_arms(body, tracking, elapsed_s)
    learning.watched_s += elapsed_s
    _grow(body, elapsed_s)
