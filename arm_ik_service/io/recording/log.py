"""An MCAP file as a walk over its records: with or without index, with or without an end.

Framing is read here, content by the MCAP library. A record is one byte of opcode and eight of length; nothing is
believed about either that the size of the file does not bear out.
"""

from __future__ import annotations

import struct
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Metadata
from mcap.stream_reader import CRCValidationError, get_chunk_data_stream

from arm_ik_service.errors import SessionError

MAGIC_SIZE = 8
LARGEST_CHUNK = 1 << 28  # bytes unpacked; ours are 2**20, other tools' a few times that
RUN_SIZE = 1 << 20  # bytes of messages outside chunks that are read at once
SHORTEST_CHUNK = 40  # bytes of its fields before the data

_FRAMING = struct.Struct("<BQ")
_CHUNK_TIMES = struct.Struct("<QQ")
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_INDEX = struct.Struct("<HI")  # channel, bytes of entries
_INDEX_ENTRY = 16
_IN_DATA = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)

# what the library, zstandard and lz4 raise over bytes that are not theirs
_DAMAGED = (
    *(McapError, CRCValidationError, zstandard.ZstdError, struct.error),
    *(ValueError, RuntimeError, EOFError, OverflowError, MemoryError),
)


class LoggedMessage(NamedTuple):
    """One message as it lies in the log."""

    log_time_ns: int
    publish_time_ns: int
    channel: int
    data: bytes


class Segment(NamedTuple):
    """A chunk, or a run of records outside any chunk: a piece of the file that is read at once."""

    offset: int
    length: int
    start_ns: int
    end_ns: int
    is_chunk: bool


@dataclass
class Log:
    """What a walk over the file has found; `messages` reads them."""

    path: Path
    segments: list[Segment] = field(default_factory=list)
    topics: dict[int, str] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)  # messages of each channel
    metadata: dict[str, str] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def messages(self, channels: frozenset[int]) -> Iterator[LoggedMessage]:
        """Read the messages of some channels by log time, in the order of the file where times are equal."""
        pending: list[LoggedMessage] = []
        try:
            with self.path.open("rb") as file:
                for segment in sorted(self.segments, key=lambda segment: segment.start_ns):
                    due = bisect_left(pending, segment.start_ns, key=_log_time)
                    yield from pending[:due]
                    del pending[:due]
                    records = self.read(file, segment)
                    pending += [message for message in _messages(records) if message.channel in channels]
                    pending.sort(key=_log_time)
            yield from pending
        except OSError as error:
            raise SessionError(f"{self.path}: {error.strerror}") from error

    def read(self, file: BinaryIO, segment: Segment) -> bytes:
        """Return the records of a segment, unpacked; nothing, and a warning, where they are damaged."""
        file.seek(segment.offset)
        data = file.read(segment.length)
        if not segment.is_chunk:
            return data
        try:
            chunk = Chunk.read(ReadDataStream(BytesIO(data)))
            unpacked = chunk.uncompressed_size
            if chunk.compression == "zstd":
                unpacked = max(unpacked, zstandard.frame_content_size(chunk.data))
            if unpacked > LARGEST_CHUNK:
                raise ValueError(f"it says that it unpacks to {unpacked} bytes")
            stream, size = get_chunk_data_stream(chunk, validate_crc=True)
            return stream.read(size)
        except _DAMAGED as error:
            self.warn(f"{self.path}: the chunk at byte {segment.offset} is damaged and left out: {error}")
            return b""

    def warn(self, text: str) -> None:
        """Keep a warning, once."""
        if text not in self.warnings:
            self.warnings.append(text)


def walk(path: Path) -> Log:
    """Find what a log holds without reading its messages where it has indexes. Raises SessionError if it is no log."""
    log = Log(path)
    try:
        with path.open("rb") as file:
            size = file.seek(0, 2)
            _walk(log, file, size)
    except OSError as error:
        raise SessionError(f"{path}: {error.strerror}") from error
    return log


def _walk(log: Log, file: BinaryIO, size: int) -> None:
    offset = MAGIC_SIZE
    indexed: set[int] | None = None  # channels in the indexes after the latest chunk; None: there was no chunk yet
    closed = False
    while offset + _FRAMING.size <= size and not closed:
        file.seek(offset)
        opcode, length = _FRAMING.unpack(file.read(_FRAMING.size))
        start, end = offset + _FRAMING.size, offset + _FRAMING.size + length
        if opcode == 0 or end > size:
            break
        if opcode == Opcode.MESSAGE_INDEX and length >= _INDEX.size and indexed is not None:
            channel, entries = _INDEX.unpack(file.read(_INDEX.size))
            log.counts[channel] += min(entries, length) // _INDEX_ENTRY
            indexed.add(channel)
        else:
            if indexed is not None and not (indexed and indexed <= log.topics.keys()):
                _look_into(log, file, log.segments[-1], count=not indexed)
                file.seek(start)
            indexed = None
            if opcode == Opcode.CHUNK and length >= SHORTEST_CHUNK:
                start_ns, end_ns = _CHUNK_TIMES.unpack(file.read(_CHUNK_TIMES.size))
                log.segments.append(Segment(start, length, start_ns, end_ns, is_chunk=True))
                indexed = set()
            elif opcode in _IN_DATA:
                _outside_chunks(log, file, offset, end)
            elif opcode == Opcode.METADATA:
                _metadata(log, file.read(length))
            closed = opcode == Opcode.DATA_END
        offset = end
    if indexed is not None and not (indexed and indexed <= log.topics.keys()):
        _look_into(log, file, log.segments[-1], count=not indexed)
    if not closed:
        log.warn(
            f"{log.path}: the recording ends at byte {offset} without having been closed (was its recorder killed?); "
            f"{log.counts.total()} messages before that are whole"
        )


def _look_into(log: Log, file: BinaryIO, segment: Segment, *, count: bool) -> None:
    """Read a segment for its channels, and for how many messages they have where no index says it."""
    for opcode, start, end, data in _records(records := log.read(file, segment)):
        if opcode == Opcode.CHANNEL:
            _channel(log, data[start:end])
        elif opcode == Opcode.MESSAGE and count and end - start >= _MESSAGE.size:
            log.counts[_MESSAGE.unpack_from(records, start)[0]] += 1


def _outside_chunks(log: Log, file: BinaryIO, offset: int, end: int) -> None:
    """Take a record that lies in no chunk into the run before it, or begin a new run."""
    file.seek(offset)
    records = file.read(end - offset)
    last = log.segments[-1] if log.segments else None
    if last is None or last.is_chunk or last.offset + last.length != offset or last.length > RUN_SIZE:
        last = Segment(offset, 0, 2**64, 0, is_chunk=False)
        log.segments.append(last)
    start_ns, end_ns = last.start_ns, last.end_ns
    for opcode, start, stop, _ in _records(records):
        if opcode == Opcode.CHANNEL:
            _channel(log, records[start:stop])
        elif opcode == Opcode.MESSAGE and stop - start >= _MESSAGE.size:
            channel, _, time_ns, _ = _MESSAGE.unpack_from(records, start)
            log.counts[channel] += 1
            start_ns, end_ns = min(start_ns, time_ns), max(end_ns, time_ns)
    log.segments[-1] = Segment(last.offset, end - last.offset, start_ns, end_ns, is_chunk=False)


def _channel(log: Log, data: bytes) -> None:
    try:
        channel = Channel.read(ReadDataStream(BytesIO(data)))
    except _DAMAGED as error:
        log.warn(f"{log.path}: a channel cannot be read and is left out: {error}")
        return
    log.topics[channel.id] = channel.topic


def _metadata(log: Log, data: bytes) -> None:
    try:
        log.metadata |= Metadata.read(ReadDataStream(BytesIO(data))).metadata
    except _DAMAGED as error:
        log.warn(f"{log.path}: a metadata record cannot be read: {error}")


def _records(data: bytes) -> Iterator[tuple[int, int, int, bytes]]:
    """Give opcode, start and end of the content of each whole record, and the bytes they are of."""
    offset, size = 0, len(data)
    while offset + _FRAMING.size <= size:
        opcode, length = _FRAMING.unpack_from(data, offset)
        start = offset + _FRAMING.size
        offset = start + length
        if offset > size:
            return
        yield opcode, start, offset, data


def _messages(data: bytes) -> Iterator[LoggedMessage]:
    for opcode, start, end, _ in _records(data):
        if opcode == Opcode.MESSAGE and end - start >= _MESSAGE.size:
            channel, _, log_time, publish_time = _MESSAGE.unpack_from(data, start)
            yield LoggedMessage(log_time, publish_time, channel, data[start + _MESSAGE.size : end])


def _log_time(message: LoggedMessage) -> int:
    return message.log_time_ns
