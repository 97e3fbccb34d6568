"""What goes out, as one flat record an avatar: 64 bits a number, so that it is an array of numbers as well."""

from __future__ import annotations

from typing import Any

import numpy as np

from arm_ik_service.compiled import Record, compiled, record_dtype
from arm_ik_service.geometry import scalar as g

_POSE = np.float64, (7,)
_ARM_FIELDS: list[tuple[Any, ...]] = [
    ("configuration", np.float64, (10,)),
    ("velocity", np.float64, (9,)),
    ("angles", np.float64, (9,)),
    ("angle_rates", np.float64, (9,)),
    ("isb", np.float64, (3,)),
    ("clavicle", *_POSE),
    ("upper_arm", *_POSE),
    ("forearm", *_POSE),
    ("hand", *_POSE),
    ("position_error_m", np.float64),
    ("orientation_error_rad", np.float64),
    ("reach_ratio", np.float64),
    ("elbow_confidence", np.float64),
    ("isb_singular", np.int64),
    ("state", np.int64),  # the worse of the next two
    ("position_state", np.int64),
    ("rotation_state", np.int64),
    ("iterations", np.int64),
    ("limits", np.int64),
]
OUTPUT = record_dtype([("chest", *_POSE), ("head", *_POSE), ("arms", record_dtype(_ARM_FIELDS), (2,))])


@compiled
def write_output(out: Record, tracking: Record, body: Record, arms: Any) -> None:
    """Gather one avatar's published state in world axes; residuals are against the raw, unclamped target."""
    chest = g.quaternion(body.chest_rotation)
    g.store_pose(out.chest, g.vector(body.chest_position), chest)
    g.store_pose(out.head, g.vector(body.head_position), g.quaternion(body.head_rotation))
    for side in range(2):
        arm, written, hand = arms[side], out.arms[side], tracking.hands[side]
        shoulder = g.vector(body.shoulders[side])
        wrist = g.add(shoulder, g.rotate(chest, g.vector(arm.wrist)))
        hand_rotation = g.multiply(chest, g.quaternion(arm.hand_rotation))
        g.store_pose(
            written.clavicle, g.vector(body.clavicles[side].position), g.quaternion(body.clavicles[side].rotation)
        )
        g.store_pose(written.upper_arm, shoulder, g.multiply(chest, g.quaternion(arm.upper_arm_rotation)))
        g.store_pose(
            written.forearm,
            g.add(shoulder, g.rotate(chest, g.vector(arm.elbow))),
            g.multiply(chest, g.quaternion(arm.forearm_rotation)),
        )
        g.store_pose(written.hand, wrist, hand_rotation)
        asked = body.wrists[side]
        written.position_error_m = g.norm(g.subtract(g.vector(asked.position), wrist))
        written.orientation_error_rad = g.norm(
            g.log(g.multiply(g.conjugate(g.quaternion(asked.rotation)), hand_rotation))
        )
        g.store(written.configuration, arm.published)
        g.store(written.velocity, arm.velocity)
        g.store(written.angles, arm.angles)
        g.store(written.angle_rates, arm.angle_rates)
        g.store(written.isb, arm.isb)
        written.isb_singular = arm.isb_singular
        written.reach_ratio = body.reach_ratio[side]
        written.elbow_confidence = arm.elbow_confidence
        written.state = min(hand.position_state, hand.rotation_state)
        written.position_state = hand.position_state
        written.rotation_state = hand.rotation_state
        written.iterations = arm.iterations
        written.limits = arm.limits
