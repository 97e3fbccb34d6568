"""A controller frame as one flat record, the form in which compiled code takes it in."""

from __future__ import annotations

import struct

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

_HEADER = struct.Struct("=2q")
_SAMPLE = struct.Struct("=13d2q")
_HEAD, _LEFT, _RIGHT = (_HEADER.size + n * _SAMPLE.size for n in range(3))
assert _RIGHT + _SAMPLE.size == FRAME.itemsize
_ABSENT = _SAMPLE.pack(*(0.0,) * 6, 1.0, *(0.0,) * 6, 0, 0)
_NO_VELOCITY = (0.0, 0.0, 0.0)


def _pack_sample(pose: TrackedPose | None, buffer: memoryview, at: int) -> None:
    if pose is None:
        buffer[at : at + _SAMPLE.size] = _ABSENT
        return
    linear, angular = pose.linear_velocity, pose.angular_velocity
    _SAMPLE.pack_into(
        buffer,
        at,
        *pose.position,
        *pose.orientation,
        *(linear or _NO_VELOCITY),
        *(angular or _NO_VELOCITY),
        pose.flags,
        (linear is not None) | (angular is not None) << 1,
    )


def pack_frame(frame: ControllerFrame, buffer: memoryview, at: int = 0) -> None:
    """Write a decoded message as a record of dtype FRAME into bytes, from byte `at` on.

    The bytes of an array of records are `records.view(np.uint8).data`. Not `records.data`: numpy spells out the whole
    dtype for it, which takes ten times as long as the rest.
    """
    _HEADER.pack_into(buffer, at, frame.seq, frame.sample_time_ns)
    _pack_sample(frame.head, buffer, at + _HEAD)
    _pack_sample(frame.left, buffer, at + _LEFT)
    _pack_sample(frame.right, buffer, at + _RIGHT)
