"""Open Sound Control 1.0 over UDP: messages bundled, sent, and forgotten.

Written out here, as it is a page of padding rules: python-osc parses whatever it builds, twice, which made four fifths
of the cost of a VMC frame. The tests read these packets with python-osc.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterable, Sequence

from arm_ik_service.errors import SettingsError

Argument = float | int | str
Message = tuple[str, Sequence[Argument]]

_BUNDLE_NOW = b"#bundle\0" + struct.pack(">Q", 1)  # the time tag 1 means: at once


def bundle(messages: Iterable[Message]) -> bytes:
    """Put messages into one packet, to be acted on together and at once."""
    parts = [_BUNDLE_NOW]
    for address, arguments in messages:
        encoded = _message(address, arguments)
        parts += (struct.pack(">i", len(encoded)), encoded)
    return b"".join(parts)


def _message(address: str, arguments: Sequence[Argument]) -> bytes:
    tags, values = ",", b""
    for argument in arguments:
        if isinstance(argument, str):
            tags, values = tags + "s", values + _string(argument)
        elif isinstance(argument, int):
            tags, values = tags + "i", values + struct.pack(">i", argument)
        else:
            tags, values = tags + "f", values + struct.pack(">f", argument)
    return _string(address) + _string(tags) + values


def _string(text: str) -> bytes:
    """Encode with one to four zeros at the end, so that a multiple of four bytes comes out."""
    data = text.encode("ascii")
    return data + b"\0" * (4 - len(data) % 4)


class OscTarget:
    """Somebody who listens on a UDP port; nobody there is no error, as nobody can tell."""

    def __init__(self, host: str, port: int) -> None:
        """Raises SettingsError where the host has no address."""
        self.lost = 0  # packets that the operating system would not take
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind, protocol)
        except OSError as error:
            raise SettingsError(f"--to {host}:{port}: {error.strerror or error}") from error
        self._address = address
        self._socket.setblocking(False)

    def send(self, messages: Iterable[Message]) -> None:
        """Send messages as one packet."""
        try:
            self._socket.sendto(bundle(messages), self._address)
        except OSError:
            self.lost += 1

    def close(self) -> None:
        """Let go of the socket."""
        self._socket.close()
