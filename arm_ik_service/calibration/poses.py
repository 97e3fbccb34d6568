"""The poses that people are asked to strike: found in a recording, or refused with the reason."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from arm_ik_service.body.profile import FOREARM_PER_STATURE, SHOULDER_WIDTH_PER_STATURE, UPPER_ARM_PER_STATURE
from arm_ik_service.calibration.observation import Observation
from arm_ik_service.errors import CalibrationError

Array = npt.NDArray[np.float64]
PoseName = Literal["t_pose", "a_pose"]

HELD_FOR_S = 0.5
STILL_M_S = 0.2
GRIP_FROM_WRIST_M = 0.075  # the palm's centroid is so far along the arm
STRAIGHT = 0.985  # reach over arm length of an arm that its owner calls straight
LENGTH_RANGE = (0.8, 1.25)  # arm length over what stature says
ARMS_DIFFER_AT_MOST = 0.08  # of their length
FORWARD_AT_MOST_DEGREES = 30.0

# degrees below the horizontal: lower and upper bound
POSES: dict[PoseName, tuple[float, float]] = {"t_pose": (-20.0, 20.0), "a_pose": (25.0, 75.0)}


@dataclass(frozen=True)
class StruckPose:
    """A pose that was held: the frames it was held for, and what the arms did."""

    name: PoseName
    start: int
    stop: int
    stature_m: float
    arm_length_m: float
    below_horizontal: float  # of the arms, mean [rad]


def _stillest(observation: Observation) -> tuple[int, int]:
    """Return the half second in which the faster hand was slowest."""
    t, speed = observation.t, observation.hand_speed.max(axis=1)
    starts = np.searchsorted(t, t - HELD_FOR_S, side="left")
    best, best_speed = (0, 0), np.inf
    for stop in range(len(t)):
        if t[stop] - t[0] >= HELD_FOR_S:
            fastest = float(speed[starts[stop] : stop + 1].max())
            if fastest < best_speed:
                best, best_speed = (int(starts[stop]), stop + 1), fastest
    return best


def _judge(name: PoseName, observation: Observation, start: int, stop: int) -> StruckPose:
    held = observation.part(slice(start, stop))
    stature = held.stature_m(50.0)
    if stature is None:
        raise CalibrationError(f"the head is {np.median(held.eye_height_m):.2f} m above the floor: nobody stands there")
    if held.hand_speed.max() > STILL_M_S:
        raise CalibrationError(f"the hands never kept still for {HELD_FOR_S:g} s: {held.hand_speed.max():.1f} m/s")
    half_width = 0.5 * SHOULDER_WIDTH_PER_STATURE * stature
    arms = np.median(held.grips[:, :, :3], axis=0) - (half_width, 0.0, 0.0)
    lengths = np.linalg.norm(arms, axis=1)
    lowest, highest = POSES[name]
    for side, arm, length in zip(("left", "right"), arms, lengths, strict=True):
        below = float(np.degrees(np.arcsin(-arm[1] / length)))
        forward = float(np.degrees(np.arctan2(abs(arm[2]), arm[0])))
        if not lowest <= below <= highest:
            raise CalibrationError(
                f"the {side} arm points {below:.0f} degrees below the horizontal, not {lowest:g} to {highest:g}"
            )
        if forward > FORWARD_AT_MOST_DEGREES and name == "t_pose":
            raise CalibrationError(f"the {side} arm points {forward:.0f} degrees away from sideways")
    if abs(lengths[0] - lengths[1]) > ARMS_DIFFER_AT_MOST * lengths.mean():
        raise CalibrationError(f"the arms differ by {100 * abs(lengths[0] - lengths[1]):.0f} cm: one of them is bent")
    length = float((lengths.mean() - GRIP_FROM_WRIST_M) / STRAIGHT)
    part = length / ((UPPER_ARM_PER_STATURE + FOREARM_PER_STATURE) * stature)
    if not LENGTH_RANGE[0] <= part <= LENGTH_RANGE[1]:
        raise CalibrationError(f"arms of {length:.2f} m on someone of {stature:.2f} m: they are bent, or not arms")
    below = float(np.arcsin(np.clip(-arms[:, 1].mean() / lengths.mean(), -1.0, 1.0)))
    return StruckPose(name, start, stop, stature, length, below)


def find_pose(observation: Observation, name: PoseName) -> StruckPose:
    """Find the pose in the stillest half second. Raises CalibrationError saying what is wrong with it."""
    if len(observation) == 0 or observation.t[-1] - observation.t[0] < HELD_FOR_S:
        raise CalibrationError(f"head and both hands were not tracked together for {HELD_FOR_S:g} s")
    return _judge(name, observation, *_stillest(observation))
