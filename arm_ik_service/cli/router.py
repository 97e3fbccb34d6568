"""`arm-ik router`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from arm_ik_service.cli.options import say, stopped_by_signals
from arm_ik_service.cli.zenoh_options import opens_hub

if TYPE_CHECKING:
    from arm_ik_service.io.zenoh_bus import BusOptions


@opens_hub
def router(
    *,
    zenoh: BusOptions,
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
    if zenoh.connect and not zenoh.listen:
        raise SettingsError("a router listens: say where with --listen tcp/HOST:PORT")
    pass_on_log = log_zenoh(denials=zenoh.access_file is not None)
    stopped = Event()
    with open_router(zenoh), stopped_by_signals(stopped.set):
        pass_on_log()
        say(f"ready: routes on {', '.join(zenoh.listens_on()) or zenoh.config_file}; Ctrl-C ends it")
        stopped.wait()
