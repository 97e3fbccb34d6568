"""Services that share people: who answers whom, and what happens when one comes, goes or dies."""

from __future__ import annotations

import signal
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from harness import KEYS, Running, standing, wait_for
from hypothesis import given
from hypothesis import strategies as st

from arm_ik_service.io.zenoh_bus import BusOptions, open_client
from arm_ik_service.io.zenoh_streams import Bus, Stream, declare_stream, query, subscribe
from arm_ik_service.programs.demo import free_endpoint
from arm_ik_service.programs.fleet import owner_of
from arm_ik_service.wire import codec
from arm_ik_service.wire.messages import ArmsState, Health

pytestmark = pytest.mark.slow  # real processes, one after the other: the default run has three minutes

ids = st.text("abcdefghijklmnopqrstuvwxyz0123456789-_", min_size=1, max_size=12)
PEOPLE = [f"person-{n}" for n in range(12)]
PERIOD_NS = 11_111_111


@given(avatar=ids, services=st.sets(ids, min_size=2, max_size=8), order=st.randoms())
def test_the_owner_is_the_same_in_whatever_order_services_are_known(avatar: str, services: set[str], order) -> None:  # type: ignore[no-untyped-def]
    listed = sorted(services)
    order.shuffle(listed)
    assert owner_of(avatar, listed) == owner_of(avatar, sorted(services))


@given(avatar=ids, services=st.sets(ids, min_size=2, max_size=8))
def test_a_service_that_goes_moves_only_its_own_people(avatar: str, services: set[str]) -> None:
    owner = owner_of(avatar, services)
    for gone in services - {owner}:
        assert owner_of(avatar, services - {gone}) == owner


def test_people_are_shared_evenly() -> None:
    counts = Counter(owner_of(f"person-{n}", ["one", "two", "three", "four"]) for n in range(4000))
    assert all(900 < count < 1100 for count in counts.values())  # 1000, and three standard deviations of 27


class Fleet:
    """Two services that know each other, and a client of both that sends for everybody."""

    def __init__(self, stack: ExitStack, arguments: dict[str, list[str]] | None = None) -> None:
        self._stack = stack
        self._arguments = arguments or {}
        self.endpoints = {"first": free_endpoint(), "second": free_endpoint()}
        self.services = {name: self.serve(name) for name in self.endpoints}
        for service in self.services.values():
            service.wait_ready()
        connect = tuple(self.endpoints.values())
        options = BusOptions(connect=connect, listen=(free_endpoint(),))
        self.bus: Bus = stack.enter_context(open_client(options, wait_s=10.0))
        self.answers: list[ArmsState] = []
        self.healths: dict[str, Health] = {}
        subscribe(self.bus, KEYS.arms(), lambda _k, payload, _t: self.answers.append(codec.arms_states.decode(payload)))
        subscribe(self.bus, KEYS.health(), self._take_health)
        self.streams: dict[str, Stream] = {
            name: declare_stream(self.bus, KEYS.controllers(name), "msgpack") for name in PEOPLE
        }
        self.seq = 0

    def serve(self, name: str) -> Running:
        other = next(endpoint for who, endpoint in self.endpoints.items() if who != name)
        more = self._arguments.get(name, [])
        service = Running("serve", "--name", name, "--listen", self.endpoints[name], "--connect", other, *more)
        self._stack.callback(self._end, service)
        return service

    @staticmethod
    def _end(service: Running) -> None:
        if service.popen.poll() is None:
            service.popen.kill()
        service.popen.wait()

    def _take_health(self, _key: str, payload: bytes, _time_ns: int) -> None:
        health = codec.healths.decode(payload)
        self.healths[health.service] = health

    def send(self, frames: int) -> None:
        for _ in range(frames):
            for stream in self.streams.values():
                stream.put(codec.encode(standing(self.seq, self.seq * PERIOD_NS)))
            self.seq += 1
            time.sleep(0.011)

    def send_until_all_are_answered(self, seconds: float = 5.0) -> float:
        """Return after how long everybody had an answer to a frame sent from now on."""
        began_s, from_seq = time.monotonic(), self.seq
        while time.monotonic() - began_s < seconds:
            self.send(1)
            if {answer.avatar for answer in self.answers if answer.seq >= from_seq} == set(PEOPLE):
                return time.monotonic() - began_s
        raise AssertionError("somebody is not answered")

    def doubles(self, from_seq: int) -> int:
        seen = Counter((answer.avatar, answer.seq) for answer in self.answers if answer.seq >= from_seq)
        return sum(count - 1 for count in seen.values())

    def settled(self, services: set[str]) -> bool:
        """Whether these services tell of each other and of exactly the people that hashing gives them."""
        return all(
            name in self.healths
            and set(self.healths[name].services) == services
            and {a.avatar for a in self.healths[name].avatars} == {p for p in PEOPLE if owner_of(p, services) == name}
            for name in services
        )

    def send_until_settled(self, services: set[str], seconds: float = 10.0) -> None:
        end_s = time.monotonic() + seconds
        while not self.settled(services):
            assert time.monotonic() < end_s, self.healths
            self.send(1)


@pytest.fixture
def fleet() -> Iterator[Fleet]:
    with ExitStack() as stack:
        yield Fleet(stack)


def test_two_services_share_people_survive_a_kill_and_take_back_only_their_share(fleet: Fleet) -> None:
    both = {"first", "second"}
    fleet.send_until_settled(both)
    from_seq = fleet.seq
    fleet.send(40)
    assert fleet.doubles(from_seq) == 0

    elbow_before = {a.avatar: a.right.bones.forearm.position for a in fleet.answers}
    fleet.services["first"].popen.kill()
    fleet.services["first"].popen.wait()
    fleet.send_until_all_are_answered()
    fleet.send_until_settled({"second"})
    assert any("taken over" in line for line in fleet.services["second"].lines)
    after = {a.avatar: a.right.bones.forearm.position for a in fleet.answers}
    for name in PEOPLE:  # the same pose is asked for: an elbow that stays was carried over
        assert np.linalg.norm(np.subtract(after[name], elbow_before[name])) < 0.03

    back = fleet.serve("first")
    back.wait_ready()
    fleet.send_until_settled(both)
    from_seq = fleet.seq
    fleet.send(40)
    assert fleet.doubles(from_seq) == 0
    assert {a.avatar for a in fleet.answers if a.seq >= from_seq} == set(PEOPLE)
    assert back.end(signal.SIGTERM) == 0  # who leaves says so
    fleet.send_until_all_are_answered()


def test_whoever_comes_late_is_told_everybodys_last_answer_by_whichever_service_has_it(fleet: Fleet) -> None:
    fleet.send_until_settled({"first", "second"})
    last = {key: codec.arms_states.decode(payload) for key, payload in query(fleet.bus, KEYS.arms())}
    assert set(last) == {KEYS.arms(name) for name in PEOPLE}
    assert wait_for(lambda: all(state.seq <= fleet.seq for state in last.values()))
    assert {key for key, _ in query(fleet.bus, KEYS.skeleton())} == {KEYS.skeleton(name) for name in PEOPLE}


def test_a_calibration_moves_along_with_the_person(tmp_path: Path) -> None:
    profile = tmp_path / "tall.toml"
    profile.write_text("[body]\nstature_m = 1.97\nupper_arm_m = 0.41\n")
    with ExitStack() as stack:
        fleet = Fleet(stack, {"first": ["--profile", str(profile)]})
        fleet.send_until_settled({"first", "second"})
        time.sleep(2.0)  # somebody new's calibration is asked for within a second
        fleet.services["first"].popen.kill()
        fleet.send_until_settled({"second"})
        skeletons = {key: codec.skeletons.decode(payload) for key, payload in query(fleet.bus, KEYS.skeleton())}
    tall = {KEYS.avatar_of(key) for key, skeleton in skeletons.items() if skeleton.upper_arm_m == 0.41}
    assert tall == {name for name in PEOPLE if owner_of(name, {"first", "second"}) == "first"}


def test_a_second_service_of_the_same_name_is_refused_with_one_line(fleet: Fleet) -> None:
    endpoint = fleet.endpoints["second"]
    twin = Running("serve", "--name", "second", "--listen", free_endpoint(), "--connect", endpoint)
    assert twin.finish() == 2
    assert "'second'" in twin.lines[-1]


def test_services_and_headsets_that_only_connect_meet_at_a_router() -> None:
    endpoint = free_endpoint()
    router = Running("router", "--listen", endpoint)
    router.wait_ready()
    services = [Running("serve", "--name", name, "--connect", endpoint) for name in ("first", "second")]
    try:
        for service in services:
            service.wait_ready()
        with open_client(BusOptions(connect=(endpoint,)), wait_s=10.0) as bus:
            answered: set[str] = set()
            subscribe(bus, KEYS.arms(), lambda key, _p, _t: answered.add(KEYS.avatar_of(key)))
            streams = [declare_stream(bus, KEYS.controllers(name), "msgpack") for name in PEOPLE]
            end_s, seq = time.monotonic() + 5.0, 0
            while answered != set(PEOPLE) and time.monotonic() < end_s:
                for stream in streams:
                    stream.put(codec.encode(standing(seq, seq * PERIOD_NS)))
                seq += 1
                time.sleep(0.011)
            assert answered == set(PEOPLE)
        assert [service.end() for service in services] == [0, 0]
        assert all("answered 0 frames" not in service.lines[-1] for service in services)
        assert router.end() == 0
    finally:
        for process in (router, *services):
            if process.popen.poll() is None:
                process.popen.kill()
            process.popen.wait()
