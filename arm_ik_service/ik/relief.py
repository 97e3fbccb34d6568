"""What turn of the trunk would relieve an arm whose shoulder nears the end of its range.

An arm that cannot go on takes the trunk along, and so tells which way the trunk went. The turn is the steepest descent
of half the sum of the squared angles by which swing and twist have come nearer to their limits than NEAR_RAD; a trunk
that turns with the arm left in space turns the humerus the other way about in the trunk's axes.
"""

from __future__ import annotations

from arm_ik_service.arm.chain import columns_of, spin_from_arm
from arm_ik_service.arm.limits import swing_excess, swing_gradient, twist_gradient, twist_of, twist_range
from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry.scalar import Vector, add, scale

NEAR_RAD = 0.3  # as where discomfort begins to rise


@compiled
def relief(arm: Record) -> Vector:
    """Rotation vector [rad], in shoulder axes, towards more room for the solve's arm; zero where there is enough."""
    chain, c = arm.chain, arm.configuration
    q = (c[0], c[1], c[2], c[3])
    bone = columns_of(q)
    turn = (0.0, 0.0, 0.0)
    swing = swing_excess(chain, scale(-1.0, bone[1])) + NEAR_RAD
    if swing > 0.0:
        turn = scale(swing, swing_gradient(chain, bone))
    twist, (lower, upper) = twist_of(bone), twist_range(chain, -bone[1][1])
    past = min(twist - (lower + NEAR_RAD), 0.0) + max(twist - (upper - NEAR_RAD), 0.0)
    if past != 0.0:
        turn = add(turn, scale(past, twist_gradient(q)))
    # from the humerus' own axes
    turn = add(add(scale(turn[0], bone[0]), scale(turn[1], bone[1])), scale(turn[2], bone[2]))
    return spin_from_arm(chain, turn)
