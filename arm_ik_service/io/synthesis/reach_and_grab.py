"""Take something off a shelf, look at it, hand it over, put it on a low table, and wave goodbye."""

from __future__ import annotations

from arm_ik_service.geometry.batch import Array
from arm_ik_service.io.synthesis.motion import Movement
from arm_ik_service.io.synthesis.person import Posture
from arm_ik_service.io.synthesis.scene import AT_CHEST, BEFORE_FACE, HANGING, READY, HandPosture, embody


def reach_and_grab(time_s: Array) -> Posture:
    """Return the person at times (N,) [s]."""
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
    return embody(time_s, pelvis, trunk, gaze, left, right)
