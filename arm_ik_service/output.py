"""What goes out: one flat record an avatar, and how it becomes an ArmsState.

The record is read with a single `struct` call; its slices are the tuples of the message. No numpy scalar is made.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

from arm_ik_service.arm.model import LIMITS
from arm_ik_service.compiled import Record, compiled, record_dtype
from arm_ik_service.geometry import scalar as g
from arm_ik_service.wire.messages import (
    VERSION,
    ArmsState,
    ArmState,
    Bones,
    IsbShoulder,
    JointAngles,
    Pose,
    TrackingState,
)

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
    ("position_state", np.int64),
    ("rotation_state", np.int64),
    ("iterations", np.int64),
    ("limits", np.int64),
]
OUTPUT = record_dtype([("chest", *_POSE), ("head", *_POSE), ("arms", record_dtype(_ARM_FIELDS), (2,))])

_ARM_FLOATS, _ARM_INTEGERS = 72, 5
_LAYOUT = struct.Struct("=14d" + f"{_ARM_FLOATS}d{_ARM_INTEGERS}q" * 2)
assert _LAYOUT.size == OUTPUT.itemsize

_STATES: tuple[TrackingState, ...] = ("lost", "held", "inferred", "tracked")


@compiled
def store_pose(out: Any, position: g.Vector, rotation: g.Quaternion) -> None:
    """Write a pose (7,) x y z qx qy qz qw in place."""
    for i in range(3):
        out[i] = position[i]
    for i in range(4):
        out[3 + i] = rotation[i]


@compiled
def write_output(out: Record, tracking: Record, body: Record, arms: Any) -> None:
    """Gather one avatar's published state in world axes; residuals are against the raw, unclamped target."""
    chest = g.quaternion(body.chest_rotation)
    store_pose(out.chest, g.vector(body.chest_position), chest)
    store_pose(out.head, g.vector(body.head_position), g.quaternion(body.head_rotation))
    for side in range(2):
        arm, written, hand = arms[side], out.arms[side], tracking.hands[side]
        shoulder = g.vector(body.shoulders[side])
        wrist = g.add(shoulder, g.rotate(chest, g.vector(arm.wrist)))
        hand_rotation = g.multiply(chest, g.quaternion(arm.hand_rotation))
        store_pose(
            written.clavicle, g.vector(body.clavicles[side].position), g.quaternion(body.clavicles[side].rotation)
        )
        store_pose(written.upper_arm, shoulder, g.multiply(chest, g.quaternion(arm.upper_arm_rotation)))
        store_pose(
            written.forearm,
            g.add(shoulder, g.rotate(chest, g.vector(arm.elbow))),
            g.multiply(chest, g.quaternion(arm.forearm_rotation)),
        )
        store_pose(written.hand, wrist, hand_rotation)
        asked = body.wrists[side]
        written.position_error_m = g.norm(g.subtract(g.vector(asked.position), wrist))
        written.orientation_error_rad = g.norm(
            g.log(g.multiply(g.conjugate(g.quaternion(asked.rotation)), hand_rotation))
        )
        written.configuration[:] = arm.published
        written.velocity[:] = arm.velocity
        written.angles[:] = arm.angles
        written.angle_rates[:] = arm.angle_rates
        written.isb[:] = arm.isb
        written.isb_singular = arm.isb_singular
        written.reach_ratio = body.reach_ratio[side]
        written.elbow_confidence = arm.elbow_confidence
        written.position_state = hand.position_state
        written.rotation_state = hand.rotation_state
        written.iterations = arm.iterations
        written.limits = arm.limits


_limit_tuples: dict[int, tuple[str, ...]] = {}


def _limits(mask: int) -> tuple[str, ...]:
    """Return the names of the set bits; each combination is built once."""
    names = _limit_tuples.get(mask)
    if names is None:
        names = tuple(name for bit, name in enumerate(LIMITS) if mask >> bit & 1)
        _limit_tuples[mask] = names
    return names


def _pose(flat: tuple[Any, ...], at: int) -> Pose:
    return Pose(flat[at : at + 3], flat[at + 3 : at + 7])


def _arm_state(flat: tuple[Any, ...], at: int) -> ArmState:
    plane, elevation, axial = flat[at + 37 : at + 40]
    position_error, orientation_error, reach_ratio, confidence = flat[at + 68 : at + 72]
    singular, position_state, rotation_state, iterations, limits = flat[at + 72 : at + 77]
    return ArmState(
        tracking=_STATES[min(position_state, rotation_state)],
        position_tracking=_STATES[position_state],
        orientation_tracking=_STATES[rotation_state],
        configuration=flat[at : at + 10],
        velocity=flat[at + 10 : at + 19],
        angles=JointAngles(*flat[at + 19 : at + 28]),
        angle_rates=JointAngles(*flat[at + 28 : at + 37]),
        isb_shoulder=IsbShoulder(plane, elevation, axial, singular != 0),
        bones=Bones(_pose(flat, at + 40), _pose(flat, at + 47), _pose(flat, at + 54), _pose(flat, at + 61)),
        position_error_m=position_error,
        orientation_error_rad=orientation_error,
        reach_ratio=reach_ratio,
        iterations=iterations,
        limits=_limits(limits),
        elbow_confidence=confidence,
    )


def read_output(
    outputs: np.ndarray[Any, Any],
    index: int,
    *,
    avatar: str,
    seq: int,
    sample_time_ns: int,
    receive_time_ns: int,
    solve_time_ns: int,
    publish_time_ns: int,
) -> ArmsState:
    """Return the message that the record `outputs[index]` of dtype OUTPUT holds."""
    flat = _LAYOUT.unpack_from(outputs.data, index * OUTPUT.itemsize)
    return ArmsState(
        version=VERSION,
        avatar=avatar,
        seq=seq,
        sample_time_ns=sample_time_ns,
        receive_time_ns=receive_time_ns,
        solve_time_ns=solve_time_ns,
        publish_time_ns=publish_time_ns,
        chest=_pose(flat, 0),
        head=_pose(flat, 7),
        left=_arm_state(flat, 14),
        right=_arm_state(flat, 14 + _ARM_FLOATS + _ARM_INTEGERS),
    )
