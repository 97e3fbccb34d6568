"""`arm-ik router`."""

from __future__ import annotations

from arm_ik_service.cli.options import (
    Access,
    Connect,
    Listen,
    Scouting,
    TlsAuthority,
    TlsCertificate,
    TlsKey,
    ZenohConfig,
    bus_options,
    say,
    stopped_by_signals,
)


def router(
    connect: Connect = None,
    listen: Listen = None,
    scouting: Scouting = False,
    zenoh_config: ZenohConfig = None,
    tls_cert: TlsCertificate = None,
    tls_key: TlsKey = None,
    tls_ca: TlsAuthority = None,
    access: Access = None,
) -> None:
    """Route between services, headsets and viewers that all connect to one place, for those who want one.

    Services need none: they connect to each other. With a router each of them takes --connect alone; a second router
    that connects to the first stands in for it.

    Example: [bold]arm-ik router --listen tcp/0.0.0.0:7447[/bold]
    """
    import logging
    from threading import Event

    from arm_ik_service.errors import SettingsError
    from arm_ik_service.io.zenoh_bus import open_router
    from arm_ik_service.io.zenoh_log import log_zenoh

    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    options = bus_options(connect, listen, scouting, zenoh_config, tls_cert, tls_key, tls_ca, access)
    if connect and not listen:
        raise SettingsError("a router listens: say where with --listen tcp/HOST:PORT")
    pass_on_log = log_zenoh(denials=access is not None)
    stopped = Event()
    with open_router(options), stopped_by_signals(stopped.set):
        pass_on_log()
        say(f"ready: routes on {', '.join(options.listens_on()) or zenoh_config}; Ctrl-C ends it")
        stopped.wait()
