"""Beat Saber Open Replay, version 1: head and two sabers at the headset's rate, from a game that millions play.

Layout (little endian): u32 magic, u8 version, then sections, each opened by a u8. Only section 0 (info) and section 1
(frames) are read; what follows says nothing about poses. Nothing in the file is trusted: every count and length is
bounded by the bytes that are left.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from arm_ik_service.errors import SessionError
from arm_ik_service.geometry import batch
from arm_ik_service.io.samples import (
    ONLY_VALID,
    Flags,
    FrozenDevice,
    Times,
    clean_poses,
    to_nanoseconds,
    to_tracked_poses,
)
from arm_ik_service.io.session import BSOR_MAGIC, DEFAULT_AVATAR, RecordedFrame, RecordedProfile
from arm_ik_service.wire.messages import FULLY_TRACKED, VERSION, ArmsState, ControllerFrame, TrackedPose

FRAME = np.dtype(
    [("time_s", "<f4"), ("fps", "<i4"), ("head", "<f4", (7,)), ("left", "<f4", (7,)), ("right", "<f4", (7,))]
)
BLOCK = 1024  # frames converted at once: vectorised, yet a hostile count costs no memory

# Song time runs at these multiples of wall time: FS faster song, SF super fast, SS slower.
SPEED_OF_MODIFIER = {"FS": 1.2, "SF": 1.5, "SS": 0.85}

# The saber lies where the game's pointer does, which is the controller's OpenXR aim pose. On a Touch controller the
# grip is pitched up from the aim by 45 degrees and sits 49 mm behind and 16 mm below it (grip and target-ray spaces
# of a Quest 3 in WebXR). So the blade leaves the fist on the thumb's side, tilted forward as a held stick is. Players
# add offsets of their own, mostly a roll: that part belongs into the calibration profile.
SABER_FROM_GRIP = np.array([0.0, -0.016, 0.049, math.sin(math.pi / 8), 0.0, 0.0, math.cos(math.pi / 8)])

# z of the left-handed Unity axes points forward, OpenXR's backward
_POSITION_TO_OPENXR = np.array([1.0, 1.0, -1.0])
_ROTATION_TO_OPENXR = np.array([-1.0, -1.0, 1.0, 1.0])

_STRINGS_BEFORE_SCORE = (
    *("format_version", "game_version", "timestamp", "player_id", "player_name", "platform", "tracking_system"),
    *("headset", "controller", "hash", "song_name", "mapper", "difficulty"),
)
_STRINGS_AFTER_SCORE = ("mode", "environment", "modifiers")
_INFO_TAIL = struct.Struct("<f?4f")  # jumpDistance, leftHanded, height, startTime, failTime, speed


class _Bytes:
    """A file read forwards that knows where it is and what is left."""

    def __init__(self, path: Path, file: BinaryIO) -> None:
        self.path, self.file = path, file
        self.size = file.seek(0, 2)
        self.offset = file.seek(0)

    def take(self, count: int, what: str) -> bytes:
        if count < 0 or count > self.size - self.offset:
            left = self.size - self.offset
            raise SessionError(
                f"{self.path}: {what} would take {count} bytes but {left} are left; the file is cut off or damaged",
                offset=self.offset,
            )
        data = self.file.read(count)
        self.offset += count
        return data

    def integer(self, what: str) -> int:
        return int.from_bytes(self.take(4, what), "little", signed=True)

    def section(self, number: int, what: str) -> None:
        if (found := self.take(1, f"the opening of the {what}")[0]) != number:
            raise SessionError(
                f"{self.path}: section {found} where the {what} (section {number}) should be; the file is damaged",
                offset=self.offset - 1,
            )

    def string(self, what: str) -> str:
        return self.take(self.integer(f"the length of {what}"), what).decode("utf-8", "replace")


class BsorSession:
    """One replay. Times are the player's, not the song's: song time over the speed modifier."""

    def __init__(
        self,
        path: Path,
        metadata: Mapping[str, str | float | bool],
        first_frame: int,
        frame_count: int,
        duration_s: float,
        warnings: tuple[str, ...],
    ) -> None:
        self.path, self.metadata, self.frame_count, self.duration_s = path, metadata, frame_count, duration_s
        self.warnings = warnings
        self.avatars: tuple[str, ...] = (DEFAULT_AVATAR,)
        self._first_frame = first_frame  # byte offset

    def frames(self) -> Iterator[RecordedFrame]:
        """Read the frames in blocks; a pose that is none (zero quaternion, the origin, frozen) comes without flags."""
        speed = float(self.metadata["speed"])
        head, left, right = _Device(), _Device(SABER_FROM_GRIP), _Device(SABER_FROM_GRIP)
        try:
            with self.path.open("rb") as file:
                file.seek(self._first_frame)
                for start in range(0, self.frame_count, BLOCK):
                    wanted = min(BLOCK, self.frame_count - start) * FRAME.itemsize
                    if len(data := file.read(wanted)) < wanted:
                        raise SessionError(f"{self.path}: the file became shorter while it was read")
                    block = np.frombuffer(data, FRAME)
                    times_ns = to_nanoseconds(block["time_s"].astype(np.float64) / speed)
                    for seq, (time_ns, *poses) in enumerate(
                        zip(
                            times_ns.tolist(),
                            head.poses(times_ns, block["head"]),
                            left.poses(times_ns, block["left"]),
                            right.poses(times_ns, block["right"]),
                            strict=True,
                        ),
                        start,
                    ):
                        yield RecordedFrame(
                            DEFAULT_AVATAR, ControllerFrame(VERSION, seq, time_ns, time_ns, "stage", *poses), None
                        )
        except OSError as error:
            raise SessionError(f"{self.path}: {error.strerror}") from error

    def arms(self) -> Iterator[ArmsState]:
        """Nothing: a replay holds no answers."""
        return iter(())

    def calibrations(self, avatar: str) -> tuple[RecordedProfile, ...]:
        """Nothing: a replay holds no profile."""
        return ()


def open_bsor(path: Path) -> BsorSession:
    """Read a replay's description and find its frames. Raises SessionError naming the byte; see `open_session`."""
    try:
        with path.open("rb") as file:
            return _open(path, _Bytes(path, file), file)
    except OSError as error:
        raise SessionError(f"{path}: {error.strerror}") from error


def _open(path: Path, data: _Bytes, file: BinaryIO) -> BsorSession:
    if data.take(4, "the magic number") != BSOR_MAGIC:
        raise SessionError(f"{path}: not a Beat Saber Open Replay", offset=0)
    if (version := data.take(1, "the format version")[0]) != 1:
        raise SessionError(f"{path}: replay format version {version}, but only version 1 is known", offset=4)
    data.section(0, "description")
    metadata: dict[str, str | float | bool] = {"format": "bsor"}
    metadata |= {name: data.string(name) for name in _STRINGS_BEFORE_SCORE}
    metadata["score"] = data.integer("score")
    metadata |= {name: data.string(name) for name in _STRINGS_AFTER_SCORE}
    _, left_handed, height, _, _, _ = _INFO_TAIL.unpack(data.take(_INFO_TAIL.size, "the end of the description"))
    metadata["left_handed"] = left_handed
    if 0.5 <= height <= 2.6:  # 0: the player never set it
        metadata["stature_m"] = height
    metadata["speed"] = speed = _speed(str(metadata["modifiers"]))

    data.section(1, "frames")
    promised = data.integer("the number of frames")
    if promised <= 0:
        raise SessionError(f"{path}: the replay says that it holds {promised} frames", offset=data.offset - 4)
    present = min(promised, (data.size - data.offset) // FRAME.itemsize)
    if present == 0:
        raise SessionError(f"{path}: the file ends before its first frame; copy it again", offset=data.offset)
    end = data.offset + present * FRAME.itemsize
    warnings = (
        ()
        if present == promised
        else (f"{path}: cut off at byte {data.size}: {present} of {promised} frames are there, whole up to byte {end}",)
    )
    first = data.offset
    times_s = []
    for index in (0, present - 1):
        file.seek(first + index * FRAME.itemsize)
        times_s.append(float(to_nanoseconds(np.frombuffer(file.read(4), "<f4"))[0]) * 1e-9)
    duration_s = max(0.0, times_s[1] - times_s[0]) / speed
    return BsorSession(path, metadata, first, present, duration_s, warnings)


def _speed(modifiers: str) -> float:
    """How many song seconds pass in a second. The modifiers are a comma-separated list."""
    factors = [SPEED_OF_MODIFIER[m] for m in modifiers.replace(" ", "").split(",") if m in SPEED_OF_MODIFIER]
    return factors[0] if factors else 1.0


class _Device:
    """Headset or saber: Unity poses to OpenXR ones, with the flags that the file itself has not."""

    def __init__(self, device_from_grip: batch.Array | None = None) -> None:
        self._device_from_grip = device_from_grip
        self._frozen = FrozenDevice()

    def poses(self, times_ns: Times, unity: npt.NDArray[np.float32]) -> Iterator[TrackedPose]:
        """Convert a block of poses (N,7). No pose, no flags; one that has long been the same is valid, not tracked."""
        raw = unity.astype(np.float64)
        raw[:, :3] *= _POSITION_TO_OPENXR
        raw[:, 3:] *= _ROTATION_TO_OPENXR
        poses, flags = clean_poses(raw)
        # a device that was never seen is written at the origin; and half a pose cannot be moved to the grip
        known = (flags == FULLY_TRACKED) & (raw[:, :3] != 0.0).any(axis=1)
        tracked = self._frozen.tracked(times_ns, poses)
        if self._device_from_grip is not None:
            poses = batch.compose(poses, self._device_from_grip)
        poses[~known] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
        final: Flags = np.where(known, np.where(tracked, FULLY_TRACKED, ONLY_VALID), 0)
        return to_tracked_poses(poses, final)
