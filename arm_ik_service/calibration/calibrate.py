"""Calibration: a profile from frames of a person in a T-pose, in an A-pose, or just moving about.

How sure it is comes with it, as standard deviations. What the frames do not show is left out of the profile, so that
it goes on being derived from stature.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import msgspec
import numpy as np
import numpy.typing as npt

from arm_ik_service.body.arm_fit import ARM_LENGTH_PART, AXIS_M
from arm_ik_service.body.profile import (
    FOREARM_PER_STATURE,
    UPPER_ARM_PER_STATURE,
    GripOffset,
    Grips,
    Profile,
)
from arm_ik_service.calibration.arm import Arm, fit_arm
from arm_ik_service.calibration.observation import Observation, observe
from arm_ik_service.calibration.poses import PoseName, StruckPose, find_pose
from arm_ik_service.errors import CalibrationError
from arm_ik_service.geometry import batch

Array = npt.NDArray[np.float64]
Method = Literal["t_pose", "a_pose", "moving"]

LEAST_MOVING_S = 1.0  # with so little the proportions of people decide, and the deviation says so
MOVES_M_S = 0.3  # hands that are faster for a tenth of the time move about
ROUNDS = 3  # the chest is placed by the measures that are sought: after three times they agree
STANDING_PERCENTILE = 75.0  # of eye height: people crouch more than they jump
STATURE_DEVIATION_M = {"t_pose": 0.03, "a_pose": 0.03, "moving": 0.05}  # headsets sit, and people stand, differently
POSE_DEVIATION_M = {"t_pose": 0.015, "a_pose": 0.03}  # of an arm length: where the shoulder is enters it
GRIP_TURNED_RAD = 1.0  # a grip farther off than wrists bend on average is held differently than assumed
WRIST_BENT_RAD = 0.4  # what of the angle is put down to a wrist that is bent all the time
AXIS_UNKNOWN_M, AXIS_FOUND_M = 0.15, 0.1  # AXIS_M for a grip that nobody stated, and for one just found


@dataclass(frozen=True)
class Calibration:
    """A profile and how sure it is."""

    profile: Profile
    method: Method
    stature_deviation_m: float  # standard deviations
    arm_length_deviation_m: float
    grips_changed: bool  # whether the controllers turned out to be held differently than the profile before said
    seconds: float  # of frames that were used
    notes: tuple[str, ...] = ()  # for the person, in sentences

    @property
    def confidence(self) -> float:
        """How much better the arm length is known than from stature: 0 no better, towards 1 far better."""
        measures = self.profile.body
        assumed = ARM_LENGTH_PART * (measures.upper_arm + measures.forearm)
        return float(max(0.0, 1.0 - (self.arm_length_deviation_m / assumed) ** 2))


def calibrate(frames: np.ndarray[Any, Any], method: Method | None = None, start: Profile | None = None) -> Calibration:
    """Estimate a profile from FRAME records (N,), beginning with `start`; None tries all methods, the surest first.

    Raises CalibrationError where the frames do not show what the method needs, saying what they show instead.
    """
    start = start or Profile()
    observation = observe(frames, start)
    if len(observation) == 0:
        raise CalibrationError("head and both hands were never tracked together")
    if method == "moving":
        return _from_movement(frames, observation, start)
    if method is not None:
        return _from_pose(find_pose(observation, method), observation, start)
    poses: tuple[PoseName, ...] = ("t_pose", "a_pose")
    for name in poses:
        try:
            return _from_pose(find_pose(observation, name), observation, start)
        except CalibrationError:
            continue
    return _from_movement(frames, observation, start)


def _with_measures(
    start: Profile, stature_m: float, upper_arm_m: float, forearm_m: float, shoulder_width_m: float | None = None
) -> Profile:
    """The profile with these measures; the shoulders' width stays as it is where it was not measured."""
    measures = msgspec.structs.replace(
        start.body,
        stature_m=round(stature_m, 3),
        upper_arm_m=round(upper_arm_m, 4),
        forearm_m=round(forearm_m, 4),
        shoulder_width_m=start.body.shoulder_width_m if shoulder_width_m is None else round(shoulder_width_m, 3),
    )
    return msgspec.structs.replace(start, body=measures)


def _offset(position: Array, rotation: Array) -> GripOffset:
    x, y, z = (round(float(v), 4) for v in position)
    qx, qy, qz, qw = (float(v) for v in batch.normalized(np.round(rotation, 6)))
    return GripOffset((x, y, z), (qx, qy, qz, qw))


def _with_grip(start: Profile, wrist_from_grip: Array) -> Profile:
    """The profile with a right grip's rotation (4,) in the wrist, and its mirror image on the left."""
    position = np.asarray(start.grip.right.position_m)
    pose = np.concatenate([position, wrist_from_grip])
    left = batch.mirror_pose(pose)
    return msgspec.structs.replace(start, grip=Grips(_offset(left[:3], left[3:]), _offset(pose[:3], pose[3:])))


# --- poses -----------------------------------------------------------------------------------------------------------


def _held_grip(pose: StruckPose, observation: Observation) -> tuple[Array, float]:
    """Grip in the wrist (4,) if the palms face down (T) or inwards (A), and how much the two hands disagree [rad]."""
    # fingers along the arm, the back of the hand up: the right wrist frame in the chest's, turned down with the arm
    fingers_right = batch.exp([0.0, -0.5 * np.pi, 0.0])
    wrist = batch.multiply(batch.exp([0.0, 0.0, -pose.below_horizontal]), fingers_right)
    grips = observation.part(slice(pose.start, pose.stop)).grips[..., 3:]
    both = grips.reshape(-1, 4)
    mean = batch.normalized(np.sum(both * np.sign(both @ both[0])[:, None], axis=0))
    left, right = (np.median(batch.angle_between(mean, grips[:, k])) for k in range(2))
    return batch.multiply(batch.conjugate(wrist), mean), float(left + right)


def _from_pose(pose: StruckPose, observation: Observation, start: Profile) -> Calibration:
    share = UPPER_ARM_PER_STATURE / (UPPER_ARM_PER_STATURE + FOREARM_PER_STATURE)
    upper_arm = share * pose.arm_length_m
    profile = _with_measures(start, pose.stature_m, upper_arm, pose.arm_length_m - upper_arm)
    notes = []
    grip, disagreement = _held_grip(pose, observation)
    turned = float(batch.angle_between(grip, np.asarray(start.grip.right.orientation_xyzw)))
    changed = turned > GRIP_TURNED_RAD and disagreement < GRIP_TURNED_RAD
    if changed:
        profile = _with_grip(profile, grip)
        notes.append(f"the controllers are held {np.degrees(turned):.0f} degrees from where OpenXR has the grip")
    return Calibration(
        profile=profile,
        method=pose.name,
        stature_deviation_m=STATURE_DEVIATION_M[pose.name],
        arm_length_deviation_m=POSE_DEVIATION_M[pose.name],
        grips_changed=changed,
        seconds=float(observation.t[pose.stop - 1] - observation.t[pose.start]),
        notes=tuple(notes),
    )


# --- movement --------------------------------------------------------------------------------------------------------


def _turned_grip(start: Profile, arm: Arm) -> tuple[Array, float]:
    """Grip in the wrist (4,) that puts the elbow near the hand's axis, by the shortest turn; the angle it was off."""
    axis = arm.elbow_in_hand / arm.forearm_m
    towards = np.array([0.0, 0.0, 1.0])
    turn = np.cross(axis, towards)
    sine = float(np.linalg.norm(turn))
    angle = float(np.arctan2(sine, axis @ towards))
    new_from_old = batch.exp(turn * (max(angle - WRIST_BENT_RAD, 0.0) / sine if sine > 1e-9 else 0.0))
    return batch.multiply(new_from_old, np.asarray(start.grip.right.orientation_xyzw)), angle


def _from_movement(frames: np.ndarray[Any, Any], observation: Observation, start: Profile) -> Calibration:
    notes, profile = [], start
    seconds = observation.seconds
    if seconds < LEAST_MOVING_S:
        raise CalibrationError(
            f"head and both hands were tracked together for {seconds:.1f} s: {LEAST_MOVING_S:g} needed"
        )
    if np.percentile(observation.hand_speed, 90.0) < MOVES_M_S:
        raise CalibrationError("the hands hardly moved: reach out, up and to the sides")
    stature = observation.stature_m(STANDING_PERCENTILE)
    if stature is None:
        notes.append("the head is too low for someone who stands: stature is as it was before")
        stature = start.body.stature_m
    arm = fit_arm(observation, stature, axis_m=AXIS_UNKNOWN_M)
    grip, angle = _turned_grip(start, arm)
    changed = angle > GRIP_TURNED_RAD
    if changed:
        profile = _with_grip(start, grip)
        notes.append(f"the controllers are held {np.degrees(angle):.0f} degrees from where OpenXR has the grip")
    for _ in range(ROUNDS):
        observation = observe(frames, profile)
        arm = fit_arm(observation, stature, axis_m=AXIS_FOUND_M if changed else AXIS_M)
        profile = _with_measures(profile, stature, arm.upper_arm_m, arm.forearm_m, arm.shoulder_width_m)
    if not arm.plausible:
        raise CalibrationError(
            f"these hands do not move as those of somebody {stature:.2f} m tall do: "
            "is each controller in its own hand, and was everything tracked in one space?"
        )
    return Calibration(
        profile=profile,
        method="moving",
        stature_deviation_m=STATURE_DEVIATION_M["moving"],
        arm_length_deviation_m=arm.length_deviation_m,
        grips_changed=changed,
        seconds=seconds,
        notes=tuple(notes),
    )
