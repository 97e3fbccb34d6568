"""The newest frame of each avatar, handed from Zenoh's thread to the loop that solves.

One slot an avatar: a queued pose is an old pose. A frame that arrives before its predecessor was taken replaces it and
is counted. The order in which slots are served is the order in which they were first filled, so nobody is starved.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from threading import Lock

import zenoh

from arm_ik_service.errors import WireError
from arm_ik_service.wire.keys import Keys, check_id


@dataclass(slots=True)
class Arrival:
    """The newest undecoded frame of one avatar."""

    avatar: str
    payload: bytes
    receive_time_ns: int
    overtaken: int  # how many frames this one replaced


class Inbox:
    """Subscribes to every avatar's controllers and keeps the newest payload of each."""

    def __init__(
        self, session: zenoh.Session, keys: Keys, *, max_message_bytes: int, max_avatars: int, max_id_length: int
    ) -> None:
        self._keys = keys
        self._max_message_bytes = max_message_bytes
        self._max_avatars = max_avatars
        self._max_id_length = max_id_length
        self._lock = Lock()  # held for a few dictionary operations, on both sides
        self._slots: dict[str, Arrival] = {}
        self._ready: SimpleQueue[str | None] = SimpleQueue()
        self._avatar_of_key: dict[str, str] = {}
        self._refused: dict[str, tuple[int, str]] = {}
        self._subscriber = session.declare_subscriber(
            keys.controllers(), zenoh.handlers.Callback(self._receive, indirect=False)
        )

    def _receive(self, sample: zenoh.Sample) -> None:
        """Run on Zenoh's network thread: store and return, never raise, never wait."""
        receive_time_ns = time.time_ns()
        payload = sample.payload
        if len(payload) > self._max_message_bytes:
            self._refuse("too_large", f"{len(payload)} bytes on {sample.key_expr}")
            return
        key = str(sample.key_expr)
        avatar = self._avatar_of_key.get(key) or self._admit(key)
        if avatar is None:
            return
        with self._lock:
            slot = self._slots.get(avatar)
            if slot is None:
                self._slots[avatar] = Arrival(avatar, payload.to_bytes(), receive_time_ns, 0)
            else:
                slot.payload, slot.receive_time_ns, slot.overtaken = (
                    payload.to_bytes(),
                    receive_time_ns,
                    slot.overtaken + 1,
                )
                return
        self._ready.put(avatar)

    def _admit(self, key: str) -> str | None:
        """Return the avatar id of a key not seen before, or None and the reason counted."""
        try:
            avatar = check_id(self._keys.avatar_of(key), self._max_id_length)
        except WireError as error:
            self._refuse("bad_id", str(error))
            return None
        if len(self._avatar_of_key) >= self._max_avatars:
            self._refuse("too_many_avatars", f"{avatar!r}: {self._max_avatars} avatars are being served")
            return None
        self._avatar_of_key[key] = avatar
        return avatar

    def _refuse(self, cause: str, detail: str) -> None:
        with self._lock:
            self._refused[cause] = (self._refused.get(cause, (0, ""))[0] + 1, detail)

    def take(self, timeout_s: float, most: int) -> list[Arrival] | None:
        """Return up to `most` newest frames, waiting up to `timeout_s` for the first; None once `stop` was called."""
        arrivals: list[Arrival] = []
        try:
            avatar = self._ready.get(timeout=max(timeout_s, 0.0))
            while True:
                if avatar is None:
                    return None
                with self._lock:
                    arrivals.append(self._slots.pop(avatar))
                if len(arrivals) >= most:
                    break
                avatar = self._ready.get_nowait()
        except Empty:
            pass
        return arrivals

    def forget(self, avatar: str) -> None:
        """Give up an avatar's place; it is admitted again if it speaks again."""
        self._avatar_of_key.pop(self._keys.controllers(avatar), None)

    def take_refused(self) -> dict[str, tuple[int, str]]:
        """Return what was refused since the last call: cause to count and the last detail."""
        with self._lock:
            refused, self._refused = self._refused, {}
        return refused

    def stop(self) -> None:
        """Make `take` return None; safe in a signal handler."""
        self._ready.put(None)

    def close(self) -> None:
        """Stop receiving."""
        self._subscriber.undeclare()
