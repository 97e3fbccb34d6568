"""Where on its circle an elbow would be comfortable: for whoever looks at an arm and asks why it is where it is.

The solver itself needs only slope and curvature where the elbow is; this looks all around.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from arm_ik_service.arm.chain import Columns, columns_of, hand_to_arm, position_to_arm
from arm_ik_service.arm.model import ANGLES, ArmModel
from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry.scalar import Vector, dot, quaternion, vector
from arm_ik_service.ik.comfort import COMFORT, discomfort, learn_habit
from arm_ik_service.ik.swivel import Reach, reach_to, side_at
from arm_ik_service.wire.messages import Side

Floats = npt.NDArray[np.float64]

SWIVELS = 120  # looked at: every 3 degrees
# More discomfort than the least there is that still counts as comfortable: 18 degrees to either side where the elbow's
# confidence is one half, about as far as recorded elbows are from where they were thought to be.
COMFORTABLE = 0.05
_FLEXION, _DEVIATION = ANGLES.index("wrist_flexion"), ANGLES.index("wrist_deviation")


@compiled
def _end(
    comfort: Any, habit: Any, chain: Record, reach: Reach, rotation: Columns, start: float, step: float, least: float
) -> float:
    """How far [rad] one can go from the swivel `start` of least discomfort in the direction of `step`."""
    before = least
    for k in range(SWIVELS // 2):
        cost = discomfort(comfort, habit, chain, reach, rotation, side_at(reach, start + (k + 1) * step))[0]
        if cost > least + COMFORTABLE:
            return (k + (least + COMFORTABLE - before) / (cost - before)) * step
        before = cost
    return SWIVELS // 2 * step


@compiled
def comfortable_stretch(
    comfort: Any, habit: Any, chain: Record, position: Vector, rotation: Columns, elbow: Vector
) -> tuple[float, float]:
    """Both ends of the comfortable stretch as swivels [rad] from where the elbow is; right arm, ISB axes."""
    reach = reach_to(chain, position)
    here = math.atan2(dot(elbow, reach[0][2]), dot(elbow, reach[0][1]))
    step = 2.0 * math.pi / SWIVELS
    best, least = 0.0, math.inf
    for k in range(-SWIVELS // 2, SWIVELS // 2):
        cost = discomfort(comfort, habit, chain, reach, rotation, side_at(reach, here + k * step))[0]
        if cost < least:
            best, least = k * step, cost
    lower = best + _end(comfort, habit, chain, reach, rotation, here + best, -step, least)
    upper = best + _end(comfort, habit, chain, reach, rotation, here + best, step, least)
    return lower, upper


@compiled
def _stretches(
    comfort: Any,
    habit: Any,
    chains: Any,
    dt_s: Any,
    angles: Any,
    elbows: Any,
    wrists: Any,
    configuration: Any,
    out: Any,
) -> None:
    chain = chains[0]
    for n in range(len(elbows)):
        configuration[7], configuration[8] = angles[n, _FLEXION], angles[n, _DEVIATION]
        learn_habit(habit, configuration, dt_s[n])
        position = position_to_arm(chain, vector(wrists[n, :3]))
        rotation = columns_of(hand_to_arm(chain, quaternion(wrists[n, 3:])))
        elbow = position_to_arm(chain, vector(elbows[n]))
        lower, upper = comfortable_stretch(comfort, habit, chain, position, rotation, elbow)
        out[n, 0], out[n, 1] = (-upper, -lower) if chain.left else (lower, upper)


class ElbowComfort:
    """One arm watched over time: what its owner does with the wrist counts as their habit, as in the solver."""

    def __init__(
        self,
        side: Side,
        upper_arm_m: float,
        forearm_m: float,
        limits: Mapping[str, tuple[float, float]],
        habit: Floats | None = None,
    ) -> None:
        """`limits` [rad] by name, those that are not the model's; `habit` of the same arm before. Raises ModelError."""
        self._chains = ArmModel.load(side=side, upper_arm_m=upper_arm_m, forearm_m=forearm_m, limits=limits).chains
        self._comfort = np.array(list(COMFORT.values()))
        self.habit = np.zeros(2) if habit is None else habit
        self._configuration = np.zeros(10)

    def stretches(self, dt_s: Floats, angles: Floats, elbows: Floats, wrists: Floats) -> Floats:
        """Swivels (N,2) [rad] about the line to the wrist, from the elbow, between which it would be comfortable.

        Of successive frames `dt_s` (N,) apart: the nine angles (N,9) [rad], elbow (N,3) [m] and hand (N,7) in the
        shoulder frame.
        """
        out = np.empty((len(elbows), 2))
        dt_s, angles, elbows, wrists = (np.ascontiguousarray(a, np.float64) for a in (dt_s, angles, elbows, wrists))
        _stretches(self._comfort, self.habit, self._chains, dt_s, angles, elbows, wrists, self._configuration, out)
        return out
