"""The hand where it should be, turned as far as the wrist goes: where position and rotation cannot both be met."""

from __future__ import annotations

import math

from arm_ik_service.arm.chain import Columns
from arm_ik_service.compiled import Record, compiled, inlined
from arm_ik_service.geometry.scalar import Vector
from arm_ik_service.ik.clock import monotonic_ns
from arm_ik_service.ik.conjugate import NEAREST, converge
from arm_ik_service.ik.swivel import Reach, posture_at, take

STUCK_M = 5e-3  # a position missed by more than this is worth a jump of the elbow
POSITION_ALONE = 1e-4  # share of the rotation's weight that is left


@inlined
def deadline_of(settings: Record) -> int:
    """Return the time of the clock at which an attempt that begins now is to end; 0 for never."""
    return monotonic_ns() + int(1e3 * settings.time_limit_us) if settings.time_limit_us > 0.0 else 0


@compiled
def reach_with_any_rotation(
    arm: Record, settings: Record, position: Vector, rotation: Columns, reach: Reach, swivel: float, used: int
) -> int:
    """Put the hand where it should be at a given swivel, turned as far as the wrist goes. Return iterations.

    In closed form, then by the loop where the shoulder's limits were in the way; undone if it is no nearer.
    """
    chain, work, q, kept = arm.chain, arm.work, arm.configuration, arm.kept
    for i in range(10):
        kept[i] = q[i]
    position_error, orientation_error, held = work.position_error_m, work.orientation_error_rad, work.held
    take(chain, posture_at(reach, rotation, swivel), q)
    # Any rotation is within this tolerance: the loop would turn the hand by sliding the elbow on.
    converge(
        chain,
        work,
        q,
        position,
        rotation,
        max(settings.iterations - used, 0),
        POSITION_ALONE * settings.rotation_weight_m * settings.rotation_weight_m,
        settings.position_tolerance_m,
        2.0 * math.pi,
        deadline_of(settings),
    )
    used += work.iterations
    if work.position_error_m > max(STUCK_M, position_error):
        for i in range(10):
            q[i] = kept[i]
        work.position_error_m, work.orientation_error_rad, work.held = position_error, orientation_error, held
    else:
        arm.restarted, arm.status = 0, NEAREST
    return used
