"""The recordings in `replay_logs/`: a made-up person in front of made-up sensors, the same on every machine.

    python -m arm_ik_service.io.synthesis replay_logs/

`scenes` lists them; each has a module that says what is done in it. `motion` is how a person gets from one posture to
the next, `person` where head and hands are in a posture, `sensors` what a headset makes of that. All of it but writing
the files is pure.
"""

from __future__ import annotations

from arm_ik_service.io.synthesis.scene import Scene
from arm_ik_service.io.synthesis.scenes import SCENES

__all__ = ["SCENES", "Scene"]
