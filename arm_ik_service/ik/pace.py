"""How far elbow and hand may move in a frame, whatever the solve came to."""

from __future__ import annotations

from typing import Any

from arm_ik_service.arm import tangent
from arm_ik_service.arm.chain import Columns, columns_of, position_to_arm, spin_to_arm, wrist_at
from arm_ik_service.arm.configuration import (
    Configuration,
    difference,
    integrate,
    read_configuration,
    store_configuration,
)
from arm_ik_service.compiled import Record, compiled, inlined
from arm_ik_service.geometry.scalar import Vector, add, clip, cross, norm, scale, subtract, vector, wrap
from arm_ik_service.ik.any_rotation import STUCK_M, reach_with_any_rotation
from arm_ik_service.ik.conjugate import NEAREST, rotation_error
from arm_ik_service.ik.jacobian import jacobian_at
from arm_ik_service.ik.swivel import Reach, elbow_swivel, nearest_with_room, reach_to

ELBOW_STEP_M = 0.04  # [m] of the elbow in one frame beyond what the hand moves, whatever the frame rate
ELBOW_M_S = 4.0  # of the elbow shown beyond twice its hand's speed: limits let through at once what they held up
CATCH_UP_M_S = 10.0  # speed of a hand on the way back to where it is asked to be, unless it is asked to move faster
PARTS = 12  # tries to find how much of a motion moves the hand as far as it may: some sweep it far out first


@compiled
def hold_elbow(arm: Record, settings: Record, position: Vector, rotation: Columns, reach: Reach) -> bool:
    """Where the elbow has gone too far from `arm.anchor`, turn it only part of the way, in closed form.

    Returns whether it was free to go as far as it went.
    """
    chain, q, anchor = arm.chain, arm.configuration, arm.anchor
    upper_arm = columns_of((anchor[0], anchor[1], anchor[2], anchor[3]))
    moved = subtract(columns_of((q[0], q[1], q[2], q[3]))[1], upper_arm[1])
    step_m = chain.upper_arm_m * norm(moved)
    if step_m <= ELBOW_STEP_M:
        return True
    allowed_m = ELBOW_STEP_M + norm(subtract(position, wrist_at(chain, anchor)))
    if step_m <= allowed_m:
        return True
    before = elbow_swivel(reach, upper_arm)
    turn = wrap(elbow_swivel(reach, columns_of((q[0], q[1], q[2], q[3]))) - before)
    most = ELBOW_STEP_M / max(reach[2] * chain.upper_arm_m, 1e-3)
    swivel = before + clip(turn, -most, most)
    arm.work.iterations = reach_with_any_rotation(arm, settings, position, rotation, reach, swivel, arm.work.iterations)
    return False


@inlined
def carried_way(arm: Record, place: Vector, dt_s: float) -> Vector:
    """Way [m] that the trunk alone takes a place of the arm's axes in a frame."""
    chain = arm.chain
    spin = spin_to_arm(chain, vector(arm.carried_spin))
    return scale(dt_s, add(position_to_arm(chain, vector(arm.carried)), cross(spin, place)))


@inlined
def most_way_m(arm: Record, carried: Vector, start: Vector, end: Vector, dt_s: float) -> float:
    """How far a hand that was held back may go in a frame, in the world: as far as its goal does, or to catch up.

    `start` and `end` of the goal's way are in the arm's axes. Where the trunk alone carries the hand farther, so far.
    """
    goals_way = add(subtract(end, start), carried_way(arm, start, dt_s))
    return max(norm(goals_way), norm(carried), CATCH_UP_M_S * dt_s)


@compiled
def hold_hand(arm: Record, settings: Record, asked: Vector, position: Vector, rotation: Columns, dt_s: float) -> bool:
    """Where the hand would leap to its `position`, it goes part of the way. Returns whether it was free to go.

    To be called before the error of this frame takes the place of the last one's in `arm.missed_m`.
    """
    chain, work, q = arm.chain, arm.work, arm.configuration
    if arm.missed_m <= STUCK_M and work.position_error_m <= STUCK_M:
        return True  # a hand that follows does not leap
    before = wrist_at(chain, arm.anchor)
    carried = carried_way(arm, before, dt_s)
    way = add(subtract(wrist_at(chain, q), before), carried)
    way_m = norm(way)
    allowed_m = most_way_m(arm, carried, vector(arm.asked), asked, dt_s)
    if way_m <= allowed_m:
        return True
    end, restarted = read_configuration(q), arm.restarted
    nearer = nearest_with_room(chain, add(before, subtract(scale(allowed_m / way_m, way), carried)))
    reach = reach_to(chain, nearer)
    swivel = elbow_swivel(reach, columns_of(end[0]))
    work.iterations = reach_with_any_rotation(arm, settings, nearer, rotation, reach, swivel, work.iterations)
    arm.restarted = restarted  # the elbow has leapt all the same
    if norm(add(subtract(wrist_at(chain, q), before), carried)) > allowed_m + STUCK_M:  # not with these limits
        go_part_of_the_way(chain, read_configuration(arm.anchor), end, carried, way_m, allowed_m, q)
        arm.restarted = 0
    here = jacobian_at(chain, read_configuration(q))
    work.position_error_m = norm(subtract(position, here.from_shoulder))
    work.orientation_error_rad = norm(rotation_error(here.hand, rotation))
    arm.status = NEAREST
    return False


@compiled
def go_part_of_the_way(
    chain: Record, start: Configuration, end: Configuration, carried: Vector, way_m: float, allowed_m: float, q: Any
) -> None:
    """Move all joints from one configuration towards another, as far as takes the hand `allowed_m` in the world.

    All of that motion would take it `way_m`, which is more; the trunk takes it `carried`. The answer goes to `q` (10,).
    """
    store_configuration(q, start)
    before = wrist_at(chain, q)
    motion, share, moved_m = difference(start, end), 1.0, way_m
    for _ in range(PARTS):
        share *= allowed_m / moved_m
        store_configuration(q, integrate(chain, start, tangent.scale(share, motion)))
        moved_m = norm(add(subtract(wrist_at(chain, q), before), carried))
        if moved_m <= allowed_m:
            break


@compiled
def hold_shown_elbow(arm: Record, dt_s: float) -> bool:
    """Let the shown elbow go no faster than an elbow does: all joints go part of the way. Returns whether it would."""
    chain, before, shown = arm.chain, arm.before, arm.shown
    start = columns_of((before[0], before[1], before[2], before[3]))[1]
    end = columns_of((shown[0], shown[1], shown[2], shown[3]))[1]
    way_m, allowed_m = chain.upper_arm_m * norm(subtract(end, start)), ELBOW_M_S * dt_s
    if way_m <= allowed_m:
        return False
    allowed_m += 2.0 * norm(subtract(wrist_at(chain, shown), wrist_at(chain, before)))
    if way_m <= allowed_m:
        return False
    shown_before = read_configuration(before)
    motion = difference(shown_before, read_configuration(shown))
    store_configuration(shown, integrate(chain, shown_before, tangent.scale(allowed_m / way_m, motion)))
    return True


@compiled
def hold_shown_hand(arm: Record, solves: Vector, dt_s: float) -> None:
    """Let the shown hand go no farther than it may on its way back to `solves`, the place where the solve has it."""
    chain, before = arm.chain, wrist_at(arm.chain, arm.before)
    carried = carried_way(arm, before, dt_s)
    way_m = norm(add(subtract(wrist_at(chain, arm.shown), before), carried))
    allowed_m = most_way_m(arm, carried, vector(arm.calm_wrist), solves, dt_s)
    if way_m > allowed_m:
        start, end = read_configuration(arm.before), read_configuration(arm.shown)
        go_part_of_the_way(chain, start, end, carried, way_m, allowed_m, arm.shown)
