"""`arm-ik serve`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from arm_ik_service.cli.options import ProfileName, SettingsFile, say, stopped_by_signals
from arm_ik_service.cli.zenoh_options import opens_hub

if TYPE_CHECKING:
    from arm_ik_service.io.zenoh_bus import BusOptions


@opens_hub
def serve(
    name: Annotated[
        str | None, typer.Option(help="Name of this service on the bus; default: host and process.")
    ] = None,
    profile: ProfileName = None,
    settings: SettingsFile = None,
    *,
    zenoh: BusOptions,
) -> None:
    """Solve both arms of everybody who publishes on avatar/<id>/controllers, and publish avatar/<id>/arms.

    Listens on loopback, tcp/127.0.0.1:7447, unless told otherwise; no router is needed. Started several times, the
    services share the avatars; with --connect and without --listen it is a client of a router or another service.

    Example: [bold]arm-ik serve --listen tcp/0.0.0.0:7447 --profile me.toml[/bold]
    """
    import logging
    import os
    import re
    import socket
    import time

    from arm_ik_service.cli.warm_up import warm_up
    from arm_ik_service.io.profile_store import find_profile
    from arm_ik_service.io.zenoh_bus import open_hub
    from arm_ik_service.io.zenoh_log import log_zenoh
    from arm_ik_service.settings import load_settings
    from arm_ik_service.wire.keys import check_id

    began_s = time.perf_counter()
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    host = re.sub(r"[^A-Za-z0-9_-]", "-", socket.gethostname())[:40]
    service_name = check_id(name or f"{host}-{os.getpid()}")
    used_profile, used_settings = find_profile(profile), load_settings(settings)
    pass_on_log = log_zenoh(denials=zenoh.access_file is not None)
    with open_hub(zenoh, waiting=say) as bus:
        pass_on_log()
        warm_up(used_settings, say)
        from arm_ik_service.programs.service import Service

        service = Service(bus, name=service_name, settings=used_settings, profile=used_profile)
        with stopped_by_signals(service.stop):
            where = ", ".join(zenoh.listens_on() or zenoh.connects_to()) or str(zenoh.config_file)
            say(f"ready in {time.perf_counter() - began_s:.1f} s: {service_name} serves on {where}; Ctrl-C ends it")
            service.run()
        service.close()
        say(service.farewell())
