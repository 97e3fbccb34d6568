"""Publishing a recording to Zenoh at the pace at which it was recorded."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from threading import Event

from arm_ik_service.io.session import RecordedFrame, Session
from arm_ik_service.io.zenoh_streams import Bus, Stream, declare_stream, has_listener
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys
from arm_ik_service.wire.messages import ControllerFrame, Encoding

FIRST_WAIT_S = 5.0  # for somebody to subscribe before the first frame goes out
CATCH_UP = 0.25  # of an interval: after a stall frames follow no closer, or the newest would overtake the rest
LONGEST_INTERVAL_S = 10.0  # a longer pause in a recording is a clock that was set, not a person who waited
FLUSH_S = 0.05  # Zenoh sends in batches: closing at once would lose the last


@dataclass(frozen=True)
class ReplayOptions:
    """What part of a recording to play, how fast, and under which id."""

    speed: float = 1.0
    loop: bool = False
    from_s: float = 0.0
    to_s: float | None = None
    avatar: str | None = None  # None: the ids that the recording has
    encoding: Encoding = "msgpack"


@dataclass
class Replayed:
    """What was put on the bus."""

    frames: int = 0
    duration_s: float = 0.0
    late_p99_ms: float = 0.0


def selected(frames: Iterator[RecordedFrame], options: ReplayOptions) -> Iterator[tuple[float, RecordedFrame]]:
    """Yield the frames between `from_s` and `to_s` with their time [s] since the beginning of the recording.

    Time is the sum of forward steps of the sample time: it never goes back, whatever the sender's clock did.
    """
    elapsed_s, last_ns = 0.0, None
    for recorded in frames:
        now_ns = recorded.frame.sample_time_ns
        if last_ns is not None:
            elapsed_s += min(max(0.0, (now_ns - last_ns) / 1e9), LONGEST_INTERVAL_S)
        last_ns = now_ns
        if options.to_s is not None and elapsed_s > options.to_s:
            return
        if elapsed_s >= options.from_s:
            yield elapsed_s, recorded


class Replayer:
    """Plays one session on an open Zenoh session, which the caller closes."""

    def __init__(
        self,
        bus: Bus,
        session: Session,
        options: ReplayOptions,
        keys: Keys,
        *,
        progress: Callable[[int], None] | None = None,
        warn: Callable[[str], None] | None = None,
    ) -> None:
        self._bus = bus
        self._session = session
        self._options = options
        self._keys = keys
        self._progress = progress
        self._warn = warn
        self._publishers: dict[str, Stream] = {}
        self._stopped = Event()

    def stop(self) -> None:
        """Make `run` return after the frame in hand; safe in a signal handler."""
        self._stopped.set()

    def run(self) -> Replayed:
        """Play until the end or `stop`. A later round continues the sequence numbers and the sample time."""
        result = Replayed()
        lateness_ms: list[float] = []
        shift_ns = seq_shift = 0
        began_s = time.monotonic()
        while not self._stopped.is_set():
            sent = self._round(result, lateness_ms, shift_ns, seq_shift)
            if not self._options.loop or sent is None:
                break
            shift_ns, seq_shift = shift_ns + sent[0], seq_shift + sent[1]
        time.sleep(FLUSH_S)
        result.duration_s = time.monotonic() - began_s
        if lateness_ms:
            result.late_p99_ms = sorted(lateness_ms)[int(0.99 * (len(lateness_ms) - 1))]
        return result

    def _round(
        self, result: Replayed, lateness_ms: list[float], shift_ns: int, seq_shift: int
    ) -> tuple[int, int] | None:
        """Play once; returns by how much the next round's times and numbers go on, or None if there was no frame."""
        first: ControllerFrame | None = None
        last: ControllerFrame | None = None
        start_s = deadline_s = last_put_s = previous_s = 0.0
        highest_seq, latest_ns, interval_s = 0, 0, 1.0 / 90.0
        for elapsed_s, recorded in selected(self._session.frames(), self._options):
            publisher = self._publisher(self._options.avatar or recorded.avatar)
            frame = recorded.frame
            if first is None:
                first, start_s, previous_s = frame, time.monotonic() - elapsed_s / self._options.speed, elapsed_s
            deadline_s = start_s + elapsed_s / self._options.speed
            if elapsed_s > previous_s:
                interval_s = (elapsed_s - previous_s) / self._options.speed
            previous_s = elapsed_s
            wait_s = max(deadline_s, last_put_s + min(CATCH_UP * interval_s, 0.005)) - time.monotonic()
            if wait_s > 0.0 and self._stopped.wait(wait_s):
                break
            last_put_s = time.monotonic()
            lateness_ms.append(max(0.0, last_put_s - deadline_s) * 1e3)
            publisher.put(codec.encode(_restamped(frame, shift_ns, seq_shift), self._options.encoding))
            result.frames += 1
            last = frame
            highest_seq, latest_ns = max(highest_seq, frame.seq), max(latest_ns, frame.sample_time_ns)
            if self._progress is not None:
                self._progress(1)
        if first is None or last is None:
            return None
        return latest_ns - first.sample_time_ns + int(interval_s * 1e9), highest_seq - first.seq + 1

    def _publisher(self, avatar: str) -> Stream:
        """Return the avatar's publisher; the first time, wait until somebody listens."""
        publisher = self._publishers.get(avatar)
        if publisher is None:
            key = self._keys.controllers(avatar)
            publisher = self._publishers[avatar] = declare_stream(self._bus, key, self._options.encoding)
            give_up_s = time.monotonic() + FIRST_WAIT_S
            while not has_listener(publisher) and not self._stopped.wait(0.01):
                if time.monotonic() > give_up_s:
                    if self._warn is not None:
                        self._warn(f"nobody listens on {key}: is `arm-ik serve` running? playing all the same")
                    break
        return publisher


def _restamped(frame: ControllerFrame, shift_ns: int, seq_shift: int) -> ControllerFrame:
    """Return the frame as put now; in the first round its number and sample time are the recorded ones."""
    return ControllerFrame(
        version=frame.version,
        seq=frame.seq + seq_shift,
        sample_time_ns=frame.sample_time_ns + shift_ns,
        publish_time_ns=time.time_ns(),
        space=frame.space,
        head=frame.head,
        left=frame.left,
        right=frame.right,
    )
