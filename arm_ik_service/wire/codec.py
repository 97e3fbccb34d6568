"""Bytes to messages and back: MessagePack or JSON, decoders built once, every field validated while it is read.

The Zenoh encoding of a sample names its form, but the first byte tells just as surely: every message is a map, JSON
opens one with `{` and no MessagePack map can begin with that byte. Reading the byte spares a string per sample.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any, Generic, TypeVar

import msgspec

from arm_ik_service.errors import DecodeError, VersionError
from arm_ik_service.wire.messages import (
    VERSION,
    ArmsHeader,
    ArmsState,
    ControllerFrame,
    Encoding,
    Health,
    Skeleton,
)

MEDIA_TYPES: dict[Encoding, str] = {"msgpack": "application/msgpack", "json": "application/json"}

Message = TypeVar("Message")
_encode_msgpack = msgspec.msgpack.Encoder().encode
_encode_json = msgspec.json.Encoder().encode
_ARMS_STATE_MAP = bytes([0x80 | len(ArmsState.__struct_fields__)])  # a map of so many fields


class _Header(msgspec.Struct):
    version: int


class MapDecoder(Generic[Message]):
    """Decodes a map of one kind from either form. Raises DecodeError, never anything else."""

    def __init__(self, kind: type[Message]) -> None:
        self._msgpack: Any = msgspec.msgpack.Decoder(kind)
        self._json: Any = msgspec.json.Decoder(kind)

    def decode(self, payload: bytes) -> Message:
        """Return what is in `payload`; the error names the path of the field that is wrong."""
        try:
            found: Message = (self._json if payload[:1] == b"{" else self._msgpack).decode(payload)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
            raise DecodeError(str(error)) from error
        return found


_headers = MapDecoder(_Header)


class Decoder(MapDecoder[Message]):
    """Decodes one kind of message, which has a version. Raises DecodeError or VersionError, never anything else."""

    def decode(self, payload: bytes) -> Message:
        """Return the message in `payload`; a newer one may well have another shape, so its version is told first."""
        try:
            message = super().decode(payload)
        except DecodeError:
            with suppress(DecodeError):
                _check(_headers.decode(payload).version)
            raise
        _check(message.version)  # type: ignore[attr-defined]
        return message


def _check(version: int) -> None:
    if version != VERSION:
        raise VersionError(version, VERSION)


controller_frames = Decoder(ControllerFrame)
arms_states = Decoder(ArmsState)
skeletons = Decoder(Skeleton)
healths = Decoder(Health)


def encode(message: msgspec.Struct, encoding: Encoding = "msgpack") -> bytes:
    """Return the bytes of a message."""
    return _encode_msgpack(message) if encoding == "msgpack" else _encode_json(message)


def join(header: ArmsHeader, body: bytes | memoryview) -> bytes:
    """Return the MessagePack of an ArmsState whose fields after the header are `body` already."""
    return b"".join((_ARMS_STATE_MAP, _encode_msgpack(header)[1:], body))


def json_schema(kind: type[msgspec.Struct]) -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a message."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **msgspec.json.schema(kind)}
