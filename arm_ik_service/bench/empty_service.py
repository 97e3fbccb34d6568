"""The service without its solve: decode, encode and put, to see what messages alone cost.

Run as `python -m arm_ik_service.bench.empty_service ENDPOINT AVATARS`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from threading import Thread

import msgspec
import numpy as np

from arm_ik_service.avatar import Avatar, Avatars
from arm_ik_service.bench.people import moving
from arm_ik_service.bench.processes import wait_for_end
from arm_ik_service.body.profile import BodyMeasures, Profile
from arm_ik_service.geometry.batch import Array
from arm_ik_service.io.zenoh_bus import BusOptions, open_hub
from arm_ik_service.programs.service import BATCH, Service
from arm_ik_service.settings import ServiceSettings, Settings
from arm_ik_service.wire import codec
from arm_ik_service.wire.messages import ArmsState, ControllerFrame, Encoding


class NoAvatars(Avatars):
    """Accepts every frame and gives every frame the same arms."""

    def __init__(self) -> None:
        self.verdicts = np.zeros(BATCH, np.int64)
        self.count = 0
        state = Avatar().step(moving(0, 90.0), now_ns=0)
        assert state is not None
        self._state: ArmsState = state

    def reset(self, index: int, profile: Profile) -> None:
        """There is nobody."""

    def resume(self, index: int, state: ArmsState) -> bool:
        """There is nobody."""
        return False

    def measures(self, index: int, profile: Profile) -> BodyMeasures:
        """Nobody learns."""
        return profile.body

    def lengths(self, indices: Sequence[int]) -> Array:
        """Nobody grows."""
        body = Profile().body
        lengths = (body.stature_m, body.upper_arm, body.forearm, 0.5 * body.shoulder_width)
        return np.tile(lengths, (len(indices), 1))

    def add(self, index: int, frame: ControllerFrame, receive_time_ns: int, predict_to_ns: int | None = None) -> int:
        """Take a place in the batch."""
        self.count += 1
        return self.count - 1

    def step(self) -> None:
        """Solve nothing."""
        self.count = 0

    def payload(
        self,
        place: int,
        frame: ControllerFrame,
        avatar: str,
        receive_time_ns: int,
        solve_time_ns: int = 0,
        publish_time_ns: int = 0,
        encoding: Encoding = "msgpack",
    ) -> bytes:
        """Encode the same arms with this frame's number and times."""
        state = self._state
        answer = ArmsState(
            version=state.version,
            avatar=avatar,
            seq=frame.seq,
            sample_time_ns=frame.sample_time_ns,
            receive_time_ns=receive_time_ns,
            solve_time_ns=solve_time_ns,
            publish_time_ns=publish_time_ns,
            chest=state.chest,
            head=state.head,
            left=state.left,
            right=state.right,
        )
        return codec.encode(answer, encoding)


def main(endpoint: str, max_avatars: int) -> None:
    """Serve until asked to end."""
    settings = msgspec.structs.replace(Settings(), service=ServiceSettings(max_avatars=max_avatars))
    with open_hub(BusOptions(listen=(endpoint,))) as bus:
        service = Service(bus, name="empty", settings=settings, profile=Profile(), avatars=NoAvatars())
        loop = Thread(target=service.run)
        loop.start()
        wait_for_end()
        service.stop()
        loop.join()
        service.close()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
