"""Who comes first, who comes again: a publisher is answered at once, whatever its numbers and its clock say."""

from __future__ import annotations

import time

import pytest
from harness import KEYS, Running, Service, standing, wait_for

from arm_ik_service.io.zenoh_bus import BusOptions, open_client
from arm_ik_service.io.zenoh_streams import subscribe
from arm_ik_service.programs.demo import bundled_session, free_endpoint
from arm_ik_service.wire import codec

RATE_HZ = 90
PERIOD_NS = 1_000_000_000 // RATE_HZ
WITHIN = int(0.2 * RATE_HZ)  # frames, which is what a busy machine keeps to; it does not keep to 200 ms
START_NS = 10**15


def frames_until_answered(service: Service, avatar: str, clock_ns: int, most: int = 3 * RATE_HZ) -> int:
    """Put frames from number 0 on, as fast as a headset does, and return how many were not answered at first."""
    stream, fresh = service.stream(avatar), service.newest
    fresh.pop(avatar, None)
    for seq in range(most):
        stream.put(codec.encode(standing(seq, clock_ns + seq * PERIOD_NS)))
        if wait_for(lambda: avatar in fresh, 1.0 / RATE_HZ):
            return fresh[avatar]
    return most


@pytest.mark.parametrize("jump_s", [-1000.0, -0.05, 0.0, 1000.0], ids="jump {} s".format)
def test_numbers_that_begin_again_with_a_clock_that_jumps_are_answered_within_200_ms(
    service: Service, jump_s: float
) -> None:
    stream = service.stream("7")
    for seq in range(30):
        service.ask(stream, "7", standing(seq, START_NS + seq * PERIOD_NS))
    service.take(30)
    assert frames_until_answered(service, "7", START_NS + 30 * PERIOD_NS + int(1e9 * jump_s)) <= WITHIN


def test_a_publisher_that_is_killed_and_started_again_is_answered_from_its_first_frames_on(service: Service) -> None:
    session = str(bundled_session("boxing"))
    for _ in range(3):
        player = Running("replay", session, "--avatar", "7", "--connect", service.endpoint)
        first = service.take(1, 30.0)
        player.popen.kill()
        player.popen.wait()
        time.sleep(0.05)
        service.take(10_000, 0.05)
        assert first[0].seq <= WITHIN


def test_a_publisher_that_was_there_before_the_service_is_answered_as_soon_as_the_service_is_ready() -> None:
    endpoint = free_endpoint()
    player = Running("replay", str(bundled_session("boxing")), "--connect", endpoint)
    services = []
    try:
        assert player.says("waiting for")
        for _ in range(2):  # the second finds a player who lost the first
            services.append(Running("serve", "--listen", endpoint))
            services[-1].wait_ready()
            with open_client(BusOptions(connect=(endpoint,)), wait_s=10.0) as bus:
                answered: list[bytes] = []
                subscribe(bus, KEYS.arms(), lambda _key, payload, _ns: answered.append(payload))  # noqa: B023
                assert wait_for(lambda: len(answered) > WITHIN, 3.0)  # noqa: B023
            services[-1].popen.kill()
            services[-1].popen.wait()
    finally:
        for process in (player, *services):
            process.popen.kill()
            process.popen.wait()
