"""The service: newest frames in, both arms out, for every avatar that is its own; health once a second.

Bad input is counted by cause and reported once a second; it is never fatal and never another avatar's problem. Alone it
serves everybody. One of several serves its share, takes over what another leaves behind, and gives up what a new one
is to have.
"""

from __future__ import annotations

import gc
import logging
import time
from collections.abc import Callable, Iterator
from functools import partial
from threading import Lock

from arm_ik_service.avatar import Avatars
from arm_ik_service.body.profile import Profile
from arm_ik_service.errors import DecodeError, ModelError, ProfileError, VersionError, WireError
from arm_ik_service.io.zenoh_inbox import Arrival, Inbox
from arm_ik_service.io.zenoh_streams import Bus, answer_queries, declare_stream, put_once, subscribe
from arm_ik_service.programs.fleet import Fleet
from arm_ik_service.programs.look_out import LookOut, profiles
from arm_ik_service.programs.onlookers import LINGER_S, Onlookers
from arm_ik_service.programs.rehearsal import Rehearsal
from arm_ik_service.programs.seats import Seat, outgrown
from arm_ik_service.programs.tally import Tally
from arm_ik_service.settings import Settings
from arm_ik_service.skeleton import skeleton_of
from arm_ik_service.tracking.state import ACCEPTED, REFUSALS
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys

log = logging.getLogger("arm_ik.service")

BATCH = 8  # frames solved by one call: more saves little per frame and delays the first of them
# A frame that finds nobody at work is solved on the thread that brought it: to hand it over costs as much as a solve.
# That thread reads no other frame meanwhile, so frames that come faster than they are answered go through the slots,
# where the newest of each avatar wins.
BACK_TO_BACK_NS = 50_000  # between the end of one and the next: it had been waiting
MOST_BACK_TO_BACK = 3
TOLD_AT_ONCE = 8  # people of a health: all of them would keep frames waiting for longer than a frame lasts
DONE = object()
SPEAKING_S = 0.5  # after its last frame somebody is expected to send another


class Service:
    """One process's worth of avatars on an open Zenoh session, which the caller closes."""

    def __init__(
        self, session: Bus, *, name: str, settings: Settings, profile: Profile, avatars: Avatars | None = None
    ) -> None:
        """Allocate and declare everything; `avatars` with room for a batch of BATCH stands in for our own.

        Raises ModelError or ProfileError where no arm can be built, BusError where the name is taken.
        """
        limits = settings.service
        self._session = session
        self._name = name
        self._limits = limits
        self._profile = profile
        self._keys = Keys(limits.key_prefix)
        self._avatars = avatars or Avatars(settings, capacity=limits.max_avatars, batch=BATCH)
        # models and limits are read now rather than in front of somebody's first pose
        self._avatars.reset(0, profile)
        skeleton_of(name, profile)
        self._free = list(range(limits.max_avatars - 1, -1, -1))
        self._seats: dict[str, Seat] = {}
        self._tally = Tally()
        self._health_at_s = time.monotonic()
        self._telling: Iterator[None] | None = None  # a health that is being put together
        self._services_changed = False
        self._working = Lock()  # held by whoever touches avatars and seats
        self._ended_ns = 0  # when the last frame was answered
        # who stands in for our avatars does so to see what the rest costs
        self._rehearsal = Rehearsal(settings, profile) if avatars is None and limits.rehearse_every_s else None
        self._back_to_back = 0
        self._fleet = Fleet(session, self._keys, name, self._note_change)
        self._inbox = Inbox(session, self._keys, limits, self._fleet.owns, self._answer_now)
        self._onlookers = Onlookers(session, self._keys, limits.encoding, self._inbox.wake)
        self._look_out = LookOut(session, self._keys, limits, self._inbox, self._seats.__contains__)
        self._health = declare_stream(session, self._keys.health(name), limits.encoding)
        self._queryables = [
            answer_queries(session, key, partial(self._of_everybody, *made), limits.encoding)
            for key, made in (
                (self._keys.skeleton(), (self._keys.skeleton, self._skeleton)),
                (self._keys.calibration(), (self._keys.calibration, self._calibration)),
                (self._keys.arms(), (self._keys.arms, lambda seat: seat.last_payload)),
            )
        ]
        self._calibrations = subscribe(session, self._keys.calibration(), self._take_calibration)
        self._join()
        # what was built so far stays: to walk through it again would stall frames for tens of milliseconds
        gc.collect()
        gc.freeze()

    def _join(self) -> None:
        """Begin to hear. One of several waits until the others have given up what will be ours."""
        if self._fleet.alone:
            self._inbox.hear_everybody()
            self._fleet.join()
            return
        self._inbox.look_out()
        self._look_out.ask_for_calibrations()
        self._fleet.join()
        time.sleep(self._limits.hand_over_s)
        self._services_changed = True

    def stop(self) -> None:
        """Make `run` return after the frame in hand; safe in a signal handler."""
        self._inbox.stop()

    def run(self) -> None:
        """Serve until `stop`. Garbage is collected once a second, between frames, not where it falls."""
        gc.disable()
        try:
            while True:
                if not self._inbox.wait(self._idle_for_s()):
                    return
                with self._working:
                    if self._services_changed:
                        self._share_out()
                    arrivals = self._inbox.take(BATCH)
                    if arrivals:
                        self._answer(arrivals)
                        self._ended_ns = time.perf_counter_ns()
                    self._onlookers.tell(idle=self._inbox.empty)
                    now_s = time.monotonic()
                    if now_s >= self._look_out.due_s:
                        self._look_out.turn(now_s)
                    if self._telling is None and now_s >= self._health_at_s:
                        self._telling = self._tell_health()
                    if self._telling is not None and next(self._telling, DONE) is DONE:
                        self._telling = None
                        gc.collect(1)
        finally:
            gc.enable()
            gc.unfreeze()

    def _idle_for_s(self) -> float:
        """For how long there is nothing to do but to wait for frames; rehearses first if that is due."""
        if self._services_changed or self._telling is not None:
            return 0.0
        due_s = min(self._health_at_s, self._look_out.due_s) - time.monotonic()
        quiet_s = (time.perf_counter_ns() - self._ended_ns) / 1e9
        if quiet_s > SPEAKING_S:
            return due_s  # whoever begins to speak wakes us
        if self._onlookers.there:
            due_s = min(due_s, LINGER_S)
        if self._rehearsal is None:
            return due_s
        every_s = self._limits.rehearse_every_s
        if quiet_s > every_s:
            self._rehearsal.run()
            return min(due_s, every_s)
        return min(due_s, every_s - quiet_s)

    def close(self) -> None:
        """Withdraw from the bus; the last health says what was served."""
        self._inbox.close()
        self._fleet.leave()
        with self._working:
            self._onlookers.close()
            for _ in self._tell_health():
                pass

    # --- frames

    def _answer_now(self, arrival: Arrival) -> bool:
        """Run on a Zenoh thread: answer a known avatar where nobody is at work and no frame was waiting."""
        quiet_ns = time.perf_counter_ns() - self._ended_ns
        if quiet_ns > BACK_TO_BACK_NS:
            self._back_to_back = 0
            if quiet_ns > SPEAKING_S * 1e9:
                return False  # the loop sleeps: it has things to do while somebody speaks
        elif self._back_to_back >= MOST_BACK_TO_BACK:
            return False
        if not self._working.acquire(blocking=False):
            return False
        try:
            if arrival.avatar not in self._seats:
                return False  # to sit down takes declarations, which are for the loop
            self._answer([arrival])
            self._back_to_back += 1
            self._ended_ns = time.perf_counter_ns()
            return True
        finally:
            self._working.release()

    def _answer(self, arrivals: list[Arrival]) -> None:
        """Decode, solve and publish one batch; what cannot be used is counted and leaves the rest alone."""
        began_ns = time.perf_counter_ns()
        batch = []
        for arrival in arrivals:
            seat = self._seats.get(arrival.avatar)
            self._tally.arrived(seat, arrival.receive_time_ns, arrival.overtaken)
            assert arrival.payload is not None
            try:
                frame = codec.controller_frames.decode(arrival.payload)
            except DecodeError as error:
                self._tally.refused("malformed", f"{arrival.avatar}: {error}", seat)
                continue
            except VersionError as error:
                self._tally.refused("version", f"{arrival.avatar}: {error}", seat)
                continue
            # a place is for whoever speaks our language: noise on a thousand keys takes none
            seat = seat or self._seat(arrival)
            if seat is not None:
                batch.append((seat, frame, arrival, self._avatars.add(seat.index, frame, arrival.receive_time_ns)))
        if not batch:
            return
        self._avatars.step()
        solve_ns = time.perf_counter_ns() - began_ns
        encoding = self._limits.encoding
        for seat, frame, arrival, place in batch:
            verdict = int(self._avatars.verdicts[place])
            if verdict != ACCEPTED:
                self._tally.refused(REFUSALS[verdict], f"{seat.name}: seq {frame.seq}", seat)
                continue
            publish_time_ns = time.time_ns()
            payload = self._avatars.payload(
                place, frame, seat.name, arrival.receive_time_ns, solve_ns, publish_time_ns, encoding
            )
            seat.publisher.put(payload)
            self._tally.answered(seat, payload, publish_time_ns - arrival.receive_time_ns)
            if self._onlookers.there:
                assert arrival.payload is not None
                self._onlookers.note(seat.name, arrival.payload, payload)

    def _seat(self, arrival: Arrival) -> Seat | None:
        """Give an avatar a row, a publisher and its skeleton on the bus; where another served it, go on from there."""
        name = arrival.avatar
        if not self._fleet.owns(name):
            return None  # it arrived before it was given up
        if not self._free:
            self._tally.refused("too_many_avatars", f"{name}: {self._limits.max_avatars} are served")
            return None
        index = self._free.pop()
        profile = self._look_out.take_profile(name) or self._profile
        try:
            self._avatars.reset(index, profile)
        except (ModelError, ProfileError) as error:
            log.warning("avatar %s: the profile it had elsewhere is not used: %s", name, error)
            profile = self._profile
            self._avatars.reset(index, profile)
        last_answer = self._inbox.take_last_answer(name)
        resumed = last_answer is not None and self._resume(index, last_answer)
        stream = declare_stream(self._session, self._keys.arms(name), self._limits.encoding)
        measures = self._avatars.measures(index, profile)
        seat = Seat(name, index, stream, profile, measures, arrival.receive_time_ns, overtaken=arrival.overtaken)
        self._seats[name] = seat
        if not self._fleet.alone:
            self._inbox.hear(name)
        put_once(self._session, self._keys.skeleton(name), self._skeleton(seat), self._limits.encoding)
        log.info("avatar %s: %s", name, "taken over" if resumed else "serving")
        return seat

    def _resume(self, index: int, payload: bytes) -> bool:
        try:
            return self._avatars.resume(index, codec.arms_states.decode(payload))
        except WireError as error:
            log.warning("an answer of another service cannot be read: %s", error)
            return False

    def _stand_up(self, seat: Seat, *, lives_on: bool) -> None:
        """Give an avatar's place away: it fell silent, or lives on with another service."""
        self._inbox.release(seat.name, seat.last_payload if lives_on else None)
        del self._seats[seat.name]
        seat.publisher.undeclare()
        self._onlookers.forget(seat.name)
        self._free.append(seat.index)

    def _forget_silent(self, now_ns: int) -> None:
        after_s = self._limits.forget_after_s
        for seat in [s for s in self._seats.values() if now_ns - s.last_arrival_ns > after_s * 1e9]:
            self._stand_up(seat, lives_on=False)
            log.info("avatar %s: silent for %.0f s, forgotten", seat.name, after_s)
        self._inbox.forget_silent(after_s)

    # --- sharing with other services

    def _note_change(self) -> None:
        """Run on a Zenoh thread: the loop does the rest."""
        self._services_changed = True
        self._inbox.wake()

    def _share_out(self) -> None:
        """Give up what is another's now, and hear what is ours."""
        self._services_changed = False
        self._inbox.forget_owners()
        given_up = [seat for seat in self._seats.values() if not self._fleet.owns(seat.name)]
        for seat in given_up:
            self._stand_up(seat, lives_on=True)
        gained = [avatar for avatar in self._inbox.others() if self._fleet.owns(avatar)]
        if self._fleet.alone:
            self._look_out.end()
        else:
            for avatar in (*self._seats, *gained):
                self._inbox.hear(avatar)
            self._look_out.begin_again(time.monotonic())
        log.info(
            "services: %s; %d avatars given up, %d taken over",
            ", ".join(sorted(self._fleet.services)),
            len(given_up),
            len(gained),
        )

    def _take_calibration(self, key: str, payload: bytes, _time_ns: int) -> None:
        """Run on a Zenoh thread: somebody was measured; from the next frame on they have these measures."""
        avatar = self._keys.avatar_of(key)
        with self._working:
            seat = self._seats.get(avatar)
            if seat is None:
                self._look_out.note_calibration(key, payload)
                return
            try:
                profile = profiles.decode(payload)
            except DecodeError as error:
                self._tally.refused("calibration", f"{avatar}: {error}", seat)
                return
            try:
                self._avatars.reset(seat.index, profile)
            except (ModelError, ProfileError) as error:
                self._tally.refused("calibration", f"{avatar}: {error}", seat)
                return
            seat.profile = profile
            seat.measures = self._avatars.measures(seat.index, profile)
            log.info("avatar %s: measured anew", avatar)
            if seat.last_payload is not None:
                self._avatars.resume(seat.index, codec.arms_states.decode(seat.last_payload))
            put_once(self._session, self._keys.skeleton(avatar), self._skeleton(seat), self._limits.encoding)

    # --- what is told

    def _tell_health(self) -> Iterator[None]:
        """Publish and log what the last period brought, a few people at a time, and frames between them."""
        # an absolute schedule, but never a burst of healths after a stall
        self._health_at_s = max(self._health_at_s + self._limits.health_period_s, time.monotonic())
        for cause, (count, detail) in self._inbox.take_refused().items():
            self._tally.refused(cause, detail, count=count)
        self._tally.log_refused()
        now_ns = time.time_ns()
        self._forget_silent(now_ns)
        seats, avatars = list(self._seats.values()), []
        for some in _portions(seats):
            for seat in some:
                refused_at_door = self._inbox.refused_of(seat.name)
                avatars.append(seat.health(now_ns, self._limits.health_period_s, refused_at_door))
            yield
        health = self._tally.health(self._name, now_ns, avatars, self._fleet.services)
        self._health.put(codec.encode(health, self._limits.encoding))
        yield
        for some in _portions(seats):
            for seat in outgrown(some, self._avatars.lengths([seat.index for seat in some])):
                if self._seats.get(seat.name) is seat:  # may have left in between
                    self._tell_what_was_learnt(seat)
                    yield
            yield

    def _tell_what_was_learnt(self, seat: Seat) -> None:
        """Publish somebody's skeleton again, without waiting for room: whoever misses it asks, or hears the next."""
        seat.measures = self._avatars.measures(seat.index, seat.profile)
        key = self._keys.skeleton(seat.name)
        put_once(self._session, key, self._skeleton(seat), self._limits.encoding, waits=False)

    def _of_everybody(
        self, key_of: Callable[[str], str], make: Callable[[Seat], bytes | None]
    ) -> Iterator[tuple[str, Callable[[], bytes | None]]]:
        """What there is to answer to a query; runs on a Zenoh thread."""
        for seat in list(self._seats.values()):
            yield key_of(seat.name), partial(make, seat)

    def _skeleton(self, seat: Seat) -> bytes:
        return codec.encode(skeleton_of(seat.name, seat.profile, seat.measures), self._limits.encoding)

    def _calibration(self, seat: Seat) -> bytes:
        return codec.encode(seat.profile, self._limits.encoding)

    def farewell(self) -> str:
        """Return one line that says what was served."""
        return self._tally.farewell()


def _portions(seats: list[Seat]) -> Iterator[list[Seat]]:
    for first in range(0, len(seats), TOLD_AT_ONCE):
        yield seats[first : first + TOLD_AT_ONCE]
