"""Where the chest is and which way it faces, from head and hands over time.

Constants marked (fit) minimise, on the CMU and Xia recordings alone and with equal weight for each of their four
people, the distance to the recorded shoulders [cm] and half of what the shoulders' jerk exceeds the recorded one by.
The optimum is flat: of its neighbours within 0.1 cm those are taken that do as well on a person left out of the fit.
"""

from __future__ import annotations

import math

from arm_ik_service.body.follow import follow, predicted_follow, settled_time, start_at
from arm_ik_service.body.state import ARM_LENGTH_OF_FIT
from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.follower import followed_rate
from arm_ik_service.geometry.scalar import Quaternion, Vector

NECK_PIVOT_IN_HEAD: Vector = (0.0, -0.165, 0.13)  # what the head turns on [m], in OpenXR VIEW axes (fit)
SHOULDER_DROP = 0.26  # of the shoulders below that pivot, in half shoulder widths (fit)
PITCH_SHARE = 0.2  # of the head's pitch that the chest takes part in (fit)
ROLL_SHARE = 0.45  # the same for roll (fit)

# The chest faces along a sum of horizontal directions: the head's, of length 1, and those below. They cannot outweigh
# it, so no hands turn the chest's back to the face; arms in want of room turn it farther (see body.trunk). The elbows
# tell more than the hands: they hang on the shoulders, and a wrist is rarely bent far, so the hand's own direction
# shows where its elbow is to 5 cm.
ELBOW_IN_WRIST: Vector = (0.0, 0.2, 0.44)  # in arm lengths: a forearm along, for a hand as it is held beside (fit)
HAND_PULL = 0.1  # from the neck to each hand, in arm lengths, at most 1 (fit)
ELBOWS_LINE_PULL = 0.75  # perpendicular to the line between the elbows, in arm lengths, at most 1 (fit)
FOREARMS_TIME_S = 0.03  # by which the elbows trail behind the hands' turning, on the chest (fit)
FACING_TIME_S = 0.02  # by which the chest trails a steady turn (fit)
TRUST_TIME_S = 0.15  # in which a lost hand ceases to say where the chest faces, and one that is back begins to
SURE_FACING = 0.5  # a shorter sum says little about the direction: the chest follows less
FASTEST_TURN_RAD_S = 25.0  # of a chest; a skater's pirouette is 30, a dancer's 15
NECK_TIME_S = 0.025  # of the neck's fading memory (fit)
TILT_TIME_S = 0.05  # by which pitch and roll of the chest trail the head's (fit)
LARGEST_TURN_RAD = 0.33  # in a frame, whatever its length ...
RECENTRED_RAD = 0.5  # ... unless the space turned by more than this: less may be the pop of a whole recording


@compiled
def _pull(weight: float, x: float, z: float, arm_length: float) -> Vector:
    """Horizontal vector of length `weight` for an arm's length and more, in proportion below."""
    s = weight / max(math.sqrt(x * x + z * z), arm_length)
    return (s * x, 0.0, s * z)


@compiled
def _step_forearms(body: Record, yaw: float, elapsed_s: float) -> None:
    """Update where each elbow is by the hand alone. A wrist that flicks turns no chest, one that stays bent does."""
    upright = g.rotation_y(-yaw)
    for k in range(2):
        to_elbow = g.scale(body.arm_length, ELBOW_IN_WRIST)
        to_elbow = g.rotate(g.multiply(upright, g.quaternion(body.wrists[k].rotation)), to_elbow)
        if body.started == 0:
            start_at(body.forearms[k], to_elbow)
        follow(body.forearms[k], to_elbow, FOREARMS_TIME_S, body.since_s, elapsed_s)


@compiled
def _trust(body: Record, tracking: Record, elapsed_s: float) -> None:
    """Update how far each hand is trusted: one that is lost stays behind where the person was."""
    share = 1.0 - math.exp(-elapsed_s / TRUST_TIME_S)
    for k in range(2):
        seen = 1.0 if tracking.hands[k].position_age_s == 0.0 else 0.0
        body.trust[k] = seen if body.started == 0 else body.trust[k] + share * (seen - body.trust[k])


@compiled
def facing(body: Record, neck: Vector, head: Quaternion, yaw: float) -> Vector:
    """Horizontal direction the chest, now at `yaw`, would face if it had the time; shorter where that is less sure."""
    hands = g.subtract(g.vector(body.wrists[1].position), g.vector(body.wrists[0].position))
    forearms = g.subtract(g.vector(body.forearms[1].at), g.vector(body.forearms[0].at))
    line = g.add(hands, g.rotate(g.rotation_y(yaw), forearms))
    both = min(body.trust[0], body.trust[1])
    total = g.add(g.heading(head), _pull(both * ELBOWS_LINE_PULL, line[2], -line[0], body.arm_length))
    for k in range(2):
        away = g.subtract(g.vector(body.wrists[k].position), neck)
        total = g.add(total, _pull(body.trust[k] * HAND_PULL, away[0], away[2], body.arm_length))
    return total


@compiled
def _turn(body: Record, direction: Vector, recentred: float, elapsed_s: float) -> None:
    yaw = math.atan2(-direction[0], -direction[2])
    if body.started == 0:
        body.yaw = yaw
        return
    sure = min(g.norm(direction) / SURE_FACING, 1.0)
    away = sure * g.wrap(yaw + body.gives.at[1] - body.yaw - recentred)
    body.yaw_rate = followed_rate(body.yaw_rate, away, settled_time(FACING_TIME_S, body.since_s), elapsed_s)
    body.yaw_rate = g.clip(body.yaw_rate, -FASTEST_TURN_RAD_S, FASTEST_TURN_RAD_S)
    turn = recentred + body.yaw_rate * elapsed_s
    if abs(recentred) < RECENTRED_RAD:
        turn = g.clip(turn, -LARGEST_TURN_RAD, LARGEST_TURN_RAD)
    body.yaw = g.wrap(body.yaw + turn)


@compiled
def _steady_neck(body: Record, asked: Vector, tracking: Record, elapsed_s: float) -> Vector:
    """Return the neck without its trembling."""
    if body.started == 0:
        start_at(body.neck, asked)
    elif body.recentres != tracking.recentres:  # the space was moved under it
        turn = g.rotation_y(tracking.recentred_yaw)
        away = g.rotate(turn, g.subtract(g.vector(body.neck.at), g.vector(tracking.recentred_from)))
        g.store(body.neck.at, g.add(g.vector(tracking.recentred_to), away))
        g.store(body.neck.rate, g.rotate(turn, g.vector(body.neck.rate)))
    if body.started != 0:
        predicted_follow(body.neck, asked, NECK_TIME_S, body.since_s, elapsed_s)
    body.recentres = tracking.recentres
    return g.vector(body.neck.at)


@compiled
def _tilted(body: Record, head: Quaternion, elapsed_s: float) -> Quaternion:
    """Return the rotation of the chest: its yaw, and the part of the head's pitch and roll that it takes."""
    upright = g.rotation_y(body.yaw)
    head_up = g.rotate(g.conjugate(upright), g.rotate(head, g.Y))
    asked = (ROLL_SHARE * head_up[0], 0.0, PITCH_SHARE * head_up[2] + body.gives.at[0])
    if body.started == 0:
        start_at(body.tilt, asked)
    up = g.add(g.Y, follow(body.tilt, asked, TILT_TIME_S, body.since_s, elapsed_s))
    return g.normalized(g.multiply(upright, g.between(g.Y, g.scale(1.0 / g.norm(up), up))))


@compiled
def step_chest(body: Record, tracking: Record, elapsed_s: float) -> None:
    """Update the pose of the chest from head and wrists."""
    head = g.quaternion(body.head_rotation)
    pivot = g.scale(body.arm_length / ARM_LENGTH_OF_FIT, NECK_PIVOT_IN_HEAD)
    neck = g.add(g.vector(body.head_position), g.rotate(head, pivot))
    yaw = g.wrap(body.yaw + tracking.recentred_yaw)
    _trust(body, tracking, elapsed_s)
    _step_forearms(body, yaw, elapsed_s)
    _turn(body, facing(body, neck, head, yaw), tracking.recentred_yaw, elapsed_s)
    if body.started == 0:  # in the axes that were not known before
        _step_forearms(body, body.yaw, elapsed_s)
    neck = _steady_neck(body, neck, tracking, elapsed_s)
    chest = _tilted(body, head, elapsed_s)
    drop = SHOULDER_DROP * body.half_width + body.settled
    g.store(body.chest_rotation, chest)
    g.store(body.chest_position, g.add(neck, g.rotate(chest, (0.0, -drop, 0.0))))
