"""For links that deliver in bursts: frames wait until they come out as evenly as they were sampled.

Where a sender's frames need between `fastest` and `fastest + delay` to get here, each is passed on at its sample time
plus `fastest` plus the delay. What needs longer is passed on at once, so nothing waits longer than the delay, and a
frame that was on time waits for just that. The clocks of sender and receiver need not agree.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from heapq import heappop, heappush
from threading import Condition, Thread

import msgspec

from arm_ik_service.errors import WireError
from arm_ik_service.wire.codec import Decoder

MOST_HELD = 256  # frames of one avatar: a quarter of a second of the fastest tracker
DRIFT = 1e-3  # part by which two clocks differ at the most, ten times a bad crystal; beyond it a link became slower
RESTARTS_NS = 1_000_000_000  # a frame that is later than any link makes it is from a clock that was set


class _Sampled(msgspec.Struct):
    version: int
    sample_time_ns: int


_sampled = Decoder(_Sampled)


@dataclass(slots=True)
class Pace:
    """One sender: by how much its quickest frames lie behind their sample times on our clock."""

    fastest_ns: float | None = None
    last_ns: int = 0
    held: int = 0

    def wait_ns(self, arrival_ns: int, sample_time_ns: int, delay_ns: int) -> int:
        """How long a frame that arrived now is to wait: 0 to `delay_ns`."""
        behind_ns = arrival_ns - sample_time_ns
        fastest_ns = behind_ns if self.fastest_ns is None else self.fastest_ns + DRIFT * (arrival_ns - self.last_ns)
        if not 0.0 <= behind_ns - fastest_ns <= RESTARTS_NS:
            fastest_ns = behind_ns
        self.fastest_ns, self.last_ns = fastest_ns, arrival_ns
        return max(0, int(delay_ns - (behind_ns - fastest_ns)))


class JitterBuffer:
    """Holds frames of many avatars and passes them on from a thread of its own, until `close`."""

    def __init__(self, delay_s: float, deliver: Callable[[str, bytes], None]) -> None:
        """`deliver` is given an avatar and a payload when it is time."""
        self._delay_ns = int(1e9 * delay_s)
        self._deliver = deliver
        self._held: list[tuple[int, int, Pace, str, bytes]] = []  # a heap, by due time and then by order of arrival
        self._count = 0
        self._changed = Condition()
        self._open = True
        self._thread = Thread(target=self._run, name="jitter buffer", daemon=True)
        self._thread.start()

    def hold(self, pace: Pace, avatar: str, payload: bytes) -> bool:
        """Take a frame in; False where its sender already has as many as may wait. Never blocks for long."""
        now_ns = time.monotonic_ns()
        try:
            sample_time_ns = _sampled.decode(payload).sample_time_ns
        except WireError:
            sample_time_ns = None  # whoever decodes it says what is wrong
        with self._changed:
            if pace.held >= MOST_HELD:
                return False
            due_ns = now_ns
            if sample_time_ns is not None:
                due_ns += pace.wait_ns(now_ns, sample_time_ns, self._delay_ns)
            pace.held += 1
            self._count += 1
            heappush(self._held, (due_ns, self._count, pace, avatar, payload))
            if self._held[0][1] == self._count:
                self._changed.notify()
        return True

    def close(self) -> None:
        """Pass nothing more on."""
        with self._changed:
            self._open = False
            self._changed.notify()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._changed:
                while self._open and (not self._held or self._held[0][0] > time.monotonic_ns()):
                    self._changed.wait(1e-9 * (self._held[0][0] - time.monotonic_ns()) if self._held else None)
                if not self._open:
                    return
                _, _, pace, avatar, payload = heappop(self._held)
                pace.held -= 1
            self._deliver(avatar, payload)
