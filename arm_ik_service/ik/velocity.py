"""Joint velocities from the hand's twist, through the same Jacobian products as the solve.

What goes out is the derivative of what goes out: the part that moves the hand follows from the hand's twist; the part
that does not (the swivel drawn by comfort, the sharing between joints) from how the configuration has been moving,
carried on to now. So the velocity is the one nearest to that recent motion, in the metric of the solve, that gives the
hand its twist: conjugate gradients on the normal equations (Hestenes & Stiefel 1952), started at the recent motion.
Lightly damped, so a straight arm stays finite; joints at a limit do not move outward.
"""

from __future__ import annotations

from typing import Any

from arm_ik_service.arm.chain import columns_of, turn_group
from arm_ik_service.arm.limits import swing_gradient, twist_gradient
from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry.scalar import (
    Quaternion,
    Vector,
    add,
    conjugate,
    cross,
    dot,
    log,
    multiply,
    scale,
    subtract,
)
from arm_ik_service.ik.conjugate import MOBILITY, combine, hold_limits, independent, project

ITERATIONS = 8  # six would do in exact arithmetic: the hand's twist has six numbers
_DAMPING = 1e-4  # of the squared scaled columns (which are about one): 0.01 % bias away from singularities
_ENOUGH = 1e-10  # squared relative residual
SPEED_BIT = 256  # place of `joint_speed` in arm.model.LIMITS


@compiled
def difference(before: Any, after: Any, dt_s: float, out: Any) -> None:
    """Mean velocity (9,) of the tangent that leads from one configuration to another in dt_s."""
    a: Quaternion = (before[0], before[1], before[2], before[3])
    b: Quaternion = (after[0], after[1], after[2], after[3])
    w = log(multiply(conjugate(a), b))
    for i in range(3):
        out[i] = w[i] / dt_s
    for i in range(6):
        out[3 + i] = (after[4 + i] - before[4 + i]) / dt_s


@compiled
def _lock(vector: Any, inverse: Any, swing: Vector, twist: Vector, locked: int) -> None:
    """Remove from a tangent vector (9,) what moves the locked limits, either way."""
    for i in range(6):
        if locked & (4 << i):
            vector[3 + i] = 0.0
    if locked & 1:
        project(vector, inverse, swing)
    if locked & 2:
        project(vector, inverse, independent(twist, swing, inverse) if locked & 1 else twist)


@compiled
def velocity_from_twist(
    chain: Record,
    work: Record,
    configuration: Any,
    linear: Vector,
    angular: Vector,
    lam: float,
    iterations: int,
    velocity: Any,
) -> int:
    """Correct `velocity` (9,) in place so that it gives the wrist its twist (right arm, ISB axes); return held limits.

    On the way in `velocity` is the recent motion; it is the answer wherever the twist leaves it free. With no
    `iterations` it is all of the answer, less what moves out of limits.
    """
    base = columns_of((configuration[0], configuration[1], configuration[2], configuration[3]))
    x1, y1, lower = turn_group(base, configuration[4], configuration[5], configuration[6])
    x2, y2, _ = turn_group(lower, configuration[7], configuration[8], configuration[9])
    r1 = scale(-chain.forearm_m, lower[1])
    r0 = add(scale(-chain.upper_arm_m, base[1]), r1)
    axes = (base[0], base[1], base[2], base[2], x1, y1, lower[2], x2, y2)
    inverse, gradient, step, direction, prior = (
        work.inverse,
        work.gradient,
        work.step,
        work.direction,
        work.last_gradient,
    )
    for i in range(9):
        r = r0 if i < 3 else r1
        along = dot(axes[i], r)
        column = lam if i >= 6 else lam + dot(r, r) - along * along
        inverse[i] = MOBILITY[i] / column
        prior[i] = velocity[i]
    swing = swing_gradient(chain, base)
    twist = twist_gradient((configuration[0], configuration[1], configuration[2], configuration[3]))
    locked = 0
    for _attempt in range(3):  # each time with what ran into a limit locked
        for i in range(9):
            velocity[i] = prior[i]
        _lock(velocity, inverse, swing, twist, locked)
        slope_before, first = 0.0, 0.0
        for k in range(iterations):
            spin0 = combine(velocity[0], base[0], velocity[1], base[1], velocity[2], base[2])
            spin1 = combine(velocity[3], base[2], velocity[4], x1, velocity[5], y1)
            spin2 = combine(velocity[6], lower[2], velocity[7], x2, velocity[8], y2)
            e_pos = subtract(linear, add(cross(spin0, r0), cross(spin1, r1)))
            e_rot = subtract(angular, add(add(spin0, spin1), spin2))
            turning = scale(lam, e_rot)
            t0, t1 = add(cross(r0, e_pos), turning), add(cross(r1, e_pos), turning)
            for i in range(9):
                t = t0 if i < 3 else (t1 if i < 6 else turning)
                gradient[i] = dot(axes[i], t) - _DAMPING * (velocity[i] - prior[i]) / inverse[i]
                step[i] = gradient[i] * inverse[i]
            _lock(step, inverse, swing, twist, locked)
            slope = 0.0
            for i in range(9):
                slope += gradient[i] * step[i]
            first = max(first, slope)
            if slope <= _ENOUGH * first or slope < 1e-14:
                break
            beta = slope / slope_before if k > 0 else 0.0
            slope_before = slope
            for i in range(9):
                direction[i] = step[i] + beta * direction[i]
            spin0 = combine(direction[0], base[0], direction[1], base[1], direction[2], base[2])
            spin1 = combine(direction[3], base[2], direction[4], x1, direction[5], y1)
            spin2 = combine(direction[6], lower[2], direction[7], x2, direction[8], y2)
            moved = add(cross(spin0, r0), cross(spin1, r1))
            turned = add(add(spin0, spin1), spin2)
            curvature = dot(moved, moved) + lam * dot(turned, turned)
            for i in range(9):
                curvature += _DAMPING * direction[i] * direction[i] / inverse[i]
            for i in range(9):
                velocity[i] += slope / curvature * direction[i]
        outward = hold_limits(chain, configuration, base, velocity, inverse) | locked
        if outward == locked:
            break
        locked = outward
    return locked
