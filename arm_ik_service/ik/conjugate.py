"""The Jacobian-transpose loop, compiled: conjugate directions on the joints that are free.

The error is e = (e_pos, e_rot) in the metric |e_pos|^2 + lam |e_rot|^2, lam a squared length. One iteration:

1. Gradient J^T e without a Jacobian: the entry of a joint with axis a at distance r = p_wrist - p_joint is
   a . (r x e_pos + lam e_rot).
2. Column scaling: each entry is divided by its squared column norm |a x r|^2 + lam (a diagonal preconditioner) and
   multiplied by the joint's mobility.
3. Limits: a joint at its bound whose step points outward is held, its step is zero; the shoulder's swing and twist
   limits are held by projecting the step onto their tangents, orthogonally in the metric of 2.
4. Polak-Ribiere+ conjugate direction s, restarted whenever the held set changes.
5. The exact step of the linearised problem, <J s, e> / <J s, J s>, at most MAX_STEP, then every limit is projected.
   A step that makes the error larger is taken back to a quarter of its length.

It stops at the tolerances, when no direction helps any more (STATIONARY), or when the budget is used up.
Sources: Balestrino et al. 1984 and Wolovich & Elliott 1984 for the transpose, Polak & Ribiere 1969 and Gilbert &
Nocedal 1992 for the directions, Gould, Hribar & Nocedal 2001 for the projected preconditioner.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from arm_ik_service.arm.chain import Columns, columns_of, turn_group
from arm_ik_service.arm.limits import (
    clamp_hinges,
    clamp_swing,
    clamp_twist,
    swing_excess,
    swing_gradient,
    twist_excess,
    twist_gradient,
    twist_of,
)
from arm_ik_service.compiled import Record, compiled, record_dtype
from arm_ik_service.geometry.scalar import (
    Vector,
    add,
    conjugate,
    cross,
    dot,
    exp,
    from_columns,
    log,
    multiply,
    normalized,
    scale,
    subtract,
)
from arm_ik_service.ik.clock import monotonic_ns
from arm_ik_service.ik.solver import Status

SOLVED, NEAREST = int(Status.SOLVED), int(Status.NEAREST)
OUT_OF_ITERATIONS, OUT_OF_TIME = int(Status.OUT_OF_ITERATIONS), int(Status.OUT_OF_TIME)

MAX_STEP = 0.5  # [rad] of any joint in one iteration: the linearisation means little beyond
STATIONARY = 1e-5  # squared scaled gradient over squared error: below, the error is orthogonal to all free columns
RETREATS = 3  # times a step is shortened before the point counts as stationary
AT_LIMIT = 1e-9  # [rad]
# The carrying angle and the axial play of the wrist are soft tissue giving way: they move a tenth as readily.
MOBILITY = (1.0, 1.0, 1.0, 1.0, 0.1, 1.0, 1.0, 1.0, 0.1)

WORK = record_dtype(
    [
        ("gradient", np.float64, (9,)),
        ("last_gradient", np.float64, (9,)),
        ("inverse", np.float64, (9,)),  # mobility over squared column norm
        ("step", np.float64, (9,)),  # scaled gradient on the free joints
        ("direction", np.float64, (9,)),
        ("before", np.float64, (10,)),  # configuration before the last step
        ("position_error_m", np.float64),
        ("orientation_error_rad", np.float64),
        ("iterations", np.int64),
        ("held", np.int64),  # bit mask over arm.model.LIMITS
    ]
)


@compiled
def rotation_error(current: Columns, wanted: Columns) -> Vector:
    """Rotation vector [rad] that takes `current` to `wanted`, in the axes both are given in."""
    s = add(add(cross(current[0], wanted[0]), cross(current[1], wanted[1])), cross(current[2], wanted[2]))
    trace = dot(current[0], wanted[0]) + dot(current[1], wanted[1]) + dot(current[2], wanted[2])
    sine, cosine = 0.5 * math.sqrt(dot(s, s)), 0.5 * (trace - 1.0)
    if cosine < -0.9:  # near half a turn the sine carries no direction
        return log(multiply(from_columns(*wanted), conjugate(from_columns(*current))))
    return scale(0.5 if sine < 1e-9 else 0.5 * math.atan2(sine, cosine) / sine, s)


@compiled
def project(step: Any, inverse: Any, normal: Vector) -> None:
    """Remove from the shoulder part of a step what moves along `normal`, orthogonally in the metric 1 / inverse."""
    n0, n1, n2 = inverse[0] * normal[0], inverse[1] * normal[1], inverse[2] * normal[2]
    s = (step[0] * normal[0] + step[1] * normal[1] + step[2] * normal[2]) / (
        n0 * normal[0] + n1 * normal[1] + n2 * normal[2]
    )
    step[0] -= s * n0
    step[1] -= s * n1
    step[2] -= s * n2


@compiled
def independent(normal: Vector, of: Vector, inverse: Any) -> Vector:
    """Part of `normal` whose projection leaves the projection along `of` alone."""
    w = (inverse[0] * of[0], inverse[1] * of[1], inverse[2] * of[2])
    return subtract(normal, scale(dot(normal, w) / dot(of, w), of))


@compiled
def hold_limits(chain: Record, configuration: Any, base: Columns, step: Any, inverse: Any) -> int:
    """Remove from a step (9,) what would leave the limits that the configuration rests on; return their bit mask."""
    held = 0
    for i in range(6):
        angle, s = configuration[4 + i], step[3 + i]
        if (angle <= chain.lower[i] + AT_LIMIT and s < 0.0) or (angle >= chain.upper[i] - AT_LIMIT and s > 0.0):
            step[3 + i] = 0.0
            held |= 4 << i
    swing = (0.0, 0.0, 0.0)
    if swing_excess(chain, scale(-1.0, base[1])) > -AT_LIMIT:
        swing = swing_gradient(chain, base)
        if swing[0] * step[0] + swing[2] * step[2] > 0.0:
            project(step, inverse, swing)
            held |= 1
    twist, height = twist_of(base), -base[1][1]
    over = twist_excess(chain, twist + AT_LIMIT, height)
    under = twist_excess(chain, twist - AT_LIMIT, height)
    if over > 0.0 or under < 0.0:
        q = (configuration[0], configuration[1], configuration[2], configuration[3])
        normal = twist_gradient(q)
        if under < 0.0:
            normal = scale(-1.0, normal)
        if normal[0] * step[0] + normal[1] * step[1] + normal[2] * step[2] > 0.0:
            if held & 1:
                normal = independent(normal, swing, inverse)
            project(step, inverse, normal)
            held |= 2
    return held


@compiled
def move(chain: Record, configuration: Any, direction: Any, length: float) -> None:
    """Step along a tangent direction (9,) and bring every limit back in, in place."""
    q = (configuration[0], configuration[1], configuration[2], configuration[3])
    q = normalized(multiply(q, exp((length * direction[0], length * direction[1], length * direction[2]))))
    q = clamp_swing(chain, q, columns_of(q))
    q = clamp_twist(chain, q, columns_of(q))
    for i in range(4):
        configuration[i] = q[i]
    for i in range(6):
        configuration[4 + i] += length * direction[3 + i]
    clamp_hinges(chain, configuration)


@compiled
def converge(
    chain: Record,
    work: Record,
    configuration: Any,
    position: Vector,
    rotation: Columns,
    budget: int,
    lam: float,
    position_tolerance_m: float,
    orientation_tolerance_rad: float,
    deadline_ns: int,
) -> int:
    """Drive the hand bone towards `position` and `rotation` (right arm, ISB axes); configuration (10,) in place.

    Returns a Status; errors, iterations and held limits are left in `work`. `deadline_ns` 0: none.
    """
    gradient, last_gradient, inverse = work.gradient, work.last_gradient, work.inverse
    step, direction, before = work.step, work.direction, work.before
    held, retreats = -1, 0
    slope_before, best, length = 0.0, math.inf, 0.0
    k = 0
    while True:
        base = columns_of((configuration[0], configuration[1], configuration[2], configuration[3]))
        x1, y1, lower = turn_group(base, configuration[4], configuration[5], configuration[6])
        x2, y2, hand = turn_group(lower, configuration[7], configuration[8], configuration[9])
        r1 = scale(-chain.forearm_m, lower[1])
        r0 = add(scale(-chain.upper_arm_m, base[1]), r1)
        e_pos, e_rot = subtract(position, r0), rotation_error(hand, rotation)
        p2, o2 = dot(e_pos, e_pos), dot(e_rot, e_rot)
        error = p2 + lam * o2
        if (
            p2 < position_tolerance_m * position_tolerance_m
            and o2 < orientation_tolerance_rad * orientation_tolerance_rad
        ):
            status = SOLVED
            break
        if error > best:  # the last step made it worse: take it back, and go a quarter as far
            for i in range(10):
                configuration[i] = before[i]
            retreats += 1
            if retreats > RETREATS or k >= budget:
                status = NEAREST if retreats > RETREATS else OUT_OF_ITERATIONS
                break
            length *= 0.25
            k += 1
            move(chain, configuration, direction, length)
            continue
        work.position_error_m, work.orientation_error_rad = math.sqrt(p2), math.sqrt(o2)
        if k >= budget:
            status = OUT_OF_ITERATIONS
            break
        if deadline_ns > 0 and monotonic_ns() >= deadline_ns:
            status = OUT_OF_TIME
            break
        best = error
        k += 1

        turning = scale(lam, e_rot)
        t0, t1 = add(cross(r0, e_pos), turning), add(cross(r1, e_pos), turning)
        axes = (base[0], base[1], base[2], base[2], x1, y1, lower[2], x2, y2)
        for i in range(9):
            axis = axes[i]
            t, r = (t0, r0) if i < 3 else (t1, r1)
            along = dot(axis, r)
            column = lam
            if i < 6:
                column += dot(r, r) - along * along
            else:
                t = turning
            gradient[i] = dot(axis, t)
            inverse[i] = MOBILITY[i] / column
            step[i] = gradient[i] * inverse[i]
        now_held = hold_limits(chain, configuration, base, step, inverse)
        slope, change = 0.0, 0.0
        for i in range(9):
            slope += gradient[i] * step[i]
            change += (gradient[i] - last_gradient[i]) * step[i]
            last_gradient[i] = gradient[i]
        if slope < STATIONARY * error:
            held = now_held
            status = NEAREST
            break
        beta = max(0.0, change / slope_before) if now_held == held and retreats == 0 else 0.0
        held, slope_before, retreats = now_held, slope, 0
        downhill = 0.0
        for i in range(9):
            direction[i] = step[i] + beta * direction[i]
        if beta > 0.0 and held:
            hold_limits(chain, configuration, base, direction, inverse)
        for i in range(9):
            downhill += direction[i] * gradient[i]
        if downhill <= 0.0:
            for i in range(9):
                direction[i] = step[i]

        spin0 = combine(direction[0], base[0], direction[1], base[1], direction[2], base[2])
        spin1 = combine(direction[3], base[2], direction[4], x1, direction[5], y1)
        spin2 = combine(direction[6], lower[2], direction[7], x2, direction[8], y2)
        velocity = add(cross(spin0, r0), cross(spin1, r1))
        spin = add(add(spin0, spin1), spin2)
        length = (dot(velocity, e_pos) + lam * dot(spin, e_rot)) / (
            dot(velocity, velocity) + lam * dot(spin, spin) + 1e-14
        )
        biggest = 0.0
        for i in range(9):
            biggest = max(biggest, abs(direction[i]))
        length = min(length, MAX_STEP / biggest)
        for i in range(10):
            before[i] = configuration[i]
        move(chain, configuration, direction, length)
    if status == SOLVED:
        work.position_error_m, work.orientation_error_rad = math.sqrt(p2), math.sqrt(o2)
    work.iterations = k
    work.held = max(held, 0)
    return status


@compiled
def combine(a: float, x: Vector, b: float, y: Vector, c: float, z: Vector) -> Vector:
    """a x + b y + c z."""
    return (
        a * x[0] + b * y[0] + c * z[0],
        a * x[1] + b * y[1] + c * z[1],
        a * x[2] + b * y[2] + c * z[2],
    )
