"""Opening a Zenoh session, with errors a person can act on. The only module that builds a Zenoh configuration.

Two roles. A *hub* (`serve`, `demo`) is a peer that listens; everything else is a *client* of a hub: Zenoh routes
between the clients of one peer, but not between peers that only have a third one in common.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import zenoh

from arm_ik_service.errors import BusError

LOOPBACK = "tcp/127.0.0.1:7447"  # 7447 is Zenoh's registered port; loopback: opening to a network is a choice
_ATTEMPT_MS = 1000  # zenoh.open cannot be interrupted, so it is tried in short attempts


@dataclass(frozen=True)
class BusOptions:
    """What `--connect --listen --scouting --zenoh-config` say. Empty lists mean the default of the role."""

    connect: tuple[str, ...] = ()
    listen: tuple[str, ...] = ()
    scouting: bool = False
    config_file: Path | None = None

    def listens_on(self) -> tuple[str, ...]:
        """Where a hub with these options listens."""
        return self.listen or (() if self.config_file else (LOOPBACK,))

    def connects_to(self) -> tuple[str, ...]:
        """Where a client with these options connects."""
        return self.connect or (() if self.listen or self.config_file or self.scouting else (LOOPBACK,))


def _configuration(options: BusOptions, role: Literal["hub", "client"]) -> zenoh.Config:
    try:
        config = zenoh.Config.from_file(str(options.config_file)) if options.config_file else zenoh.Config()
    except zenoh.ZError as error:
        raise BusError(f"Zenoh configuration {options.config_file}: {error}") from error

    def put(key: str, value: Any) -> None:
        config.insert_json5(key, json.dumps(value))

    listen = options.listens_on() if role == "hub" else options.listen
    connect = options.connect if role == "hub" else options.connects_to()
    if options.config_file is None:
        put("mode", "peer" if role == "hub" or options.listen or options.scouting else "client")
        put("scouting/multicast/enabled", options.scouting)
        put("scouting/gossip/enabled", options.scouting)
    try:
        if listen or options.config_file is None:
            put("listen/endpoints", listen)
        if connect:
            put("connect/endpoints", connect)
            put("connect/timeout_ms", _ATTEMPT_MS if role == "client" else 0)
            put("connect/exit_on_failure", role == "client")
    except zenoh.ZError as error:
        raise BusError(f"endpoint {', '.join((*listen, *connect))} is not of the form tcp/HOST:PORT") from error
    return config


def open_hub(options: BusOptions) -> zenoh.Session:
    """Open the session of a service. Raises BusError where the port is taken or the endpoint is wrong."""
    try:
        return zenoh.open(_configuration(options, "hub"))
    except zenoh.ZError as error:
        where = ", ".join(options.listens_on()) or str(options.config_file)
        if "in use" in str(error):
            raise BusError(f"{where} is in use: is another `arm-ik serve` running? choose with --listen") from error
        raise BusError(f"cannot listen on {where}: {_reason(error)}") from error


def open_client(
    options: BusOptions, *, wait_s: float | None = None, waiting: Callable[[str], None] | None = None
) -> zenoh.Session:
    """Open a session to a hub, trying again until `wait_s` is over (None: for ever; interruptible once a second).

    `waiting` is called once with a line to show if the hub is not there yet. Raises BusError when the time is over.
    """
    config = _configuration(options, "client")
    where = ", ".join(options.connects_to()) or "the network"
    give_up = None if wait_s is None else time.monotonic() + wait_s
    said = False
    while True:
        try:
            return zenoh.open(config)
        except zenoh.ZError as error:
            if "in use" in str(error):
                raise BusError(f"{', '.join(options.listen)} is in use: choose another port with --listen") from error
            if "nable to connect" not in str(error):
                raise BusError(f"cannot connect to {where}: {_reason(error)}") from error
            if give_up is not None and time.monotonic() >= give_up:
                raise BusError(f"nobody answers at {where}: is `arm-ik serve` running there?") from error
        if not said and waiting is not None:
            waiting(f"waiting for {where} (is `arm-ik serve` running there?)")
            said = True


def _reason(error: Exception) -> str:
    """The first line of Zenoh's error, without the source positions it appends."""
    return str(error).splitlines()[0].split(" at /")[0].strip()
