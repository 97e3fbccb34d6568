"""The arm as it is shown: its elbow follows the solve's about the line from shoulder to wrist, calmly.

The solve answers every frame for itself. Where limits are in the way its elbow starts and stops within a frame, as no
elbow of a person does, or leaps to another posture. Two things make it calm. What is sudden is not followed: an
acceleration beyond SUDDEN_M_S2 opens a gap to the solve's elbow that closes without haste. And what is left is followed
in about the time in which the hand moves on by `elbow_lag_m`: an elbow hardly moves while a hand only turns in its
place, and at once when the hand goes somewhere (both as measured on recorded arms).

The hand stays where it is. It is turned less than asked for as long as the wrist would be beyond its limits, by little
where the elbow can come nearer to the solve's for it. An elbow that would have to leap for the hand's sake does not:
it goes its way along the shoulder's limits, and the hand is kept as near to its place as they let it.

The solve does not know what is shown, so nothing can swing up between the two. The elbow's turn is measured against
the line's own motion (parallel transport), which has no preferred direction and therefore no pole.
"""

from __future__ import annotations

import math
from typing import Any

from arm_ik_service.arm.chain import Columns, columns_of, hand_columns, turn_group, wrist_at
from arm_ik_service.arm.limits import clamp_shoulder, swing_excess, swing_surely_inside, twist_excess, twist_of
from arm_ik_service.compiled import Record, compiled, inlined
from arm_ik_service.geometry.follower import followed_rate
from arm_ik_service.geometry.scalar import (
    Quaternion,
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
from arm_ik_service.ik.any_rotation import POSITION_ALONE, STUCK_M
from arm_ik_service.ik.conjugate import NEAREST, SOLVED, converge, rotation_error
from arm_ik_service.ik.jacobian import NO_WRENCH, store_wrench
from arm_ik_service.ik.pace import hold_shown_elbow, hold_shown_hand
from arm_ik_service.ik.swivel import beyond, elbow_side, hand_angles, turn_hand

LONGEST_S = 0.2  # that an elbow takes while the hand rests
SUDDEN_M_S2 = 3.0  # acceleration of the solve's elbow about the line that is not followed at once ...
SUDDEN_TIME_S = 0.07  # ... but in about this time
MOST_M_S2 = 20.0  # acceleration about the line of the elbow shown
SMALLEST_LEVER_M = 0.02  # of the elbow about the line, for both: nobody sees a straight arm turn
FASTEST_RAD_S = 20.0  # about the line; what is faster is a leap, which is not followed and leaves no swing behind
STEP_M = 0.02  # of an elbow in a frame that may be made for the wrist's sake alone
LARGEST_RAD = 3.0  # by which an elbow comes after the solve's: beyond half a turn it comes from the other side
MOST_MISSED_RAD2 = 0.12**2  # of the hand's rotation, squared, for the elbow's sake
UNSEEN_RAD = 1e-5  # a turn that is not worth the work
ITERATIONS = 3  # a frame, for a hand whose elbow goes its own way: so few that they do not make it leap after all
PARTS, HALVINGS = 8, 3  # tries to find how much of a turn the joints allow


@compiled
def calm(arm: Record, settings: Record, asked: Vector, rotation: Columns, dt_s: float) -> None:
    """Write to `arm.shown` the configuration with its elbow where it is to be seen, one frame after `arm.before`.

    `asked` and `rotation` are asked of the hand.
    """
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
        arm.calm_gap, arm.calm_gap_rate, arm.calm_astray = 0.0, 0.0, 0
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
            most = max(min(abs(turned), FASTEST_RAD_S * dt_s), abs(to_go + turn), STEP_M / lever_m)
            turn, missed = _turned(arm, settings, axis, upper_arm, turn, clip(to_go, -most, most) - to_go)
        if turn != wanted:
            speed = (to_go + turn) / dt_s
            arm.calm_speed = speed if abs(speed) < FASTEST_RAD_S else 0.0
        arm.calm_turn = turn
        held = hold_shown_elbow(arm, dt_s)
        if held or missed == math.inf or arm.calm_astray == 1:
            hold_shown_hand(arm, wrist, dt_s)
            off_m = norm(subtract(wrist_at(chain, arm.shown), wrist))
            arm.calm_astray, missed = 1 if off_m > STUCK_M else 0, math.inf
        if missed > 0.0:
            _report(arm, settings, asked, rotation)
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
def _turned(
    arm: Record, settings: Record, axis: Vector, upper_arm: Columns, turn: float, nearer: float
) -> tuple[float, float]:
    """Turn the shown arm about the line, past its hand, or as much less, down to `nearer`, as shoulder and wrist want.

    Returns how far [rad], and the square of what is missed of the hand's rotation [rad^2], infinity where its place may
    be missed too.
    """
    q = arm.configuration
    hand = turn_group(turn_group(upper_arm, q[4], q[5], q[6])[2], q[7], q[8], 0.0)[2]  # its axial play stays
    missed = _take(arm, axis, hand, turn)
    if missed < MOST_MISSED_RAD2:
        return turn, missed
    allowed, least, refused = _first_allowed(arm, axis, hand, turn, nearer)
    if least == math.inf:
        if nearer != 0.0:
            _go_on(arm, settings, axis, hand, nearer)
        return nearer, math.inf
    for _ in range(HALVINGS):
        tried = 0.5 * (allowed + refused)
        missed = _take(arm, axis, hand, tried)
        if missed < MOST_MISSED_RAD2:
            allowed, least = tried, missed
        else:
            refused = tried
    return allowed, least


@compiled
def _first_allowed(arm: Record, axis: Vector, hand: Columns, start: float, end: float) -> tuple[float, float, float]:
    """Take the first turn from `start` to `end` that is allowed; returns it, what it misses, and the one before it.

    Where none is, what is missed is infinite.
    """
    refused = start
    for i in range(PARTS + 1):
        tried = start + (end - start) * (i / PARTS)
        missed = _take(arm, axis, hand, tried)
        if missed < MOST_MISSED_RAD2:
            return tried, missed, refused
        refused = tried
    return 0.0, math.inf, refused


@compiled
def _take(arm: Record, axis: Vector, hand: Columns, turn: float) -> float:
    """Turn the shown arm about the line, past its hand, unless that misses too much of the hand's rotation [rad^2].

    Returns the square of what it misses or would miss; infinity where the shoulder forbids it.
    """
    chain, q, shown = arm.chain, arm.configuration, arm.shown
    shoulder = _shoulder_turned(q, axis, turn)
    base = columns_of(shoulder)
    if not _shoulder_allows(chain, base):
        return math.inf
    pronation, flexion, deviation = hand_angles(turn_group(base, q[4], q[5], 0.0)[2], hand)
    lower, upper = chain.lower, chain.upper
    missed = beyond(pronation, lower[2], upper[2]) + beyond(flexion, lower[3], upper[3])
    missed += beyond(deviation, lower[4], upper[4])
    if missed < MOST_MISSED_RAD2:
        for i in range(4):
            shown[i] = shoulder[i]
        turn_hand(chain, shown, (pronation, flexion, deviation))
    return missed


@compiled
def _go_on(arm: Record, settings: Record, axis: Vector, hand: Columns, turn: float) -> None:
    """Turn the shown arm about the line as far as its shoulder goes, and bring its hand back as near as can be."""
    chain, work, q, shown = arm.chain, arm.calm_work, arm.configuration, arm.shown
    shoulder = clamp_shoulder(chain, _shoulder_turned(q, axis, turn))
    for i in range(4):
        shown[i] = shoulder[i]
    store_wrench(work.pull, NO_WRENCH)
    lam = POSITION_ALONE * settings.rotation_weight_m * settings.rotation_weight_m
    tolerance_m, any_turn = settings.position_tolerance_m, 2.0 * math.pi
    converge(chain, work, shown, wrist_at(chain, q), hand, ITERATIONS, lam, tolerance_m, any_turn, 0)
    _turn_hand(chain, shown, hand)


@inlined
def _turn_hand(chain: Record, shown: Any, hand: Columns) -> None:
    """Turn a hand as far as it goes towards given axes; its axial play stays as it is."""
    base = columns_of((shown[0], shown[1], shown[2], shown[3]))
    turn_hand(chain, shown, hand_angles(turn_group(base, shown[4], shown[5], 0.0)[2], hand))


@inlined
def _shoulder_turned(configuration: Any, axis: Vector, turn: float) -> Quaternion:
    """Rotation of the upper arm of a configuration (10,) turned about an axis [rad]."""
    s, c = sine_cosine(0.5 * turn)
    q = (configuration[0], configuration[1], configuration[2], configuration[3])
    return multiply((s * axis[0], s * axis[1], s * axis[2], c), q)


@inlined
def _shoulder_allows(chain: Record, bone: Columns) -> bool:
    twist, height = twist_of(bone), -bone[1][1]
    if twist_excess(chain, twist, height) != 0.0:
        return False
    return swing_surely_inside(chain, bone) or swing_excess(chain, scale(-1.0, bone[1])) <= 0.0


@inlined
def _report(arm: Record, settings: Record, asked: Vector, rotation: Columns) -> None:
    """Leave in `arm` how far the hand that is shown is from what was asked."""
    arm.position_error_m = norm(subtract(asked, wrist_at(arm.chain, arm.shown)))
    arm.orientation_error_rad = norm(rotation_error(hand_columns(arm.shown), rotation))
    met = arm.position_error_m <= 2.0 * settings.position_tolerance_m
    if arm.status == SOLVED and not (met and arm.orientation_error_rad <= 2.0 * settings.orientation_tolerance_rad):
        arm.status = NEAREST
