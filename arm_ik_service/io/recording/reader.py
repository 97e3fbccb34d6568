"""A recording as a session: frames, answers and profiles out of a log, by the keys they were published under."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TypeVar

from arm_ik_service.errors import SessionError, WireError
from arm_ik_service.io.recording.log import Log, LoggedMessage, walk
from arm_ik_service.io.session import RecordedFrame, RecordedProfile
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import check_id
from arm_ik_service.wire.messages import ArmsState, ControllerFrame, Skeleton

Message = TypeVar("Message", ControllerFrame, ArmsState)


class Recording:
    """One MCAP recording. A message that cannot be decoded is left out; `warnings` counts them."""

    def __init__(self, log: Log) -> None:
        self.path = log.path
        self._log = log
        self._channels: dict[str, dict[int, str]] = {}  # kind of message -> channel -> avatar
        for channel, topic in log.topics.items():
            kind, avatar = _kind_and_avatar(topic)
            if avatar is not None:
                self._channels.setdefault(kind, {})[channel] = avatar
        self._refused: Counter[str] = Counter()
        self._first_cause: dict[str, str] = {}
        self._profiles: dict[str, list[RecordedProfile]] | None = None  # once they are asked for
        frames = self._channels.get("controllers", {})
        self.avatars: tuple[str, ...] = tuple(dict.fromkeys(frames.values()))
        self.frame_count: int = sum(log.counts[channel] for channel in frames)
        self.answer_count: int = sum(log.counts[channel] for channel in self._channels.get("arms", {}))
        timed = [segment for segment in log.segments if segment.start_ns <= segment.end_ns]
        span_ns = max(s.end_ns for s in timed) - min(s.start_ns for s in timed) if timed else 0
        self.duration_s: float = span_ns * 1e-9
        self.metadata: Mapping[str, str | float | bool] = {"format": "mcap", **log.metadata}

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was wrong but could be lived with, a line each."""
        refused = (
            f"{self.path}: {count} messages on {topic} were left out, the first because: {self._first_cause[topic]}"
            for topic, count in self._refused.items()
        )
        return (*self._log.warnings, *refused)

    def frames(self) -> Iterator[RecordedFrame]:
        """Read the frames of all avatars by the time at which they were received."""
        for avatar, message, frame in self._decoded("controllers", codec.controller_frames):
            yield RecordedFrame(avatar, frame, message.log_time_ns)

    def arms(self) -> Iterator[ArmsState]:
        """Read the answers of all avatars by the time at which the recorder received them."""
        for _, _, answer in self._decoded("arms", codec.arms_states):
            yield answer

    def skeleton(self, avatar: str) -> Skeleton | None:
        """Return the last recorded skeleton of an avatar, or None."""
        last = self._last("skeleton", avatar)
        try:
            return None if last is None else codec.skeletons.decode(last)
        except WireError as error:
            self._refuse(f"the skeleton of {avatar}", error)
            return None

    def calibrations(self, avatar: str) -> tuple[RecordedProfile, ...]:
        """Return the calibration profiles that were recorded of an avatar, by time; empty where there are none."""
        if self._profiles is None:
            self._profiles = {}
            avatars = self._channels.get("calibration", {})
            for message in self._log.messages(frozenset(avatars)) if avatars else ():
                profile = RecordedProfile(message.log_time_ns, message.data)
                self._profiles.setdefault(avatars[message.channel], []).append(profile)
        return tuple(self._profiles.get(avatar, ()))

    def _last(self, kind: str, avatar: str) -> bytes | None:
        channels = frozenset(c for c, name in self._channels.get(kind, {}).items() if name == avatar)
        last = None
        if channels:
            for message in self._log.messages(channels):
                last = message.data
        return last

    def _decoded(self, kind: str, decoder: codec.Decoder[Message]) -> Iterator[tuple[str, LoggedMessage, Message]]:
        avatars = self._channels.get(kind, {})
        self._refused.clear()
        for message in self._log.messages(frozenset(avatars)) if avatars else ():
            try:
                decoded = decoder.decode(message.data)
            except WireError as error:
                self._refuse(self._log.topics[message.channel], error)
                continue
            yield avatars[message.channel], message, decoded

    def _refuse(self, what: str, error: WireError) -> None:
        self._refused[what] += 1
        self._first_cause.setdefault(what, str(error))


def open_recording(path: Path) -> Recording:
    """Open an MCAP recording. Raises SessionError for one that holds no controller frames; see `open_session`."""
    log = walk(path)
    recording = Recording(log)
    if not recording.avatars or recording.frame_count == 0:
        topics = ", ".join(sorted(log.topics.values())[:6]) or "nothing"
        cause = f"; {log.warnings[0].removeprefix(f'{path}: ')}" if log.warnings else ""
        raise SessionError(f"{path}: no controller frames on any avatar/<id>/controllers; it has {topics}{cause}")
    return recording


def _kind_and_avatar(topic: str) -> tuple[str, str | None]:
    """Take a key apart, whatever prefix it has; an avatar of None is not one of ours."""
    *_, room, avatar, kind = ("", "", "", *topic.split("/"))
    try:
        return kind, check_id(avatar) if room == "avatar" else None
    except WireError:
        return kind, None
