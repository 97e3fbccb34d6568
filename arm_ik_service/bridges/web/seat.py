"""One paired headset: its frames go to the bus, the service's answers wait here for its socket."""

from __future__ import annotations

import asyncio
from collections import deque

import msgspec

from arm_ik_service.bridges.frames import FramePublisher
from arm_ik_service.bridges.web.messages import Arms, Bones, Frame, encode
from arm_ik_service.errors import WireError
from arm_ik_service.io.zenoh_streams import Bus, query, subscribe
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys
from arm_ik_service.wire.messages import Encoding

_WAITING = 64  # replies a page may leave unread: it asks for one a second


class Seat:
    """Everything of one avatar between Zenoh and the event loop, on which all but the two `_receive` methods run.

    Answers wait in one slot, newest wins: on a slow radio a page gets fewer arms, never older ones.
    """

    def __init__(self, bus: Bus, keys: Keys, avatar: str, encoding: Encoding) -> None:
        self.avatar = avatar
        self.returned = 0
        self.foreign = 0  # messages on the avatar's keys that are none of ours
        self._bus = bus
        self._keys = keys
        self._loop = asyncio.get_running_loop()
        self._something = asyncio.Event()
        self._replies: deque[bytes] = deque(maxlen=_WAITING)
        self._arms: bytes | None = None
        self._publisher = FramePublisher(bus, keys, avatar, encoding)
        self._subscribers = [
            subscribe(bus, keys.arms(avatar), self._receive_arms),
            subscribe(bus, keys.skeleton(avatar), self._receive_skeleton),
        ]

    @property
    def published(self) -> int:
        """How many frames went to the bus."""
        return self._publisher.published

    def publish(self, frame: Frame) -> None:
        """Put a page's frame on the bus, under its own number."""
        self._publisher.publish(
            frame.sample_time_ns,
            frame.space,
            frame.head.tracked_pose() if frame.head else None,
            frame.left.tracked_pose("left") if frame.left else None,
            frame.right.tracked_pose("right") if frame.right else None,
            seq=frame.seq,
        )

    def reply(self, message: msgspec.Struct) -> None:
        """Queue a message for the page."""
        self._replies.append(encode(message))
        self._something.set()

    async def next_message(self) -> bytes:
        """Wait for something to send: replies first, then the newest arms."""
        while True:
            if self._replies:
                return self._replies.popleft()
            if self._arms is not None:
                arms, self._arms = self._arms, None
                self.returned += 1
                return arms
            self._something.clear()
            await self._something.wait()

    async def describe(self) -> None:
        """Ask the service once for the skeleton: it publishes it only when it first hears of an avatar."""
        answers = await asyncio.to_thread(lambda: list(query(self._bus, self._keys.skeleton(self.avatar))))
        for _, payload in answers:
            self._take_skeleton(payload)

    def close(self) -> None:
        """Withdraw from the bus."""
        for subscriber in self._subscribers:
            subscriber.undeclare()
        self._publisher.close()

    def _receive_arms(self, _key: str, payload: bytes, _time_ns: int) -> None:
        self._loop.call_soon_threadsafe(self._take_arms, payload)

    def _receive_skeleton(self, _key: str, payload: bytes, _time_ns: int) -> None:
        self._loop.call_soon_threadsafe(self._take_skeleton, payload)

    def _take_arms(self, payload: bytes) -> None:
        try:
            self._arms = encode(Arms(codec.arms_states.decode(payload)))
        except WireError:
            self.foreign += 1
            return
        self._something.set()

    def _take_skeleton(self, payload: bytes) -> None:
        try:
            self.reply(Bones(codec.skeletons.decode(payload)))
        except WireError:
            self.foreign += 1
