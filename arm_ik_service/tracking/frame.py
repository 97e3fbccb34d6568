"""A controller frame as one flat record, the form in which compiled code takes it in."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

from arm_ik_service.compiled import record_dtype
from arm_ik_service.wire.messages import ControllerFrame, TrackedPose

SAMPLE = record_dtype(
    [
        ("position", np.float64, (3,)),
        ("rotation", np.float64, (4,)),
        ("linear_velocity", np.float64, (3,)),
        ("angular_velocity", np.float64, (3,)),
        ("location_flags", np.int64),  # XrSpaceLocationFlags; 0 where the device is absent
        ("velocity_flags", np.int64),  # XrSpaceVelocityFlags: 1 linear valid, 2 angular valid
    ]
)
FRAME = record_dtype(
    [
        ("seq", np.int64),
        ("sample_time_ns", np.int64),
        ("head", SAMPLE),
        ("hands", SAMPLE, (2,)),  # left, right
    ]
)

_LAYOUT = struct.Struct("=2q" + "13d2q" * 3)
assert _LAYOUT.size == FRAME.itemsize
_ABSENT = (0.0,) * 6 + (1.0,) + (0.0,) * 6 + (0, 0)
_NO_VELOCITY = (0.0, 0.0, 0.0)


def _flat(pose: TrackedPose | None) -> tuple[float, ...]:
    if pose is None:
        return _ABSENT
    linear, angular = pose.linear_velocity, pose.angular_velocity
    return (
        *pose.position,
        *pose.orientation,
        *(linear or _NO_VELOCITY),
        *(angular or _NO_VELOCITY),
        pose.flags,
        (linear is not None) | (angular is not None) << 1,
    )


def pack_frame(frame: ControllerFrame, frames: np.ndarray[Any, Any], index: int) -> None:
    """Write a decoded message into `frames[index]` of dtype FRAME; one packing call, no numpy scalar."""
    _LAYOUT.pack_into(
        frames.data,
        index * FRAME.itemsize,
        frame.seq,
        frame.sample_time_ns,
        *_flat(frame.head),
        *_flat(frame.left),
        *_flat(frame.right),
    )
