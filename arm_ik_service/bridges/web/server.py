"""The HTTPS server: one page, and a WebSocket a headset. The only module that imports aiohttp."""

from __future__ import annotations

import asyncio
import logging
import socket
import time
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any

from aiohttp import WSMsgType, web

from arm_ik_service.bridges.web import messages
from arm_ik_service.bridges.web.addresses import url
from arm_ik_service.bridges.web.certificate import Papers
from arm_ik_service.bridges.web.pairing import Pairing
from arm_ik_service.bridges.web.seat import Seat
from arm_ik_service.errors import BridgeError, DecodeError
from arm_ik_service.io.zenoh_streams import Bus
from arm_ik_service.wire.keys import Keys
from arm_ik_service.wire.messages import Encoding

log = logging.getLogger("arm_ik.bridge.web")

HELLO_WITHIN_S = 5.0
HEARTBEAT_S = 4.0  # a headset that was taken off the network is noticed after one and a half of these
CLOSE_WITHIN_S = 1.0  # for the other side to say goodbye
REPORT_PERIOD_S = 1.0
UNREAD_BYTES = 8192  # in the socket's own buffer, about three answers: beyond that the newest waits in its seat

_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",  # these two give the page a clock of 5 us instead of 100
    "Cross-Origin-Embedder-Policy": "require-corp",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}


@dataclass
class Tally:
    """What the server did since the start."""

    published: int = 0
    returned: int = 0
    refused: dict[str, int] = field(default_factory=dict)  # cause -> count


class _DropError(Exception):
    """Close this socket with a code and a reason, and count the cause."""

    def __init__(self, cause: str, code: int, detail: str) -> None:
        super().__init__(detail)
        self.cause = cause
        self.code = code


class WebBridge:
    """Serves headsets on an open Zenoh session, which the caller closes."""

    def __init__(
        self, bus: Bus, keys: Keys, *, names: list[str], port: int, papers: Papers, code: str, encoding: Encoding
    ) -> None:
        self.tally = Tally()
        self._bus = bus
        self._keys = keys
        self._port = port
        self._papers = papers
        self._encoding = encoding
        self._names = names
        self._origins: set[str] = set()
        self._pairing = Pairing(code, papers.secret)
        self._seats: dict[str, tuple[Seat, web.WebSocketResponse]] = {}
        self._ending: dict[web.WebSocketResponse, asyncio.Task[bool]] = {}
        self._details: dict[str, tuple[int, str]] = {}
        self._page = _page_files()

    async def run(self, host: str | None, stopped: asyncio.Event, ready: Any) -> None:
        """Serve until `stopped`; `ready(port)` is called once the port is open. Raises BridgeError if it is taken."""
        app = web.Application()
        app.router.add_get("/socket", self._socket)
        app.router.add_get("/{name:.*}", self._file)
        runner = web.AppRunner(app, access_log=None, shutdown_timeout=1.0)
        await runner.setup()
        port = self._port or _free_port()
        try:
            try:
                site = web.TCPSite(runner, host, port, ssl_context=self._papers.tls, reuse_address=True)
                await site.start()
            except OSError as error:
                raise BridgeError(f"cannot listen on port {port}: {error.strerror}; try --port") from error
            self._origins = {url(name, port) for name in self._names}
            ready(port)
            while not stopped.is_set():
                self._report()
                try:
                    await asyncio.wait_for(stopped.wait(), REPORT_PERIOD_S)
                except TimeoutError:
                    continue
        finally:
            for _, websocket in list(self._seats.values()):
                self._end_soon(websocket, messages.RESTART, b"the bridge is stopped")
            await asyncio.gather(*self._ending.values(), return_exceptions=True)
            await runner.cleanup()
            self._report()

    async def _file(self, request: web.Request) -> web.StreamResponse:
        found = self._page.get(request.match_info["name"] or "index.html")
        if found is None:
            return web.Response(status=404, text="there is no such file\n", headers=_HEADERS)
        content, content_type = found
        return web.Response(body=content, content_type=content_type, charset="utf-8", headers=_HEADERS)

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        """One headset, from its hello to its end."""
        origin = request.headers.get("Origin", "none")
        if origin not in self._origins:
            self._refuse("origin", f"{request.remote}: a page from {origin[:100]}")
            return web.Response(status=403, text="this page may not be used from another origin\n")
        websocket = web.WebSocketResponse(
            max_msg_size=messages.MAX_MESSAGE_BYTES,
            compress=False,
            heartbeat=HEARTBEAT_S,
            timeout=CLOSE_WITHIN_S,
            writer_limit=UNREAD_BYTES,
        )
        await websocket.prepare(request)
        who = str(request.remote)
        try:
            avatar = await self._pair(websocket, who)
            who = avatar
            await self._serve(websocket, avatar)
        except _DropError as drop:
            self._refuse(drop.cause, f"{who}: {drop}")
            await websocket.close(code=drop.code, message=str(drop).encode()[:120])
        if (ending := self._ending.pop(websocket, None)) is not None:
            await ending  # returning would close the socket before it said why
        return websocket

    async def _pair(self, websocket: web.WebSocketResponse, address: str) -> str:
        """Return the avatar id of a page that says who it is. Raises _DropError."""
        try:
            hello = await asyncio.wait_for(_receive(websocket), HELLO_WITHIN_S)
        except TimeoutError:
            raise _DropError("silent", messages.MALFORMED, "said nothing after connecting") from None
        if hello is None:
            raise _DropError("silent", messages.MALFORMED, "left without a word")
        if not isinstance(hello, messages.Hello):
            raise _DropError("malformed", messages.MALFORMED, "the first message has to be a hello")
        if hello.protocol != messages.PROTOCOL:
            raise _DropError(
                "protocol", messages.MALFORMED, "page and bridge are of different versions: reload the page"
            )
        avatar = self._pairing.avatar_for_token(hello.token) if hello.token else None
        if avatar is not None:
            return avatar
        now_s = time.monotonic()
        if self._pairing.locked(address, now_s):
            raise _DropError("locked", messages.TOO_MANY_TRIES, "too many wrong codes: wait a minute")
        avatar = self._pairing.avatar_for_code(hello.code or "", address, now_s)
        if avatar is None:
            raise _DropError("code", messages.WRONG_CODE, "wrong code")
        return avatar

    async def _serve(self, websocket: web.WebSocketResponse, avatar: str) -> None:
        """Carry frames in and arms out until the page leaves. Raises _DropError."""
        before = self._seats.pop(avatar, None)
        if before is not None:
            self._end_soon(before[1], messages.TAKEN_OVER, b"this avatar was opened in another window")
        seat = Seat(self._bus, self._keys, avatar, self._encoding)
        self._seats[avatar] = seat, websocket
        seat.reply(messages.Welcome(avatar, self._pairing.token(avatar)))
        log.info("%s: paired", avatar)
        writer = asyncio.create_task(_write(seat, websocket))
        describing = asyncio.create_task(seat.describe())
        try:
            while (message := await _receive(websocket)) is not None:
                if isinstance(message, messages.Frame):
                    seat.publish(message)
                elif isinstance(message, messages.Ping):
                    seat.reply(messages.Pong(message.page_ms, time.time_ns()))
                else:
                    raise _DropError("malformed", messages.MALFORMED, "a second hello")
        finally:
            writer.cancel()
            describing.cancel()
            await asyncio.gather(writer, describing, return_exceptions=True)
            if self._seats.get(avatar, (None, None))[0] is seat:
                del self._seats[avatar]
            seat.close()
            self.tally.published += seat.published
            self.tally.returned += seat.returned
            if seat.foreign:
                self._refuse("foreign", f"{avatar}: what somebody else put on its keys", seat.foreign)
            log.info("%s: left after %d frames", avatar, seat.published)

    def _end_soon(self, websocket: web.WebSocketResponse, code: int, reason: bytes) -> None:
        """Close a socket without waiting for it: its page may be gone, and the new one is here."""
        self._ending[websocket] = asyncio.create_task(websocket.close(code=code, message=reason))

    def _refuse(self, cause: str, detail: str, count: int = 1) -> None:
        self.tally.refused[cause] = self.tally.refused.get(cause, 0) + count
        self._details[cause] = (self._details.get(cause, (0, ""))[0] + count, detail)

    def _report(self) -> None:
        """Say once a second what was refused, so that nobody can fill a disk."""
        for cause, (count, detail) in self._details.items():
            log.warning("refused %d, %s; the last: %s", count, cause, detail)
        self._details.clear()

    def farewell(self) -> str:
        """Return one line that says what was carried."""
        refused = ", ".join(f"{count} {cause}" for cause, count in self.tally.refused.items()) or "none"
        return f"published {self.tally.published} frames, returned {self.tally.returned} answers, refused: {refused}"


async def _receive(websocket: web.WebSocketResponse) -> messages.FromPage | None:
    """Return the next message, or None at the end. Raises _DropError for what is no message of ours."""
    received = await websocket.receive()
    if received.type is WSMsgType.BINARY:
        try:
            return messages.decode(received.data)
        except DecodeError as error:
            raise _DropError("malformed", messages.MALFORMED, str(error)) from error
    if received.type is WSMsgType.TEXT:
        raise _DropError("malformed", messages.MALFORMED, "text instead of MessagePack")
    if received.type is WSMsgType.ERROR and getattr(received.data, "code", 0) == messages.TOO_LARGE:
        raise _DropError("too_large", messages.TOO_LARGE, f"a message of more than {messages.MAX_MESSAGE_BYTES} bytes")
    return None


async def _write(seat: Seat, websocket: web.WebSocketResponse) -> None:
    """Send what the seat has, as fast as the page takes it; a page that is gone ends the reader as well."""
    while True:
        message = await seat.next_message()
        try:
            await websocket.send_bytes(message)
        except (ConnectionError, RuntimeError):
            return


def _free_port() -> int:
    """Return a port that was free a moment ago: asking for port 0 would give IPv4 and IPv6 different ones."""
    with socket.socket() as probe:
        probe.bind(("", 0))
        return int(probe.getsockname()[1])


def _page_files() -> dict[str, tuple[bytes, str]]:
    """Return the files of the page by name, with their types: a handful of kilobytes, held in memory."""
    folder = files("arm_ik_service.bridges.web") / "page"
    found = {}
    for entry in folder.iterdir():
        suffix = entry.name[entry.name.rfind(".") :]
        if suffix in _TYPES:
            found[entry.name] = (entry.read_bytes(), _TYPES[suffix])
    return found
