"""Opening a Zenoh session, with errors a person can act on. The only module that builds a Zenoh configuration.

Three roles. A *hub* (`serve`, `demo`) is a peer that listens; everything else is a *client* of a hub: Zenoh routes
between the clients of one peer, but not between peers that only have a third one in common. A *router* routes between
everybody who connects to it, and does nothing else.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import zenoh

from arm_ik_service.errors import BusError

LOOPBACK = "127.0.0.1:7447"  # 7447 is Zenoh's registered port; loopback: opening to a network is a choice
_ATTEMPT_MS = 1000  # zenoh.open cannot be interrupted, so it is tried in short attempts
# A process that dies is noticed at once, for its connections close. A link that is cut is noticed when the lease is
# over: Zenoh's default of 10 s would leave avatars without a service for as long; stalls of busy machines reach 0.1 s.
LEASE_MS = 1000
KEEP_ALIVES_PER_LEASE = 4
_PEERS_MS = 300
_RETRY = {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 1.5}

# What may wait for the network: at a client one of Zenoh's batches and what TCP takes to be sent, at a hub what TCP has
# taken in. Systems let 4 MB wait and more, which are old poses in front of the door where the newest wins: under
# overload a third of a second of them, measured. What finds no room the client drops. TCP sends up to 64 KB in a piece
# within a machine: where less than one may wait to be sent, it waits 40 ms for an acknowledgement that the receiver
# keeps back for the next; where less than two may wait to be read, it drops one, and waits 200 ms to send it again.
BATCHES_WAITING = 1
SENT_BYTES = 64 * 1024
READ_BYTES = 128 * 1024

# To close a link that was cut, with data under way, blocks one of Zenoh's receiving threads for up to 10 s (SO_LINGER,
# eclipse-zenoh/zenoh#1101). Of the default two, one link to each of two lost machines would take both.
_RUNTIME = "(rx: (worker_threads: 8))"

Role = Literal["hub", "client", "router"]


@dataclass(frozen=True)
class TlsFiles:
    """Who we are and whom we believe: PEM files. TLS here is always mutual: both sides show a certificate."""

    certificate: Path
    key: Path
    authority: Path

    def missing(self) -> list[Path]:
        """Those that cannot be read."""
        return [path for path in (self.certificate, self.key, self.authority) if not path.is_file()]


@dataclass(frozen=True)
class BusOptions:
    """What `--connect --listen --scouting --zenoh-config --tls-...` say. Empty lists mean the default of the role."""

    connect: tuple[str, ...] = ()
    listen: tuple[str, ...] = ()
    scouting: bool = False
    config_file: Path | None = None
    tls: TlsFiles | None = None
    access_file: Path | None = None  # what `arm-ik certificates` writes: who may read and write what

    @property
    def _loopback(self) -> str:
        return f"{'tls' if self.tls else 'tcp'}/{LOOPBACK}"

    def listens_on(self) -> tuple[str, ...]:
        """Where a hub with these options listens. One that only connects is a client of what it connects to."""
        return self.listen or (() if self.config_file or self.connect else (self._loopback,))

    def connects_to(self) -> tuple[str, ...]:
        """Where a client with these options connects."""
        return self.connect or (() if self.listen or self.config_file or self.scouting else (self._loopback,))


def _configuration(options: BusOptions, role: Role) -> zenoh.Config:
    os.environ.setdefault("ZENOH_RUNTIME", _RUNTIME)  # read when the first session of the process is opened
    try:
        config = zenoh.Config.from_file(str(options.config_file)) if options.config_file else zenoh.Config()
    except zenoh.ZError as error:
        raise BusError(f"Zenoh configuration {options.config_file}: {error}") from error

    def put(key: str, value: Any) -> None:
        config.insert_json5(key, json.dumps(value))

    listen = options.listen if role == "client" else options.listens_on()
    connect = options.connects_to() if role == "client" else options.connect
    if options.config_file is None:
        peer = role == "hub" or options.listen or options.scouting
        put("mode", "router" if role == "router" else "peer" if peer else "client")
        put("scouting/multicast/enabled", options.scouting)
        put("scouting/gossip/enabled", options.scouting)
        put("transport/link/tx/lease", LEASE_MS)
        put("transport/link/tx/keep_alive", KEEP_ALIVES_PER_LEASE)
    if options.tls is not None:
        _put_tls(options.tls, put)
    if options.config_file is None:  # after TLS, whose section is put as a whole
        _bound_what_waits(role, put)
    if options.access_file is not None:
        try:
            put("access_control", json.loads(options.access_file.read_bytes()))
        except (OSError, ValueError, zenoh.ZError) as error:
            raise BusError(f"access rules {options.access_file}: {error}") from error
    try:
        if listen or options.config_file is None:
            put("listen/endpoints", listen)
        if connect:
            put("connect/endpoints", connect)
            put("connect/retry", _RETRY)
            # the others of a fleet are awaited for a moment, so that the first look round finds them
            put("connect/timeout_ms", _ATTEMPT_MS if role == "client" else _PEERS_MS)
            put("connect/exit_on_failure", role == "client")
    except zenoh.ZError as error:
        raise BusError(f"endpoint {', '.join((*listen, *connect))} is not of the form tcp/HOST:PORT") from error
    return config


def _bound_what_waits(role: Role, put: Callable[[str, Any], None]) -> None:
    name, size = ("so_sndbuf", SENT_BYTES) if role == "client" else ("so_rcvbuf", READ_BYTES)
    for protocol in ("tcp", "tls"):
        put(f"transport/link/{protocol}/{name}", size)
    if role == "client":
        put("transport/link/tx/queue/size/data", BATCHES_WAITING)


def _put_tls(files: TlsFiles, put: Callable[[str, Any], None]) -> None:
    """Show the same certificate whether we listen or connect, ask the other side for one, and hold it to its name."""
    if missing := files.missing():
        raise BusError(f"{missing[0]} cannot be read: `arm-ik certificates` makes certificates for a lab")
    put(
        "transport/link/tls",
        {
            "root_ca_certificate": str(files.authority),
            "listen_certificate": str(files.certificate),
            "listen_private_key": str(files.key),
            "connect_certificate": str(files.certificate),
            "connect_private_key": str(files.key),
            "enable_mtls": True,
            "verify_name_on_connect": True,
        },
    )


def open_hub(options: BusOptions, *, waiting: Callable[[str], None] | None = None) -> zenoh.Session:
    """Open the session of a service. Raises BusError where the port is taken or the endpoint is wrong.

    With endpoints to connect to and none to listen on it is a client, of a router or of another service, and waits for
    it as `open_client` does.
    """
    if options.connect and not options.listen and not options.config_file:
        return open_client(options, waiting=waiting)
    return _listen(options, "hub")


def open_router(options: BusOptions) -> zenoh.Session:
    """Open the session of a router. Raises BusError where the port is taken or the endpoint is wrong."""
    return _listen(options, "router")


def _listen(options: BusOptions, role: Role) -> zenoh.Session:
    config = _configuration(options, role)
    try:
        return zenoh.open(config)
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
                raise BusError(_nobody(options, where)) from error
        if not said and waiting is not None:
            waiting(f"waiting for {where} ({_likely(options)})")
            said = True


def _likely(options: BusOptions) -> str:
    """The likely causes: Zenoh tells a client that is refused no more than one that finds nobody."""
    running = "is `arm-ik serve` running there?"
    if options.tls is not None:
        return f"{running} is {options.tls.certificate} signed by the authority it believes, and its name in its own?"
    if any(endpoint.startswith("tls/") for endpoint in options.connects_to()):
        return f"{running} it asks for a certificate: --tls-cert --tls-key --tls-ca"
    return running


def _nobody(options: BusOptions, where: str) -> str:
    return f"nobody answers at {where}: {_likely(options)}"


def _reason(error: Exception) -> str:
    """The first line of Zenoh's error, without the source positions it appends."""
    return str(error).splitlines()[0].split(" at /")[0].strip()
