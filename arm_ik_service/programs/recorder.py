"""Writing what is on the bus to an MCAP file: controllers in, arms out, skeletons and calibrations."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Event, Thread

from arm_ik_service.errors import ArmIkError, WireError
from arm_ik_service.io.recording import RecordingWriter
from arm_ik_service.io.zenoh_streams import Bus, query, subscribe
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys


@dataclass
class Recorded:
    """What was written."""

    frames: int = 0
    answers: int = 0
    refused: int = 0


class Recorder:
    """Records every avatar on an open Zenoh session, which the caller closes.

    Messages wait in memory between Zenoh's thread and the file: a slow disk costs memory, never a frame.
    """

    def __init__(self, bus: Bus, path: Path, keys: Keys, *, progress: Callable[[Recorded], None] | None = None) -> None:
        """Raises SessionError where the file cannot be made."""
        self._bus = bus
        self._keys = keys
        self._progress = progress
        self._stopped = Event()
        self._queue: SimpleQueue[tuple[str, str, bytes, int]] = SimpleQueue()
        self._described: set[str] = set()
        self.recorded = Recorded()
        self._writer = RecordingWriter(path, keys=keys)
        self._subscribers = [
            subscribe(bus, key, lambda *arrival, kind=kind: self._queue.put((kind, *arrival)))
            for kind, key in (
                ("controllers", keys.controllers()),
                ("arms", keys.arms()),
                ("calibration", keys.calibration()),
                ("skeleton", keys.skeleton()),
            )
        ]

    def stop(self) -> None:
        """Make `run` return once what has arrived is written; safe in a signal handler."""
        self._stopped.set()

    def run(self, duration_s: float | None = None) -> Recorded:
        """Record until `stop` or for `duration_s`, then close the file; it is whole whatever happens in between."""
        end_s = None if duration_s is None else time.monotonic() + duration_s
        with self._writer:
            while not self._stopped.is_set() and (end_s is None or time.monotonic() < end_s):
                self._drain(wait_s=0.1)
            for subscriber in self._subscribers:
                subscriber.undeclare()
            self._drain(wait_s=0.0)
        return self.recorded

    def _drain(self, wait_s: float) -> None:
        try:
            item = self._queue.get(timeout=wait_s) if wait_s > 0.0 else self._queue.get_nowait()
            while True:
                self._write(*item)
                item = self._queue.get_nowait()
        except Empty:
            pass
        self._writer.flush_if_due()
        if self._progress is not None:
            self._progress(self.recorded)

    def _write(self, kind: str, key: str, payload: bytes, receive_time_ns: int) -> None:
        avatar = self._keys.avatar_of(key)
        try:
            if kind == "controllers":
                self._writer.write_frame(avatar, codec.controller_frames.decode(payload), receive_time_ns)
                self.recorded.frames += 1
            elif kind == "calibration":
                self._writer.write_calibration(avatar, payload, receive_time_ns)
            elif kind == "skeleton":
                self._writer.write_skeleton(avatar, payload, receive_time_ns)
            else:
                self._writer.write_arms(avatar, codec.arms_states.decode(payload), receive_time_ns)
                self.recorded.answers += 1
        except WireError:
            self.recorded.refused += 1
            return
        if kind == "arms" and avatar not in self._described:
            self._described.add(avatar)
            self._describe(avatar, receive_time_ns)

    def _describe(self, avatar: str, time_ns: int) -> None:
        """Ask the service for what it published before we came; a service that is gone simply does not answer."""
        for key, write in (
            (self._keys.skeleton(avatar), self._writer.write_skeleton),
            (self._keys.calibration(avatar), self._writer.write_calibration),
        ):
            for _, payload in query(self._bus, key):
                write(avatar, payload, time_ns)


@contextmanager
def recorded_beside(bus: Bus, path: Path | None, keys: Keys) -> Iterator[Recorded]:
    """Record for the length of the block, on the session of something else: the service sends both but once.

    Nothing where `path` is None. Raises SessionError, at the end if it is the disk that gives out.
    """
    if path is None:
        yield Recorded()
        return
    recorder = Recorder(bus, path, keys)
    failed: list[ArmIkError] = []

    def run() -> None:
        try:
            recorder.run()
        except ArmIkError as error:
            failed.append(error)

    worker = Thread(target=run, name="recorder")
    worker.start()
    try:
        yield recorder.recorded
    finally:
        recorder.stop()
        worker.join()
    if failed:
        raise failed[0]
