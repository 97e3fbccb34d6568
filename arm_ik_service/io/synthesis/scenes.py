"""The recordings there are."""

from __future__ import annotations

from arm_ik_service.io.synthesis.boxing import boxing
from arm_ik_service.io.synthesis.reach_and_grab import reach_and_grab
from arm_ik_service.io.synthesis.scene import Scene
from arm_ik_service.io.synthesis.tracking_loss import LOSSES, SKIPPED_S, losing_tracking

SCENES: tuple[Scene, ...] = (
    Scene("reach_and_grab", "taking something off a shelf, handing it over, waving", 72.0, 15.0, 1, reach_and_grab),
    Scene("boxing", "shadow boxing with punches of 5 to 6 m/s", 90.0, 14.5, 2, boxing),
    Scene(
        "tracking_loss",
        "hands that the headset loses behind the back, beside the head and on a table",
        80.0,
        15.0,
        3,
        losing_tracking,
        LOSSES,
        SKIPPED_S,
    ),
)
