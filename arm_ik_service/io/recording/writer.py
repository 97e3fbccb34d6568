"""Writes MCAP so that little is lost whatever becomes of the writer."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType

import msgspec
from mcap.writer import CompressionType, Writer

from arm_ik_service import __version__
from arm_ik_service.errors import DecodeError, SessionError
from arm_ik_service.io.samples import finite_frame
from arm_ik_service.wire.codec import encode, json_schema
from arm_ik_service.wire.keys import Keys
from arm_ik_service.wire.messages import ArmsState, ControllerFrame, Pose, Skeleton

PROFILE = "arm_ik"  # of the MCAP header, and the name of our metadata record
FLUSH_EVERY_NS = 1_000_000_000  # what a kill costs at most; a second of two avatars still compresses well
CHUNK_SIZE = 1 << 20  # bytes before compression: closed earlier than a second where very much comes in
SEQUENCE_MASK = 0xFFFFFFFF  # MCAP counts in 32 bits


class RecordingWriter:
    """A recording being written. A context manager: `close`, after an error too, ends the file with its index."""

    def __init__(self, path: Path, metadata: Mapping[str, str] | None = None, keys: Keys | None = None) -> None:
        """Create the file, replacing an older one. Raises SessionError if it cannot be written."""
        self.path = path
        self.message_count = 0
        self._keys = keys or Keys()
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._flushed_log_time_ns: int | None = None
        self._waiting_since_s: float | None = None  # when the oldest message came that a kill would lose
        with self._explained():
            self._file = path.open("wb")
            self._writer = Writer(self._file, chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD)
            self._writer.start(PROFILE, f"arm-ik-service {__version__}")
            if metadata:
                self._writer.add_metadata(PROFILE, dict(metadata))
            self._writer.flush()

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.close()

    def write_frame(self, avatar: str, frame: ControllerFrame, log_time_ns: int) -> None:
        """Add a frame received at `log_time_ns`. Numbers that are none, which JSON has not, lose their flags."""
        frame = finite_frame(frame)
        channel = self._channel(self._keys.controllers(avatar), ControllerFrame)
        self._add(channel, encode(frame, "json"), log_time_ns, frame.publish_time_ns, frame.seq)

    def write_arms(self, avatar: str, answer: ArmsState, log_time_ns: int) -> None:
        """Add an answer received at `log_time_ns`."""
        channel = self._channel(self._keys.arms(avatar), ArmsState)
        self._add(channel, encode(answer, "json"), log_time_ns, answer.publish_time_ns, answer.seq)

    def write_skeleton(self, avatar: str, payload: bytes, log_time_ns: int) -> None:
        """Add a skeleton as it came over the bus, in either encoding."""
        self._add(self._channel(self._keys.skeleton(avatar), Skeleton), _as_json(payload), log_time_ns, log_time_ns)

    def write_calibration(self, avatar: str, payload: bytes, log_time_ns: int) -> None:
        """Add a calibration profile as it came over the bus, in either encoding."""
        self._add(self._channel(self._keys.calibration(avatar), None), _as_json(payload), log_time_ns, log_time_ns)

    def write_pose(self, key: str, pose: Pose, log_time_ns: int) -> None:
        """Add where a thing of the scene is, under the key that moves it."""
        self._add(self._channel(key, Pose), encode(pose, "json"), log_time_ns, log_time_ns)

    def flush(self) -> None:
        """Hand everything written so far to the operating system: from here on a kill cannot lose it."""
        with self._explained():
            self._writer.flush()
        self._waiting_since_s = None

    def flush_if_due(self) -> None:
        """Flush what has waited for a second; to be called now and then, for messages that no other follows."""
        if self._waiting_since_s is not None and time.monotonic() - self._waiting_since_s >= FLUSH_EVERY_NS * 1e-9:
            self.flush()

    def close(self) -> None:
        """Write the index and close the file; again is harmless."""
        if not self._file.closed:
            with self._explained(), self._file:
                self._writer.finish()

    def _add(self, channel: int, data: bytes, log_time_ns: int, publish_time_ns: int, seq: int | None = None) -> None:
        log_time_ns = max(0, log_time_ns)  # MCAP times are unsigned
        sequence = self.message_count if seq is None else seq
        with self._explained():
            self._writer.add_message(channel, log_time_ns, data, max(0, publish_time_ns), sequence & SEQUENCE_MASK)
        self.message_count += 1
        if self._waiting_since_s is None:
            self._waiting_since_s = time.monotonic()
        if self._flushed_log_time_ns is None:
            self._flushed_log_time_ns = log_time_ns
        elif abs(log_time_ns - self._flushed_log_time_ns) >= FLUSH_EVERY_NS:
            # by the time of the messages, so that the same messages give the same file
            self._flushed_log_time_ns = log_time_ns
            self.flush()

    def _channel(self, key: str, kind: type[msgspec.Struct] | None) -> int:
        """Return the channel of a key; on first use its schema goes into the file, `None` being any JSON object."""
        if key not in self._channels:
            name = "Calibration" if kind is None else kind.__name__
            if name not in self._schemas:
                schema = msgspec.json.encode({"type": "object"} if kind is None else json_schema(kind))
                self._schemas[name] = self._writer.register_schema(f"arm_ik.{name}", "jsonschema", schema)
            self._channels[key] = self._writer.register_channel(key, "json", self._schemas[name])
        return self._channels[key]

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise SessionError(f"{self.path}: cannot be written: {error.strerror}") from error


def _as_json(payload: bytes) -> bytes:
    """Return JSON of a payload in either encoding. Raises DecodeError."""
    try:
        return payload if payload[:1] == b"{" else msgspec.json.encode(msgspec.msgpack.decode(payload))
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError, TypeError) as error:
        raise DecodeError(f"neither MessagePack nor JSON: {error}") from error
