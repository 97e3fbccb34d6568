"""Sending live states on in other dialects, in a process of its own: no sink can delay the service.

It watches: states come a moment after whoever waits for them has them. The process gives way to others where processors
are scarce, and between Zenoh's thread and the sinks lies one slot an avatar: sinks that are slow get the newest state,
not a queue. One process serves several dialects: the service then sends every state once, and this process reads it
once.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from threading import Condition

from arm_ik_service.errors import WireError
from arm_ik_service.exports.mirror import mirrored, mirrored_frame
from arm_ik_service.io.zenoh_streams import Bus, subscribe
from arm_ik_service.programs.sinks import Sink
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys
from arm_ik_service.wire.messages import ArmsState, ControllerFrame

REMEMBERED = 32  # frames of an avatar that may wait for their answer


@dataclass
class Exported:
    """What was sent."""

    sent: int = 0
    overtaken: int = 0
    refused: int = 0
    avatars: tuple[str, ...] = ()


class Exporter:
    """Sends what is published on an open Zenoh session, which the caller closes, to sinks, which are closed with it."""

    def __init__(
        self,
        bus: Bus,
        sinks: Sequence[Sink],
        keys: Keys,
        *,
        avatar: str | None = None,
        mirror: bool = False,
        most_hz: float | None = None,
    ) -> None:
        """`avatar` None: all, or the first who is heard where a sink knows one person only."""
        self._sinks, self._keys, self._mirror = sinks, keys, mirror
        self._only = avatar  # whom sinks are told of that know one person only
        self._many = any(sink.many for sink in sinks)
        self._spacing_s = 0.0 if most_hz is None else 1.0 / most_hz
        self._next_s: dict[str, float] = {}
        self._newest: dict[str, bytes] = {}
        self._frames: dict[str, deque[ControllerFrame]] = {}
        self._changed = Condition()
        self._stopped = False
        self._exported = Exported()
        self._subscribers = [subscribe(bus, keys.watched_arms(avatar or "*"), self._take_arms)]
        if any(sink.wants_frames for sink in sinks):  # each subscriber costs the service's process a copy of the stream
            self._subscribers.append(subscribe(bus, keys.watched_controllers(avatar or "*"), self._take_frame))

    def stop(self) -> None:
        """Make `run` return; safe in a signal handler."""
        self._stopped = True

    def run(self, duration_s: float | None = None) -> Exported:
        """Send until `stop`, or for `duration_s`."""
        end_s = None if duration_s is None else time.monotonic() + duration_s
        try:
            while not self._stopped and (end_s is None or time.monotonic() < end_s):
                with self._changed:
                    if not self._changed.wait_for(lambda: self._newest, timeout=0.1):
                        continue
                with self._changed:
                    arrived, self._newest = self._newest, {}
                for avatar, payload in arrived.items():
                    self._send(avatar, payload)
        finally:
            for subscriber in self._subscribers:
                subscriber.undeclare()
            for sink in self._sinks:
                sink.close()
        return self._exported

    def _take_arms(self, key: str, payload: bytes, _time_ns: int) -> None:
        """Run on Zenoh's network thread: store and return."""
        avatar = self._keys.avatar_of(key)
        with self._changed:
            if avatar in self._newest:
                self._exported.overtaken += 1
            self._newest[avatar] = payload
            self._changed.notify()

    def _take_frame(self, key: str, payload: bytes, _time_ns: int) -> None:
        try:
            frame = codec.controller_frames.decode(payload)
        except WireError:
            return
        self._frames.setdefault(self._keys.avatar_of(key), deque(maxlen=REMEMBERED)).append(frame)

    def _send(self, avatar: str, payload: bytes) -> None:
        self._only = self._only or avatar
        if not self._many and avatar != self._only:
            return
        now_s = time.monotonic()
        if now_s < self._next_s.get(avatar, 0.0):
            return
        if self._spacing_s:
            # from the time it was due, unless that is long past: the mean rate is then the one asked for
            self._next_s[avatar] = max(self._next_s.get(avatar, 0.0), now_s - self._spacing_s) + self._spacing_s
        try:
            state = codec.arms_states.decode(payload)
        except WireError:
            self._exported.refused += 1
            return
        frame = self._frame_of(avatar, state)
        if self._mirror:
            state, frame = mirrored(state), None if frame is None else mirrored_frame(frame)
        for sink in self._sinks:
            if sink.many or avatar == self._only:
                sink.send(state, frame if sink.wants_frames else None)
        self._exported.sent += 1
        if avatar not in self._exported.avatars:
            self._exported.avatars += (avatar,)

    def _frame_of(self, avatar: str, state: ArmsState) -> ControllerFrame | None:
        """Return the frame that a state answers, or the newest one heard."""
        frames = list(self._frames.get(avatar, ()))
        for frame in reversed(frames):
            if frame.seq == state.seq and frame.sample_time_ns == state.sample_time_ns:
                return frame
        return frames[-1] if frames else None
