"""The service: newest frames in, both arms out, for every avatar that speaks; health once a second.

Bad input is counted by cause and reported once a second; it is never fatal and never another avatar's problem.
"""

from __future__ import annotations

import gc
import logging
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import arm_ik_service
from arm_ik_service.avatar import Avatars
from arm_ik_service.body.profile import Profile
from arm_ik_service.errors import DecodeError, VersionError
from arm_ik_service.io.zenoh_inbox import Arrival, Inbox
from arm_ik_service.io.zenoh_streams import Bus, Stream, announce, answer_queries, declare_stream, put_once
from arm_ik_service.settings import Settings
from arm_ik_service.skeleton import skeleton_of
from arm_ik_service.tracking.state import ACCEPTED, REFUSALS
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys
from arm_ik_service.wire.messages import VERSION, AvatarHealth, Health

log = logging.getLogger("arm_ik.service")

BATCH = 8  # frames solved by one call: more saves little per frame and delays the first of them


@dataclass(slots=True)
class Seat:
    """One avatar being served."""

    name: str
    index: int
    publisher: Stream
    profile: Profile
    last_arrival_ns: int
    answered: int = 0
    overtaken: int = 0
    refused: int = 0
    answered_at_health: int = 0


@dataclass(slots=True)
class _Latencies:
    """Receive-to-publish times of the last health period, in a ring that is allocated once."""

    ring_ns: Any = field(default_factory=lambda: np.zeros(32_768, np.int64))
    count: int = 0

    def add(self, nanoseconds: int) -> None:
        self.ring_ns[self.count % len(self.ring_ns)] = nanoseconds
        self.count += 1

    def take_ms(self) -> tuple[float, float]:
        """Return p50 and p99 [ms] since the last call."""
        seen = self.ring_ns[: min(self.count, len(self.ring_ns))]
        self.count = 0
        if len(seen) == 0:
            return 0.0, 0.0
        p50, p99 = np.percentile(seen, [50, 99]) / 1e6
        return float(p50), float(p99)


class Service:
    """One process's worth of avatars on an open Zenoh session, which the caller closes."""

    def __init__(self, session: Bus, *, name: str, settings: Settings, profile: Profile) -> None:
        """Allocate and declare everything. Raises ModelError or ProfileError where no arm can be built."""
        limits = settings.service
        self._session = session
        self._name = name
        self._limits = limits
        self._profile = profile
        self._keys = Keys(limits.key_prefix)
        self._avatars = Avatars(settings, capacity=limits.max_avatars, batch=BATCH)
        # models and limits are read now rather than in front of somebody's first pose
        self._avatars.reset(0, profile)
        skeleton_of(name, profile)
        self._free = list(range(limits.max_avatars - 1, -1, -1))
        self._seats: dict[str, Seat] = {}
        self._refused: dict[str, int] = {}
        self._details: dict[str, tuple[int, str]] = {}
        self._answered = 0
        self._overtaken = 0
        self._latencies = _Latencies()
        self._started_s = time.monotonic()
        self._health_at_s = self._started_s
        self._inbox = Inbox(
            session,
            self._keys,
            max_message_bytes=limits.max_message_bytes,
            max_avatars=limits.max_avatars,
            max_id_length=limits.max_id_length,
        )
        self._health = declare_stream(session, self._keys.health(name), limits.encoding)
        self._queryables = [
            answer_queries(session, self._keys.skeleton(), self._skeletons, limits.encoding),
            answer_queries(session, self._keys.calibration(), self._calibrations, limits.encoding),
        ]
        # what was built so far stays: to walk through it again would stall frames for tens of milliseconds
        gc.collect()
        gc.freeze()
        self._token = announce(session, self._keys.liveliness(name))

    def stop(self) -> None:
        """Make `run` return after the frame in hand; safe in a signal handler."""
        self._inbox.stop()

    def run(self) -> None:
        """Serve until `stop`. Garbage is collected once a second, between frames, not where it falls."""
        gc.disable()
        try:
            while True:
                arrivals = self._inbox.take(self._health_at_s - time.monotonic(), BATCH)
                if arrivals is None:
                    return
                if arrivals:
                    self._answer(arrivals)
                if time.monotonic() >= self._health_at_s:
                    self._publish_health()
                    gc.collect(1)
        finally:
            gc.enable()
            gc.unfreeze()

    def close(self) -> None:
        """Withdraw from the bus; the last health says what was served."""
        self._inbox.close()
        self._publish_health()
        self._token.undeclare()

    def _answer(self, arrivals: list[Arrival]) -> None:
        """Decode, solve and publish one batch; what cannot be used is counted and leaves the rest alone."""
        began_ns = time.perf_counter_ns()
        batch = []
        for arrival in arrivals:
            seat = self._seats.get(arrival.avatar) or self._seat(arrival)
            seat.last_arrival_ns = arrival.receive_time_ns
            seat.overtaken += arrival.overtaken
            self._overtaken += arrival.overtaken
            try:
                frame = codec.controller_frames.decode(arrival.payload)
            except DecodeError as error:
                self._refuse("malformed", f"{arrival.avatar}: {error}", seat)
                continue
            except VersionError as error:
                self._refuse("version", f"{arrival.avatar}: {error}", seat)
                continue
            batch.append((seat, frame, arrival, self._avatars.add(seat.index, frame, arrival.receive_time_ns)))
        self._avatars.step()
        solve_ns = time.perf_counter_ns() - began_ns
        encoding = self._limits.encoding
        for seat, frame, arrival, place in batch:
            verdict = int(self._avatars.verdicts[place])
            if verdict != ACCEPTED:
                self._refuse(REFUSALS[verdict], f"{seat.name}: seq {frame.seq}", seat)
                continue
            publish_time_ns = time.time_ns()
            state = self._avatars.answer(place, frame, seat.name, arrival.receive_time_ns, solve_ns, publish_time_ns)
            seat.publisher.put(codec.encode(state, encoding))
            seat.answered += 1
            self._answered += 1
            self._latencies.add(publish_time_ns - arrival.receive_time_ns)

    def _seat(self, arrival: Arrival) -> Seat:
        """Give an avatar heard for the first time a row, a publisher and its skeleton on the bus."""
        index = self._free.pop()
        self._avatars.reset(index, self._profile)
        seat = Seat(
            arrival.avatar,
            index,
            declare_stream(self._session, self._keys.arms(arrival.avatar), self._limits.encoding),
            self._profile,
            arrival.receive_time_ns,
        )
        self._seats[arrival.avatar] = seat
        put_once(self._session, *self._skeleton(seat), self._limits.encoding)
        log.info("avatar %s: serving", arrival.avatar)
        return seat

    def _forget_silent(self, now_ns: int) -> None:
        silent = [s for s in self._seats.values() if now_ns - s.last_arrival_ns > self._limits.forget_after_s * 1e9]
        for seat in silent:
            self._inbox.forget(seat.name)
            del self._seats[seat.name]
            seat.publisher.undeclare()
            self._free.append(seat.index)
            log.info("avatar %s: silent for %.0f s, forgotten", seat.name, self._limits.forget_after_s)

    def _refuse(self, cause: str, detail: str, seat: Seat | None = None, count: int = 1) -> None:
        self._refused[cause] = self._refused.get(cause, 0) + count
        self._details[cause] = (self._details.get(cause, (0, ""))[0] + count, detail)
        if seat is not None:
            seat.refused += count

    def _publish_health(self) -> None:
        """Publish and log what the last period brought; called between frames."""
        for cause, (count, detail) in self._inbox.take_refused().items():
            self._refuse(cause, detail, count=count)
        for cause, (count, detail) in self._details.items():
            log.warning("refused %d frame(s), %s; the last: %s", count, cause, detail)
        self._details.clear()
        now_ns = time.time_ns()
        self._forget_silent(now_ns)
        p50_ms, p99_ms = self._latencies.take_ms()
        period_s = self._limits.health_period_s
        rows = []
        for seat in self._seats.values():
            rate = (seat.answered - seat.answered_at_health) / period_s
            seat.answered_at_health = seat.answered
            silent_s = max(0.0, (now_ns - seat.last_arrival_ns) / 1e9)
            rows.append(AvatarHealth(seat.name, rate, seat.answered, seat.overtaken, seat.refused, silent_s))
        health = Health(
            version=VERSION,
            service=self._name,
            software=f"arm-ik-service {arm_ik_service.__version__}",
            time_ns=now_ns,
            uptime_s=time.monotonic() - self._started_s,
            answered=self._answered,
            overtaken=self._overtaken,
            refused=dict(self._refused),
            latency_p50_ms=p50_ms,
            latency_p99_ms=p99_ms,
            avatars=tuple(rows),
        )
        self._health.put(codec.encode(health, self._limits.encoding))
        # an absolute schedule, but never a burst of healths after a stall
        self._health_at_s = max(self._health_at_s + period_s, time.monotonic())

    def _skeleton(self, seat: Seat) -> tuple[str, bytes]:
        message = skeleton_of(seat.name, seat.profile)
        return self._keys.skeleton(seat.name), codec.encode(message, self._limits.encoding)

    def _skeletons(self) -> Iterator[tuple[str, bytes]]:
        """What there is to answer to a query; runs on a Zenoh thread."""
        for seat in list(self._seats.values()):
            yield self._skeleton(seat)

    def _calibrations(self) -> Iterator[tuple[str, bytes]]:
        for seat in list(self._seats.values()):
            yield self._keys.calibration(seat.name), codec.encode(seat.profile, self._limits.encoding)

    def farewell(self) -> str:
        """Return one line that says what was served."""
        refused = ", ".join(f"{count} {cause}" for cause, count in self._refused.items()) or "none"
        return f"answered {self._answered} frames, overtaken {self._overtaken}, refused: {refused}"
