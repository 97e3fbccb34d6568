"""Where the elbow feels at home: the discomfort of a posture, and how it changes with the elbow's swivel.

Hand position and rotation leave the elbow's swivel free. People choose it so that no joint is far from the middle of
its use. Discomfort is a sum of

- wrist flexion and deviation, quadratic while small and flat when large (a Cauchy penalty): a bent wrist is avoided,
  but how a hand was mounted on its tracker shifts these angles, so a large one is no stronger evidence than a fair one,
  and half of what is usual for a person counts as their rest;
- pronation, quadratic around its rest;
- humeral twist, quadratic around a rest that depends on where the upper arm points (Donders' law of the arm: Hore,
  Watts & Vilis 1992; Gielen et al. 1997);
- the pull of the upper arm's weight, down and slightly out of the body's way;
- a rise ahead of every limit, so that the elbow makes way before the hand is stuck.

The constants are fitted to recorded elbows by `tests/bench/fit_elbow_comfort.py`, on the CMU and Xia recordings alone.
"""

from __future__ import annotations

import math
from typing import Any

from arm_ik_service.arm.chain import Columns
from arm_ik_service.arm.limits import twist_of
from arm_ik_service.compiled import Record, compiled
from arm_ik_service.ik.swivel import Posture, Reach, posture_at, violation

# The fitted constants, in the order of the record field `comfort`: angles [rad], weights [1/rad^2], the rest of the
# twist per unit of the humerus' direction [rad], pulls per unit of it.
COMFORT: dict[str, float] = {
    "pronation_rest": 1.35,
    "pronation_weight": 0.05,
    "flexion_weight": 1.2,
    "deviation_weight": 1.75,
    "twist_weight": 0.24,
    "twist_rest": 0.0,
    "twist_forward": 0.3,
    "twist_up": 0.35,
    "twist_out": -0.8,
    "pull_down": 0.4,
    "pull_out": 0.9,
}
WRIST_SCALE = 0.5  # [rad] half of the wrist's functional range (Ryu et al. 1991): beyond, the penalty flattens
HABIT_SHARE = 0.5  # of a person's usual wrist flexion and deviation that counts as their rest
HABIT_TIME_S = 5.0  # over which the usual is averaged
LIMIT_MARGIN = 0.05  # [rad] ahead of a limit where discomfort begins to rise
LIMIT_WEIGHT = 3.0  # [1/rad^2] how steeply
_PROBE = 0.06  # [rad] swivel difference for slope and curvature


@compiled
def discomfort(comfort: Any, habit: Any, chain: Record, posture: Posture) -> float:
    """How far a posture is from comfortable; no unit, only differences mean anything.

    `comfort` is COMFORT's values, `habit` the person's usual wrist flexion and deviation [rad].
    """
    upper_arm, _, pronation, flexion, deviation = posture
    y = upper_arm[1]  # the humerus points along -y
    p = pronation - comfort[0]
    f, d = (flexion - HABIT_SHARE * habit[0]) / WRIST_SCALE, (deviation - HABIT_SHARE * habit[1]) / WRIST_SCALE
    t = twist_of(upper_arm) - comfort[5] + comfort[6] * y[0] + comfort[7] * y[1] + comfort[8] * y[2]
    total: float = (
        comfort[1] * p * p
        + WRIST_SCALE * WRIST_SCALE * (comfort[2] * math.log(1.0 + f * f) + comfort[3] * math.log(1.0 + d * d))
        + comfort[4] * t * t
        - comfort[9] * y[1]
        + comfort[10] * y[2]
        + LIMIT_WEIGHT * violation(chain, posture, LIMIT_MARGIN)
    )
    return total


@compiled
def learn_habit(habit: Any, configuration: Any, dt_s: float) -> None:
    """Move the usual wrist flexion and deviation towards those of a configuration (10,) held for dt_s."""
    share = dt_s / (HABIT_TIME_S + dt_s)
    habit[0] += share * (configuration[7] - habit[0])
    habit[1] += share * (configuration[8] - habit[1])


@compiled
def slope_and_curvature(
    comfort: Any, habit: Any, chain: Record, reach: Reach, rotation: Columns, swivel: float
) -> tuple[float, float]:
    """First and second derivative of discomfort over the swivel, by differences."""
    here = discomfort(comfort, habit, chain, posture_at(reach, rotation, swivel))
    ahead = discomfort(comfort, habit, chain, posture_at(reach, rotation, swivel + _PROBE))
    behind = discomfort(comfort, habit, chain, posture_at(reach, rotation, swivel - _PROBE))
    return (ahead - behind) / (2.0 * _PROBE), (ahead - 2.0 * here + behind) / (_PROBE * _PROBE)
