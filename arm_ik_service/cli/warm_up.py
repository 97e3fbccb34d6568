"""Compiling the solver before the first pose, and saying so the first time, when it takes seconds."""

from __future__ import annotations

import gc
from collections.abc import Callable
from threading import Timer
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from arm_ik_service.settings import Settings

SAY_AFTER_S = 1.2  # loading compiled code from the cache takes less
GARBAGE = (20_000, 50, 100)  # Python's thresholds: a compiler keeps most of what it makes; 5 % of the time, 16 MB


def warm_up(settings: Settings, say: Callable[[str], None]) -> None:
    """Run on made-up numbers all that takes long to compile, so that it is compiled, or loaded from the cache.

    Where that is compiled, the solver by itself and calibration, which a service does not need, as well: they are made
    of the same parts, which are compiled once a process.
    """
    note = Timer(SAY_AFTER_S, say, ["compiling the solver: once after an installation, some 10 to 30 s ..."])
    note.daemon = True
    note.start()
    thresholds = gc.get_threshold()
    gc.set_threshold(*GARBAGE)
    try:
        from arm_ik_service.avatar import Avatar, step_batch
        from arm_ik_service.compiled import was_cached
        from arm_ik_service.wire.messages import VERSION, ControllerFrame, TrackedPose

        pose = TrackedPose((0.0, 1.6, 0.0), (0.0, 0.0, 0.0, 1.0))
        frame = ControllerFrame(VERSION, 0, 0, 0, "stage", pose, None, None)
        Avatar(settings=settings).step(frame, now_ns=0)
        if not was_cached(step_batch):
            _run_what_shares_its_parts()
    finally:
        gc.set_threshold(*thresholds)
        note.cancel()


def _run_what_shares_its_parts() -> None:
    import numpy as np

    from arm_ik_service.arm.model import ArmModel
    from arm_ik_service.body.profile import Profile
    from arm_ik_service.calibration.observation import observe
    from arm_ik_service.ik.jacobian_transpose import JacobianTranspose
    from arm_ik_service.tracking.frame import FRAME

    arm = ArmModel.load(side="right", upper_arm_m=0.3, forearm_m=0.26)
    hand = arm.forward(arm.rest)["hand"]
    solver = JacobianTranspose(arm)
    solver.solve(hand)
    solver.track(hand[None])
    observe(np.zeros(1, FRAME), Profile())
