"""Two services share people; one is lost, and comes back: how long nobody answered, and who moved."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from threading import Thread
from typing import Any, NamedTuple

from arm_ik_service.bench.load import Load
from arm_ik_service.bench.namespace import INSIDE, OUTSIDE, Namespace
from arm_ik_service.bench.processes import Part
from arm_ik_service.io.zenoh_bus import BusOptions, open_client
from arm_ik_service.programs.demo import free_endpoint
from arm_ik_service.programs.fleet import owner_of

NAMES = LOST, KEPT = "first", "second"
LOST_AT_S, BACK_AT_S = 4.0, 8.0
STEADY_FROM_S = 2.0
SETTLING_S, SETTLED_FOR_S = 2.0, 2.0  # from when it is back
MOST_S = 60.0  # a busy machine takes seconds to start a service, not minutes


class Failover(NamedTuple):
    """What a client saw. Gaps [s] are between two answers to the same person, the worst of all people."""

    avatars: int
    rate_hz: float
    steady_gap_s: float  # before anything happened
    lost_gap_s: float
    unanswered: int  # people without an answer at the end of the time after the loss
    joined_gap_s: float
    doubles_joining: int  # frames answered twice while the service came back
    doubles_settled: int
    shares: dict[str, int]  # people of each service at the end
    misplaced: int  # people who are not with the service that hashing gives them: who moved without need

    def as_json(self) -> dict[str, Any]:
        """All of it, by name."""
        return self._asdict()


class _Pair:
    """Both services, the first of them alone in a network if its link is to be cut."""

    def __init__(self, stack: ExitStack, cut: bool) -> None:
        self._stack = stack
        self._network = Namespace() if cut else None
        if self._network is not None:
            stack.callback(self._network.close)
        ports = [free_endpoint().rsplit(":", 1)[1] for _ in NAMES]
        hosts = (INSIDE, OUTSIDE) if cut else ("127.0.0.1", "127.0.0.1")
        self.endpoints = [f"tcp/{host}:{port}" for host, port in zip(hosts, ports, strict=True)]
        self._lost = self._serve(LOST)
        kept = self._serve(KEPT)
        for service in (self._lost, kept):
            service.wait_ready()

    def _serve(self, name: str) -> Part:
        own, other = self.endpoints if name == LOST else self.endpoints[::-1]
        inside = self._network.inside if self._network is not None and name == LOST else ()
        arguments = ("serve", "--name", name, "--listen", own, "--connect", other)
        service = Part("arm_ik_service", *arguments, inside=inside)
        self._stack.callback(service.end)
        return service

    def lose(self) -> None:
        """Kill the first service, or cut its link."""
        if self._network is not None:
            self._network.cut()
        else:
            self._lost.popen.kill()

    def bring_back(self) -> None:
        """Start it again, or join the link."""
        if self._network is not None:
            self._network.join()
        else:
            self._serve(LOST).wait_ready()


def measure_failover(
    *, avatars: int, rate_hz: float, cut: bool = False, progress: Callable[[int], None] | None = None
) -> Failover:
    """Lose the first of two services, bring it back, and watch from a peer of both."""
    came_back_s = MOST_S
    with ExitStack() as stack:
        pair = _Pair(stack, cut)
        # a peer of both: the link to the one stands whatever becomes of the other
        options = BusOptions(connect=tuple(pair.endpoints), listen=(free_endpoint(),))
        bus = stack.enter_context(open_client(options, wait_s=10.0))
        people = Load(bus, tuple(pair.endpoints), avatars, rate_hz, MOST_S, peer=True)
        stack.callback(people.close)

        def disturb() -> None:
            nonlocal came_back_s
            for at_s, happen in ((LOST_AT_S, pair.lose), (BACK_AT_S, pair.bring_back)):
                while people.began_ns == 0 or people.elapsed_s < at_s:
                    time.sleep(0.005)
                happen()
            came_back_s = people.elapsed_s
            time.sleep(SETTLING_S + SETTLED_FOR_S)
            people.stop()

        helper = Thread(target=disturb)
        helper.start()
        people.run(progress=progress)
        helper.join()
    settled_s = came_back_s + SETTLING_S
    # a service tells its people once a second, and once more when it ends: of the last two seconds the last word counts
    last = {health.service: health for health in people.healths}
    owners = {avatar.avatar: name for name, health in last.items() for avatar in health.avatars}
    return Failover(
        avatars,
        rate_hz,
        steady_gap_s=float(people.longest_gaps_s(STEADY_FROM_S, LOST_AT_S).max()),
        lost_gap_s=float(people.longest_gaps_s(LOST_AT_S - 0.1, BACK_AT_S).max()),
        unanswered=int((people.longest_gaps_s(BACK_AT_S - 0.5, BACK_AT_S) > 0.4).sum()),
        joined_gap_s=float(people.longest_gaps_s(BACK_AT_S, settled_s + SETTLED_FOR_S).max()),
        doubles_joining=people.measured(LOST_AT_S, settled_s).doubles,
        doubles_settled=people.measured(STEADY_FROM_S, LOST_AT_S).doubles + people.measured(settled_s).doubles,
        shares={name: len(health.avatars) for name, health in last.items()},
        misplaced=sum(owners.get(name) != owner_of(name, NAMES) for name in people.names),
    )
