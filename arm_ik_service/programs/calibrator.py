"""Measuring a person: frames from a recording or from the bus, and what the calibration makes of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from arm_ik_service.calibration.calibrate import Calibration, Method
from arm_ik_service.errors import CalibrationError, WireError
from arm_ik_service.io.zenoh_streams import Bus, subscribe
from arm_ik_service.tracking.frame import FRAME, pack_frame
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys
from arm_ik_service.wire.messages import ControllerFrame

POSES: dict[Method, str] = {
    "t_pose": "stand straight, arms out to the sides, level, palms down; hold still",
    "a_pose": "stand straight, arms half way down to the sides, palms in; hold still",
    "moving": "move about: reach out to the front, up, down and to the sides, and turn",
}


def as_records(frames: Iterable[ControllerFrame]) -> np.ndarray[Any, Any]:
    """Return frames as one array of FRAME records (N,)."""
    kept = list(frames)
    records = np.zeros(len(kept), FRAME)
    buffer = records.view(np.uint8).data
    for index, frame in enumerate(kept):
        pack_frame(frame, buffer, index * FRAME.itemsize)
    return records


def gather_live(
    bus: Bus, avatar: str, seconds: float, keys: Keys, progress: Callable[[float], None] | None = None
) -> list[ControllerFrame]:
    """Listen to one avatar's controllers for so long. Raises CalibrationError where nothing is heard."""
    frames: list[ControllerFrame] = []

    def take(_key: str, payload: bytes, _time_ns: int) -> None:
        try:
            frames.append(codec.controller_frames.decode(payload))
        except WireError:
            return  # the service counts what is malformed

    subscriber: Any = subscribe(bus, keys.controllers(avatar), take)
    began_s = time.monotonic()
    while (elapsed_s := time.monotonic() - began_s) < seconds:
        time.sleep(min(0.1, seconds - elapsed_s))
        if progress is not None:
            progress(min(seconds, time.monotonic() - began_s))
    subscriber.undeclare()
    if not frames:
        raise CalibrationError(f"no frame came on {keys.controllers(avatar)}: is the headset bridge running?")
    return frames


def describe(calibration: Calibration) -> list[str]:
    """Return what was found in sentences, and how sure it is."""
    body = calibration.profile.body
    how = {"t_pose": "a T-pose", "a_pose": "an A-pose", "moving": "movement"}[calibration.method]
    return [
        f"from {how}, {calibration.seconds:.1f} s",
        f"stature {body.stature_m:.2f} m, give or take {100 * calibration.stature_deviation_m:.0f} cm",
        f"upper arm {body.upper_arm:.3f} m, forearm {body.forearm:.3f} m, "
        f"together give or take {100 * calibration.arm_length_deviation_m:.1f} cm",
        f"shoulders {body.shoulder_width:.2f} m apart",
        *calibration.notes,
    ]
