"""The body stage: tracked devices in; chest, shoulders and what is asked of each arm out."""

from __future__ import annotations

import numpy as np

from arm_ik_service.body.chest import step_chest
from arm_ik_service.body.grip import initialise_grip, mirrored_turn
from arm_ik_service.body.learning import initialise_learning, learn
from arm_ik_service.body.profile import Profile
from arm_ik_service.body.reach import soft_reach
from arm_ik_service.body.shoulders import settle, step_shoulder
from arm_ik_service.body.state import BODY
from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import batch
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Vector

LONGEST_STEP_S = 0.1  # a gap in the data is not time in which the body was seen to move


def initialise_body(body: Record, profile: Profile) -> None:
    """Set a BODY record to the measures of `profile`; its pose follows from the first frame."""
    for name in BODY.names or ():
        body[name] = np.zeros((), BODY[name])
    body.upper_arm, body.forearm = profile.body.upper_arm, profile.body.forearm
    body.arm_length = body.upper_arm + body.forearm
    body.half_width = 0.5 * profile.body.shoulder_width
    initialise_learning(body, profile)
    initialise_grip(body.grip, profile)
    for k, offset in enumerate((profile.grip.left, profile.grip.right)):
        body.wrist_in_grip[k] = batch.conjugate(batch.normalized(offset.orientation_xyzw))
        body.grip_in_wrist[k] = offset.position_m
    for q in (body.head_rotation, body.chest_rotation):
        q[:] = g.IDENTITY
    for k in range(2):
        for pose_record in (body.clavicles[k], body.wrists[k], body.targets[k]):
            pose_record.rotation[:] = g.IDENTITY


@compiled
def _place_wrist(body: Record, tracking: Record, k: int) -> None:
    hand = tracking.hands[k]
    assumed = g.multiply(g.quaternion(hand.rotation), g.quaternion(body.wrist_in_grip[k]))
    rotation = g.multiply(assumed, g.exp(mirrored_turn(g.vector(body.grip.turn), k)))
    # the grip stays where it is in the hand, however that is turned
    offset = g.rotate(rotation, g.vector(body.grip_in_wrist[k]))
    g.store(body.wrists[k].position, g.subtract(g.vector(hand.position), offset))
    g.store(body.wrists[k].rotation, g.normalized(rotation))


@compiled
def _set_target(body: Record, k: int, shoulder_before: Vector, dt_s: float, settings: Record) -> None:
    target, wrist = body.targets[k], body.wrists[k]
    shoulder_from_world = g.conjugate(g.quaternion(body.chest_rotation))
    away = g.subtract(g.vector(wrist.position), g.vector(body.shoulders[k]))
    ratio = g.norm(away) / body.arm_length
    granted = soft_reach(ratio, settings.soft_reach_from) / max(ratio, 1e-9)
    position = g.rotate(shoulder_from_world, g.scale(granted, away))
    rotation = g.normalized(g.multiply(shoulder_from_world, g.quaternion(wrist.rotation)))
    if body.started and dt_s > 0.0:
        rate = 1.0 / dt_s
        moved = g.subtract(position, g.vector(target.position))
        turned = g.log(g.multiply(rotation, g.conjugate(g.quaternion(target.rotation))))
        carried = g.rotate(shoulder_from_world, g.subtract(g.vector(body.shoulders[k]), shoulder_before))
        g.store(target.linear_velocity, g.scale(rate, moved))
        g.store(target.carried_linear_velocity, g.scale(rate, carried))
        g.store(target.carried_angular_velocity, (0.0, body.yaw_rate, 0.0))  # what tilts is slow
        g.store(target.angular_velocity, g.scale(rate, turned))
    body.reach_ratio[k] = ratio
    g.store(target.position, position)
    g.store(target.rotation, rotation)


@compiled
def step_body(body: Record, tracking: Record, settings: Record) -> None:
    """Place the person in the BODY record for the devices of the TRACKING record. Always finite."""
    g.store(body.head_position, g.vector(tracking.head.position))
    g.store(body.head_rotation, g.quaternion(tracking.head.rotation))
    dt_s = tracking.interval_s if tracking.dt_s > 0.0 else 0.0
    elapsed_s = min(tracking.interval_s, LONGEST_STEP_S)
    for k in range(2):
        _place_wrist(body, tracking, k)
    step_chest(body, tracking, elapsed_s)
    if settings.learns and body.learning.arms:
        learn(body, tracking, elapsed_s)
    for k in range(2):
        if tracking.hands[k].position_age_s == 0.0 and tracking.head.position_age_s == 0.0:  # both are seen
            settle(body, k, elapsed_s)
        shoulder_before = g.vector(body.shoulders[k])
        step_shoulder(body, k)
        _set_target(body, k, shoulder_before, dt_s, settings)
    body.since_s += elapsed_s if body.started else 0.0
    body.started = 1
