"""Walking: a cycle of key frames, and someone who walks with it to where they are sent."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

# One cycle of two steps, at four instants from one heel strike of the right foot to the next: shoulder and elbow
# flexion [deg] of the right arm, height of the body [m], turn of the shoulders to the left [deg]. The left arm is half
# a cycle behind. Adults at 1.3 m/s (Murray, Sepic & Barnard 1967, J Bone Joint Surg).
_KEYS = np.array(
    [
        (-20.0, 16.0, -0.020, -4.0),
        (2.0, 22.0, 0.018, 0.0),
        (22.0, 34.0, -0.020, 4.0),
        (2.0, 24.0, 0.018, 0.0),
    ]
)
CYCLE_M = 1.35  # of way
SPEED_M_S = 1.3
ACCELERATION_M_S2 = 1.4
TURN_RAD_S = 2.0
FACING_RAD = 0.5  # nobody walks off before facing about this near to where they go


def cycle(phase: float) -> Floats:
    """Key-framed values (4,) at a phase, of period 1."""
    return along_cycle(_KEYS, phase)


def along_cycle(keys: Floats, phase: float) -> Floats:
    """Values (k,) at a phase, of period 1, of a closed Catmull-Rom spline through keys (N,k)."""
    place = (phase % 1.0) * len(keys)
    k, t = int(place), place - int(place)
    a, b, c, d = (keys[(k + i) % len(keys)] for i in (-1, 0, 1, 2))
    return np.asarray(0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3))


@dataclass
class Walker:
    """A body on the floor: `place` (x, z) [m], `heading` [rad] about +Y, 0 facing -z, `speed` [m/s], `phase`."""

    place: Floats
    heading: float = 0.0
    speed: float = 0.0
    phase: float = 0.0

    def step(self, goal: Floats, standoff: float, dt: float) -> None:
        """Walk on towards `goal` (x, z) for a time step, turning first, to stand `standoff` [m] before it."""
        away = goal - self.place
        distance = float(np.hypot(*away))
        off = 0.0
        if distance > 0.05:
            off = (math.atan2(-away[0], -away[1]) - self.heading + math.pi) % (2.0 * math.pi) - math.pi
            self.heading += float(np.clip(off, -TURN_RAD_S * dt, TURN_RAD_S * dt))
        left = max(distance - standoff, 0.0) if abs(off) < FACING_RAD else 0.0
        wanted = min(SPEED_M_S, math.sqrt(2.0 * 0.7 * ACCELERATION_M_S2 * left))
        change = ACCELERATION_M_S2 * dt
        self.speed += min(max(wanted - self.speed, -2.0 * change), change)
        self.speed = min(self.speed, left / dt)
        self.place = self.place + self.speed * dt * np.array([-math.sin(self.heading), -math.cos(self.heading)])
        self.phase += self.speed * dt / CYCLE_M

    @property
    def stride(self) -> float:
        """How much of the cycle is to be seen: 0 standing, 1 at full speed."""
        return min(self.speed / (0.6 * SPEED_M_S), 1.0)
