"""How a controller sits in the hand, found out where no profile says it: a wrist is not turned for long as none can be.

Programs differ by up to 60 degrees in what they call the pose of a hand: OpenXR's grip, an aim, a saber with its
player's own offset. So what the wrists fall short of their targets' rotation by is taken for a turn of the controllers
in the hands, the one the mirror image of the other, little by little, until what is missing on one side of the wrists'
ranges balances what is missing on the other. A controller that turns within the ranges teaches nothing.
"""

from __future__ import annotations

import numpy as np

from arm_ik_service.body.profile import Grips, Profile
from arm_ik_service.compiled import Record, compiled, record_dtype
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Vector

GRIP_TIME_S = 3.0  # in which a constant shortfall is learnt at first ...
GRIP_SETTLES_AFTER_S = 120.0  # ... and the time after which it takes twice as long
ENOUGH_RAD = 0.1  # shortfalls up to this are of limits that are a little narrow, or of a swing that went too far
LARGEST_SHORTFALL_RAD = (
    0.35  # more of a single frame counts as this: it is a hand that let go, or a rotation gone wrong
)
TURNING_RAD_S = 1.0  # a hand that hardly turns says the same over and over; it may rest, or be frozen
MET_M = 5e-3  # an arm that does not reach its hand's place says nothing of the rotation
LARGEST_TURN_RAD = 1.2  # of a controller: what is farther off is no hand on a controller

GRIP = record_dtype(
    [
        ("learns", np.int64),  # 1 where no profile says how the controllers sit
        ("turn", np.float64, (3,)),  # [rad] of the right wrist from where the profile has it: a rotation vector in it
    ]
)


def initialise_grip(grip: Record, profile: Profile) -> None:
    """Learn from nothing where the profile has the default grips: they count as not stated."""
    grip["learns"] = profile.grip == Grips()
    grip["turn"] = 0.0


@compiled
def mirrored_turn(turn: Vector, k: int) -> Vector:
    """A rotation vector, which is axial, of the right hand (1) or the left (0) as that of the right hand, and back."""
    return turn if k == 1 else g.scale(-1.0, g.mirror_vector(turn))


@compiled
def _shortfall(target: Record, arm: Record) -> Vector:
    """Rotation vector, in the wrist's frame, from the rotation asked for to the nearest that the solve found."""
    short = g.log(g.multiply(g.conjugate(g.quaternion(target.rotation)), g.quaternion(arm.hand_found)))
    angle = g.norm(short)
    return g.scale(min(angle - ENOUGH_RAD, LARGEST_SHORTFALL_RAD) / angle, short)


@compiled
def learn_grip(body: Record, tracking: Record, arms: Record, elapsed_s: float) -> None:
    """Take what the arms of this frame fell short of into the turn of the controllers, for the next frame."""
    if not body.grip.learns:
        return
    pace = elapsed_s / (GRIP_TIME_S * (1.0 + body.since_s / GRIP_SETTLES_AFTER_S))
    turn = g.vector(body.grip.turn)
    for k in range(2):
        arm, hand = arms[k], tracking.hands[k]
        seen = hand.position_age_s == 0.0 and hand.rotation_age_s == 0.0
        if seen and arm.work.orientation_error_rad > ENOUGH_RAD and arm.work.position_error_m < MET_M:
            short = mirrored_turn(_shortfall(body.targets[k], arm), k)
            turning = min(g.norm(g.vector(hand.angular_velocity)) / TURNING_RAD_S, 1.0)
            turn = g.add(turn, g.scale(0.5 * pace * turning, short))
    g.store(body.grip.turn, g.scale(min(1.0, LARGEST_TURN_RAD / max(g.norm(turn), 1e-9)), turn))
