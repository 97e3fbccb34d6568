"""Reach to where a headset cannot see, put a controller down, and come back each time."""

from __future__ import annotations

from arm_ik_service.geometry.batch import Array
from arm_ik_service.io.synthesis.motion import Movement
from arm_ik_service.io.synthesis.person import Posture
from arm_ik_service.io.synthesis.scene import AT_CHEST, BEFORE_FACE, READY, HandPosture, embody
from arm_ik_service.io.synthesis.sensors import Loss

LOSSES = (
    Loss("right", 2.55, 2.95, "inferred"),
    Loss("right", 2.95, 4.15, "lost"),
    Loss("left", 3.9, 5.45, "inferred"),
    Loss("right", 6.3, 8.0, "held"),
    Loss("left", 8.1, 10.4, "absent"),
    Loss("right", 12.55, 12.85, "inferred"),
    Loss("left", 11.75, 11.85, "lost"),
)
SKIPPED_S = (1.5, 4.6, 4.6125, 9.2, 9.2125, 9.225, 13.5)


def losing_tracking(time_s: Array) -> Posture:
    """Return the person at times (N,) [s]."""
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
    return embody(time_s, pelvis, trunk, gaze, left, right)
