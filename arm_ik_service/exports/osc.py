"""Open Sound Control over UDP: messages bundled, sent, and forgotten."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pythonosc.osc_bundle import OscBundle
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder
from pythonosc.udp_client import UDPClient

from arm_ik_service.errors import SettingsError

Argument = float | int | str
Message = tuple[str, Sequence[Argument]]


def bundle(messages: Iterable[Message]) -> OscBundle:
    """Put messages into one bundle, to be acted on together and at once."""
    bundled = OscBundleBuilder(IMMEDIATELY)
    for address, arguments in messages:
        message = OscMessageBuilder(address)
        for argument in arguments:
            message.add_arg(argument)
        bundled.add_content(message.build())
    return bundled.build()


class OscTarget:
    """Somebody who listens on a UDP port; nobody there is no error, as nobody can tell."""

    def __init__(self, host: str, port: int) -> None:
        """Raises SettingsError where the host has no address."""
        self.lost = 0  # packets that the operating system would not take
        try:
            self._client = UDPClient(host, port)
        except OSError as error:
            raise SettingsError(f"--to {host}:{port}: {error}") from error

    def send(self, messages: Iterable[Message]) -> None:
        """Send messages as one packet."""
        try:
            self._client.send(bundle(messages))
        except OSError:
            self.lost += 1

    def close(self) -> None:
        """Let go of the socket."""
        self._client._sock.close()
