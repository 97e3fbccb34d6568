"""One frame of one arm: from where it was, to the new target, with the elbow drawn to where it is comfortable.

1. The arm goes on as the hand was pulled last, its elbow turns towards comfort, at most as fast as a stated bound, and
   flexes as far as the target's distance says.
2. `converge` brings the hand onto the target.
3. A target that limits or reach forbid: the position first. The loop goes on from where it stopped with the rotation
   weighing a hundred times less.
4. A position still missed although another swivel could meet it (a limit in the way): the arm starts again from the
   closed form at the nearest such swivel, within the same budget. That is a jump of the elbow that the hand demands.
5. A position met with the hand turned far off, although another swivel could meet both: the elbow travels there at a
   bounded speed, over as many frames as it takes, and the hand keeps its position on the way.
6. Whatever came of it, the elbow moves no further than the hand does and ELBOW_STEP_M more, as long as the hand can
   keep its position: its rotation follows a few frames later.
7. A hand that could not be where it was asked to be comes back at a bounded speed, or at that which is asked of it:
   along the straight way where the limits allow it, else along that of the joints.
"""

from __future__ import annotations

import math

from arm_ik_service.arm import tangent
from arm_ik_service.arm.chain import Columns, columns_of, wrist_at
from arm_ik_service.arm.configuration import integrate, read_configuration, store_configuration
from arm_ik_service.arm.tangent import Tangent
from arm_ik_service.compiled import Record, compiled, inlined
from arm_ik_service.geometry.follower import followed_rate
from arm_ik_service.geometry.scalar import Vector, clip, components, norm, scale, store, subtract
from arm_ik_service.geometry.trigonometry import angle_of, sine_cosine
from arm_ik_service.ik.any_rotation import POSITION_ALONE, STUCK_M, deadline_of, reach_with_any_rotation
from arm_ik_service.ik.comfort import discomfort, learn_habit
from arm_ik_service.ik.conjugate import NEAREST, OUT_OF_TIME, SOLVED, converge
from arm_ik_service.ik.held import rests, walls_at
from arm_ik_service.ik.jacobian import NO_WRENCH, read_wrench, store_wrench
from arm_ik_service.ik.pace import ELBOW_STEP_M, hold_elbow, hold_hand
from arm_ik_service.ik.swivel import (
    Reach,
    elbow_side,
    elbow_swivel,
    nearest_with_room,
    posture_at,
    reach_to,
    side_at,
    swivel_of,
    take,
    violation,
)

SEEDS = 24  # swivels looked at when there is no good start: every 15 degrees
FLAT = 0.8  # curvature below which discomfort counts as flat: Newton's step would be too long
GIVE_TIME_S = 0.3  # in which the carrying angle and the wrist's axial play come back to zero
HALF_SURE = 1.0  # curvature at which the elbow's confidence is one half
CARRIED = 0.7  # of an arm's bend that may be carrying angle
STEADY = 8  # frames without a limit before a motion is carried on: one that leaves a limit is not the one that came
STUCK_RAD = 0.26  # a hand turned further off than this (15 degrees) is worth the elbow's way to another swivel
ESCAPE_HASTE = 2.0  # times swivel_speed_rad_s on that way
POSITION_FIRST = 0.01  # share of the rotation's weight that is left once the target is known to be out of reach
_NEARNESS = 0.02  # [1/rad] what a far swivel must gain to be preferred to a near one
_POSSIBLE = 1e-3  # [rad^2] sum of squared excesses that axial play and carrying angle can make up for
_ROOM = 0.1  # [rad] to the limits, wanted of the second other start
_BETTER = 0.5  # a new start must at least halve the error: no alternation between two that are as good


@inlined
def towards_comfort(arm: Record, settings: Record, reach: Reach, rotation: Columns, dt_s: float) -> Tangent:
    """Return the motion about the line from shoulder to wrist towards less discomfort, within the speed bound."""
    chain, q = arm.chain, arm.configuration
    upper_arm = columns_of((q[0], q[1], q[2], q[3]))
    side = elbow_side(reach[0][0], upper_arm)
    _, slope, curvature = discomfort(arm.comfort, arm.habit, chain, reach, rotation, side)
    arm.elbow_confidence = max(curvature, 0.0) / (max(curvature, 0.0) + HALF_SURE)
    # A critically damped follower, so that the swivel's speed is continuous and its lag is swivel_time_s.
    away = -slope / max(abs(curvature), FLAT)
    speed = followed_rate(arm.swivel_speed, away, max(settings.swivel_time_s, 1e-6), dt_s)
    gain = settings.swivel_acceleration_rad_s2 * dt_s
    speed = clip(speed, arm.swivel_speed - gain, arm.swivel_speed + gain)
    speed = clip(speed, -settings.swivel_speed_rad_s, settings.swivel_speed_rad_s)
    arm.swivel_speed = speed
    back = dt_s / (dt_s + GIVE_TIME_S)
    swing = scale(speed * dt_s, components(upper_arm, reach[0][0]))
    return swing, (0.0, -back * q[5], 0.0), (0.0, 0.0, -back * q[9])


@compiled
def most_comfortable(arm: Record, reach: Reach, rotation: Columns) -> float:
    """Return the swivel of least discomfort, all around."""
    best, least = 0.0, math.inf
    for i in range(SEEDS):
        swivel = (i - SEEDS // 2) * (2.0 * math.pi / SEEDS)
        cost = discomfort(arm.comfort, arm.habit, arm.chain, reach, rotation, side_at(reach, swivel))[0]
        if cost < least:
            best, least = swivel, cost
    return best


@compiled
def nearest_possible(
    chain: Record, reach: Reach, rotation: Columns, swivel: float, margin: float, nearness: float
) -> float:
    """Return the swivel near a given one at which limits drawn in by `margin` [rad] are kept, or least broken."""
    best, least = swivel, math.inf
    for i in range(SEEDS):
        step = (i - SEEDS // 2) * (2.0 * math.pi / SEEDS)
        cost = violation(chain, posture_at(reach, rotation, swivel + step), margin) + nearness * abs(step)
        if cost < least:
            best, least = swivel + step, cost
    return best


@inlined
def _converge(
    arm: Record, settings: Record, position: Vector, rotation: Columns, budget: int, share: float, deadline: int
) -> int:
    lam = share * settings.rotation_weight_m * settings.rotation_weight_m
    return converge(
        arm.chain,
        arm.work,
        arm.configuration,
        position,
        rotation,
        budget,
        lam,
        settings.position_tolerance_m,
        settings.orientation_tolerance_rad,
        deadline,
    )


@inlined
def report_error(arm: Record, asked: Vector, position: Vector) -> None:
    """Leave in `arm` how far the hand is from what was asked, where `position` was granted instead."""
    arm.position_error_m, arm.orientation_error_rad = arm.work.position_error_m, arm.work.orientation_error_rad
    if position != asked:
        arm.position_error_m = norm(subtract(asked, wrist_at(arm.chain, arm.configuration)))
        arm.status = NEAREST
    arm.missed_m = arm.position_error_m


@compiled
def find_target(arm: Record, settings: Record, asked: Vector, rotation: Columns) -> None:
    """Meet one target by itself from the configuration at hand: other starts are as good as the one given."""
    position = nearest_with_room(arm.chain, asked)
    reach = reach_to(arm.chain, position)
    arm.restarted, arm.escape, arm.steady = 0, 0.0, 0
    store_wrench(arm.work.pull, NO_WRENCH)
    work, budget, deadline = arm.work, settings.iterations, deadline_of(settings)
    status = _converge(arm, settings, position, rotation, _first_share(budget), 1.0, deadline)
    used = work.iterations
    for attempt in range(2):
        if not _finished(status):
            margin, nearness = (0.0, _NEARNESS) if attempt == 0 else (_ROOM, 0.0)
            status, used = _start_again(
                arm, settings, position, rotation, reach, margin, nearness, used, status, deadline
            )
    if not _finished(status) and work.position_error_m > settings.position_tolerance_m:
        _converge(arm, settings, position, rotation, max(budget - used, 0), POSITION_FIRST, deadline)
        used += work.iterations
    work.iterations, arm.status = used, status
    report_error(arm, asked, position)


@compiled
def follow_target(arm: Record, settings: Record, position: Vector, rotation: Columns, reach: Reach) -> None:
    """Meet the next of a stream of targets from the configuration at hand: steps 2 to 5."""
    arm.restarted = 0
    work, budget, deadline = arm.work, settings.iterations, deadline_of(settings)
    status = _converge(arm, settings, position, rotation, _first_share(budget), 1.0, deadline)
    used = work.iterations
    if not _finished(status) and work.position_error_m > settings.position_tolerance_m:
        _converge(arm, settings, position, rotation, (budget - used) // 2, POSITION_FIRST, deadline)
        used += work.iterations
    if not _finished(status) and work.position_error_m > STUCK_M:
        anchor = arm.anchor
        swivel = elbow_swivel(reach, columns_of((anchor[0], anchor[1], anchor[2], anchor[3])))
        used = reach_with_any_rotation(arm, settings, position, rotation, reach, swivel, used)
    for attempt in range(2):
        if not _finished(status) and work.position_error_m > STUCK_M:
            margin, nearness = (0.0, _NEARNESS) if attempt == 0 else (_ROOM, 0.0)
            status, used = _start_again(
                arm, settings, position, rotation, reach, margin, nearness, used, status, deadline
            )
    if not _finished(status) and work.orientation_error_rad > STUCK_RAD and work.position_error_m <= STUCK_M:
        q = arm.configuration
        swivel = swivel_of(reach, columns_of((q[0], q[1], q[2], q[3])))
        wanted = nearest_possible(arm.chain, reach, rotation, swivel, 0.0, _NEARNESS)
        if violation(arm.chain, posture_at(reach, rotation, wanted), 0.0) < _POSSIBLE:
            arm.escape = wanted - swivel
    work.iterations, arm.status = used, status


@compiled
def escape(arm: Record, settings: Record, position: Vector, rotation: Columns, reach: Reach, dt_s: float) -> None:
    """Take one frame of the elbow's way to another swivel, the hand's position kept, its rotation as far as it goes."""
    work, q, budget, deadline = arm.work, arm.configuration, settings.iterations, deadline_of(settings)
    radius = max(reach[2] * arm.chain.upper_arm_m, 1e-3)
    most = min(ESCAPE_HASTE * settings.swivel_speed_rad_s * dt_s, ELBOW_STEP_M / radius)
    turn = clip(arm.escape, -most, most)
    swivel = swivel_of(reach, columns_of((q[0], q[1], q[2], q[3]))) + turn
    posture = posture_at(reach, rotation, swivel)
    take(arm.chain, posture, q)
    arm.restarted, arm.swivel_speed = 1, 0.0
    status = _converge(arm, settings, position, rotation, _first_share(budget), 1.0, deadline)
    used = work.iterations
    arm.escape = 0.0 if status == SOLVED or abs(arm.escape - turn) < 1e-3 else arm.escape - turn
    if not _finished(status):  # the loop would slide back to where the hand was stuck
        take(arm.chain, posture, q)
        _converge(arm, settings, position, rotation, budget - used, POSITION_ALONE, deadline)
        used += work.iterations
    work.iterations, arm.status = used, status


@inlined
def _first_share(budget: int) -> int:
    """Iterations before anything but the plain loop is tried."""
    return (2 * budget + 2) // 3


@inlined
def _finished(status: int) -> bool:
    return status in (SOLVED, OUT_OF_TIME)


@compiled
def _start_again(
    arm: Record,
    settings: Record,
    position: Vector,
    rotation: Columns,
    reach: Reach,
    margin: float,
    nearness: float,
    used: int,
    status: int,
    deadline: int,
) -> tuple[int, int]:
    """Try the closed form at another possible swivel; keep it if it is clearly better. Return status, iterations."""
    chain, work, q, kept = arm.chain, arm.work, arm.configuration, arm.kept
    lam = settings.rotation_weight_m * settings.rotation_weight_m
    before = work.position_error_m**2 + lam * work.orientation_error_rad**2
    position_error, orientation_error, held = work.position_error_m, work.orientation_error_rad, work.held
    for i in range(10):
        kept[i] = q[i]
    swivel = swivel_of(reach, columns_of((q[0], q[1], q[2], q[3])))
    swivel = nearest_possible(chain, reach, rotation, swivel, margin, nearness)
    take(chain, posture_at(reach, rotation, swivel), q)
    left = max(settings.iterations - used, 0)
    again = _converge(arm, settings, position, rotation, (2 * left + 2) // 3, 1.0, deadline)
    used += work.iterations
    if work.position_error_m**2 + lam * work.orientation_error_rad**2 < _BETTER * before:
        arm.restarted = 1
        arm.swivel_speed = 0.0
        return again, used
    for i in range(10):
        q[i] = kept[i]
    work.position_error_m, work.orientation_error_rad, work.held = position_error, orientation_error, held
    return status, used


@inlined
def carry_on(arm: Record, towards_comfort: Tangent, dt_s: float) -> None:
    """Move the elbow towards comfort, and pull the hand on as it was pulled last.

    What is left to solve is by how much the hand has sped up or slowed down. The wrench is carried on, not the joints'
    motion: that would keep the elbow swinging with nothing to stop it. Not into a limit: at the end of the elbow's
    extension nothing would tell the loop the way back.
    """
    chain, work = arm.chain, arm.work
    start = read_configuration(arm.configuration)
    if arm.steady >= STEADY:
        share = dt_s / arm.frame_s
        onward = tangent.scale(share, tangent.read(work.onward))
        q = integrate(chain, start, tangent.add(onward, towards_comfort))
        if not rests(walls_at(chain, q, columns_of(q[0]))):
            force, moment = read_wrench(work.pull)
            store_wrench(work.pull, (scale(share, force), scale(share, moment)))
            store_configuration(arm.configuration, q)
            return
    store_wrench(work.pull, NO_WRENCH)
    store_configuration(arm.configuration, integrate(chain, start, towards_comfort))


@inlined
def bend(arm: Record, reach: Reach) -> None:
    """Flex the elbow as far as the target's distance says, given the carrying angle, which bends the arm too."""
    q, lower, upper = arm.configuration, arm.chain.lower, arm.chain.upper
    most = CARRIED * angle_of(reach[3], reach[4])
    q[5] = clip(clip(q[5], -most, most), lower[1], upper[1])
    cosine = min(reach[4] / sine_cosine(q[5])[1], 1.0)
    q[4] = clip(angle_of(math.sqrt(1.0 - cosine * cosine), cosine), lower[0], upper[0])


@compiled
def step_frame(arm: Record, settings: Record, asked: Vector, rotation: Columns, dt_s: float) -> None:
    """Take one frame: position and rotation asked of the hand bone, right arm, ISB axes."""
    position = nearest_with_room(arm.chain, asked)
    reach = reach_to(arm.chain, position)
    for i in range(10):
        arm.anchor[i] = arm.configuration[i]
    if arm.escape != 0.0:
        escape(arm, settings, position, rotation, reach, dt_s)
    else:
        swivel = tangent.STILL
        if arm.work.position_error_m <= STUCK_M:
            swivel = towards_comfort(arm, settings, reach, rotation, dt_s)
        else:  # a hand that cannot be met leaves no swivel free
            arm.swivel_speed = 0.0
        carry_on(arm, swivel, dt_s)
        # The target's distance tells the elbow's flexion; a straight arm could not tell the loop the way back.
        bend(arm, reach)
        follow_target(arm, settings, position, rotation, reach)
    moved_freely = hold_elbow(arm, settings, position, rotation, reach)
    moved_freely = hold_hand(arm, settings, asked, position, rotation, dt_s) and moved_freely
    moved_freely = moved_freely and arm.status == SOLVED and arm.work.held == 0 and arm.restarted == 0
    arm.steady, arm.frame_s = arm.steady + 1 if moved_freely else 0, dt_s
    report_error(arm, asked, position)
    store(arm.asked, asked)
    learn_habit(arm.habit, arm.configuration, dt_s)


@compiled
def first_frame(arm: Record, settings: Record, asked: Vector, rotation: Columns) -> None:
    """Take a frame without a past: start at the most comfortable swivel."""
    arm.swivel_speed = 0.0
    reach = reach_to(arm.chain, nearest_with_room(arm.chain, asked))
    take(arm.chain, posture_at(reach, rotation, most_comfortable(arm, reach, rotation)), arm.configuration)
    find_target(arm, settings, asked, rotation)
    store(arm.asked, asked)
