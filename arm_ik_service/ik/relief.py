"""What turn of the trunk would relieve an arm whose shoulder nears the end of its range.

An arm that cannot go on takes the trunk along, and so tells which way the trunk went. The turn is the steepest descent
of half the sum of the squared angles by which swing and twist have come nearer to their limits than NEAR_RAD; a trunk
that turns with the arm left in space turns the humerus the other way about in the trunk's axes.
"""

from __future__ import annotations

from arm_ik_service.arm.chain import columns_of, spin_from_arm
from arm_ik_service.arm.limits import swing_excess, swing_gradient, twist_beyond, twist_gradient, twist_of
from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry.scalar import Vector, add, combine, scale
from arm_ik_service.ik.comfort import LIMIT_MARGIN

NEAR_RAD = LIMIT_MARGIN  # where discomfort begins to rise too


@compiled
def relief(arm: Record) -> Vector:
    """Rotation vector [rad], in shoulder axes, towards more room for the solve's arm; zero where there is enough."""
    chain, c = arm.chain, arm.configuration
    q = (c[0], c[1], c[2], c[3])
    bone = columns_of(q)
    swing = max(swing_excess(chain, scale(-1.0, bone[1])) + NEAR_RAD, 0.0)
    twist = twist_beyond(chain, twist_of(bone), -bone[1][1], NEAR_RAD)
    if swing == 0.0 and twist == 0.0:
        return (0.0, 0.0, 0.0)
    turn = (0.0, 0.0, 0.0)  # in the humerus' own axes
    if swing > 0.0:
        turn = scale(swing, swing_gradient(chain, bone))
    if twist != 0.0:
        turn = add(turn, scale(twist, twist_gradient(q)))
    return spin_from_arm(chain, combine(turn, bone))
