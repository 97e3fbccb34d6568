"""`arm-ik top`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from arm_ik_service.cli.options import Json, say, stopped_by_signals
from arm_ik_service.cli.zenoh_options import opens_client

if TYPE_CHECKING:
    from rich.console import Group

    from arm_ik_service.io.zenoh_bus import BusOptions
    from arm_ik_service.wire.messages import Health

PERIOD_S = 0.5


@opens_client
def top(
    duration_s: Annotated[
        float | None, typer.Option("--duration", metavar="SECONDS", min=0.1, help="Stop after so long.")
    ] = None,
    prefix: Annotated[str, typer.Option(help="Key prefix, as in the service's settings.")] = "",
    json_output: Json = False,
    *,
    zenoh: BusOptions,
) -> None:
    """Show every service and avatar live: rate, latency, residual, tracking, frames lost.

    With --json one object is printed, with what every service told last.

    Example: [bold]arm-ik top --connect tcp/127.0.0.1:7447[/bold]
    """
    import json
    import time
    from threading import Event

    import msgspec
    from rich.console import Console
    from rich.live import Live

    from arm_ik_service.io.zenoh_bus import open_client
    from arm_ik_service.programs.top import Top
    from arm_ik_service.wire.keys import Keys

    stopped = Event()
    with open_client(zenoh, waiting=say) as bus, stopped_by_signals(stopped.set):
        watched = Top(bus, Keys(prefix))
        if json_output:
            stopped.wait(duration_s or 2.5)  # two healths
            typer.echo(json.dumps({"services": msgspec.to_builtins(watched.services())}))
        else:
            end_s = None if duration_s is None else time.monotonic() + duration_s
            # a pipe has no width of its own: give the tables what they need
            console = Console() if Console().is_terminal else Console(width=120)
            with Live(console=console, auto_refresh=False) as live:
                while not stopped.wait(PERIOD_S) and (end_s is None or time.monotonic() < end_s):
                    live.update(_picture(watched.services()), refresh=True)
        watched.close()


def _picture(services: list[Health]) -> Group:
    from rich.console import Group
    from rich.table import Table

    from arm_ik_service.programs.top import rows_of

    above = Table(title="services")
    above.add_column("service", no_wrap=True)
    for heading in ("up", "avatars", "frames/s", "answered %", "p50 ms", "p99 ms", "MB", "refused"):
        above.add_column(heading, justify="right")
    for health in services:
        refused = ", ".join(f"{count} {cause}" for cause, count in health.refused.items())
        above.add_row(
            health.service,
            f"{health.uptime_s:.0f} s",
            str(len(health.avatars)),
            f"{sum(avatar.frames_per_s for avatar in health.avatars):.0f}",
            f"{100.0 * health.answered_share:.1f}",
            f"{health.latency_p50_ms:.2f}",
            f"{health.latency_p99_ms:.2f}",
            f"{health.memory_bytes / 1e6:.0f}",
            refused or "none",
        )
    below = Table(title="avatars" if services else "no service speaks: is `arm-ik serve` running there?")
    for heading in ("avatar", "service", "tracking"):
        below.add_column(heading, no_wrap=True)
    for heading in ("frames/s", "answered %", "worst ms", "off mm", "overtaken", "refused", "silent s"):
        below.add_column(heading, justify="right")
    for service, avatar in rows_of(services):
        below.add_row(
            avatar.avatar,
            service,
            avatar.tracking,
            f"{avatar.frames_per_s:.0f}",
            f"{100.0 * avatar.answered_share:.1f}",
            f"{avatar.latency_max_ms:.2f}",
            f"{1e3 * avatar.position_error_m:.1f}",
            str(avatar.overtaken),
            str(avatar.refused),
            f"{avatar.silent_s:.1f}" if avatar.silent_s > 1.0 else "",
        )
    return Group(above, below)
