"""People made of numbers: head and two hands in time, and their way through the tracking and body stages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from arm_ik_service.body.profile import BodyMeasures, Profile
from arm_ik_service.body.state import BODY
from arm_ik_service.body.step import initialise_body, step_body
from arm_ik_service.compiled import compiled
from arm_ik_service.geometry import batch
from arm_ik_service.settings import BodySettings, TrackingSettings, to_record
from arm_ik_service.tracking.frame import FRAME
from arm_ik_service.tracking.state import TRACKING
from arm_ik_service.tracking.step import ACCEPTED, initialise_tracking, step_tracking
from arm_ik_service.wire.messages import FULLY_TRACKED

Array = npt.NDArray[np.float64]
Records = np.ndarray[Any, Any]

HEAD, LEFT, RIGHT = 0, 1, 2
MS = 1_000_000


def distance_m(truth: Mapping[str, Array], a: str, b: str) -> float:
    """Median distance [m] between two joints of a motion capture."""
    return float(np.median(np.linalg.norm(truth[a] - truth[b], axis=1)))


def measures_of(truth: Mapping[str, Array]) -> BodyMeasures:
    """What a motion capture says of its person's bones."""
    return BodyMeasures(
        upper_arm_m=distance_m(truth, "left_shoulder", "left_elbow"),
        forearm_m=distance_m(truth, "left_elbow", "left_wrist"),
        shoulder_width_m=distance_m(truth, "left_shoulder", "right_shoulder"),
    )


@dataclass(frozen=True)
class Take:
    """A stretch of motion: times [s] (N,), poses (N, 3, 7) of head, left, right, and their location flags (N, 3)."""

    t: Array
    poses: Array
    flags: npt.NDArray[np.int64]

    @property
    def frames(self) -> Records:
        """The same as FRAME records (N,); the clock starts at one second."""
        frames = np.zeros(len(self.t), FRAME)
        frames["seq"] = np.arange(len(self.t))
        frames["sample_time_ns"] = np.round((self.t + 1.0) * 1e9).astype(np.int64)
        for device, samples in enumerate((frames["head"], frames["hands"][:, 0], frames["hands"][:, 1])):
            samples["position"] = self.poses[:, device, :3]
            samples["rotation"] = self.poses[:, device, 3:]
            samples["location_flags"] = self.flags[:, device]
        return frames

    def moved(self, device: int, offset: npt.ArrayLike) -> Take:
        """The same with `offset` [m], (3,) or (N, 3), added to the positions of one device."""
        poses = self.poses.copy()
        poses[:, device, :3] += np.asarray(offset, float)
        return replace(self, poses=poses)

    def turned(self, device: int, rotation: npt.ArrayLike) -> Take:
        """The same with one device's rotations replaced by `rotation`, (4,) or (N, 4)."""
        poses = self.poses.copy()
        poses[:, device, 3:] = rotation
        return replace(self, poses=poses)

    def flagged(self, device: int, when: slice, flags: int) -> Take:
        """The same with other location flags for one device over a stretch of frames."""
        changed = self.flags.copy()
        changed[when, device] = flags
        return replace(self, flags=changed)

    def in_space(self, pose: npt.ArrayLike, when: slice = slice(None)) -> Take:
        """The same with everything moved by one rigid motion (7,) over a stretch of frames."""
        poses = self.poses.copy()
        poses[when] = batch.compose(pose, poses[when])
        return replace(self, poses=poses)


def standing(seconds: float = 1.0, rate: float = 90.0) -> Take:
    """Return someone who looks along -Z with both hands half raised, and holds still."""
    t = np.arange(round(seconds * rate)) / rate
    poses = np.zeros((len(t), 3, 7))
    poses[:, :, 6] = 1.0
    poses[:, HEAD, :3] = (0.0, 1.65, 0.0)
    poses[:, LEFT, :3] = (-0.25, 1.2, -0.3)
    poses[:, RIGHT, :3] = (0.25, 1.2, -0.3)
    return Take(t, poses, np.full((len(t), 3), FULLY_TRACKED))


def stroke(t: Array, start_s: float, duration_s: float, way: npt.ArrayLike) -> Array:
    """Return offsets (N, 3) of a minimum-jerk movement by `way`; its top speed is 1.875 |way| / duration."""
    x = np.clip((t - start_s) / duration_s, 0.0, 1.0)[:, None]
    return np.asarray((10.0 * x**3 - 15.0 * x**4 + 6.0 * x**5) * np.asarray(way))


def yaw_degrees(rotations: Array) -> Array:
    """Return the yaw (N,) of rotations (N, 4) over time, unwrapped; positive to the left."""
    z = batch.rotate(rotations, [0.0, 0.0, 1.0])
    return np.degrees(np.unwrap(np.arctan2(z[:, 0], z[:, 2])))


@compiled
def _run(
    tracking: Any, body: Any, frames: Any, receive_ns: Any, tracked: Any, placed: Any, verdicts: Any, ts: Any, bs: Any
) -> None:
    for k in range(len(frames)):
        verdicts[k] = step_tracking(tracking[0], frames[k], receive_ns[k], ts)
        if verdicts[k] == ACCEPTED:
            step_body(body[0], tracking[0], bs)
        tracked[k] = tracking[0]
        placed[k] = body[0]


@dataclass(frozen=True)
class Run:
    """What the stages made of every frame."""

    tracking: Records
    body: Records
    verdicts: npt.NDArray[np.int64]

    def position(self, device: int) -> Array:
        """World positions (N, 3) [m] of one device."""
        return np.asarray(self.device(device)["position"])

    def device(self, device: int) -> Records:
        """DEVICE records (N,)."""
        tracking = self.tracking
        return np.asarray(tracking["head"] if device == HEAD else tracking["hands"][:, device - 1])


def run(
    frames: Records,
    *,
    receive_ns: npt.NDArray[np.int64] | None = None,
    profile: Profile | None = None,
    tracking: TrackingSettings | None = None,
    body: BodySettings | None = None,
    settled_m: float = 0.0,
) -> Run:
    """Send FRAME records (N,) through both stages; received when they were sampled unless said otherwise."""
    t, b = np.zeros(1, TRACKING), np.zeros(1, BODY)
    initialise_tracking(t[0])
    initialise_body(b[0], profile or Profile())
    b[0].settled = settled_m
    n = len(frames)
    out = Run(np.zeros(n, TRACKING), np.zeros(n, BODY), np.zeros(n, np.int64))
    times = frames["sample_time_ns"] if receive_ns is None else receive_ns
    records = to_record(tracking or TrackingSettings()), to_record(body or BodySettings())
    _run(t, b, frames, np.ascontiguousarray(times), out.tracking, out.body, out.verdicts, *records)
    return out


def speeds(t: Array, positions: Array) -> Array:
    """Return speeds [m/s] (N - 1,) from frame to frame."""
    return np.asarray(np.linalg.norm(np.diff(positions, axis=0), axis=1) / np.diff(t))
