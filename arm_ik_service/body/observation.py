"""What a stretch of frames shows of a person, in the chest's frame: the material that calibration works on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from arm_ik_service.body.learning import EYES_PER_STATURE, STANDING_EYES_M
from arm_ik_service.body.profile import Profile
from arm_ik_service.body.state import BODY
from arm_ik_service.body.step import initialise_body, step_body
from arm_ik_service.compiled import compiled
from arm_ik_service.geometry import batch
from arm_ik_service.settings import BodySettings, TrackingSettings, to_record
from arm_ik_service.tracking.state import ACCEPTED, TRACKING
from arm_ik_service.tracking.step import initialise_tracking, step_tracking

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


@compiled
def _observe(tracking: Any, body: Any, frames: Any, tracked: Any, placed: Any, seen: Any, ts: Any, bs: Any) -> None:
    for k in range(len(frames)):
        # a recording is in order by itself: no receive time is needed to judge it
        seen[k] = step_tracking(tracking[0], frames[k], frames[k].sample_time_ns, ts) == ACCEPTED
        if seen[k]:
            body[0].settled = 0.0
            step_body(body[0], tracking[0], bs)
            for hand in range(2):
                seen[k] = seen[k] and tracking[0].hands[hand].position_age_s == 0.0
                seen[k] = seen[k] and tracking[0].hands[hand].rotation_age_s == 0.0
            seen[k] = seen[k] and tracking[0].head.position_age_s == 0.0
            tracked[k] = tracking[0]
            placed[k] = body[0]


def observe(frames: np.ndarray[Any, Any], profile: Profile) -> Observation:
    """Track FRAME records (N,) and place the person of `profile` in them."""
    tracking, body = np.zeros(1, TRACKING), np.zeros(1, BODY)
    initialise_tracking(tracking[0])
    initialise_body(body[0], profile)
    tracked, placed = np.zeros(len(frames), TRACKING), np.zeros(len(frames), BODY)
    seen = np.zeros(len(frames), np.bool_)
    settings = to_record(TrackingSettings()), to_record(BodySettings(learns=False))
    _observe(tracking, body, frames, tracked, placed, seen, *settings)

    tracked, placed = tracked[seen], placed[seen]
    hands = tracked["hands"]
    chest = np.concatenate([placed["chest_position"], placed["chest_rotation"]], axis=1)
    chest_from_world = batch.inverse(chest)[:, None]
    return Observation(
        t=tracked["sample_time_ns"] * 1e-9,
        eye_height_m=tracked["head"]["position"][:, 1].copy(),
        hand_speed=np.linalg.norm(hands["linear_velocity"], axis=2),
        grips=_as_right(chest_from_world, hands),
        wrists=_as_right(chest_from_world, placed["wrists"]),
    )


def _as_right(chest_from_world: Array, poses: np.ndarray[Any, Any]) -> Array:
    """Poses (N, 2, 7) in the chest's frame, the left ones mirrored."""
    in_chest = batch.compose(chest_from_world, np.concatenate([poses["position"], poses["rotation"]], axis=2))
    in_chest[:, 0] = batch.mirror_pose(in_chest[:, 0])
    return in_chest
