"""What was answered, told once more a moment later to those who only watch, so that nobody who waits waits for them.

A second receiver of an answer delays the first: where cores are few its threads wake at the moment at which the first's
are to run. Measured on two cores, one person at 90 Hz: 1.4 times a bare echo's round trip instead of 1.2, whatever the
second does with it. Views and exports therefore listen on keys of their own. These get the very same bytes, frame and
answer, when the answer has had time to arrive.

Nobody is ever waited for: under load the newest answer of each avatar is told now and then, and the rest is not.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from itertools import islice
from typing import NamedTuple

from arm_ik_service.io.zenoh_streams import Bus, Stream, declare_stream, watch_listeners
from arm_ik_service.wire.keys import Keys
from arm_ik_service.wire.messages import Encoding

LINGER_S = 0.002  # after an answer: it has arrived, and the next frame of the same person is far
PATIENCE_S = 0.1  # of onlookers, where the service finds no moment between frames: ten pictures a second
AT_ONCE = 16  # avatars told at a time: frames wait meanwhile


class _Streams(NamedTuple):
    """Where one avatar is watched."""

    controllers: Stream
    arms: Stream


class _Waiting(NamedTuple):
    """What is to be told of one avatar."""

    since_ns: int
    frame: bytes
    answer: bytes


class Onlookers:
    """Whoever calls holds the service's lock; `there` may be read by anybody."""

    def __init__(self, bus: Bus, keys: Keys, encoding: Encoding, come: Callable[[], None]) -> None:
        """`come` is called on a Zenoh thread when somebody begins to watch: store and return."""
        self._bus, self._keys, self._encoding = bus, keys, encoding
        self._come = come
        self._seen = [False, False]
        self.there = False
        self._waiting: dict[str, _Waiting] = {}  # in the order in which they began to wait
        self._streams: dict[str, _Streams] = {}
        # to everybody's keys nothing is ever put: they tell whether anybody is watched
        self._everybody = self._declared("*")
        self._watches = [watch_listeners(stream, partial(self._see, n)) for n, stream in enumerate(self._everybody)]

    def _see(self, which: int, there: bool) -> None:
        self._seen[which] = there
        self.there = any(self._seen)
        if there:
            self._come()

    def note(self, avatar: str, frame: bytes, answer: bytes) -> None:
        """Keep a frame and its answer to be told; they take the place of those that wait."""
        before = self._waiting.get(avatar)
        since_ns = time.monotonic_ns() if before is None else before.since_ns
        self._waiting[avatar] = _Waiting(since_ns, frame, answer)

    def tell(self, *, idle: bool) -> None:
        """Tell those that have waited long enough; that is not long where no frame waits."""
        if self._waiting:
            self._tell(time.monotonic_ns() - int(1e9 * (LINGER_S if idle else PATIENCE_S)), AT_ONCE)

    def close(self) -> None:
        """Tell the last answers."""
        self._tell(time.monotonic_ns(), len(self._waiting))

    def _tell(self, until_ns: int, most: int) -> None:
        for avatar, (since_ns, frame, answer) in list(islice(self._waiting.items(), most)):
            if since_ns > until_ns:
                return
            del self._waiting[avatar]
            streams = self._streams.get(avatar)
            if streams is None:
                streams = self._streams[avatar] = self._declared(avatar)
            streams.controllers.put(frame)
            streams.arms.put(answer)

    def forget(self, avatar: str) -> None:
        """Tell no more of an avatar that is no longer served here."""
        self._waiting.pop(avatar, None)
        for stream in self._streams.pop(avatar, ()):
            stream.undeclare()

    def _declared(self, avatar: str) -> _Streams:
        keys = self._keys.watched_controllers(avatar), self._keys.watched_arms(avatar)
        return _Streams(*(declare_stream(self._bus, key, self._encoding) for key in keys))
