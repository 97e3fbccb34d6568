"""What every bridge puts on the bus: numbered controller frames of one avatar."""

from __future__ import annotations

import time

from arm_ik_service.io.zenoh_streams import Bus, declare_stream
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys
from arm_ik_service.wire.messages import VERSION, ControllerFrame, Encoding, Space, TrackedPose


class FramePublisher:
    """Publishes the frames of one avatar on an open Zenoh session, which the caller closes."""

    def __init__(self, bus: Bus, keys: Keys, avatar: str, encoding: Encoding = "msgpack") -> None:
        self.avatar = avatar
        self.published = 0
        self._encoding = encoding
        self._stream = declare_stream(bus, keys.controllers(avatar), encoding)
        self._next_seq = 0

    def publish(
        self,
        sample_time_ns: int,
        space: Space,
        head: TrackedPose | None,
        left: TrackedPose | None,
        right: TrackedPose | None,
        *,
        seq: int | None = None,
    ) -> ControllerFrame:
        """Put one frame and return it; without a `seq` of its own it gets the next number."""
        frame = ControllerFrame(
            version=VERSION,
            seq=self._next_seq if seq is None else seq,
            sample_time_ns=sample_time_ns,
            publish_time_ns=time.time_ns(),
            space=space,
            head=head,
            left=left,
            right=right,
        )
        self._next_seq = frame.seq + 1
        self._stream.put(codec.encode(frame, self._encoding))
        self.published += 1
        return frame

    def close(self) -> None:
        """Withdraw from the bus."""
        self._stream.undeclare()
