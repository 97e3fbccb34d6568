"""What the view cannot know by itself: where on their circles the elbows of people on the bus would be comfortable."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from arm_ik_service.body.profile import RangesOfMotion
from arm_ik_service.geometry import batch
from arm_ik_service.ik.comfortable import ElbowComfort
from arm_ik_service.io.rerun_view import Arm
from arm_ik_service.wire.messages import Side, Skeleton

Floats = npt.NDArray[np.float64]

LONGEST_STEP_S = 0.1  # a pause says nothing of how a wrist is held


class ElbowComforts:
    """Calculated of published poses, arm by arm; call it with the frames of each in their order."""

    def __init__(self) -> None:
        self._arms: dict[tuple[str, Side], tuple[Skeleton, ElbowComfort]] = {}
        self._last_ns: dict[tuple[str, Side], int] = {}
        # compiled now rather than while the first frames wait
        ElbowComfort("right", 0.3, 0.26, {}).stretches(*(np.ones(shape) for shape in ((1,), (1, 9), (1, 3), (1, 7))))

    def __call__(self, skeleton: Skeleton, arm: Arm, times_ns: npt.NDArray[np.int64]) -> Floats:
        """Swivels (N,2) [rad] from the elbow, counted about the line from shoulder to wrist, that are comfortable."""
        key = (skeleton.avatar, arm.side)
        known, comfort = self._arms.get(key, (None, None))
        if comfort is None or known is not skeleton:
            limits = {limit.name: (limit.lower, limit.upper) for limit in skeleton.joint_limits}
            stated = {name: limits[name] for name in RangesOfMotion.__struct_fields__ if name in limits}
            habit = None if comfort is None else comfort.habit
            comfort = ElbowComfort(arm.side, skeleton.upper_arm_m, skeleton.forearm_m, stated, habit)
            self._arms[key] = (skeleton, comfort)
        dt_s = 1e-9 * np.diff(times_ns, prepend=self._last_ns.get(key, times_ns[0]))
        self._last_ns[key] = int(times_ns[-1])
        world_from_shoulder = np.concatenate([arm.upper_arm[:, :3], arm.chest[:, 3:]], axis=1)
        shoulder_from_world = batch.inverse(world_from_shoulder)
        wrists = batch.compose(shoulder_from_world, arm.hand)
        elbows = shoulder_from_world[:, :3] + batch.rotate(shoulder_from_world[:, 3:], arm.forearm[:, :3])
        return comfort.stretches(np.clip(dt_s, 0.0, LONGEST_STEP_S), arm.angles, elbows, wrists)
