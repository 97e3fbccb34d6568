"""How the trunk gives way to the arms: it turns and bends to where they have room, and towards what they reach for.

Head and hands do not show a trunk that turns under them: a dancer who fixes a point while she spins, or holds on to a
partner. An arm near the end of its range does, for trunks are turned before shoulders hurt; so does a hand farther away
than its arm is long. The trunk follows both in about a twentieth of a second, and comes back when the arms have room
again. Bending to the side is left out: it relieves an arm by little, and elbows that wave were less calm with it.

The gains are chosen with all motion captures in view. Shoulders and elbows are as near to the recorded ones with half
or twice of them; elbows are not as calm: half the gain for room leaves one of 61_02 with 1.9 times the recorded jerk,
twice of it those of bandai1_call with 3; twice the gain for reach, these with 1.6.
"""

from __future__ import annotations

from arm_ik_service.body.follow import follow
from arm_ik_service.body.grip import ENOUGH_RAD
from arm_ik_service.body.shoulders import away_from_rest
from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import scalar as g

ROOM_GAIN = 4.0  # turn of the trunk over what relieves an arm
REACH_GAIN = 40.0  # turn of the trunk [rad] over what is reached too far, and the shoulder's lever on it
REACHED_TOO_FAR = 1.05  # reach ratio of a stretched arm from where its shoulder rests: girdle and trunk give the rest
GIVES_AT_MOST_RAD = 0.8  # 45 degrees: as far as a trunk turns on its pelvis
GIVES_TIME_S = 0.06
SETS_IN_S = 0.5  # after the first frame: who is found in an odd posture does not start with a swing
GRIP_UNSURE_RAD = 0.05  # a grip learnt so far off its default is known half as well: the arms' angles tell less


@compiled
def _reached_for(body: Record, k: int) -> float:
    """Turn to the left [rad] that brings the shoulder of one side nearer to a hand too far away."""
    away = away_from_rest(body, k)
    distance = g.norm(away)
    too_far = distance / body.arm_length - REACHED_TOO_FAR
    if too_far <= 0.0:
        return 0.0
    side = body.half_width if k == 1 else -body.half_width
    return float(REACH_GAIN * too_far * -side * away[2] / (distance * body.arm_length))


@compiled
def give_way(body: Record, tracking: Record, arms: Record, elapsed_s: float) -> None:
    """Let the trunk of the next frame give way to the arms of this one; hands that are not seen ask for nothing."""
    turn = g.norm(g.vector(body.grip.turn)) / GRIP_UNSURE_RAD
    room_gain = ROOM_GAIN / (1.0 + turn * turn)
    bend, yaw = 0.0, 0.0
    for k in range(2):
        if tracking.hands[k].position_age_s == 0.0:
            if arms[k].work.orientation_error_rad < ENOUGH_RAD:  # else it is the grip that is wrong, or the wrist's end
                bend += room_gain * arms[k].relief[0]
                yaw += room_gain * arms[k].relief[1]
            if not body.learning.arms:  # else an arm that is too short is taken for a longer one
                yaw += _reached_for(body, k)
    share = g.smoothstep(body.since_s / SETS_IN_S)
    asked = (share * bend, share * yaw, 0.0)
    asked = g.scale(min(1.0, GIVES_AT_MOST_RAD / max(g.norm(asked), 1e-9)), asked)
    follow(body.gives, asked, GIVES_TIME_S, body.since_s, elapsed_s)
