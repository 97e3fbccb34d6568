"""Bursts in, even frames out: by sample time, with a bounded delay, and never more than a bounded number waiting."""

from __future__ import annotations

import time
from contextlib import ExitStack

import numpy as np
import numpy.typing as npt
import pytest
from harness import KEYS, standing, wait_for

from arm_ik_service.io.jitter_buffer import MOST_HELD, JitterBuffer, Pace
from arm_ik_service.io.zenoh_bus import BusOptions, open_client, open_hub
from arm_ik_service.io.zenoh_inbox import Arrival, Inbox
from arm_ik_service.io.zenoh_streams import declare_stream
from arm_ik_service.programs.demo import free_endpoint
from arm_ik_service.settings import ServiceSettings
from arm_ik_service.wire import codec

Times = npt.NDArray[np.int64]

MS = 1_000_000
PERIOD = 1_000_000_000 // 90
DELAY = 60 * MS


def bursts(count: int) -> tuple[Times, Times]:
    """Sample and arrival times [ns] of a 90 Hz stream that a link delivers five at a time, on two unlike clocks."""
    sampled = np.arange(count) * PERIOD
    return sampled, 10**15 + 5 * PERIOD * (1 + np.arange(count) // 5) + 3 * MS


def left(sampled: Times, arrived: Times) -> Times:
    pace = Pace()
    waits = [pace.wait_ns(int(a), int(s), DELAY) for a, s in zip(arrived, sampled, strict=True)]
    assert all(0 <= wait <= DELAY for wait in waits)
    return np.asarray(arrived + np.array(waits))


def test_bursts_come_out_as_they_were_sampled() -> None:
    out = np.diff(left(*bursts(200)))[10:]
    assert np.abs(out - PERIOD).max() < 0.2 * MS


@pytest.mark.parametrize("drift", [-2e-4, 2e-4])
def test_clocks_that_drift_apart_are_followed(drift: float) -> None:
    sampled, arrived = bursts(90 * 600)
    out = left((sampled * (1.0 + drift)).astype(np.int64), arrived)
    late = out - arrived
    assert late.reshape(-1, 5).max(axis=1)[1000:].min() > DELAY - 2 * MS
    assert np.abs(np.diff(out)[1000:] - PERIOD).max() < 0.3 * MS


@pytest.mark.parametrize("step_s", [-3600, -2, 2, 3600])
def test_a_clock_that_is_set_disturbs_no_more_than_a_few_bursts(step_s: int) -> None:
    sampled, arrived = bursts(400)
    sampled[200:] += step_s * 1_000_000_000
    assert np.abs(np.diff(left(sampled, arrived))[215:] - PERIOD).max() < 0.2 * MS


def test_what_is_later_than_the_delay_waits_no_longer() -> None:
    sampled, arrived = bursts(200)
    arrived[100] += 2 * DELAY
    out = left(sampled, arrived)
    assert out[100] == arrived[100]


class Held:
    def __init__(self, delay_s: float) -> None:
        self.out: list[bytes] = []
        self.buffer = JitterBuffer(delay_s, lambda _avatar, payload: self.out.append(payload))


def test_no_more_than_a_bounded_number_wait_and_closing_lets_go_of_them() -> None:
    held, pace = Held(0.25), Pace()
    frames = [codec.encode(standing(n, 10**18 + n)) for n in range(MOST_HELD + 10)]
    began = time.monotonic()
    taken = [held.buffer.hold(pace, "a", frame) for frame in frames]
    if time.monotonic() - began < 0.2:  # none was due yet
        assert taken == [True] * MOST_HELD + [False] * 10
    held.buffer.close()
    assert len(held.out) < len(frames)


def test_what_cannot_be_read_is_passed_on_for_the_service_to_count() -> None:
    held = Held(0.25)
    assert held.buffer.hold(Pace(), "a", b"noise")
    assert wait_for(lambda: held.out == [b"noise"])
    held.buffer.close()


def arrivals(jitter_buffer_s: float, count: int = 60) -> list[int]:
    """Receive times [ns] of frames that a sender of 90 Hz puts on a real bus five at a time."""
    limits = ServiceSettings(max_avatars=4, jitter_buffer_s=jitter_buffer_s)
    received: list[int] = []
    endpoint = free_endpoint()

    def note(arrival: Arrival) -> bool:
        received.append(arrival.receive_time_ns)
        return True

    with ExitStack() as stack:
        inbox = Inbox(stack.enter_context(open_hub(BusOptions(listen=(endpoint,)))), KEYS, limits, lambda _: True, note)
        inbox.hear_everybody()
        bus = stack.enter_context(open_client(BusOptions(connect=(endpoint,)), wait_s=5.0))
        stream = declare_stream(bus, KEYS.controllers("a"), "msgpack")
        began_s, began_ns = time.monotonic(), time.time_ns()
        for n in range(count):
            if n % 5 == 0:
                time.sleep(max(0.0, began_s + 1e-9 * PERIOD * (n + 5) - time.monotonic()))
            stream.put(codec.encode(standing(n, began_ns + n * PERIOD)))
        assert wait_for(lambda: len(received) == count)
        inbox.close()
    return received


def test_a_bursty_sender_is_received_far_more_evenly_than_it_sends() -> None:
    as_sent, evened = (np.diff(arrivals(delay_s))[10:] for delay_s in (0.0, 1e-9 * DELAY))
    off_as_sent, off_evened = (np.median(np.abs(intervals - PERIOD)) for intervals in (as_sent, evened))
    assert off_evened < 0.2 * off_as_sent
