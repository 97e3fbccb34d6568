"""Threads that keep their thread state."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest
from harness import wait_for

from arm_ik_service.io.zenoh_bus import BusOptions, open_client, open_hub
from arm_ik_service.io.zenoh_streams import Bus, declare_stream, subscribe
from arm_ik_service.programs.demo import free_endpoint


@pytest.fixture
def buses() -> Iterator[tuple[Bus, Bus]]:
    """A hub, and a client of it."""
    endpoint = free_endpoint()
    with open_hub(BusOptions(listen=(endpoint,))) as hub, open_client(BusOptions(connect=(endpoint,))) as client:
        yield hub, client


def test_a_network_thread_is_the_same_to_python_from_callback_to_callback(buses: tuple[Bus, Bus]) -> None:
    """What Python remembers of a thread is lost with its thread state."""
    hub, client = buses
    remembered, seen = threading.local(), []

    def receive(_key: str, _payload: bytes, _time_ns: int) -> None:
        remembered.count = getattr(remembered, "count", 0) + 1
        seen.append((threading.get_ident(), remembered.count))

    subscribe(client, "there", receive)
    stream = declare_stream(hub, "there", "msgpack")
    assert wait_for(lambda: (stream.put(b"x"), len(seen) > 50)[1])
    counts = dict(seen)  # the last of each thread
    assert sum(counts.values()) == len(seen)


def test_a_thread_of_pythons_own_that_is_called_back_ends_as_ever(buses: tuple[Bus, Bus]) -> None:
    hub, _ = buses
    heard: list[str] = []
    subscribe(hub, "here", lambda _key, _payload, _time_ns: heard.append(threading.current_thread().name))
    for n in range(20):  # a put to a subscriber of the same session calls it on the thread that puts
        worker = threading.Thread(target=declare_stream(hub, "here", "msgpack").put, args=(b"x",), name=f"t{n}")
        worker.start()
        worker.join(5.0)
        assert not worker.is_alive()
    assert heard == [f"t{n}" for n in range(20)]
