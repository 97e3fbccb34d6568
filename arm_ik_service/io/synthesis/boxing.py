"""Shadow boxing: jabs, crosses, hooks and an uppercut, singly and in combinations, between slips and bounces."""

from __future__ import annotations

import numpy as np

from arm_ik_service.geometry import batch
from arm_ik_service.geometry.batch import Array
from arm_ik_service.io.synthesis.motion import Movement
from arm_ik_service.io.synthesis.person import Posture
from arm_ik_service.io.synthesis.scene import HANGING, HandPosture, embody
from arm_ik_service.wire.messages import Side


def _ahead(
    side: Side,
    yaw: float,
    x: float,
    y: float,
    z: float,
    pronation: float,
    flexion: float,
    deviation: float,
    lift: float,
) -> HandPosture:
    """Give a hand posture for a wrist in world axes about the point between the shoulders, the trunk turned so."""
    in_girdle = batch.rotate(batch.exp([0.0, -np.radians(yaw), 0.0]), [x, y, z])
    right_x = float(in_girdle[0]) * (1.0 if side == "right" else -1.0)
    return (right_x, float(in_girdle[1]), float(in_girdle[2]), pronation, flexion, deviation, lift)


# The boxer stands with the left shoulder forward: yaw is positive to the left, so this is half side-on.
_STANCE = (-28.0, 9.0)
_STANDING = (0.0, -0.05, 0.0)  # knees bent


def _guard(side: Side, yaw: float) -> HandPosture:
    """Fists up before the chin, the left one further out; where they are in the world does not turn with the trunk."""
    if side == "left":
        return _ahead("left", yaw, -0.07, 0.08, -0.34, 88.0, -4.0, 4.0, 12.0)
    return _ahead("right", yaw, 0.10, 0.08, -0.18, 82.0, -4.0, 4.0, 8.0)


class _Boxer:
    """Writes punches into five movements at once. Each one ends where it began: in the guard."""

    def __init__(self) -> None:
        self.hands: dict[Side, Movement] = {"left": Movement(HANGING), "right": Movement(HANGING)}
        self.trunk, self.pelvis, self.gaze = Movement((0.0, 1.0)), Movement((0.0, -0.01, 0.0)), Movement((0.0, -4.0))
        self.hands["left"].stroke(0.5, 0.8, _guard("left", _STANCE[0]))
        self.hands["right"].stroke(0.6, 0.8, _guard("right", _STANCE[0]))
        self.trunk.stroke(0.5, 0.9, _STANCE)
        self.pelvis.stroke(0.5, 0.9, _STANDING)
        self.gaze.stroke(0.4, 0.6, (0.0, 1.0))

    def punch(self, side: Side, at_s: float, duration_s: float, yaw: float, lean: float, target: HandPosture) -> None:
        """Throw a fist and turn the trunk into it, the other fist staying before the chin; then back into the guard."""
        other: Side = "right" if side == "left" else "left"
        back_s, back_duration_s = at_s + duration_s + 0.02, 1.7 * duration_s
        self.hands[side].stroke(at_s, duration_s, target).stroke(back_s, back_duration_s, _guard(side, _STANCE[0]))
        for movement, turned, stance in (
            (self.hands[other], _guard(other, yaw), _guard(other, _STANCE[0])),
            (self.trunk, (yaw, lean), _STANCE),
        ):
            movement.stroke(at_s - 0.03, duration_s + 0.02, turned).stroke(back_s, back_duration_s, stance)

    def jab(self, at_s: float) -> None:
        """Left hand straight ahead with a short step, the fist turning over on the way."""
        self.pelvis.stroke(at_s - 0.05, 0.22, (0.0, -0.05, -0.07)).stroke(at_s + 0.22, 0.4, _STANDING)
        self.punch("left", at_s, 0.16, -42.0, 12.0, _ahead("left", -42.0, -0.02, 0.07, -0.71, 150.0, 0.0, 4.0, 38.0))

    def cross(self, at_s: float) -> None:
        """Right hand straight ahead, carried by the trunk."""
        self.punch("right", at_s, 0.18, 22.0, 14.0, _ahead("right", 22.0, 0.02, 0.07, -0.65, 150.0, 0.0, 4.0, 42.0))

    def hook(self, at_s: float) -> None:
        """Left arm bent and level, swung in by the trunk."""
        self.hands["left"].stroke(at_s - 0.20, 0.22, _ahead("left", -8.0, -0.40, 0.00, -0.28, 92.0, 0.0, 2.0, 60.0))
        self.hands["right"].stroke(at_s - 0.20, 0.20, _guard("right", -8.0))
        self.trunk.stroke(at_s - 0.20, 0.20, (-8.0, 11.0))
        self.punch("left", at_s, 0.20, -55.0, 10.0, _ahead("left", -55.0, 0.06, 0.06, -0.47, 100.0, 6.0, 0.0, 80.0))

    def uppercut(self, at_s: float) -> None:
        """Right hand from below, palm to the face, the knees pushing."""
        self.hands["right"].stroke(
            at_s - 0.20, 0.22, _ahead("right", _STANCE[0], 0.20, -0.28, -0.13, 55.0, 0.0, 4.0, 8.0)
        )
        self.pelvis.stroke(at_s - 0.22, 0.22, (0.02, -0.10, 0.0)).stroke(at_s - 0.01, 0.3, _STANDING)
        self.punch("right", at_s, 0.18, 12.0, 6.0, _ahead("right", 12.0, 0.03, 0.08, -0.42, 28.0, 8.0, 0.0, 14.0))

    def slip(self, at_s: float, side_m: float) -> None:
        """Duck away to one side."""
        self.pelvis.stroke(at_s, 0.26, (side_m, -0.10, 0.02)).stroke(at_s + 0.30, 0.36, _STANDING)
        self.trunk.stroke(at_s, 0.26, (_STANCE[0] - 80.0 * side_m, 19.0)).stroke(at_s + 0.30, 0.36, _STANCE)

    def rest(self, at_s: float) -> None:
        """Let the hands sink."""
        self.hands["left"].stroke(at_s, 1.0, HANGING)
        self.hands["right"].stroke(at_s + 0.1, 1.0, HANGING)
        self.trunk.stroke(at_s, 1.0, (0.0, 1.0))
        self.pelvis.stroke(at_s, 1.0, (0.0, -0.01, 0.0))


def boxing(time_s: Array) -> Posture:
    """Return the person at times (N,) [s]."""
    boxer = _Boxer()
    boxer.jab(2.0)
    boxer.jab(2.8)
    boxer.jab(3.7)
    boxer.cross(4.02)
    boxer.slip(4.9, 0.11)
    boxer.jab(5.8)
    boxer.cross(6.12)
    boxer.hook(6.72)
    boxer.slip(7.6, -0.11)
    boxer.hook(8.4)
    boxer.cross(8.82)
    boxer.uppercut(9.9)
    boxer.hook(10.52)
    boxer.jab(11.5)
    boxer.cross(11.82)
    boxer.rest(12.9)
    posture = embody(time_s, boxer.pelvis, boxer.trunk, boxer.gaze, *boxer.hands.values())
    bouncing = np.interp(time_s, [1.2, 2.0, 12.4, 13.2], [0.0, 1.0, 1.0, 0.0])
    posture.pelvis[:, 1] += 0.012 * bouncing * np.sin(2.0 * np.pi * 1.7 * time_s)
    return posture
