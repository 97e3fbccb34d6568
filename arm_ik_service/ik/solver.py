"""What every solver is: a hand pose in, a configuration out. It never raises on a target; it returns its best."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from arm_ik_service.arm.model import ArmModel

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]


class Status(IntEnum):
    """Why a solver stopped."""

    SOLVED = 0  # both errors within tolerance
    NEAREST = 1  # limits or reach forbid it: no step makes it better
    OUT_OF_ITERATIONS = 2
    OUT_OF_TIME = 3


class Solution(NamedTuple):
    """One arm for one target."""

    configuration: Array  # (10,) Pinocchio's q: shoulder quaternion x y z w, six hinges [rad]
    iterations: int
    position_error_m: float
    orientation_error_rad: float
    status: Status


class Track(NamedTuple):
    """One arm along N targets, each solved from the one before."""

    configuration: Array  # (N, 10)
    iterations: Counts  # (N,)
    position_error_m: Array  # (N,)
    orientation_error_rad: Array  # (N,)
    status: Counts  # (N,) values of Status


class Solver(Protocol):
    """Every solver is built from an arm and keyword options and has these two methods.

    Targets are poses x y z qx qy qz qw of the OpenXR wrist frame in the shoulder frame (at the glenohumeral joint,
    aligned with the chest, OpenXR axes), of the arm's own side, quaternions of unit length.
    """

    arm: ArmModel

    def solve(self, shoulder_from_hand: npt.ArrayLike, start: npt.ArrayLike | None = None) -> Solution:
        """Solve one target (7,) from the configuration `start` (10,); None starts at the arm's rest."""
        ...

    def track(self, shoulder_from_hands: npt.ArrayLike, start: npt.ArrayLike | None = None) -> Track:
        """Solve targets (N, 7) in order, each from the solution before; None lets the solver choose the first."""
        ...


def as_targets(shoulder_from_hands: npt.ArrayLike) -> Array:
    """Return targets as a contiguous (N, 7) array of finite numbers with unit quaternions. Raises ValueError."""
    targets = np.ascontiguousarray(shoulder_from_hands, float)
    if targets.ndim != 2 or targets.shape[1] != 7:
        raise ValueError(f"targets of shape {targets.shape}: (N, 7) is needed, x y z qx qy qz qw")
    length = np.linalg.norm(targets[:, 3:], axis=1)
    if not np.isfinite(targets).all() or (np.abs(length - 1.0) > 1e-3).any():
        raise ValueError("targets must be finite and their quaternions of unit length")
    return targets
