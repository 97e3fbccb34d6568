"""Compiling the solver before the first pose, and saying so the first time, when it takes seconds."""

from __future__ import annotations

from collections.abc import Callable
from threading import Timer
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from arm_ik_service.settings import Settings

SAY_AFTER_S = 1.2  # loading compiled code from the cache takes less


def warm_up(settings: Settings, say: Callable[[str], None]) -> None:
    """Run the whole pipeline once on a made-up frame, so that every function is compiled or loaded."""
    note = Timer(SAY_AFTER_S, say, ["compiling the solver: once after an installation, some 15 to 30 s ..."])
    note.daemon = True
    note.start()
    try:
        from arm_ik_service.avatar import Avatar
        from arm_ik_service.wire.messages import VERSION, ControllerFrame, TrackedPose

        pose = TrackedPose((0.0, 1.6, 0.0), (0.0, 0.0, 0.0, 1.0))
        frame = ControllerFrame(VERSION, 0, 0, 0, "stage", pose, None, None)
        Avatar(settings=settings).step(frame, now_ns=0)
    finally:
        note.cancel()
