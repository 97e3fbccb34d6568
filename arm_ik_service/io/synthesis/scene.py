"""What a scene is: a performance in time, and what becomes of it on the way to the file.

A hand posture is the wrist in the girdle frame (origin between the shoulders, x to the hand's own side, y up, z back)
in metres, then pronation, wrist flexion, ulnar deviation and elbow lift in degrees: see `person._arm`. Both hands are
written as right ones. A fist round a controller sits in a slightly extended wrist.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from arm_ik_service.geometry.batch import Array
from arm_ik_service.io.session import RecordedFrame
from arm_ik_service.io.synthesis.motion import Movement
from arm_ik_service.io.synthesis.person import Posture, pose_person
from arm_ik_service.io.synthesis.sensors import Loss, sense

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


def embody(
    time_s: Array, pelvis: Movement, trunk: Movement, gaze: Movement, left: Movement, right: Movement
) -> Posture:
    """Return the person, who besides what is asked breathes, sways, glances about and has hands that tremble."""
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
