"""A running service for a test."""

from __future__ import annotations

import time
from collections.abc import Iterator
from queue import SimpleQueue

import pytest
from harness import KEYS, Running, Service

from arm_ik_service.io.zenoh_bus import BusOptions, open_client
from arm_ik_service.io.zenoh_streams import subscribe
from arm_ik_service.programs.demo import free_endpoint
from arm_ik_service.wire import codec
from arm_ik_service.wire.messages import ArmsState, Health


@pytest.fixture
def service() -> Iterator[Service]:
    endpoint = free_endpoint()
    process = Running("serve", "--name", "under-test", "--listen", endpoint)
    try:
        process.wait_ready()
        with open_client(BusOptions(connect=(endpoint,)), wait_s=10.0) as bus:
            answers: SimpleQueue[ArmsState] = SimpleQueue()
            healths: list[Health] = []
            newest: dict[str, int] = {}

            def take(_key: str, payload: bytes, _time_ns: int) -> None:
                answer = codec.arms_states.decode(payload)
                answers.put(answer)
                newest[answer.avatar] = answer.seq

            subscribe(bus, KEYS.arms(), take)
            subscribe(bus, KEYS.health(), lambda _k, payload, _t: healths.append(codec.healths.decode(payload)))
            time.sleep(0.1)  # for the subscriptions to reach the service
            yield Service(process, endpoint, bus, answers, healths, newest)
    finally:
        if process.popen.poll() is None:
            process.popen.kill()
        process.popen.wait()
