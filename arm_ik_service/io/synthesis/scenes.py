"""What is done in each recording: postures by name, and who goes to which when.

A hand posture is the wrist in the girdle frame (origin between the shoulders, x to the hand's own side, y up, z back)
in metres, then pronation, wrist flexion, ulnar deviation and elbow lift in degrees: see `person._arm`. Both hands are
written as right ones. A fist round a controller sits in a slightly extended wrist.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from arm_ik_service.geometry import batch
from arm_ik_service.geometry.batch import Array
from arm_ik_service.io.session import RecordedFrame
from arm_ik_service.io.synthesis.motion import Movement
from arm_ik_service.io.synthesis.person import Posture, pose_person
from arm_ik_service.io.synthesis.sensors import Loss, sense
from arm_ik_service.wire.messages import Side

HandPosture = tuple[float, float, float, float, float, float, float]

# standing about
HANGING: HandPosture = (0.23, -0.55, -0.06, 95.0, -8.0, 0.0, 10.0)
READY: HandPosture = (0.17, -0.35, -0.24, 95.0, -18.0, 4.0, 12.0)
AT_CHEST: HandPosture = (0.07, -0.23, -0.27, 85.0, -15.0, 6.0, 20.0)
BEFORE_FACE: HandPosture = (0.09, 0.00, -0.28, 60.0, -12.0, 4.0, 18.0)


@dataclass(frozen=True)
class Scene:
    """One recording to be made."""

    name: str
    about: str
    rate_hz: float
    duration_s: float
    seed: int
    perform: Callable[[Array], Posture]  # times (N,) [s] to the person at these times
    losses: tuple[Loss, ...] = ()
    skipped_s: tuple[float, ...] = ()  # moments at which the sender misses a frame

    @property
    def time_s(self) -> Array:
        """The times (N,) of its frames."""
        return np.arange(round(self.duration_s * self.rate_hz)) / self.rate_hz

    def frames(self) -> Iterator[RecordedFrame]:
        """Perform and record it: the same frames every time."""
        poses = pose_person(self.perform(self.time_s))
        return sense(poses, self.time_s, self.losses, self.skipped_s, self.seed)


def _posture(
    time_s: Array, pelvis: Movement, trunk: Movement, gaze: Movement, left: Movement, right: Movement
) -> Posture:
    """Degrees to radians, and what nobody can leave off: breathing, swaying, and hands that tremble."""
    hands = []
    for k, hand in enumerate((left, right)):
        values = hand.at(time_s)
        values[:, 3:] = np.radians(values[:, 3:])
        for axis, (rate_hz, amplitude_m) in enumerate(((8.3, 0.0004), (9.1, 0.0005), (0.31, 0.004))):
            values[:, axis] += amplitude_m * np.sin(2.0 * np.pi * rate_hz * time_s + 1.3 * axis + 2.1 * k)
        hands.append(values)
    sway = np.stack(
        [
            0.006 * np.sin(2.0 * np.pi * 0.23 * time_s) + 0.003 * np.sin(2.0 * np.pi * 0.61 * time_s + 0.7),
            0.002 * np.sin(2.0 * np.pi * 0.28 * time_s),
            0.007 * np.sin(2.0 * np.pi * 0.19 * time_s + 1.9) + 0.003 * np.sin(2.0 * np.pi * 0.53 * time_s),
        ],
        axis=1,
    )
    glances = np.stack(
        [1.2 * np.sin(2.0 * np.pi * 0.37 * time_s), 0.8 * np.sin(2.0 * np.pi * 0.29 * time_s + 0.4)], axis=1
    )
    return Posture(
        pelvis=pelvis.at(time_s) + sway,
        trunk=np.radians(trunk.at(time_s)),
        gaze=np.radians(gaze.at(time_s) + glances),
        left=hands[0],
        right=hands[1],
    )


def _reach_and_grab(time_s: Array) -> Posture:
    """Take something off a shelf, look at it, hand it over, put it on a low table, and wave goodbye."""
    shelf: HandPosture = (0.16, 0.12, -0.47, 88.0, -12.0, 4.0, 24.0)
    before_shelf: HandPosture = (0.17, 0.06, -0.38, 90.0, -16.0, 4.0, 24.0)
    taking_over: HandPosture = (0.02, -0.16, -0.30, 92.0, -10.0, 4.0, 26.0)
    table: HandPosture = (0.26, -0.41, -0.34, 125.0, -24.0, 4.0, 14.0)
    waving_in: HandPosture = (0.25, 0.04, -0.26, 142.0, -6.0, -4.0, 20.0)
    waving_out: HandPosture = (0.37, 0.02, -0.24, 142.0, -6.0, 10.0, 24.0)
    right = (
        Movement(HANGING)
        .stroke(1.2, 1.0, before_shelf)
        .stroke(2.0, 0.5, shelf)
        .stroke(2.9, 1.0, AT_CHEST)
        .stroke(3.9, 0.7, BEFORE_FACE)
        .stroke(4.7, 0.6, (*BEFORE_FACE[:3], 105.0, 8.0, -4.0, 26.0))  # turn it over
        .stroke(5.4, 0.6, (*BEFORE_FACE[:3], 45.0, -16.0, 4.0, 16.0))
        .stroke(6.3, 0.8, taking_over)
        .stroke(7.9, 0.9, READY)
        .stroke(10.6, 0.8, waving_in)
    )
    for i in range(6):
        right.stroke(11.3 + 0.3 * i, 0.32, waving_out if i % 2 == 0 else waving_in)
    right.stroke(13.4, 1.0, HANGING)
    left = (
        Movement(HANGING)
        .stroke(3.6, 0.9, READY)
        .stroke(6.4, 0.8, taking_over)
        .stroke(7.6, 0.8, (0.20, -0.24, -0.32, 100.0, -14.0, 4.0, 18.0))
        .stroke(8.2, 0.9, table)
        .stroke(9.5, 0.9, READY)
        .stroke(13.2, 1.0, HANGING)
    )
    trunk = (
        Movement((0.0, 1.0))
        .stroke(1.3, 1.1, (9.0, 5.0))
        .stroke(2.9, 1.0, (2.0, 1.0))
        .stroke(7.7, 1.1, (24.0, 13.0))
        .stroke(9.4, 1.1, (0.0, 1.0))
        .stroke(10.6, 1.0, (-5.0, 0.0))
        .stroke(13.3, 1.0, (0.0, 1.0))
    )
    gaze = (
        Movement((0.0, -4.0))
        .stroke(0.8, 0.5, (-6.0, 4.0))
        .stroke(3.2, 0.7, (-5.0, -22.0))
        .stroke(7.4, 0.6, (32.0, -38.0))
        .stroke(9.6, 0.6, (0.0, -6.0))
        .stroke(10.4, 0.4, (-4.0, 2.0))
        .stroke(13.9, 0.6, (0.0, -5.0))
    )
    pelvis = (
        Movement((0.0, -0.01, 0.0))
        .stroke(1.3, 1.0, (0.01, -0.01, -0.06))
        .stroke(3.0, 1.0, (0.0, -0.01, 0.0))
        .stroke(7.8, 1.0, (-0.05, -0.05, -0.04))
        .stroke(9.4, 1.0, (0.0, -0.01, 0.0))
    )
    return _posture(time_s, pelvis, trunk, gaze, left, right)


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


def _boxing(time_s: Array) -> Posture:
    """Shadow boxing: jabs, crosses, hooks and an uppercut, singly and in combinations, between slips and bounces."""
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
    posture = _posture(time_s, boxer.pelvis, boxer.trunk, boxer.gaze, *boxer.hands.values())
    bouncing = np.interp(time_s, [1.2, 2.0, 12.4, 13.2], [0.0, 1.0, 1.0, 0.0])
    posture.pelvis[:, 1] += 0.012 * bouncing * np.sin(2.0 * np.pi * 1.7 * time_s)
    return posture


def _losing_tracking(time_s: Array) -> Posture:
    """Reach to where a headset cannot see, put a controller down, and come back each time."""
    behind_back: HandPosture = (0.20, -0.40, 0.14, 120.0, -4.0, 4.0, 34.0)
    beside_hip: HandPosture = (0.36, -0.42, -0.02, 105.0, -8.0, 4.0, 26.0)
    beside_head: HandPosture = (0.30, 0.21, -0.06, 60.0, -10.0, 4.0, 62.0)
    low_side: HandPosture = (0.33, -0.47, 0.05, 100.0, -8.0, 4.0, 18.0)
    aside: HandPosture = (0.47, -0.05, -0.30, 95.0, -12.0, 4.0, 30.0)
    ahead: HandPosture = (0.15, -0.06, -0.47, 100.0, -14.0, 4.0, 24.0)
    on_table: HandPosture = (0.22, -0.40, -0.36, 118.0, -20.0, 4.0, 14.0)
    right = (
        Movement(READY)
        .stroke(1.0, 0.8, ahead)
        .stroke(1.9, 0.7, beside_hip)
        .stroke(2.4, 0.6, behind_back)
        .stroke(3.6, 0.6, beside_hip)
        .stroke(4.0, 0.7, READY)
        .stroke(5.0, 0.7, aside)
        .stroke(5.9, 0.7, beside_head)
        .stroke(7.5, 0.7, BEFORE_FACE)
        .stroke(8.0, 0.8, READY)
        .stroke(11.3, 0.7, ahead)
        .stroke(12.3, 0.6, aside)
        .stroke(13.2, 0.8, READY)
    )
    left = (
        Movement(READY)
        .stroke(3.4, 0.8, low_side)
        .stroke(5.2, 0.8, AT_CHEST)
        .stroke(7.0, 0.9, on_table)
        .stroke(10.6, 0.9, READY)
        .stroke(11.4, 0.7, ahead)
        .stroke(12.6, 0.8, READY)
    )
    trunk = (
        Movement((0.0, 1.0))
        .stroke(2.0, 0.9, (-12.0, 0.0))
        .stroke(3.6, 0.9, (6.0, 2.0))
        .stroke(5.0, 0.8, (-10.0, 1.0))
        .stroke(6.9, 1.0, (12.0, 11.0))
        .stroke(10.6, 1.0, (0.0, 1.0))
    )
    gaze = (
        Movement((0.0, -8.0))
        .stroke(1.0, 0.5, (-4.0, -6.0))
        .stroke(2.6, 0.6, (14.0, -4.0))
        .stroke(4.9, 0.6, (-24.0, -4.0))
        .stroke(6.7, 0.6, (16.0, -36.0))
        .stroke(9.6, 0.7, (0.0, -6.0))
        .stroke(10.6, 0.5, (12.0, -26.0))
        .stroke(11.6, 0.5, (0.0, -6.0))
    )
    pelvis = Movement((0.0, -0.01, 0.0)).stroke(6.9, 1.0, (-0.03, -0.04, -0.03)).stroke(10.5, 1.0, (0.0, -0.01, 0.0))
    return _posture(time_s, pelvis, trunk, gaze, left, right)


SCENES: tuple[Scene, ...] = (
    Scene("reach_and_grab", "taking something off a shelf, handing it over, waving", 72.0, 15.0, 1, _reach_and_grab),
    Scene("boxing", "shadow boxing with punches of 5 to 6 m/s", 90.0, 14.5, 2, _boxing),
    Scene(
        "tracking_loss",
        "hands that the headset loses behind the back, beside the head and on a table",
        80.0,
        15.0,
        3,
        _losing_tracking,
        losses=(
            Loss("right", 2.55, 2.95, "inferred"),
            Loss("right", 2.95, 4.15, "lost"),
            Loss("left", 3.9, 5.45, "inferred"),
            Loss("right", 6.3, 8.0, "held"),
            Loss("left", 8.1, 10.4, "absent"),
            Loss("right", 12.55, 12.85, "inferred"),
            Loss("left", 11.75, 11.85, "lost"),
        ),
        skipped_s=(1.5, 4.6, 4.6125, 9.2, 9.2125, 9.225, 13.5),
    ),
)
