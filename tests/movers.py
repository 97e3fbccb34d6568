"""People who stand and move both arms about, made of numbers: their bones, and how far their wrists bend, are known."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from persons import HEAD, LEFT, RIGHT, Take, standing

from arm_ik_service.body.profile import BodyMeasures, Grips
from arm_ik_service.geometry import batch

Array = npt.NDArray[np.float64]
GRIP = Grips().right
DEFAULT_GRIP = np.array([*GRIP.position_m, *GRIP.orientation_xyzw])

PEOPLE = [
    BodyMeasures(stature_m=1.6),
    BodyMeasures(stature_m=1.9),
    BodyMeasures(stature_m=1.75, upper_arm_m=0.35, forearm_m=0.27),
    BodyMeasures(stature_m=1.75, upper_arm_m=0.3, forearm_m=0.23),
]


def sway(rng: np.random.Generator, t: Array, lower: npt.ArrayLike, upper: npt.ArrayLike) -> Array:
    """Smooth random angles (N, k) [rad] between bounds [degrees]."""
    lower, upper = np.radians(lower), np.radians(upper)
    phase = rng.uniform(0.0, 2.0 * np.pi, (3, len(lower)))
    speed = rng.uniform(0.5, 4.0, (3, len(lower)))
    wave = np.sin(speed[:, None] * t[None, :, None] + phase[:, None]).sum(axis=0)
    return np.asarray(0.5 * (lower + upper) + 0.5 * (upper - lower) * np.tanh(wave))


def turns(x: Array, y: Array, z: Array) -> Array:
    """Rotations (N, 4): about x, then about z, then about y."""
    zero = np.zeros_like(x)
    about = [np.stack(v, axis=-1) for v in ((x, zero, zero), (zero, zero, z), (zero, y, zero))]
    return batch.multiply(batch.exp(about[2]), batch.multiply(batch.exp(about[1]), batch.exp(about[0])))


def arm(
    rng: np.random.Generator,
    t: Array,
    upper_arm: float,
    forearm: float,
    shoulder: npt.ArrayLike,
    grip: Array,
    flick: float = 1.0,
) -> Array:
    """Grip poses (N, 7) of a right arm that moves about its shoulder; its wrist bends by 25 degrees times `flick`."""
    abduction, flexion, bend, roll = sway(rng, t, [5, -30, 0, -60], [80, 120, 110, 60]).T
    chest_from_upper = turns(flexion, -0.3 * abduction, abduction)
    elbow = np.asarray(shoulder) + batch.rotate(chest_from_upper, [0.0, -upper_arm, 0.0])
    chest_from_fore = batch.multiply(chest_from_upper, turns(bend, 0.0 * bend, 0.0 * bend))
    down = batch.rotate(chest_from_fore, [0.0, -1.0, 0.0])
    # the wrist frame of a straight wrist has its -z along the forearm; then it bends
    hand = batch.multiply(chest_from_fore, batch.exp([-0.5 * np.pi, 0.0, 0.0]))
    hand = batch.multiply(hand, batch.exp(np.stack([0 * roll, 0 * roll, roll], axis=1)))
    bent = flick * sway(rng, t, [-25, -15, -1], [25, 15, 1])
    wrist = np.concatenate([elbow + forearm * down, batch.multiply(hand, batch.exp(bent))], axis=1)
    return batch.compose(wrist, grip)


def lively(seconds: float, body: BodyMeasures, grip: Array = DEFAULT_GRIP, seed: int = 0, flick: float = 1.0) -> Take:
    """Return someone of these measures who stands and moves both arms about; left grips are mirrored."""
    rng = np.random.default_rng(seed)
    take = standing(seconds, 60.0)
    length = body.upper_arm + body.forearm
    eyes = 0.936 * body.stature_m
    half = 0.5 * body.shoulder_width
    shoulder = np.array([half, eyes - 0.165 * length / 0.56 - 0.26 * half, 0.13 * length / 0.56])
    take.poses[:, HEAD, 1] = eyes
    take.poses[:, RIGHT] = arm(rng, take.t, body.upper_arm, body.forearm, shoulder, grip, flick)
    take.poses[:, LEFT] = batch.mirror_pose(arm(rng, take.t, body.upper_arm, body.forearm, shoulder, grip, flick))
    return take
