"""Joint velocities from the hand's twist, through the same Jacobian products as the solve.

What goes out is the derivative of what goes out: the part that moves the hand follows from the hand's twist; the part
that does not (the swivel drawn by comfort, the sharing between joints) from how the configuration has been moving,
carried on to now. So the velocity is the one nearest to that recent motion, in the metric of the solve, that gives the
hand its twist: conjugate gradients on the normal equations (Hestenes & Stiefel 1952), started at the recent motion.
Lightly damped, so a straight arm stays finite; joints at a limit do not move outward.
"""

from __future__ import annotations

from arm_ik_service.arm import tangent
from arm_ik_service.arm.configuration import Configuration
from arm_ik_service.arm.tangent import Tangent
from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry.scalar import Vector, dot, scale, subtract
from arm_ik_service.ik.held import hold, lock, walls_at
from arm_ik_service.ik.jacobian import jacobian_at, preconditioner, times, transposed_times

ITERATIONS = 8  # six would do in exact arithmetic: the hand's twist has six numbers
_DAMPING = 1e-4  # of the squared scaled columns (which are about one): 0.01 % bias away from singularities
_ENOUGH = 1e-10  # squared relative residual
SPEED_BIT = 256  # place of `joint_speed` in arm.model.LIMITS


@compiled
def velocity_from_twist(
    chain: Record, q: Configuration, recent: Tangent, linear: Vector, angular: Vector, lam: float, iterations: int
) -> tuple[Tangent, int]:
    """Return the velocity nearest to `recent` that gives the wrist its twist (right arm, ISB axes), and held limits.

    `recent` is the answer wherever the twist leaves it free. With no `iterations` it is all of the answer, less what
    moves out of limits.
    """
    here = jacobian_at(chain, q)
    inverse = preconditioner(here, lam)
    walls = walls_at(chain, q, here.shoulder)
    locked = 0
    velocity = recent
    for _attempt in range(3):  # each time with what ran into a limit locked
        velocity, direction = lock(walls, recent, inverse, locked), tangent.STILL
        slope_before, first = 0.0, 0.0
        for k in range(iterations):
            moved, turned = times(here, velocity)
            gradient = transposed_times(here, (subtract(linear, moved), scale(lam, subtract(angular, turned))))
            strayed = tangent.subtract(recent, velocity)
            gradient = tangent.add(gradient, tangent.scale(_DAMPING, tangent.over(strayed, inverse)))
            step = lock(walls, tangent.times(inverse, gradient), inverse, locked)
            slope = tangent.dot(gradient, step)
            first = max(first, slope)
            if slope <= _ENOUGH * first or slope < 1e-14:
                break
            beta = slope / slope_before if k > 0 else 0.0
            slope_before = slope
            direction = tangent.add(step, tangent.scale(beta, direction))
            moved, turned = times(here, direction)
            curvature = dot(moved, moved) + lam * dot(turned, turned)
            curvature += _DAMPING * tangent.dot(direction, tangent.over(direction, inverse))
            velocity = tangent.add(velocity, tangent.scale(slope / curvature, direction))
        velocity, outward = hold(walls, velocity, inverse)
        outward |= locked
        if outward == locked:
            break
        locked = outward
    return velocity, locked
