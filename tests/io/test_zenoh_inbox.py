"""The door of the service on a real bus: what is taken in, how fast, and of whom."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest
from harness import KEYS, wait_for

from arm_ik_service.io.zenoh_bus import BusOptions, open_client, open_hub
from arm_ik_service.io.zenoh_inbox import Arrival, Inbox
from arm_ik_service.io.zenoh_streams import Bus, put_once
from arm_ik_service.programs.demo import free_endpoint
from arm_ik_service.settings import ServiceSettings

LIMITS = ServiceSettings(
    max_message_bytes=100, max_id_length=8, max_avatars=2, max_frames_per_s=100.0, rate_burst_s=0.2
)


class Door:
    def __init__(self, stack: ExitStack, owns: Callable[[str], bool]) -> None:
        endpoint = free_endpoint()
        self.inbox = Inbox(stack.enter_context(open_hub(BusOptions(listen=(endpoint,)))), KEYS, LIMITS, owns)
        self.bus: Bus = stack.enter_context(open_client(BusOptions(connect=(endpoint,)), wait_s=5.0))

    def put(self, avatar: str, payload: bytes) -> None:
        put_once(self.bus, KEYS.controllers(avatar), payload, "msgpack")

    def take(self, seconds: float = 0.3) -> list[Arrival]:
        """Return what has arrived when nothing more comes."""
        time.sleep(seconds)
        assert self.inbox.wait(0.0)
        return self.inbox.take(100)

    def refused(self) -> dict[str, int]:
        return {cause: count for cause, (count, _) in self.inbox.take_refused().items()}


@pytest.fixture
def mine() -> set[str]:
    return {"a", "b", "c", "d", "e"}


@pytest.fixture
def door(mine: set[str]) -> Iterator[Door]:
    with ExitStack() as stack:
        opened = Door(stack, lambda avatar: avatar in mine)
        yield opened
        opened.inbox.close()


def test_the_newest_of_each_avatar_is_taken_and_the_rest_counted(door: Door) -> None:
    door.inbox.hear_everybody()
    for n in range(5):
        door.put("a", b"a%d" % n)
        door.put("b", b"b%d" % n)
    taken = [(arrival.avatar, arrival.payload, arrival.overtaken) for arrival in door.take()]
    assert taken == [("a", b"a4", 4), ("b", b"b4", 4)]


def test_a_flood_is_let_in_at_its_rate_and_costs_nobody_else_anything(door: Door) -> None:
    door.inbox.hear_everybody()
    for n in range(200):
        door.put("a", b"%d" % n)
    door.put("b", b"one")
    taken = {arrival.avatar: arrival for arrival in door.take()}
    assert taken["b"].payload == b"one"
    refused = door.refused()["rate"]
    assert taken["a"].overtaken + 1 + refused == 200
    assert refused == door.inbox.refused_of("a")
    assert 20 <= taken["a"].overtaken + 1 <= 60  # 0.2 s of 100 a second at once, and what came due meanwhile
    time.sleep(0.2)
    door.put("a", b"again")
    assert [arrival.payload for arrival in door.take()] == [b"again"]


def test_what_is_too_large_or_has_an_odd_id_or_is_one_too_many_is_refused_by_cause(door: Door, mine: set[str]) -> None:
    door.inbox.hear_everybody()
    door.put("a", bytes(101))
    door.put("a b", b"")
    door.put("far-too-long", b"")
    for avatar in ("b", "c", "d", "e"):  # twice as many doors as places
        door.put(avatar, b"x")
    assert {arrival.avatar for arrival in door.take()} == {"b", "c", "d"}
    assert door.refused() == {"too_large": 1, "bad_id": 2, "too_many_avatars": 1}


def test_others_are_heard_in_a_look_out_remembered_with_their_answer_and_taken_in_once_they_are_ours(
    door: Door, mine: set[str]
) -> None:
    door.inbox.hear("a")
    door.inbox.look_out()
    door.put("other", b"frame")
    put_once(door.bus, KEYS.arms("other"), b"answer", "msgpack")
    door.put("a", b"own")
    assert [(arrival.avatar, arrival.overtaken) for arrival in door.take()] == [("a", 0)]
    door.inbox.end_look_out()
    assert door.inbox.others() == ["other"]
    door.put("other", b"unheard")
    assert door.take() == []
    mine.add("other")
    door.inbox.forget_owners()
    door.inbox.hear("other")
    assert door.inbox.take_last_answer("other") == b"answer"
    time.sleep(0.1)
    door.put("other", b"heard")
    assert [arrival.payload for arrival in door.take()] == [b"heard"]


def test_what_was_given_up_is_not_taken_even_if_it_had_arrived(door: Door) -> None:
    door.inbox.hear("a")
    time.sleep(0.1)
    door.put("a", b"before")
    time.sleep(0.2)
    door.inbox.release("a", b"answer")
    assert door.take(0.0) == []
    assert door.inbox.take_last_answer("a") == b"answer"


def test_waiting_lasts_no_longer_than_it_is_told_and_ends_when_it_is_stopped(door: Door) -> None:
    door.inbox.wake()
    assert door.inbox.wait(60.0)
    assert door.inbox.take(1) == []
    assert door.inbox.wait(0.01)
    door.inbox.stop()
    assert not door.inbox.wait(60.0)


def test_whoever_is_silent_is_forgotten(door: Door) -> None:
    door.inbox.hear_everybody()
    for avatar in ("a", "b", "c", "d"):
        door.put(avatar, b"x")
    door.take()
    door.inbox.forget_silent(after_s=0.0)
    assert wait_for(lambda: door.inbox.refused_of("a") == 0)
    door.put("e", b"x")
    assert [arrival.avatar for arrival in door.take()] == ["e"]
