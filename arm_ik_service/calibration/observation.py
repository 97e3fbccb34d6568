"""What a stretch of frames shows of a person, in the chest's frame: the material that calibration works on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from arm_ik_service.body.learning import EYES_PER_STATURE, STANDING_EYES_M
from arm_ik_service.body.profile import Profile
from arm_ik_service.compiled import compiled, record_dtype
from arm_ik_service.geometry import batch
from arm_ik_service.geometry import scalar as g
from arm_ik_service.pipeline import PERSON, arm_models, initialise_person, settings_record, step_person
from arm_ik_service.settings import BodySettings, Settings
from arm_ik_service.tracking.state import ACCEPTED

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

LONGEST_STEP_S = 0.1  # a longer gap is not time in which anybody was seen


@dataclass(frozen=True)
class Observation:
    """Accepted frames in which head and both hands were seen. Left hands are mirrored: all is as on the right."""

    t: Array  # (N,) [s]
    eye_height_m: Array  # (N,)
    hand_speed: Array  # (N, 2) [m/s]
    grips: Array  # (N, 2, 7) in the chest's frame
    wrists: Array  # (N, 2, 7) the same by the profile's grip offsets

    def __len__(self) -> int:
        return len(self.t)

    @property
    def seconds(self) -> float:
        """Time that the frames cover, without the gaps between them."""
        return float(np.sum(np.minimum(np.diff(self.t), LONGEST_STEP_S)))

    def part(self, which: Any) -> Observation:
        """Return the frames that an index selects."""
        return Observation(*(getattr(self, name)[which] for name in self.__dataclass_fields__))

    def stature_m(self, percentile: float) -> float | None:
        """Stature [m] by a percentile of the height of the eyes; None unless it is that of someone who stands."""
        eyes = float(np.percentile(self.eye_height_m, percentile))
        lowest, highest = STANDING_EYES_M
        return eyes / EYES_PER_STATURE if lowest <= eyes <= highest else None


_SEEN = record_dtype(
    [
        ("t", np.float64),
        ("eye_height_m", np.float64),
        ("hand_speed", np.float64, (2,)),
        ("chest", np.float64, (7,)),
        ("grips", np.float64, (2, 7)),
        ("wrists", np.float64, (2, 7)),
    ]
)


@compiled
def _all_seen(tracking: Any) -> bool:
    seen = tracking.head.position_age_s == 0.0 and tracking.head.rotation_age_s == 0.0
    for k in range(2):
        hand = tracking.hands[k]
        seen = seen and hand.position_age_s == 0.0 and hand.rotation_age_s == 0.0
    return bool(seen)


@compiled
def _note(seen: Any, tracking: Any, body: Any) -> None:
    seen.t = 1e-9 * tracking.sample_time_ns
    seen.eye_height_m = tracking.head.position[1]
    chest = g.quaternion(body.chest_rotation)
    unsettled = g.rotate(chest, (0.0, body.settled, 0.0))  # the shoulders as the measures put them
    g.store_pose(seen.chest, g.add(g.vector(body.chest_position), unsettled), chest)
    for k in range(2):
        hand, wrist = tracking.hands[k], body.wrists[k]
        seen.hand_speed[k] = g.norm(g.vector(hand.linear_velocity))
        g.store_pose(seen.grips[k], g.vector(hand.position), g.quaternion(hand.rotation))
        g.store_pose(seen.wrists[k], g.vector(wrist.position), g.quaternion(wrist.rotation))


@compiled
def _observe(people: Any, frames: Any, seen: Any, settings: Any) -> int:
    """Fill `seen` with the frames in which everything was seen; how many they are."""
    person, count = people[0], 0
    for k in range(len(frames)):
        # a recording is in order by itself: no receive time is needed to judge it
        if step_person(person, frames[k], frames[k].sample_time_ns, 0.0, settings[0]) != ACCEPTED:
            continue
        if _all_seen(person.tracking):
            _note(seen[count], person.tracking, person.body)
            count += 1
    return count


def observe(frames: np.ndarray[Any, Any], profile: Profile) -> Observation:
    """Track FRAME records (N,) and place the person of `profile` in them, arms and all: trunks give way to them."""
    people = np.zeros(1, PERSON)
    initialise_person(people[0], profile, arm_models(profile))
    settings = settings_record(Settings(body=BodySettings(learns=False)))
    seen = np.zeros(len(frames), _SEEN)
    seen = seen[: _observe(people, frames, seen, settings)]
    chest_from_world = batch.inverse(seen["chest"])[:, None]
    return Observation(
        t=seen["t"],
        eye_height_m=seen["eye_height_m"],
        hand_speed=seen["hand_speed"],
        grips=_as_right(batch.compose(chest_from_world, seen["grips"])),
        wrists=_as_right(batch.compose(chest_from_world, seen["wrists"])),
    )


def _as_right(poses: Array) -> Array:
    """Poses (N, 2, 7) in the chest's frame with the left ones mirrored."""
    poses[:, 0] = batch.mirror_pose(poses[:, 0])
    return poses
