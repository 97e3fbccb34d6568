"""What `arm-ik solve` writes: the answers of one session as arrays, a row each, world axes, metres and radians.

`t_ns, seq`, and for each side `_shoulder, _elbow, _wrist, _grip` (N,3), `_configuration` (N,10), `_velocity` (N,9),
`_tracking` (N,) text, `_position_error_m`, `_orientation_error_rad` and `_iterations` (N,).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from arm_ik_service.geometry import scalar as g
from arm_ik_service.io.columns import Table
from arm_ik_service.wire.messages import SIDES, ArmsState, ArmState, Vector


class SolutionWriter:
    """Gathers answers; `save` writes them. An hour at 90 Hz takes 200 MB, in memory as on disk."""

    def __init__(self, left_wrist_from_grip: Vector, right_wrist_from_grip: Vector) -> None:
        """Take the positions of the grips [m] in the wrist frames, from the profile that was solved with."""
        self._grips = (left_wrist_from_grip, right_wrist_from_grip)
        fields: list[tuple[Any, ...]] = [("t_ns", np.int64), ("seq", np.int64)]
        for side in SIDES:
            fields += [(f"{side}_{point}", np.float64, (3,)) for point in ("shoulder", "elbow", "wrist", "grip")]
            fields += [(f"{side}_configuration", np.float64, (10,)), (f"{side}_velocity", np.float64, (9,))]
            fields += [(f"{side}_tracking", "U8")]
            fields += [(f"{side}_{error}", np.float64) for error in ("position_error_m", "orientation_error_rad")]
            fields += [(f"{side}_iterations", np.int64)]
        self._table = Table(fields)

    def __len__(self) -> int:
        return len(self._table)

    def write(self, answer: ArmsState) -> None:
        """Add one answer."""
        left, right = (_flat(arm, grip) for arm, grip in zip((answer.left, answer.right), self._grips, strict=True))
        self._table.append((answer.sample_time_ns, answer.seq, *left, *right))

    def save(self, path: Path) -> None:
        """Write the file. Raises SessionError if it cannot be written."""
        self._table.save(path)


def _flat(arm: ArmState, wrist_from_grip: Vector) -> tuple[Any, ...]:
    hand = arm.bones.hand
    return (
        arm.bones.upper_arm.position,
        arm.bones.forearm.position,
        hand.position,
        g.add(hand.position, g.rotate(hand.orientation, wrist_from_grip)),
        arm.configuration,
        arm.velocity,
        arm.tracking,
        arm.position_error_m,
        arm.orientation_error_rad,
        arm.iterations,
    )
