"""The newest frame of each avatar, handed from Zenoh's thread to the loop that solves.

One slot an avatar: a queued pose is an old pose. A frame that arrives before its predecessor was taken replaces it and
is counted. The order in which slots are served is the order in which they were first filled, so nobody is starved.

A service that is alone hears everybody through one subscription. One of several has a subscription for each of its own
avatars, and from time to time looks out: for a moment it hears everybody, to find out who else speaks.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from threading import Lock

import zenoh

from arm_ik_service.errors import WireError
from arm_ik_service.io.jitter_buffer import JitterBuffer, Pace
from arm_ik_service.io.zenoh_threads import keep_thread_state
from arm_ik_service.settings import ServiceSettings
from arm_ik_service.wire.keys import Keys, check_id

_WAKE = ""  # no avatar's id
_FOREIGN_PER_OWN = 16  # other services' avatars remembered, for each that we could serve


@dataclass(slots=True)
class Arrival:
    """The newest undecoded frame of one avatar."""

    avatar: str
    payload: bytes | None  # None: given up before it was taken
    receive_time_ns: int
    overtaken: int  # how many frames this one replaced


@dataclass(slots=True)
class _Door:
    """One avatar that may come in, and how fast."""

    avatar: str
    due_ns: int = 0  # the time at which it has used up what it may send until then (generic cell rate algorithm)
    last_ns: int = 0
    refused: int = 0
    pace: Pace = field(default_factory=Pace)  # for the jitter buffer


@dataclass(slots=True)
class _Others:
    """What a look-out brought: other services' avatars, when they were heard last, and their newest answers."""

    heard_ns: dict[str, int] = field(default_factory=dict)
    answers: dict[str, bytes] = field(default_factory=dict)


class Inbox:
    """Keeps the newest payload of each avatar that is ours. Deaf until `hear_everybody` or `hear`."""

    def __init__(
        self,
        session: zenoh.Session,
        keys: Keys,
        limits: ServiceSettings,
        owns: Callable[[str], bool],
        answer_now: Callable[[Arrival], bool] | None = None,
    ) -> None:
        """Both callables run on Zenoh's network threads, or the jitter buffer's.

        `owns` is asked once for an avatar until `forget_owners`. `answer_now` is offered a frame before which none
        waits, and says whether it is done with.
        """
        self._session = session
        self._keys = keys
        self._limits = limits
        self._owns = owns
        self._answer_now = answer_now
        self._period_ns = int(1e9 / limits.max_frames_per_s)
        self._burst_ns = int(1e9 * limits.rate_burst_s)
        self._lock = Lock()  # held for a few dictionary operations, on both sides
        self._slots: dict[str, Arrival] = {}
        self._ready: SimpleQueue[str | None] = SimpleQueue()
        self._next: str | None = _WAKE
        self._doors: dict[str, _Door] = {}  # by key
        self._owned: dict[str, bool] = {}  # by key
        self._refused: dict[str, tuple[int, str]] = {}
        self._others = _Others()
        self._own_subscribers: dict[str, zenoh.Subscriber[None]] = {}  # by key
        self._buffer = JitterBuffer(limits.jitter_buffer_s, self._deliver_now) if limits.jitter_buffer_s else None
        self._everybody: zenoh.Subscriber[None] | None = None
        self._answers: zenoh.Subscriber[None] | None = None

    # --- what is heard; called by the loop

    def hear_everybody(self) -> None:
        """Hear all avatars, and take in those that are ours."""
        if self._everybody is None:
            self._everybody = self._subscribe(self._keys.controllers(), self._receive_any)

    def hear(self, avatar: str) -> None:
        """Hear one avatar, whoever else is heard."""
        key = self._keys.controllers(avatar)
        if key not in self._own_subscribers:
            self._own_subscribers[key] = self._subscribe(key, self._receive)

    def release(self, avatar: str, answer: bytes | None = None) -> None:
        """Hear an avatar no more, and drop what has arrived; `answer` is its last one if it lives on elsewhere."""
        key = self._keys.controllers(avatar)
        subscriber = self._own_subscribers.pop(key, None)
        if subscriber is not None:
            subscriber.undeclare()
        with self._lock:
            self._doors.pop(key, None)
            slot = self._slots.get(avatar)
            if slot is not None:
                slot.payload = None  # its place in the line stays, and is passed over
            if answer is not None:
                self._others.heard_ns[avatar] = time.monotonic_ns()
                self._others.answers[avatar] = answer

    def look_out(self) -> None:
        """Hear everybody and their answers, until `end_look_out`."""
        self.hear_everybody()
        if self._answers is None:
            self._answers = self._subscribe(self._keys.arms(), self._note_answer)

    def end_look_out(self, *, hear_everybody: bool = False) -> None:
        """Hear only our own avatars again, or everybody from now on."""
        if self._answers is not None:
            self._answers.undeclare()
            self._answers = None
        if hear_everybody:
            self.hear_everybody()
        elif self._everybody is not None:
            self._everybody.undeclare()
            self._everybody = None

    def forget_owners(self) -> None:
        """Ask again who is ours."""
        self._owned = {}

    def others(self) -> list[str]:
        """Return the avatars that were heard and not taken in."""
        with self._lock:
            return list(self._others.heard_ns)

    def take_last_answer(self, avatar: str) -> bytes | None:
        """Return the last answer heard that another service gave an avatar which is now ours."""
        with self._lock:
            self._others.heard_ns.pop(avatar, None)
            return self._others.answers.pop(avatar, None)

    def _subscribe(self, key: str, receive: Callable[[zenoh.Sample], None]) -> zenoh.Subscriber[None]:
        return self._session.declare_subscriber(key, zenoh.handlers.Callback(receive, indirect=False))

    # --- receiving; on Zenoh's network threads: store and return, never raise, never wait

    def _receive_any(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        if key in self._own_subscribers:
            return  # it comes that way
        owned = self._owned.get(key)
        if owned is None:
            owned = self._is_ours(self._keys.avatar_of(key))
            if len(self._owned) >= _FOREIGN_PER_OWN * self._limits.max_avatars:
                self._owned = {}
            self._owned[key] = owned
        if owned:
            self._take_in(key, sample)
        elif len(self._others.heard_ns) < _FOREIGN_PER_OWN * self._limits.max_avatars:
            with self._lock:
                self._others.heard_ns[self._keys.avatar_of(key)] = time.monotonic_ns()

    def _is_ours(self, avatar: str) -> bool:
        try:
            check_id(avatar, self._limits.max_id_length)
        except WireError:
            return True  # to be refused, and counted
        return self._owns(avatar)

    def _receive(self, sample: zenoh.Sample) -> None:
        self._take_in(str(sample.key_expr), sample)

    def _take_in(self, key: str, sample: zenoh.Sample) -> None:
        keep_thread_state()
        receive_time_ns = time.time_ns()
        door = self._doors.get(key) or self._admit(key)
        if door is None:
            return
        now_ns = door.last_ns = time.monotonic_ns()
        due_ns = (door.due_ns if door.due_ns > now_ns else now_ns) + self._period_ns
        if due_ns - now_ns > self._burst_ns:
            self._refuse("rate", f"{door.avatar}: more than {self._limits.max_frames_per_s:g} frames a second", door)
            return
        door.due_ns = due_ns
        payload = sample.payload
        if len(payload) > self._limits.max_message_bytes:
            self._refuse("too_large", f"{door.avatar}: {len(payload)} bytes", door)
            return
        if self._buffer is None:
            self._deliver(Arrival(door.avatar, payload.to_bytes(), receive_time_ns, 0))
        elif not self._buffer.hold(door.pace, door.avatar, payload.to_bytes()):
            self._refuse("jitter_buffer", f"{door.avatar}: too many frames at once", door)

    def _deliver_now(self, avatar: str, payload: bytes) -> None:
        """Run on the jitter buffer's thread. A frame counts as received when it leaves the buffer: so it is solved."""
        self._deliver(Arrival(avatar, payload, time.time_ns(), 0))

    def _deliver(self, arrival: Arrival) -> None:
        avatar = arrival.avatar
        if not self._slots and self._answer_now is not None and self._answer_now(arrival):
            return
        with self._lock:
            slot = self._slots.get(avatar)
            if slot is None:
                self._slots[avatar] = arrival
            else:
                slot.payload, slot.receive_time_ns = arrival.payload, arrival.receive_time_ns
                slot.overtaken += 1
                return
        self._ready.put(avatar)

    def _admit(self, key: str) -> _Door | None:
        """Return the door of a key not seen before, or None and the reason counted."""
        try:
            avatar = check_id(self._keys.avatar_of(key), self._limits.max_id_length)
        except WireError as error:
            self._refuse("bad_id", str(error))
            return None
        # more than can be served, for some never say anything that can be read; and still bounded
        if len(self._doors) >= 2 * self._limits.max_avatars:
            self._refuse("too_many_avatars", f"{avatar}: {self._limits.max_avatars} are served")
            return None
        with self._lock:
            return self._doors.setdefault(key, _Door(avatar))

    def _note_answer(self, sample: zenoh.Sample) -> None:
        avatar = self._keys.avatar_of(str(sample.key_expr))
        ours = self._keys.controllers(avatar) in self._own_subscribers
        if not ours and len(self._others.answers) < _FOREIGN_PER_OWN * self._limits.max_avatars:
            payload = sample.payload.to_bytes()
            with self._lock:
                self._others.answers[avatar] = payload

    def _refuse(self, cause: str, detail: str, door: _Door | None = None) -> None:
        with self._lock:
            self._refused[cause] = (self._refused.get(cause, (0, ""))[0] + 1, detail)
        if door is not None:
            door.refused += 1

    # --- taking; called by the loop

    def wait(self, timeout_s: float) -> bool:
        """Wait up to `timeout_s` for a frame, or until `wake`; False once `stop` was called."""
        try:
            self._next = self._ready.get(timeout=max(timeout_s, 0.0))
        except Empty:
            self._next = _WAKE
        return self._next is not None

    def take(self, most: int) -> list[Arrival]:
        """Return up to `most` newest frames, the one that `wait` saw first; never waits."""
        arrivals: list[Arrival] = []
        avatar, self._next = self._next, _WAKE
        while True:
            if avatar:
                with self._lock:
                    arrival = self._slots.pop(avatar)
                if arrival.payload is not None:
                    arrivals.append(arrival)
                if len(arrivals) >= most:
                    return arrivals
            try:
                avatar = self._ready.get_nowait()
            except Empty:
                return arrivals
            if avatar is None:
                self._ready.put(None)  # for the next `wait`
                return arrivals

    @property
    def empty(self) -> bool:
        """Whether no frame waits."""
        return not self._slots

    def refused_of(self, avatar: str) -> int:
        """Return how many of an avatar's frames were refused here."""
        door = self._doors.get(self._keys.controllers(avatar))
        return door.refused if door is not None else 0

    def forget_silent(self, after_s: float) -> None:
        """Forget whoever has not been heard for so long, ours and others."""
        before_ns = time.monotonic_ns() - int(1e9 * after_s)
        with self._lock:
            for key, door in list(self._doors.items()):
                if door.last_ns < before_ns:
                    del self._doors[key]
            for avatar, heard_ns in list(self._others.heard_ns.items()):
                if heard_ns < before_ns:
                    del self._others.heard_ns[avatar]
            for avatar in self._others.answers.keys() - self._others.heard_ns.keys():
                del self._others.answers[avatar]
        for key in self._own_subscribers.keys() - self._doors.keys():  # taken over, and never heard
            self._own_subscribers.pop(key).undeclare()

    def take_refused(self) -> dict[str, tuple[int, str]]:
        """Return what was refused since the last call: cause to count and the last detail."""
        with self._lock:
            refused, self._refused = self._refused, {}
        return refused

    def wake(self) -> None:
        """Make `wait` return at once; from any thread."""
        self._ready.put(_WAKE)

    def stop(self) -> None:
        """Make `wait` return False; safe in a signal handler."""
        self._ready.put(None)

    def close(self) -> None:
        """Stop receiving."""
        self.end_look_out()
        for subscriber in self._own_subscribers.values():
            subscriber.undeclare()
        self._own_subscribers.clear()
        if self._buffer is not None:
            self._buffer.close()
