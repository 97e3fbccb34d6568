"""The arm as it is shown: its elbow follows the solve's about the line from shoulder to wrist, calmly.

The solve answers every frame for itself. Where a joint's limit is in the way its elbow starts, stops and leaps within a
frame, as no elbow of a person does. Two things make it calm. What is sudden is not followed: an acceleration beyond
SUDDEN_M_S2 opens a gap to the solve's elbow that closes without haste. And what is left is followed in about the time
in which the hand moves on by `elbow_lag_m`: an elbow hardly moves while a hand only turns in its place, and at once
when the hand goes somewhere (both as measured on recorded arms). The hand itself stays where it is; it is turned less
than asked for as long as the wrist would be beyond its limits.

The solve does not know what is shown, so nothing can swing up between the two. The elbow's turn is measured against
the line's own motion (parallel transport), which has no preferred direction and therefore no pole.
"""

from __future__ import annotations

import math

from arm_ik_service.arm.chain import Columns, columns_of, hand_columns, turn_group, wrist_at
from arm_ik_service.arm.limits import swing_excess, swing_surely_inside, twist_excess, twist_of
from arm_ik_service.compiled import Record, compiled, inlined
from arm_ik_service.geometry.follower import followed_rate
from arm_ik_service.geometry.scalar import (
    Vector,
    between,
    clip,
    cross,
    dot,
    multiply,
    norm,
    rotate,
    scale,
    store,
    subtract,
    vector,
    wrap,
)
from arm_ik_service.geometry.trigonometry import angle_of, sine_cosine
from arm_ik_service.ik.conjugate import NEAREST, SOLVED, rotation_error
from arm_ik_service.ik.swivel import beyond, elbow_side, hand_angles, turn_hand

LONGEST_S = 0.2  # that an elbow takes while the hand rests
SUDDEN_M_S2 = 3.0  # acceleration of the solve's elbow about the line that is not followed at once ...
SUDDEN_TIME_S = 0.1  # ... but in about this time
MOST_M_S2 = 20.0  # acceleration about the line of the elbow shown
SMALLEST_LEVER_M = 0.02  # of the elbow about the line, for both: nobody sees a straight arm turn
FASTEST_RAD_S = 20.0  # about the line; what is faster is a leap, which leaves no swing behind
STEP_M = 0.02  # of an elbow in a frame that may be made for the wrist's sake alone
LARGEST_RAD = 0.3  # by which an elbow comes after the solve's: from farther away there may be no way
MOST_MISSED_RAD2 = 0.12**2  # of the hand's rotation, squared, for the elbow's sake
UNSEEN_RAD = 1e-5  # a turn that is not worth the work
PARTS, HALVINGS = 8, 3  # tries to find how much of a turn the joints allow


@compiled
def calm(arm: Record, settings: Record, rotation: Columns, dt_s: float) -> None:
    """Write to `arm.shown` the configuration with its elbow where it is to be seen; `rotation` is asked of the hand."""
    chain, q = arm.chain, arm.configuration
    for i in range(10):
        arm.shown[i] = q[i]
    if settings.elbow_lag_m == 0.0:
        return
    wrist, upper_arm = wrist_at(chain, q), columns_of((q[0], q[1], q[2], q[3]))
    distance = norm(wrist)
    axis = scale(1.0 / distance, wrist) if distance > 1e-9 else (0.0, -1.0, 0.0)
    side = elbow_side(axis, upper_arm)
    if arm.calm_started == 0:
        arm.calm_started, arm.calm_turn, arm.calm_speed = 1, 0.0, 0.0
        arm.calm_gap, arm.calm_gap_rate = 0.0, 0.0
    else:
        came_from = rotate(between(vector(arm.calm_axis), axis), vector(arm.calm_side))
        turned = angle_of(dot(cross(came_from, side), axis), dot(came_from, side))
        to_go = wrap(turned - arm.calm_turn)
        along = dot(upper_arm[1], axis)
        lever_m = max(chain.upper_arm_m * math.sqrt(max(1.0 - along * along, 0.0)), SMALLEST_LEVER_M)
        speed_m_s = norm(subtract(wrist, vector(arm.calm_wrist))) / dt_s
        time_s = min(settings.elbow_lag_m / max(speed_m_s, 1e-6), LONGEST_S)
        gap = _gap(arm, turned / dt_s, SUDDEN_M_S2 / lever_m, dt_s)
        wanted = _follow(arm, to_go + gap, time_s, MOST_M_S2 / lever_m, dt_s) - to_go
        turn, missed = clip(wanted, -LARGEST_RAD, LARGEST_RAD), 0.0
        if abs(turn) > UNSEEN_RAD:
            # where the wrist has it come nearer, it comes no faster than the solve's elbow goes, or a little
            most = max(abs(turned), abs(to_go + turn), STEP_M / lever_m)
            turn, missed = _turned(arm, axis, upper_arm, turn, clip(to_go, -most, most) - to_go)
        if turn != wanted:
            speed = (to_go + turn) / dt_s
            arm.calm_speed = speed if abs(speed) < FASTEST_RAD_S else 0.0
        arm.calm_turn = turn
        if missed > 0.0:
            _report(arm, settings, rotation)
    store(arm.calm_wrist, wrist)
    store(arm.calm_axis, axis)
    store(arm.calm_side, side)


@inlined
def _gap(arm: Record, speed: float, most: float, dt_s: float) -> float:
    """How far [rad] what is to be followed is from the solve's elbow, which goes at `speed` [rad/s] about the line.

    It is opened by what that changed faster than `most` [rad/s^2], and closes as a critically damped spring does.
    """
    change = (speed - arm.calm_solved_speed) / dt_s if arm.calm_started == 2 else 0.0
    arm.calm_started, arm.calm_solved_speed = 2, speed
    rate = arm.calm_gap_rate - (change - clip(change, -most, most)) * dt_s
    arm.calm_gap_rate = followed_rate(rate, -arm.calm_gap, SUDDEN_TIME_S, dt_s)
    arm.calm_gap = clip(arm.calm_gap + arm.calm_gap_rate * dt_s, -LARGEST_RAD, LARGEST_RAD)
    return float(arm.calm_gap)


@inlined
def _follow(arm: Record, to_go: float, time_s: float, most: float, dt_s: float) -> float:
    """Step [rad] of a critically damped follower whose acceleration is bounded [rad/s^2]."""
    speed = followed_rate(arm.calm_speed, to_go, max(time_s, 1e-6), dt_s)
    gain = most * dt_s
    slowest, fastest = arm.calm_speed - gain, arm.calm_speed + gain
    speed = clip(speed, slowest, fastest)
    # no faster than what can be stopped on the way that is left
    stoppable = max(math.sqrt(2.0 * most * abs(to_go) + 0.25 * gain * gain) - 0.5 * gain, 0.0)
    speed = clip(clip(speed, -stoppable, stoppable), slowest, fastest)
    arm.calm_speed = speed
    return float(speed * dt_s)


@compiled
def _turned(arm: Record, axis: Vector, upper_arm: Columns, turn: float, nearer: float) -> tuple[float, float]:
    """Turn the shown arm about the line, past its hand, or as much less, down to `nearer`, as its wrist wants it.

    The shoulder has its way in any case. Returns how far [rad], and the square of what is missed of the hand's
    rotation [rad^2].
    """
    q = arm.configuration
    hand = turn_group(turn_group(upper_arm, q[4], q[5], q[6])[2], q[7], q[8], 0.0)[2]  # its axial play stays
    missed = _take(arm, axis, hand, turn, MOST_MISSED_RAD2)
    if missed < MOST_MISSED_RAD2:
        return turn, missed
    allowed, least, refused = _first_allowed(arm, axis, hand, turn, nearer, MOST_MISSED_RAD2)
    if least == math.inf:
        allowed, least, refused = _first_allowed(arm, axis, hand, nearer, 0.0, math.inf)
        return allowed, least
    for _ in range(HALVINGS):
        tried = 0.5 * (allowed + refused)
        missed = _take(arm, axis, hand, tried, MOST_MISSED_RAD2)
        if missed < MOST_MISSED_RAD2:
            allowed, least = tried, missed
        else:
            refused = tried
    return allowed, least


@compiled
def _first_allowed(
    arm: Record, axis: Vector, hand: Columns, start: float, end: float, most_missed: float
) -> tuple[float, float, float]:
    """Take the first turn from `start` to `end` that is allowed; returns it, what it misses, and the one before it.

    Where none is, what is missed is infinite; at 0 nothing is.
    """
    refused = start
    for i in range(PARTS + 1):
        tried = start + (end - start) * (i / PARTS)
        missed = _take(arm, axis, hand, tried, most_missed)
        if missed < most_missed:
            return tried, missed, refused
        refused = tried
    return 0.0, math.inf, refused


@compiled
def _take(arm: Record, axis: Vector, hand: Columns, turn: float, most_missed: float) -> float:
    """Turn the shown arm about the line, past its hand, unless that misses too much of the hand's rotation [rad^2].

    Returns the square of what it misses or would miss; infinity where the shoulder forbids it.
    """
    chain, q, shown = arm.chain, arm.configuration, arm.shown
    s, c = sine_cosine(0.5 * turn)
    shoulder = multiply((s * axis[0], s * axis[1], s * axis[2], c), (q[0], q[1], q[2], q[3]))
    base = columns_of(shoulder)
    if not _shoulder_allows(chain, base):
        return math.inf
    pronation, flexion, deviation = hand_angles(turn_group(base, q[4], q[5], 0.0)[2], hand)
    lower, upper = chain.lower, chain.upper
    missed = beyond(pronation, lower[2], upper[2]) + beyond(flexion, lower[3], upper[3])
    missed += beyond(deviation, lower[4], upper[4])
    if missed < most_missed:
        for i in range(4):
            shown[i] = shoulder[i]
        turn_hand(chain, shown, (pronation, flexion, deviation))
    return missed


@inlined
def _shoulder_allows(chain: Record, bone: Columns) -> bool:
    twist, height = twist_of(bone), -bone[1][1]
    if twist_excess(chain, twist, height) != 0.0:
        return False
    return swing_surely_inside(chain, bone) or swing_excess(chain, scale(-1.0, bone[1])) <= 0.0


@inlined
def _report(arm: Record, settings: Record, rotation: Columns) -> None:
    """Leave in `arm` how far the hand that is shown is turned from what was asked."""
    arm.orientation_error_rad = norm(rotation_error(hand_columns(arm.shown), rotation))
    if arm.status == SOLVED and arm.orientation_error_rad > 2.0 * settings.orientation_tolerance_rad:
        arm.status = NEAREST
