"""The web bridge as a process, and pages that speak to it from Python."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from harness import KEYS, Running, wait_for

from arm_ik_service.io.zenoh_streams import Bus
from arm_ik_service.wire import codec
from arm_ik_service.wire.messages import ControllerFrame

CODE = "123456"
Result = TypeVar("Result")


@dataclass
class Hub:
    """An open bus without a service, and every frame that came over it."""

    endpoint: str
    bus: Bus
    frames: dict[str, list[ControllerFrame]] = field(default_factory=dict)

    def count(self, avatar: str) -> int:
        return len(self.frames.get(avatar, []))

    def receive(self, key: str, payload: bytes, _time_ns: int) -> None:
        self.frames.setdefault(KEYS.avatar_of(key), []).append(codec.controller_frames.decode(payload))


@dataclass
class Served:
    """A running `arm-ik bridge web`."""

    process: Running
    port: int

    @property
    def origin(self) -> str:
        return f"https://localhost:{self.port}"

    def farewell(self) -> str:
        assert self.process.end() == 0, self.process.lines
        return self.process.lines[-1]


def start_web_bridge(endpoint: str, state: Path, port: int = 0) -> Served:
    process = Running(
        "bridge", "web", "--port", str(port), "--code", CODE, "--state", str(state), "--connect", endpoint
    )
    process.wait_ready()
    line = next(line for line in process.lines if line.startswith("ready"))
    return Served(process, int(line.split("port ")[1].split(";")[0]))


class Page:
    """What a page does on its socket, from Python."""

    def __init__(self, socket: Any) -> None:
        self.socket = socket

    async def send(self, **message: Any) -> None:
        await self.socket.send_bytes(msgspec.msgpack.encode(message))

    async def hello(self, **credentials: Any) -> Any:
        await self.send(type="hello", protocol=1, **credentials)
        return await self.next()

    async def next(self) -> Any:
        """Return the next message, or the close code."""
        from aiohttp import WSMsgType

        received = await self.socket.receive(timeout=5.0)
        if received.type is WSMsgType.BINARY:
            return msgspec.msgpack.decode(received.data)
        return received.data if received.type is WSMsgType.CLOSE else self.socket.close_code


def with_page(
    served: Served, use: Callable[[Page], Awaitable[Result]], *, origin: str | None = None, path: str = "/socket"
) -> Result:
    """Open a socket to the bridge as a page of that origin would, and use it."""
    import aiohttp

    async def run() -> Result:
        async with aiohttp.ClientSession() as session:
            url = f"https://localhost:{served.port}{path}"
            headers = {"Origin": origin or served.origin}
            async with session.ws_connect(url, headers=headers, ssl=False, max_msg_size=0) as socket:
                return await use(Page(socket))

    return asyncio.run(run())


def heard(hub: Hub, avatar: str, count: int, seconds: float = 5.0) -> list[ControllerFrame]:
    """Wait until that many frames of an avatar came."""
    wait_for(lambda: hub.count(avatar) >= count, seconds)
    time.sleep(0.05)
    return list(hub.frames.get(avatar, []))
