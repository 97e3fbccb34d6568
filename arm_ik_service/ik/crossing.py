"""The way the arm that is shown takes to where the solve's arm has leapt.

Where limits leave the hand no way on, the solve's arm goes to another posture within a frame, and while the hand cannot
be met at all its joints may jump about between postures that are as good. What is shown comes after in its own time:
the gap between the two, a tangent, closes as a critically damped spring does (games call that inertialisation: Bollo,
GDC 2018). On the way the hand is brought to where it should be by a few iterations of the loop a frame, so few that the
elbow goes smoothly even where the loop would slide it far, no faster than a hand is let come back elsewhere, and it is
turned as the solve turns it.
"""

from __future__ import annotations

import math
from typing import Any

from arm_ik_service.arm import tangent
from arm_ik_service.arm.chain import Columns, columns_of, forearm_columns, hand_columns, turn_group, wrist_at
from arm_ik_service.arm.configuration import difference, integrate, read_configuration, store_configuration
from arm_ik_service.arm.tangent import Tangent
from arm_ik_service.compiled import Record, compiled, inlined
from arm_ik_service.geometry.follower import followed_rate
from arm_ik_service.geometry.scalar import Vector, norm, subtract
from arm_ik_service.ik.any_rotation import POSITION_ALONE, STUCK_M
from arm_ik_service.ik.conjugate import NEAREST, converge, rotation_error
from arm_ik_service.ik.jacobian import NO_WRENCH, store_wrench
from arm_ik_service.ik.pace import CATCH_UP_M_S, go_part_of_the_way
from arm_ik_service.ik.swivel import hand_angles, nearest_with_room, turn_hand

LEAP_M = 0.08  # of the solve's elbow in a frame, beyond twice what its hand moves: no elbow goes there at once
TIME_S = 0.08  # in which most of the way is made
ITERATIONS = 3  # a frame, for the hand
ASTRAY_M = 0.02  # a hand that stays this far from where the solve has it is held there by a limit ...
PATIENCE_S = 0.1  # ... and after this long, in all, it goes the straight way of the joints instead
NEAR_RAD, SLOW_RAD_S = 1e-4, 1e-2  # a gap that is not worth the work
THERE, CLOSES, LOST = 0, 1, 2  # what is shown is the goal; comes nearer to it as it moves; or to where it last was


@compiled
def cross_over(arm: Record, settings: Record, asked: Vector, rotation: Columns, dt_s: float) -> None:
    """Change `arm.shown`, as it should be by now, to what can be `dt_s` [s] after `arm.before`, shown one frame ago.

    `asked` and `rotation` are asked of the hand.
    """
    chain, went_on = arm.chain, arm.crosses
    missed, leapt = arm.missed_m > STUCK_M, _leapt(chain, arm.goal, arm.shown)
    goal_before, goal = read_configuration(arm.goal), read_configuration(arm.shown)
    if settings.elbow_lag_m == 0.0 or arm.started == 0 or not (missed or leapt or went_on != THERE):
        store_configuration(arm.goal, goal)
        arm.crosses = THERE
        return
    goals_way_m = norm(subtract(wrist_at(chain, arm.shown), wrist_at(chain, arm.goal)))
    store_configuration(arm.goal, goal)
    # a goal that jumps about, or has just leapt, has no motion to go along with
    still = missed or leapt
    gap = difference(goal if still else goal_before, read_configuration(arm.before))
    if missed or went_on == LOST:
        rate = tangent.read(arm.recent_velocity)
        if not still:
            rate = tangent.subtract(rate, tangent.scale(1.0 / dt_s, difference(goal_before, goal)))
    else:
        rate = tangent.read(arm.crossing_rate) if went_on == CLOSES else tangent.STILL
    rate = _closing(rate[0], gap[0], dt_s), _closing(rate[1], gap[1], dt_s), _closing(rate[2], gap[2], dt_s)
    gap = tangent.add(gap, tangent.scale(dt_s, rate))
    tangent.store(arm.crossing_rate, rate)
    arm.crosses = LOST if missed else CLOSES
    if not still and _size(gap) < NEAR_RAD and _size(rate) < SLOW_RAD_S:
        arm.crosses = THERE
        return
    store_configuration(arm.shown, integrate(chain, goal, gap))
    position = nearest_with_room(chain, asked)
    if still:
        arm.crossing_astray_s = 0.0
    if arm.crossing_astray_s < PATIENCE_S:
        _bring_hand(arm, settings, position, rotation)
        if norm(subtract(wrist_at(chain, arm.shown), position)) > ASTRAY_M:
            arm.crossing_astray_s += dt_s
    _hold_hand(arm, max(goals_way_m, CATCH_UP_M_S * dt_s))
    _turn_hand(arm)
    _report(arm, asked, rotation)


@inlined
def _leapt(chain: Record, before: Any, after: Any) -> bool:
    """Tell whether an arm's elbow goes from one configuration (10,) to another as no elbow does."""
    one = columns_of((before[0], before[1], before[2], before[3]))
    other = columns_of((after[0], after[1], after[2], after[3]))
    elbow_m = chain.upper_arm_m * norm(subtract(other[1], one[1]))
    if elbow_m <= LEAP_M:
        return False
    return bool(elbow_m > LEAP_M + 2.0 * norm(subtract(wrist_at(chain, after), wrist_at(chain, before))))


@inlined
def _closing(rate: Vector, gap: Vector, dt_s: float) -> Vector:
    """Rate [rad/s] of three joints' gap in the next frame."""
    return (
        followed_rate(rate[0], -gap[0], TIME_S, dt_s),
        followed_rate(rate[1], -gap[1], TIME_S, dt_s),
        followed_rate(rate[2], -gap[2], TIME_S, dt_s),
    )


@inlined
def _size(t: Tangent) -> float:
    return norm(t[0]) + norm(t[1]) + norm(t[2])


@inlined
def _bring_hand(arm: Record, settings: Record, position: Vector, rotation: Columns) -> None:
    work, lam = arm.crossing_work, POSITION_ALONE * settings.rotation_weight_m * settings.rotation_weight_m
    store_wrench(work.pull, NO_WRENCH)
    tolerance_m, any_turn = settings.position_tolerance_m, 2.0 * math.pi
    converge(arm.chain, work, arm.shown, position, rotation, ITERATIONS, lam, tolerance_m, any_turn, 0)


@inlined
def _hold_hand(arm: Record, allowed_m: float) -> None:
    """Let the hand go no farther in a frame than it may."""
    before = wrist_at(arm.chain, arm.before)
    way_m = norm(subtract(wrist_at(arm.chain, arm.shown), before))
    if way_m > allowed_m:
        start, end = read_configuration(arm.before), read_configuration(arm.shown)
        go_part_of_the_way(arm.chain, start, end, before, way_m, allowed_m, arm.shown)


@inlined
def _turn_hand(arm: Record) -> None:
    """Turn the shown hand as that of the goal, as far as the wrist goes; its axial play stays as it is."""
    q, goal = arm.shown, arm.goal
    hand = turn_group(forearm_columns(goal), goal[7], goal[8], goal[9] - q[9])[2]
    base = columns_of((q[0], q[1], q[2], q[3]))
    turn_hand(arm.chain, q, hand_angles(turn_group(base, q[4], q[5], 0.0)[2], hand))


@inlined
def _report(arm: Record, asked: Vector, rotation: Columns) -> None:
    """Leave in `arm` how far the hand that is shown is from what was asked."""
    arm.position_error_m = norm(subtract(asked, wrist_at(arm.chain, arm.shown)))
    arm.orientation_error_rad = norm(rotation_error(hand_columns(arm.shown), rotation))
    arm.status = NEAREST
