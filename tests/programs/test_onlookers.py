"""Those who only watch: what they are told, when, and what they lose before anybody else loses anything."""

from __future__ import annotations

import time
from collections.abc import Iterator
from threading import Event

import pytest
from harness import KEYS, Service, standing, wait_for

from arm_ik_service.io.zenoh_bus import BusOptions, open_client, open_hub
from arm_ik_service.io.zenoh_streams import Bus, subscribe
from arm_ik_service.programs.demo import free_endpoint
from arm_ik_service.programs.onlookers import AT_ONCE, LINGER_S, Onlookers
from arm_ik_service.wire import codec

PERIOD_NS = 11_111_111


@pytest.fixture
def buses() -> Iterator[tuple[Bus, Bus]]:
    """A hub, and a client of it."""
    endpoint = free_endpoint()
    with open_hub(BusOptions(listen=(endpoint,))) as hub, open_client(BusOptions(connect=(endpoint,))) as client:
        yield hub, client


def watching(bus: Bus, key: str) -> list[tuple[str, bytes]]:
    told: list[tuple[str, bytes]] = []
    subscribe(bus, key, lambda got, payload, _time_ns: told.append((got, payload)))
    return told


def test_who_watches_is_told_the_very_same_bytes_and_only_what_was_answered(service: Service) -> None:
    frames, answers = watching(service.bus, KEYS.watched_controllers()), watching(service.bus, KEYS.watched_arms("7"))
    direct = watching(service.bus, KEYS.arms("7"))
    stream = service.stream("7")
    time.sleep(0.1)
    sent = [codec.encode(standing(seq, seq * PERIOD_NS)) for seq in range(30)]
    for payload in (sent[0], b"noise", *sent[1:]):
        stream.put(payload)
        time.sleep(0.02)
    assert wait_for(lambda: len(answers) == len(direct) == 30), (len(answers), len(direct), len(frames))
    assert [payload for _, payload in answers] == [payload for _, payload in direct]
    assert [payload for _, payload in frames] == sent
    assert {key for key, _ in answers} == {KEYS.watched_arms("7")}


def test_whoever_speaks_again_after_a_silence_is_seen_at_once(service: Service) -> None:
    answers = watching(service.bus, KEYS.watched_arms())
    stream = service.stream("7")
    for seq in range(3):
        time.sleep(0.7)  # the loop has gone to sleep
        stream.put(codec.encode(standing(seq, seq * 700_000_000)))
        assert wait_for(lambda: len(answers) == seq + 1, 0.3)  # noqa: B023


def test_nobody_is_noticed_until_somebody_watches_and_when_the_last_has_gone(buses: tuple[Bus, Bus]) -> None:
    hub, client = buses
    come = Event()
    onlookers = Onlookers(hub, KEYS, "msgpack", come.set)
    assert not onlookers.there
    for key in (KEYS.watched_arms("7"), KEYS.watched_controllers()):
        come.clear()
        eye = subscribe(client, key, lambda _key, _payload, _time_ns: None)
        assert come.wait(2.0)
        assert onlookers.there
        eye.undeclare()
        assert wait_for(lambda: not onlookers.there)
    also_there = subscribe(hub, KEYS.watched_arms(), lambda _key, _payload, _time_ns: None)
    assert Onlookers(hub, KEYS, "msgpack", come.set).there
    also_there.undeclare()


def test_a_service_that_is_never_idle_tells_the_newest_now_and_then_and_everybody_in_turn(
    buses: tuple[Bus, Bus],
) -> None:
    hub, client = buses
    told = watching(client, KEYS.watched_arms())
    onlookers = Onlookers(hub, KEYS, "msgpack", lambda: None)
    assert wait_for(lambda: onlookers.there)
    people = [f"p{n}" for n in range(2 * AT_ONCE)]
    for answer in (b"old", b"new"):
        for name in people:
            onlookers.note(name, b"frame", answer)
        time.sleep(2.0 * LINGER_S)
        onlookers.tell(idle=False)
    assert told == []
    for first in (0, AT_ONCE):
        onlookers.tell(idle=True)
        names = people[first : first + AT_ONCE]
        assert wait_for(lambda: len(told) == first + AT_ONCE)  # noqa: B023
        assert told[first:] == [(KEYS.watched_arms(name), b"new") for name in names]
    onlookers.note("p0", b"frame", b"last")
    onlookers.note("p1", b"frame", b"of somebody who is gone")
    onlookers.forget("p1")
    onlookers.close()
    assert wait_for(lambda: len(told) == len(people) + 1)
    assert told[-1] == (KEYS.watched_arms("p0"), b"last")
