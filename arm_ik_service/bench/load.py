"""Many people at once: a process that sends their frames, and here their answers, with every time in between."""

from __future__ import annotations

import gc
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from arm_ik_service.bench.processes import Part
from arm_ik_service.bench.sender import name_of
from arm_ik_service.errors import WireError
from arm_ik_service.io.zenoh_streams import Bus, subscribe
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys
from arm_ik_service.wire.messages import Health

ANSWERED_WITHIN_S = 0.3
BEGINS_IN_NS = 50_000_000


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
    way_in_p99_ms: float = 0.0  # put to receive, and
    way_out_p99_ms: float = 0.0  # publish to callback: Zenoh, the network, and whoever waits for a processor


class Load:
    """People who all wave, evenly shifted within a period."""

    def __init__(
        self,
        bus: Bus,
        endpoints: tuple[str, ...],
        avatars: int,
        rate_hz: float,
        seconds: float,
        *,
        keys: Keys | None = None,
        peer: bool = False,
    ) -> None:
        """Hear on `bus`; the sender connects to `endpoints`, as a client of one or as a peer of all of them."""
        keys = keys or Keys()
        frames = max(1, int(seconds * rate_hz))
        self._frames = frames
        self.names = [name_of(n) for n in range(avatars)]
        self._index = {keys.arms(name): n for n, name in enumerate(self.names)}
        self._come_ns: Times = np.zeros((avatars, frames), np.int64)
        self._receive_ns: Times = np.zeros((avatars, frames), np.int64)
        self._publish_ns: Times = np.zeros((avatars, frames), np.int64)
        self._doubles: list[int] = []  # when they came
        self.healths: list[Health] = []
        self.began_ns = 0
        self._stopped = False
        self._subscribers = [
            subscribe(bus, keys.arms(), self._receive),
            subscribe(bus, keys.health(), self._receive_health),
        ]
        self._folder = tempfile.TemporaryDirectory()
        file = Path(self._folder.name) / "put_ns"
        self._put_ns: Times = np.memmap(file, np.int64, mode="w+", shape=(avatars, frames))
        arguments = (str(file), str(avatars), str(rate_hz), str(frames), keys.prefix, "peer" if peer else "hub")
        self._sender = Part("arm_ik_service.bench.sender", *arguments, *endpoints)

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
        self._receive_ns[row, stamps.seq] = stamps.receive_time_ns
        self._publish_ns[row, stamps.seq] = stamps.publish_time_ns

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
        """Send it all, and wait a moment for the last answers. Raises ArmIkError where the sender cannot."""
        self._sender.wait_ready()
        popen = self._sender.popen
        assert popen.stdin is not None
        gc.collect()
        gc.disable()
        try:
            began_ns = time.monotonic_ns() + BEGINS_IN_NS
            popen.stdin.write(f"{began_ns}\n")
            popen.stdin.flush()
            self.began_ns = began_ns
            done = 0
            while popen.poll() is None and not self._stopped:
                time.sleep(0.05)
                if progress is not None:
                    sent = int(np.count_nonzero(self._put_ns[-1]))
                    progress((sent - done) * len(self.names))
                    done = sent
            popen.stdin.close()
            popen.wait()
            time.sleep(ANSWERED_WITHIN_S)
        finally:
            gc.enable()

    def close(self) -> None:
        """Send and hear no more."""
        self._sender.end()
        for subscriber in self._subscribers:
            subscriber.undeclare()
        self._put_ns = np.array(self._put_ns)
        self._folder.cleanup()

    def measured(self, from_s: float = 0.0, to_s: float = float("inf")) -> Measured:
        """Return what became of the frames sent in a span after the beginning [s]."""
        sent = self._sent(from_s, to_s)
        answered = sent & (self._come_ns > 0)
        shares = answered.sum(axis=1) / np.maximum(sent.sum(axis=1), 1)
        client_ms = (self._come_ns - self._put_ns)[answered] / 1e6
        service_ms = (self._publish_ns - self._receive_ns)[answered] / 1e6
        set_ns = time.time_ns() - time.monotonic_ns()  # the service stamps by the wall clock
        in_ms = (self._receive_ns - set_ns - self._put_ns)[answered] / 1e6
        out_ms = (self._come_ns + set_ns - self._publish_ns)[answered] / 1e6
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
            way_in_p99_ms=_percentiles(in_ms, 99)[0],
            way_out_p99_ms=_percentiles(out_ms, 99)[0],
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
