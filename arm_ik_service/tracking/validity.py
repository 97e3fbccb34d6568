"""Which parts of a sample can be believed at all: the flags, and numbers that a pose can have."""

from __future__ import annotations

import math
from typing import Any

from arm_ik_service.compiled import Record, compiled
from arm_ik_service.tracking.state import INFERRED, LOST, TRACKED
from arm_ik_service.wire.messages import (
    ORIENTATION_TRACKED,
    ORIENTATION_VALID,
    POSITION_TRACKED,
    POSITION_VALID,
)

FARTHEST_M = 1000.0  # from the origin, along each axis: no tracked space is larger, and float32 still resolves 0.1 mm
NORM_TOLERANCE = 0.02  # of a quaternion; rounded to two decimals it is off by at most this


@compiled
def _position_is_plausible(position: Any) -> bool:
    farthest = FARTHEST_M
    return bool(abs(position[0]) <= farthest and abs(position[1]) <= farthest and abs(position[2]) <= farthest)


@compiled
def _rotation_is_plausible(rotation: Any) -> bool:
    x, y, z, w = rotation[0], rotation[1], rotation[2], rotation[3]
    if not (abs(x) < 2.0 and abs(y) < 2.0 and abs(z) < 2.0 and abs(w) < 2.0):
        return False
    return bool(abs(math.sqrt(x * x + y * y + z * z + w * w) - 1.0) <= NORM_TOLERANCE)


@compiled
def _was_filled_in(sample: Record) -> bool:
    """Senders that have nothing yet send a pose of zeros; one that is real has a rotation."""
    position = sample.position
    at_origin = position[0] == 0.0 and position[1] == 0.0 and position[2] == 0.0
    return not at_origin or _rotation_is_plausible(sample.rotation)


@compiled
def position_quality(sample: Record) -> int:
    """TRACKED, INFERRED (valid only: dead-reckoned, or a guess of the runtime) or LOST, for the position."""
    if sample.location_flags & POSITION_VALID == 0 or not _position_is_plausible(sample.position):
        return LOST
    if not _was_filled_in(sample):
        return LOST
    return TRACKED if sample.location_flags & POSITION_TRACKED else INFERRED


@compiled
def rotation_quality(sample: Record) -> int:
    """TRACKED, INFERRED or LOST, for the orientation of a sample."""
    if sample.location_flags & ORIENTATION_VALID == 0 or not _rotation_is_plausible(sample.rotation):
        return LOST
    return TRACKED if sample.location_flags & ORIENTATION_TRACKED else INFERRED
