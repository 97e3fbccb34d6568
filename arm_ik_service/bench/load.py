"""Many people at once on one session: sends their frames, takes their answers, and keeps every time in between."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from arm_ik_service.bench.people import moving
from arm_ik_service.errors import WireError
from arm_ik_service.io.zenoh_streams import Bus, declare_stream, has_listener, subscribe
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys
from arm_ik_service.wire.messages import Health

TICK_S = 0.001  # frames that are due within it go out together: to sleep for each would load the machine itself
ANSWERED_WITHIN_S = 0.3
LISTENED_WITHIN_S = 5.0
CATCH_UP = 0.25  # of a period: after a stall frames follow no closer, or the newest would overtake the rest


class Stamps(msgspec.Struct):
    """What of an answer is kept; the rest is skipped while reading."""

    seq: int
    receive_time_ns: int
    publish_time_ns: int


_stamps = msgspec.msgpack.Decoder(Stamps).decode
Times = npt.NDArray[np.int64]


class Measured(NamedTuple):
    """What became of the frames of a span; times in milliseconds."""

    avatars: int
    sent: int
    answered_share: float
    least_share: float  # of the avatar that fared worst
    most_share: float
    service_p50_ms: float  # receive to publish, the service's own stamps
    service_p99_ms: float
    client_p50_ms: float  # put to callback: also the age of the answered frame
    client_p99_ms: float
    client_max_ms: float
    doubles: int  # answers to a frame that had one


class Load:
    """People who all wave, evenly shifted within a period."""

    def __init__(self, bus: Bus, avatars: int, rate_hz: float, seconds: float, keys: Keys | None = None) -> None:
        keys = keys or Keys()
        self._rate_hz = rate_hz
        self._frames = max(1, int(seconds * rate_hz))
        self.names = [f"person-{n:03d}" for n in range(avatars)]
        self._index = {keys.arms(name): n for n, name in enumerate(self.names)}
        self._streams = [declare_stream(bus, keys.controllers(name), "msgpack") for name in self.names]
        self._put_ns: Times = np.zeros((avatars, self._frames), np.int64)
        self._come_ns: Times = np.zeros((avatars, self._frames), np.int64)
        self._in_service_ns: Times = np.zeros((avatars, self._frames), np.int64)
        self._doubles: list[int] = []  # when they came
        self.healths: list[Health] = []
        self.began_ns = 0
        self._stopped = False
        self._subscribers = [
            subscribe(bus, keys.arms(), self._receive),
            subscribe(bus, keys.health(), self._receive_health),
        ]

    def _receive(self, key: str, payload: bytes, _time_ns: int) -> None:
        now_ns = time.monotonic_ns()
        row = self._index.get(key)
        stamps = _stamps(payload)
        if row is None or stamps.seq >= self._frames:
            return
        if self._come_ns[row, stamps.seq]:
            self._doubles.append(now_ns)
            return
        self._come_ns[row, stamps.seq] = now_ns
        self._in_service_ns[row, stamps.seq] = stamps.publish_time_ns - stamps.receive_time_ns

    def _receive_health(self, _key: str, payload: bytes, _time_ns: int) -> None:
        with suppress(WireError):  # of another version: its answers are measured all the same
            self.healths.append(codec.healths.decode(payload))

    @property
    def elapsed_s(self) -> float:
        """Time since the first frame was due."""
        return (time.monotonic_ns() - self.began_ns) / 1e9

    def stop(self) -> None:
        """Make `run` end with the frames in hand, before its time."""
        self._stopped = True

    def run(self, *, progress: Callable[[int], None] | None = None) -> None:
        """Send it all, and wait a moment for the last answers."""
        give_up_s = time.monotonic() + LISTENED_WITHIN_S
        while not has_listener(self._streams[0]) and time.monotonic() < give_up_s:
            time.sleep(0.01)
        count = len(self._streams)
        period_s = 1.0 / self._rate_hz
        gc.collect()
        gc.disable()
        try:
            start_s = time.monotonic() + 0.01
            self.began_ns = int(start_s * 1e9)
            for seq in range(self._frames):
                if self._stopped:
                    break
                payload = codec.encode(moving(seq, self._rate_hz))
                at_s = start_s + seq * period_s
                late_s = time.monotonic() - at_s
                if late_s > period_s:  # this machine stalled: what was missed is not sent in one burst
                    start_s += late_s - CATCH_UP * period_s
                    at_s = start_s + seq * period_s
                done = 0
                while done < count:
                    due = min(count, 1 + int((time.monotonic() - at_s) / period_s * count))
                    for row in range(done, due):
                        self._put_ns[row, seq] = time.monotonic_ns()
                        self._streams[row].put(payload)
                    done = max(done, due)
                    if done < count:
                        time.sleep(TICK_S)
                if progress is not None:
                    progress(count)
        finally:
            gc.enable()
        time.sleep(ANSWERED_WITHIN_S)

    def close(self) -> None:
        """Send and hear no more."""
        for subscriber in self._subscribers:
            subscriber.undeclare()
        for stream in self._streams:
            stream.undeclare()

    def measured(self, from_s: float = 0.0, to_s: float = float("inf")) -> Measured:
        """Return what became of the frames sent in a span after the beginning [s]."""
        sent = self._sent(from_s, to_s)
        answered = sent & (self._come_ns > 0)
        shares = answered.sum(axis=1) / np.maximum(sent.sum(axis=1), 1)
        client_ms = (self._come_ns - self._put_ns)[answered] / 1e6
        service_ms = self._in_service_ns[answered] / 1e6
        begin_ns = self.began_ns + from_s * 1e9
        service_p50, service_p99 = _percentiles(service_ms, 50, 99)
        client_p50, client_p99, client_max = _percentiles(client_ms, 50, 99, 100)
        return Measured(
            avatars=len(self.names),
            sent=int(sent.sum()),
            answered_share=float(answered.sum() / max(sent.sum(), 1)),
            least_share=float(shares.min()),
            most_share=float(shares.max()),
            service_p50_ms=service_p50,
            service_p99_ms=service_p99,
            client_p50_ms=client_p50,
            client_p99_ms=client_p99,
            client_max_ms=client_max,
            doubles=sum(begin_ns <= at_ns < self.began_ns + to_s * 1e9 for at_ns in self._doubles),
        )

    def longest_gaps_s(self, from_s: float, to_s: float) -> npt.NDArray[np.float64]:
        """Return each avatar's longest time without an answer in a span; the whole span where there is none."""
        begin_ns, end_ns = self.began_ns + from_s * 1e9, self.began_ns + to_s * 1e9
        gaps = []
        for times in self._come_ns:
            inside = np.sort(times[(times >= begin_ns) & (times < end_ns)])
            gaps.append(np.diff([begin_ns, *inside, end_ns]).max() / 1e9)
        return np.array(gaps)

    def _sent(self, from_s: float, to_s: float) -> npt.NDArray[np.bool_]:
        since_s = (self._put_ns - self.began_ns) / 1e9
        inside: npt.NDArray[np.bool_] = (self._put_ns > 0) & (since_s >= from_s) & (since_s < to_s)
        return inside


def _percentiles(values: Any, *which: float) -> tuple[float, ...]:
    if len(values) == 0:
        return (float("nan"),) * len(which)
    return tuple(float(value) for value in np.percentile(values, which))
