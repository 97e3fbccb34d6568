"""What sinks cost everybody else: one person's round trips with every sink attached, beside without, in turns.

Three arrangements take turns on one service: nobody else; a process that hears the same and does nothing with it; all
sinks, in one process, as `arm-ik export` runs them. The first two differ by what a listener costs, in the service, on
the wire and in reading; the last two by the sinks' own work.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from statistics import median
from typing import Any, NamedTuple

from arm_ik_service.bench.latency import ANSWERED_WITHIN_S, AVATAR, Line, RoundTrips, seq_of
from arm_ik_service.bench.people import moving
from arm_ik_service.bench.processes import part
from arm_ik_service.exports.dialects import OSC_PORTS, LiveDialect
from arm_ik_service.io.zenoh_bus import BusOptions, open_client
from arm_ik_service.io.zenoh_streams import has_listener
from arm_ik_service.programs.demo import free_endpoint
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys

SETTLE_FRAMES = 90  # after somebody came or went; not counted
ARRANGEMENTS = ("alone", "listener", "sinks")


class Attached(NamedTuple):
    """The blocks of each arrangement, one a round, in the order of the rounds."""

    rate_hz: float
    blocks: dict[str, list[RoundTrips]]

    def p50_ms(self, arrangement: str) -> float:
        """Median over the blocks."""
        return median(block.p50_ms for block in self.blocks[arrangement])

    def p99_ms(self, arrangement: str) -> float:
        """Median over the blocks."""
        return median(block.p99_ms for block in self.blocks[arrangement])

    def p50_ratio(self, arrangement: str) -> float:
        """Over nobody else in the same round; median over the rounds."""
        return median(a.p50_ms / b.p50_ms for a, b in zip(self.blocks[arrangement], self.blocks["alone"], strict=True))

    def p99_ratio(self, arrangement: str) -> float:
        """Over nobody else in the same round; median over the rounds."""
        return median(a.p99_ms / b.p99_ms for a, b in zip(self.blocks[arrangement], self.blocks["alone"], strict=True))

    def as_json(self) -> dict[str, Any]:
        """All of it, by name."""
        return {
            "rate_hz": self.rate_hz,
            **{
                name: {
                    "p50_ms": self.p50_ms(name),
                    "p99_ms": self.p99_ms(name),
                    "p50_ratio": self.p50_ratio(name),
                    "p99_ratio": self.p99_ratio(name),
                    "blocks": [block._asdict() for block in blocks],
                }
                for name, blocks in self.blocks.items()
            },
        }


def measure_attached(
    *, rate_hz: float, frames: int, rounds: int, progress: Callable[[int], None] | None = None
) -> Attached:
    """Start a service, and send `frames` in each arrangement, `rounds` times over."""
    keys, endpoint = Keys(), free_endpoint()
    blocks: dict[str, list[RoundTrips]] = {name: [] for name in ARRANGEMENTS}
    with (
        part("arm_ik_service", "serve", "--name", "bench", "--listen", endpoint),
        open_client(BusOptions(connect=(endpoint,)), wait_s=5.0) as bus,
    ):
        line = Line(
            bus,
            keys.controllers(AVATAR),
            keys.arms(AVATAR),
            lambda n: codec.encode(moving(n, rate_hz)),
            lambda payload: seq_of(payload).seq,
        )
        give_up_s = time.monotonic() + 5.0
        while not has_listener(line.stream) and time.monotonic() < give_up_s:
            time.sleep(0.01)
        for turn in range(rounds):
            for name in _turned(turn):
                with _arranged(name, endpoint, keys):
                    blocks[name].append(_block(line, rate_hz, frames, progress))
    return Attached(rate_hz, blocks)


def _turned(turn: int) -> tuple[str, ...]:
    """Nobody is always first: a machine that gets busier or quieter then does so for all alike."""
    first = turn % len(ARRANGEMENTS)
    return ARRANGEMENTS[first:] + ARRANGEMENTS[:first]


@contextmanager
def _arranged(name: str, endpoint: str, keys: Keys) -> Iterator[None]:
    if name == "sinks":
        with _heard_out(len(OSC_PORTS)) as ports:
            to = [f"--to={dialect}=127.0.0.1:{port}" for dialect, port in zip(OSC_PORTS, ports, strict=True)]
            with part("arm_ik_service", "export", *LiveDialect, *to, "--connect", endpoint):
                yield
        return
    listener = part("arm_ik_service.bench.silent_listener", endpoint, keys.arms(), keys.controllers())
    with listener if name == "listener" else nullcontext():
        yield


@contextmanager
def _heard_out(count: int) -> Iterator[list[int]]:
    """Give UDP ports that somebody holds open; nobody reads them, as a receiver's work is not ours."""
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    try:
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        yield [one.getsockname()[1] for one in sockets]
    finally:
        for one in sockets:
            one.close()


def _block(line: Line, rate_hz: float, frames: int, progress: Callable[[int], None] | None) -> RoundTrips:
    first = len(line.put_ns) + SETTLE_FRAMES
    start_s = time.monotonic() + 0.01
    for n in range(SETTLE_FRAMES + frames):
        wait_s = start_s + n / rate_hz - time.monotonic()
        if wait_s > 0.0:
            time.sleep(wait_s)
        line.send()
        if progress is not None and n >= SETTLE_FRAMES:
            progress(1)
    give_up_s = time.monotonic() + ANSWERED_WITHIN_S
    while len(line.put_ns) - 1 not in line.come_ns and time.monotonic() < give_up_s:
        time.sleep(0.01)
    return line.round_trips(first)
