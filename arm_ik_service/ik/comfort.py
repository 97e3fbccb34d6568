"""Where the elbow feels at home: the discomfort of a posture, and the turn of the swivel that lowers it.

Hand position and rotation leave the elbow's swivel free. People choose it so that no joint is far from the middle of
its use: a quadratic in pronation, wrist flexion, deviation and humeral twist, plus the pull of the upper arm's weight
down and slightly out. The constants are fitted to recorded elbows by `tests/bench/fit_elbow_comfort.py` on the CMU and
Xia recordings. Near a limit discomfort rises steeply, so that the elbow makes way before the hand is stuck.
"""

from __future__ import annotations

from typing import Any

from arm_ik_service.arm.chain import Columns
from arm_ik_service.arm.limits import twist_of
from arm_ik_service.compiled import Record, compiled
from arm_ik_service.ik.swivel import Posture, Reach, posture_at, violation

# Names and values of the fitted constants; angles in radians, weights per squared radian, pulls per unit direction.
COMFORT: dict[str, float] = {
    "pronation_rest": 1.11,
    "pronation_weight": 0.05,
    "wrist_flexion_rest": 0.0,
    "wrist_flexion_weight": 0.48,
    "deviation_rest": 0.0,
    "deviation_weight": 1.57,
    "twist_rest": -0.36,
    "twist_weight": 0.25,
    "pull_down": 0.86,
    "pull_out": 0.74,
    "pull_forward": 0.11,
}
LIMIT_MARGIN = 0.12  # [rad] ahead of a limit where discomfort begins to rise
LIMIT_WEIGHT = 12.0  # [1/rad^2] how steeply
_PROBE = 0.06  # [rad] swivel difference for slope and curvature


@compiled
def discomfort(comfort: Any, chain: Record, posture: Posture) -> float:
    """How far a posture is from comfortable; no unit, only differences mean anything. `comfort` is COMFORT's values."""
    upper_arm, _, pronation, flexion, deviation = posture
    y = upper_arm[1]
    p, f, d = pronation - comfort[0], flexion - comfort[2], deviation - comfort[4]
    t = twist_of(upper_arm) - comfort[6]
    return (
        comfort[1] * p * p
        + comfort[3] * f * f
        + comfort[5] * d * d
        + comfort[7] * t * t
        - comfort[8] * y[1]
        + comfort[9] * y[2]
        + comfort[10] * y[0]
        + LIMIT_WEIGHT * violation(chain, posture, LIMIT_MARGIN)
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
