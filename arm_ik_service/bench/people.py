"""A made-up person for measurements of the service: the boxer of the bundled recording, there and back for ever.

The wrists are ones that a person has, as controllers in a player's hands report them; poses that no wrist reaches, such
as level grips before the chest, would make the solver use up its budget in every frame. The service and what it is held
against, the empty service and the echo, get the same frames.
"""

from __future__ import annotations

import time
from functools import cache

import numpy as np

from arm_ik_service.geometry.batch import Array
from arm_ik_service.io.synthesis.boxing import boxing
from arm_ik_service.io.synthesis.person import pose_person
from arm_ik_service.wire.messages import VERSION, ControllerFrame, TrackedPose

ONE_WAY_S = 14.5  # hands that hang still, a round of punches, hands that hang still

_Devices = tuple[TrackedPose, TrackedPose, TrackedPose]


@cache
def _devices(rate_hz: float) -> list[_Devices]:
    """Return head, left and right of a whole round: backwards it ends where it began."""
    poses = pose_person(boxing(np.arange(round(ONE_WAY_S * rate_hz)) / rate_hz))
    there = list(zip(*(_tracked(device) for device in (poses.head, poses.left, poses.right)), strict=True))
    return there + there[-2:0:-1]


def _tracked(poses: Array) -> list[TrackedPose]:
    return [TrackedPose((x, y, z), (qx, qy, qz, qw)) for x, y, z, qx, qy, qz, qw in poses.tolist()]


def moving(seq: int, rate_hz: float) -> ControllerFrame:
    """Return frame `seq` of a person who boxes."""
    devices = _devices(rate_hz)
    head, left, right = devices[seq % len(devices)]
    return ControllerFrame(
        version=VERSION,
        seq=seq,
        sample_time_ns=int(seq / rate_hz * 1e9),
        publish_time_ns=time.time_ns(),
        space="stage",
        head=head,
        left=left,
        right=right,
    )
