"""The Jacobian-transpose loop, compiled: conjugate directions on the joints that are free.

The error is e = (e_pos, e_rot) in the metric |e_pos|^2 + lam |e_rot|^2, lam a squared length. One iteration:

1. Gradient J^T e without a Jacobian: the entry of a joint with axis a at distance r = p_wrist - p_joint is
   a . (r x e_pos + lam e_rot).
2. Column scaling: each entry is divided by its squared column norm |a x r|^2 + lam (a diagonal preconditioner) and
   multiplied by the joint's mobility.
3. Limits: a step that would leave one is held back (`held`).
4. Polak-Ribiere+ conjugate direction s, restarted whenever the held set changes.
5. The exact step of the linearised problem, <J s, e> / <J s, J s>, at most MAX_STEP, then every limit is projected.
   A step that makes the error larger is taken back to a quarter of its length.

It stops at the tolerances, when no direction helps any more (STATIONARY), or when the budget is used up.
Sources: Balestrino et al. 1984 and Wolovich & Elliott 1984 for the transpose, Polak & Ribiere 1969 and Gilbert &
Nocedal 1992 for the directions.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from arm_ik_service.arm import tangent
from arm_ik_service.arm.chain import Columns
from arm_ik_service.arm.configuration import integrate, read_configuration, store_configuration
from arm_ik_service.compiled import Record, compiled, inlined, record_dtype
from arm_ik_service.geometry.scalar import (
    Vector,
    add,
    conjugate,
    cross,
    dot,
    from_columns,
    log,
    multiply,
    scale,
    subtract,
)
from arm_ik_service.geometry.trigonometry import arc
from arm_ik_service.ik.clock import monotonic_ns
from arm_ik_service.ik.held import hold, walls_at
from arm_ik_service.ik.jacobian import (
    NO_WRENCH,
    Wrench,
    jacobian_at,
    preconditioner,
    read_wrench,
    store_wrench,
    times,
    transposed_times,
)
from arm_ik_service.ik.solver import Status

SOLVED, NEAREST = int(Status.SOLVED), int(Status.NEAREST)
OUT_OF_ITERATIONS, OUT_OF_TIME = int(Status.OUT_OF_ITERATIONS), int(Status.OUT_OF_TIME)

MAX_STEP = 0.5  # [rad] of any joint in one iteration: the linearisation means little beyond
STATIONARY = 1e-5  # squared scaled gradient over squared error: below, the error is orthogonal to all free columns
RETREATS = 3  # times a step is shortened before the point counts as stationary

WORK = record_dtype(
    [
        ("position_error_m", np.float64),
        ("orientation_error_rad", np.float64),
        ("iterations", np.int64),
        ("held", np.int64),  # bit mask over arm.model.LIMITS
        (
            "pull",
            np.float64,
            (6,),
        ),  # given: one to begin with; left: with all that pulled the hand
        ("onward", np.float64, (9,)),  # where that pull would move the joints from here; if solved
    ]
)


@inlined
def rotation_error(current: Columns, wanted: Columns) -> Vector:
    """Rotation vector [rad] that takes `current` to `wanted`, in the axes both are given in."""
    s = add(add(cross(current[0], wanted[0]), cross(current[1], wanted[1])), cross(current[2], wanted[2]))
    trace = dot(current[0], wanted[0]) + dot(current[1], wanted[1]) + dot(current[2], wanted[2])
    cosine = 0.5 * (trace - 1.0)
    if cosine < -0.9:  # near half a turn the sine carries no direction
        return log(multiply(from_columns(*wanted), conjugate(from_columns(*current))))
    return scale(0.5 * arc(0.5 * math.sqrt(dot(s, s)), cosine), s)


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
    q = read_configuration(configuration)
    before, last_gradient, direction = q, tangent.STILL, tangent.STILL
    held, retreats = -1, 0
    slope_before, best, length = 0.0, math.inf, 0.0
    p2_best, o2_best = 0.0, 0.0
    pull, pulled = NO_WRENCH, read_wrench(work.pull)
    pulled_before = pulled
    k = 0
    while True:
        here = jacobian_at(chain, q)
        e_pos, e_rot = subtract(position, here.from_shoulder), rotation_error(here.hand, rotation)
        p2, o2 = dot(e_pos, e_pos), dot(e_rot, e_rot)
        error = p2 + lam * o2
        if (
            p2 < position_tolerance_m * position_tolerance_m
            and o2 < orientation_tolerance_rad * orientation_tolerance_rad
        ):
            status, p2_best, o2_best = SOLVED, p2, o2
            onward = tangent.times(preconditioner(here, lam), transposed_times(here, pulled))
            tangent.store(work.onward, onward)
            break
        if error > best:  # the last step made it worse: take it back, and go a quarter as far
            q = before
            retreats += 1
            if retreats > RETREATS or k >= budget:
                status = NEAREST if retreats > RETREATS else OUT_OF_ITERATIONS
                break
            length *= 0.25
            k += 1
            q, pulled = integrate(chain, before, tangent.scale(length, direction)), _more(pulled_before, length, pull)
            continue
        p2_best, o2_best = p2, o2
        if k >= budget:
            status = OUT_OF_ITERATIONS
            break
        if deadline_ns > 0 and monotonic_ns() >= deadline_ns:
            status = OUT_OF_TIME
            break
        best = error
        k += 1

        wrench = (e_pos, scale(lam, e_rot))
        gradient = transposed_times(here, wrench)
        inverse = preconditioner(here, lam)
        walls = walls_at(chain, q, here.shoulder)
        step, now_held = hold(walls, tangent.times(inverse, gradient), inverse)
        slope = tangent.dot(gradient, step)
        if slope < STATIONARY * error:
            held = now_held
            status = NEAREST
            break
        beta = 0.0
        if now_held == held and retreats == 0:
            beta = max(0.0, tangent.dot(tangent.subtract(gradient, last_gradient), step) / slope_before)
        held, slope_before, last_gradient, retreats = now_held, slope, gradient, 0
        direction = tangent.add(step, tangent.scale(beta, direction))
        if beta > 0.0 and held:
            direction, _ = hold(walls, direction, inverse)
        pull = _more(wrench, beta, pull)
        if tangent.dot(direction, gradient) <= 0.0:
            direction, pull = step, wrench

        velocity, spin = times(here, direction)
        length = (dot(velocity, e_pos) + lam * dot(spin, e_rot)) / (
            dot(velocity, velocity) + lam * dot(spin, spin) + 1e-14
        )
        length = min(length, MAX_STEP / tangent.largest(direction))
        before, pulled_before = q, pulled
        q, pulled = integrate(chain, q, tangent.scale(length, direction)), _more(pulled, length, pull)
    store_configuration(configuration, q)
    work.position_error_m, work.orientation_error_rad = math.sqrt(p2_best), math.sqrt(o2_best)
    work.iterations = k
    work.held = max(held, 0)
    store_wrench(work.pull, pulled)
    return status


@inlined
def _more(wrench: Wrench, s: float, other: Wrench) -> Wrench:
    return add(wrench[0], scale(s, other[0])), add(wrench[1], scale(s, other[1]))
