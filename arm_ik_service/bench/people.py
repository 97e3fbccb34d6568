"""A made-up person for measurements of the service: no two frames ask the same of the arms."""

from __future__ import annotations

import math
import time

from arm_ik_service.wire.messages import VERSION, ControllerFrame, TrackedPose


def moving(seq: int, rate_hz: float) -> ControllerFrame:
    """Return frame `seq` of a person who waves both hands up to 0.6 m/s: every frame is work for the solver."""
    t = seq / rate_hz
    level = (0.0, 0.0, 0.0, 1.0)
    wave = 0.2 * math.sin(3.0 * t)
    return ControllerFrame(
        version=VERSION,
        seq=seq,
        sample_time_ns=int(t * 1e9),
        publish_time_ns=time.time_ns(),
        space="stage",
        head=TrackedPose((0.02 * wave, 1.6, 0.0), level),
        left=TrackedPose((-0.25, 1.1 + wave, -0.35), level),
        right=TrackedPose((0.25, 1.1 - wave, -0.35), level),
    )
