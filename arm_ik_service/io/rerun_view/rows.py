"""A frame and its answer as one flat row of numbers, and the rows of a while as the arrays that are logged.

Rows are gathered and sent together: one call an entity costs the same for one row as for a thousand.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from arm_ik_service.wire.messages import (
    ORIENTATION_VALID,
    POSITION_VALID,
    SIDES,
    ArmsState,
    ArmState,
    ControllerFrame,
    JointAngles,
    Pose,
    TrackedPose,
    TrackingState,
)

Floats = npt.NDArray[np.float64]

ANGLES: tuple[str, ...] = JointAngles.__struct_fields__
BONES = ("upper_arm", "forearm", "hand")
RESTS = ("shoulder_swing", *ANGLES[2:])  # names in ArmState.limits of the limits an arm rests on
LATENCIES = ("network", "solve", "total")

_VALID = ORIENTATION_VALID | POSITION_VALID
_NAN = math.nan
_NO_TARGET = (_NAN,) * 7


def _layout() -> tuple[dict[str, slice], int]:
    sizes = [("chest", 7), ("head", 7), ("latency_ms", len(LATENCIES))]
    for side in SIDES:
        sizes += [(f"{side}/{bone}", 7) for bone in BONES]
        sizes += [(f"{side}/target", 7), (f"{side}/angles", 9), (f"{side}/rates", 9), (f"{side}/residual_mm", 1)]
        sizes += [(f"{side}/rests", len(RESTS))]
    places, start = {}, 0
    for name, size in sizes:
        places[name] = slice(start, start + size)
        start += size
    return places, start


PLACES, WIDTH = _layout()


def _pose(pose: Pose) -> tuple[float, ...]:
    return (*pose.position, *pose.orientation)


def _target(pose: TrackedPose | None) -> tuple[float, ...]:
    if pose is None or pose.flags & _VALID != _VALID:
        return _NO_TARGET
    return (*pose.position, *pose.orientation)


def _angles(angles: JointAngles) -> tuple[float, ...]:
    return (
        angles.shoulder_flexion,
        angles.shoulder_abduction,
        angles.shoulder_twist,
        angles.elbow_flexion,
        angles.elbow_carrying,
        angles.pronation,
        angles.wrist_flexion,
        angles.wrist_deviation,
        angles.wrist_axial,
    )


@lru_cache(maxsize=1024)  # few combinations occur
def _rests(limits: tuple[str, ...]) -> tuple[float, ...]:
    return tuple(float(name in limits) for name in RESTS)


def _arm(arm: ArmState, target: TrackedPose | None) -> tuple[float, ...]:
    bones = arm.bones
    return (
        *_pose(bones.upper_arm),
        *_pose(bones.forearm),
        *_pose(bones.hand),
        *_target(target),
        *_angles(arm.angles),
        *_angles(arm.angle_rates),
        1e3 * arm.position_error_m,
        *_rests(arm.limits),
    )


def _latency_ms(frame: ControllerFrame | None, arms: ArmsState) -> tuple[float, float, float]:
    """Network, solve, total; NaN where no clock was read, which is a 0 in the message: a session solved offline."""
    if arms.publish_time_ns == 0:
        return _NAN, _NAN, _NAN
    solve = 1e-6 * arms.solve_time_ns
    if frame is None or frame.publish_time_ns == 0:
        return _NAN, solve, _NAN
    sent = frame.publish_time_ns
    return 1e-6 * (arms.receive_time_ns - sent), solve, 1e-6 * (arms.publish_time_ns - sent)


def row_of(frame: ControllerFrame | None, arms: ArmsState) -> tuple[float, ...]:
    """Flatten to WIDTH numbers, laid out as PLACES says. A target that is absent or not valid is NaN."""
    left, right = (frame.left, frame.right) if frame is not None else (None, None)
    return (
        *_pose(arms.chest),
        *_pose(arms.head),
        *_latency_ms(frame, arms),
        *_arm(arms.left, left),
        *_arm(arms.right, right),
    )


@dataclass
class Rows:
    """What has been gathered of one avatar and not yet been sent."""

    frames: list[int] = field(default_factory=list)
    times_ns: list[int] = field(default_factory=list)
    values: list[tuple[float, ...]] = field(default_factory=list)
    states: list[tuple[TrackingState, TrackingState]] = field(default_factory=list)

    def add(self, frame: ControllerFrame | None, arms: ArmsState) -> None:
        """Append a row."""
        self.frames.append(arms.seq)
        self.times_ns.append(arms.sample_time_ns)
        self.values.append(row_of(frame, arms))
        self.states.append((arms.left.tracking, arms.right.tracking))

    def __len__(self) -> int:
        return len(self.frames)
