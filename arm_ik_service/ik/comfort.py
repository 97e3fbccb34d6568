"""Where the elbow feels at home: the discomfort of a posture, and the turn of the swivel that lowers it.

Hand position and rotation leave the elbow's swivel free. People choose it so that no joint is far from the middle of
its use: a quadratic in pronation, wrist flexion, deviation and humeral twist, plus the pull of the upper arm's weight
down and slightly out. The constants are fitted to recorded elbows by `tests/bench/fit_elbow_comfort.py` on the CMU and
Xia recordings. Near a limit discomfort rises steeply, so that the elbow makes way before the hand is stuck.
"""

from __future__ import annotations

import math
from typing import Any

from arm_ik_service.arm.chain import Columns
from arm_ik_service.arm.limits import twist_of
from arm_ik_service.compiled import Record, compiled
from arm_ik_service.ik.swivel import Posture, Reach, posture_at, violation

# Names and values of the fitted constants; angles in radians, weights per squared radian, pulls per unit direction.
COMFORT: dict[str, float] = {
    "pronation_rest": 1.11,
    "pronation_weight": 0.05,
    "flexion_weight": 0.48,
    "flexion_scale": 3.0,
    "deviation_weight": 1.57,
    "deviation_scale": 3.0,
    "twist_weight": 0.25,
    "twist_rest": -0.36,
    "twist_forward": 0.0,
    "twist_up": 0.0,
    "twist_out": 0.0,
    "pull_down": 0.86,
    "pull_out": 0.74,
    "pull_forward": 0.11,
    "limit_margin": 0.05,
    "limit_weight": 3.0,
    "twist_scale": 3.0,
}
_PROBE = 0.06  # [rad] swivel difference for slope and curvature


@compiled
def discomfort(comfort: Any, chain: Record, posture: Posture) -> float:
    """How far a posture is from comfortable; no unit, only differences mean anything. `comfort` is COMFORT's values."""
    upper_arm, _, pronation, flexion, deviation = posture
    y = upper_arm[1]
    p = pronation - comfort[0]
    f, d = flexion / comfort[3], deviation / comfort[5]
    t = twist_of(upper_arm) - comfort[7] + comfort[8] * y[0] + comfort[9] * y[1] + comfort[10] * y[2]
    return (
        comfort[1] * p * p
        + comfort[2] * comfort[3] * comfort[3] * math.log(1.0 + f * f)
        + comfort[4] * comfort[5] * comfort[5] * math.log(1.0 + d * d)
        + comfort[6] * comfort[16] * comfort[16] * math.log(1.0 + t * t / (comfort[16] * comfort[16]))
        - comfort[11] * y[1]
        + comfort[12] * y[2]
        + comfort[13] * y[0]
        + comfort[15] * violation(chain, posture, comfort[14])
    )


@compiled
def slope_and_curvature(
    comfort: Any, chain: Record, reach: Reach, rotation: Columns, swivel: float
) -> tuple[float, float]:
    """First and second derivative of discomfort over the swivel, by differences."""
    here = discomfort(comfort, chain, posture_at(reach, rotation, swivel))
    ahead = discomfort(comfort, chain, posture_at(reach, rotation, swivel + _PROBE))
    behind = discomfort(comfort, chain, posture_at(reach, rotation, swivel - _PROBE))
    return (ahead - behind) / (2.0 * _PROBE), (ahead - 2.0 * here + behind) / (_PROBE * _PROBE)
