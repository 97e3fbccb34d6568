"""Controllers-in to arms-out against a bare Zenoh echo of the same sizes, taken in turns in the same run."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any, NamedTuple

import msgspec
import numpy as np

from arm_ik_service.bench import echo
from arm_ik_service.bench.people import moving
from arm_ik_service.bench.processes import part
from arm_ik_service.errors import ArmIkError
from arm_ik_service.io.zenoh_bus import BusOptions, open_client
from arm_ik_service.io.zenoh_streams import Bus, Stream, declare_stream, has_listener, subscribe
from arm_ik_service.programs.demo import free_endpoint
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys

WARM_UP_FRAMES = 90  # connections, caches and the first solves; not counted
ANSWERED_WITHIN_S = 1.0
AVATAR = "bench"


class Seq(msgspec.Struct):
    """What of an answer tells which frame it answers; the rest is skipped while reading."""

    seq: int


seq_of = msgspec.msgpack.Decoder(Seq).decode


class RoundTrips(NamedTuple):
    """Put to callback, as one client sees it [ms]."""

    sent: int
    answered: int
    p50_ms: float
    p99_ms: float
    max_ms: float


class Latency(NamedTuple):
    """The service and the echo, frame by frame in turns."""

    rate_hz: float
    frame_bytes: int
    answer_bytes: int
    view: bool
    service: RoundTrips
    echo: RoundTrips

    @property
    def p50_ratio(self) -> float:
        """Service over echo."""
        return self.service.p50_ms / self.echo.p50_ms

    @property
    def p99_ratio(self) -> float:
        """Service over echo."""
        return self.service.p99_ms / self.echo.p99_ms

    def as_json(self) -> dict[str, Any]:
        """All of it, by name."""
        found = self._asdict() | {"p50_ratio": self.p50_ratio, "p99_ratio": self.p99_ratio}
        return found | {"service": self.service._asdict(), "echo": self.echo._asdict()}


class Line:
    """One way there and back: when each number was put, and when its answer came [ns]."""

    def __init__(
        self, bus: Bus, key_in: str, key_out: str, encode: Callable[[int], bytes], number_of: Callable[[bytes], int]
    ) -> None:
        self.stream: Stream = declare_stream(bus, key_in, "msgpack")
        self._encode = encode
        self._number_of = number_of
        self.put_ns: list[int] = []
        self.come_ns: dict[int, int] = {}
        self.answer_bytes = 0
        self._subscriber = subscribe(bus, key_out, self._receive)

    def _receive(self, _key: str, payload: bytes, _time_ns: int) -> None:
        now_ns = time.perf_counter_ns()
        self.answer_bytes = len(payload)
        self.come_ns[self._number_of(payload)] = now_ns

    def send(self) -> None:
        """Put the next number."""
        payload = self._encode(len(self.put_ns))
        self.put_ns.append(time.perf_counter_ns())
        self.stream.put(payload)

    def round_trips(self, first: int = WARM_UP_FRAMES) -> RoundTrips:
        """What became of the frames from the `first` on that counts."""
        numbers = range(first, len(self.put_ns))
        trips_ms = [(self.come_ns[n] - self.put_ns[n]) / 1e6 for n in numbers if n in self.come_ns]
        if not trips_ms:
            raise ArmIkError("no answer came back: the service or the echo is not reachable")
        p50, p99 = np.percentile(trips_ms, [50, 99])
        return RoundTrips(len(numbers), len(trips_ms), float(p50), float(p99), max(trips_ms))


def take_turns(lines: list[Line], rate_hz: float, frames: int, progress: Callable[[int], None] | None = None) -> None:
    """Send `frames` on every line, one a period of `rate_hz`, in evenly spaced slots: noise falls on all of them alike.

    In every period their order is drawn anew: whoever always came second would always find the processors awake, and
    in their caches what the first one's onlookers do.
    """
    slot_s = 1.0 / rate_hz / len(lines)
    chance = random.Random(0)
    start_s = time.monotonic() + 0.01
    for n in range(frames + WARM_UP_FRAMES):
        for k, line in enumerate(chance.sample(lines, len(lines))):
            wait_s = start_s + (n * len(lines) + k) * slot_s - time.monotonic()
            if wait_s > 0.0:
                time.sleep(wait_s)
            line.send()
        if progress is not None:
            progress(1)
    give_up_s = time.monotonic() + ANSWERED_WITHIN_S
    while any(len(line.come_ns) < len(line.put_ns) for line in lines) and time.monotonic() < give_up_s:
        time.sleep(0.01)


def measure_latency(
    *, rate_hz: float, frames: int, view: str | None = None, progress: Callable[[int], None] | None = None
) -> Latency:
    """Start a service and an echo, and send both the same number of frames. `view` is a file for a viewer to write."""
    keys = Keys()
    service_at, echo_at = free_endpoint(), free_endpoint()
    answer_bytes = len(_one_answer())
    frame_bytes = len(codec.encode(moving(0, rate_hz)))
    filler = bytes(frame_bytes - echo.HEADER_BYTES)
    with ExitStack() as stack:
        stack.enter_context(part("arm_ik_service", "serve", "--name", "bench", "--listen", service_at))
        stack.enter_context(part("arm_ik_service.bench.echo", echo_at, str(answer_bytes)))
        if view is not None:
            stack.enter_context(part("arm_ik_service", "view", "--save", view, "--connect", service_at))
        buses = [
            stack.enter_context(open_client(BusOptions(connect=(at,)), wait_s=5.0)) for at in (service_at, echo_at)
        ]
        lines = [
            Line(
                buses[0],
                keys.controllers(AVATAR),
                keys.arms(AVATAR),
                lambda n: codec.encode(moving(n, rate_hz)),
                lambda payload: seq_of(payload).seq,
            ),
            Line(
                buses[1],
                echo.KEY_IN,
                echo.KEY_OUT,
                lambda n: n.to_bytes(echo.HEADER_BYTES, "little") + filler,
                lambda payload: int.from_bytes(payload[: echo.HEADER_BYTES], "little"),
            ),
        ]
        give_up_s = time.monotonic() + 5.0
        while not all(has_listener(line.stream) for line in lines) and time.monotonic() < give_up_s:
            time.sleep(0.01)
        take_turns(lines, rate_hz, frames, progress)
        service, bare = (line.round_trips() for line in lines)
        return Latency(rate_hz, frame_bytes, lines[0].answer_bytes, view is not None, service, bare)


def _one_answer() -> bytes:
    """The bytes of an answer, for its size."""
    from arm_ik_service.avatar import Avatar

    state = Avatar(name=AVATAR).step(moving(0, 90.0), now_ns=0)
    assert state is not None
    return codec.encode(state)
