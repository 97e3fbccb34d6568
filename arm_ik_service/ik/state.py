"""One arm in time: the record that the solve keeps from frame to frame and leaves its answer in."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from arm_ik_service.arm.chain import CHAIN
from arm_ik_service.arm.model import ArmModel
from arm_ik_service.compiled import Record, record_dtype
from arm_ik_service.ik.comfort import COMFORT
from arm_ik_service.ik.conjugate import WORK

ARM = record_dtype(
    [
        ("chain", CHAIN),
        ("comfort", np.float64, (len(COMFORT),)),
        ("work", WORK),
        # memory
        ("started", np.int64),  # 0: no frame yet; else 1 and the frames on end with the hand met at the same limits
        ("before", np.float64, (10,)),  # what was shown one frame ago
        ("recent_velocity", np.float64, (9,)),  # mean over the last frame
        ("habit", np.float64, (2,)),  # usual wrist flexion and deviation [rad]
        ("swivel_speed", np.float64),  # [rad/s] of the elbow about the arm's line, for comfort
        ("frame_s", np.float64),  # how long the last frame was
        ("steady", np.int64),  # frames on end that the hand was met with no limit in the way
        ("escape", np.float64),  # [rad] swivel still to go to where the hand can be met; 0: none
        ("kept", np.float64, (10,)),  # the best so far while another start is tried
        ("asked", np.float64, (3,)),  # of the hand one frame ago [m], in the arm's axes
        ("carried", np.float64, (3,)),  # velocity [m/s] of the shoulder with the trunk, in shoulder axes ...
        ("carried_spin", np.float64, (3,)),  # ... and the trunk's own [rad/s]
        ("anchor", np.float64, (10,)),  # configuration at the beginning of the frame
        ("calm_started", np.int64),  # 1: there was a frame before (2: and one before that), of which the solve had
        ("calm_wrist", np.float64, (3,)),  # its wrist there [m],
        ("calm_axis", np.float64, (3,)),  # the line to it [unit],
        ("calm_side", np.float64, (3,)),  # and its elbow in this direction from that line [unit]
        ("calm_solved_speed", np.float64),  # that elbow's [rad/s] about the line
        ("calm_gap", np.float64),  # [rad] from it to what is followed, where it went too suddenly
        ("calm_gap_rate", np.float64),  # [rad/s] of that
        ("calm_turn", np.float64),  # [rad] about that line, from the solve's elbow to the one shown
        ("calm_speed", np.float64),  # [rad/s] of the one shown
        ("missed_m", np.float64),  # what the solve's hand was off, one frame ago until this one is solved
        ("calm_astray", np.int64),  # 1 where the hand shown is not where the solve has it
        ("calm_work", WORK),  # of bringing it there
        # the answer; positions and rotations in the shoulder frame of the arm's own side
        ("configuration", np.float64, (10,)),
        ("shown", np.float64, (10,)),  # the configuration with its elbow calmed, and without leaps
        ("published", np.float64, (10,)),  # the one shown, or where its velocity leads to
        ("velocity", np.float64, (9,)),  # [rad/s], tangent order
        ("angles", np.float64, (9,)),  # arm.model.ANGLES [rad]
        ("angle_rates", np.float64, (9,)),  # [rad/s]
        ("isb", np.float64, (3,)),  # plane of elevation, elevation, axial rotation [rad]
        ("isb_singular", np.int64),
        ("elbow", np.float64, (3,)),
        ("wrist", np.float64, (3,)),
        ("upper_arm_rotation", np.float64, (4,)),  # ISB bone axes
        ("forearm_rotation", np.float64, (4,)),
        ("hand_rotation", np.float64, (4,)),  # OpenXR wrist frame
        ("hand_found", np.float64, (4,)),  # the same of the solve, before its elbow is calmed
        ("position_error_m", np.float64),
        ("orientation_error_rad", np.float64),
        ("relief", np.float64, (3,)),  # [rad] turn of the trunk that would give it room: see ik.relief
        ("elbow_confidence", np.float64),  # 0: any swivel is as comfortable; 1: the comfort is sharp
        ("iterations", np.int64),
        ("limits", np.int64),  # bit i: the arm rests on arm.model.LIMITS[i]
        ("status", np.int64),  # ik.solver.Status
        ("restarted", np.int64),  # 1 where this frame was solved from a new start: the elbow may have jumped
    ]
)


def initialise_arm(arm: Record, model: ArmModel) -> None:
    """Put an ARM record of a person's arm at rest, without a past."""
    for name in ARM.names or ():
        arm[name] = np.zeros((), ARM[name])
    arm["chain"] = model.chains[0]
    arm["comfort"] = list(COMFORT.values())
    arm["configuration"] = model.rest
    arm["shown"] = model.rest


def new_arm(model: ArmModel) -> npt.NDArray[Any]:
    """Return an array of one ARM record, at rest."""
    arms = np.zeros(1, ARM)
    initialise_arm(arms[0], model)
    return arms
