"""`arm-ik export`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from arm_ik_service.cli.options import Json, say, stopped_by_signals
from arm_ik_service.cli.zenoh_options import opens_client
from arm_ik_service.exports.dialects import OSC_PORTS, LiveDialect, RosWay

if TYPE_CHECKING:
    from arm_ik_service.io.zenoh_bus import BusOptions
    from arm_ik_service.io.zenoh_streams import Bus
    from arm_ik_service.programs.sinks import Sink


@opens_client
def export(
    dialects: Annotated[
        list[LiveDialect],
        typer.Argument(
            metavar="DIALECT...",
            help="vmc: VRM avatars over OSC. vrchat: OSC trackers. ros2: JointState and TF in CDR on Zenoh. "
            "openxr: XR_FB_body_tracking joints in JSON on Zenoh. Several cost the service no more than one.",
        ),
    ],
    to: Annotated[
        list[str] | None,
        typer.Option(
            "--to",
            metavar="[DIALECT=]HOST:PORT",
            help="Where vmc and vrchat send: 127.0.0.1:39539, 127.0.0.1:9000. Of both: once each, with its name.",
        ),
    ] = None,
    avatar: Annotated[str | None, typer.Option(help="Whose arms; else everybody's, or the first one's.")] = None,
    mirror: Annotated[bool, typer.Option("--mirror", help="Left and right as in a mirror.")] = False,
    most_hz: Annotated[
        float | None, typer.Option("--rate", metavar="HZ", min=1.0, help="Send no more often than this.")
    ] = None,
    lower_arm_twist: Annotated[
        float,
        typer.Option(min=0.0, max=1.0, help="vmc: share of the pronation in the lower arm, the rest in the hand."),
    ] = 0.5,
    chest: Annotated[bool, typer.Option("--chest", help="vrchat: send the chest as tracker 3.")] = False,
    domain: Annotated[int, typer.Option(min=0, max=232, help="ros2: ROS_DOMAIN_ID.")] = 0,
    way: Annotated[RosWay, typer.Option(help="ros2: for rmw_zenoh, for zenoh-bridge-ros2dds, or both.")] = RosWay.BOTH,
    duration_s: Annotated[
        float | None, typer.Option("--duration", metavar="SECONDS", min=0.1, help="Stop after so long.")
    ] = None,
    prefix: Annotated[str, typer.Option(help="Key prefix, as in the service's settings.")] = "",
    json_output: Json = False,
    *,
    zenoh: BusOptions,
) -> None:
    """Send everybody's arms on to programs that speak other dialects, until Ctrl-C. For files: arm-ik convert.

    Example: [bold]arm-ik export vmc --to 127.0.0.1:39539[/bold]

    Example: [bold]arm-ik export vmc vrchat ros2 --to vmc=192.168.1.7:39539[/bold]
    """
    import json
    from dataclasses import asdict

    from arm_ik_service.io.zenoh_bus import open_client
    from arm_ik_service.programs.exporter import Exporter
    from arm_ik_service.programs.priority import give_way
    from arm_ik_service.programs.sinks import BodyTrackingSink, Ros2Sink, VmcSink, VrChatSink
    from arm_ik_service.wire.keys import Keys

    dialects = list(dict.fromkeys(dialects))
    addresses = _addresses(dialects, to or [])
    give_way()

    def sink_on(bus: Bus, dialect: LiveDialect) -> Sink:
        if dialect is LiveDialect.VMC:
            return VmcSink(*addresses[dialect], lower_arm_twist)
        if dialect is LiveDialect.VRCHAT:
            return VrChatSink(*addresses[dialect], chest=chest)
        if dialect is LiveDialect.ROS2:
            return Ros2Sink(bus, domain=domain, rmw_zenoh=way is not RosWay.ROS2DDS, bridge=way is not RosWay.RMW_ZENOH)
        return BodyTrackingSink(bus, prefix)

    with open_client(zenoh, waiting=say) as bus:
        sinks = [sink_on(bus, dialect) for dialect in dialects]
        exporter = Exporter(bus, sinks, Keys(prefix), avatar=avatar, mirror=mirror, most_hz=most_hz)
        with stopped_by_signals(exporter.stop):
            where = {dialect: f" to {host}:{port}" for dialect, (host, port) in addresses.items()}
            what = ", ".join(f"{dialect.value}{where.get(dialect, '')}" for dialect in dialects)
            say(f"ready; sending {what}; Ctrl-C ends it")
            result = exporter.run(duration_s)
    if json_output:
        typer.echo(json.dumps(asdict(result)))
    else:
        say(f"{result.sent} states sent of {', '.join(result.avatars) or 'nobody'}, {result.overtaken} overtaken")


def _addresses(dialects: list[LiveDialect], to: list[str]) -> dict[LiveDialect, tuple[str, int]]:
    """Where each dialect that goes over OSC is sent: what --to says, by its name or the only one; else the usual port.

    Raises SettingsError.
    """
    from arm_ik_service.errors import SettingsError

    over_osc = [dialect for dialect in dialects if dialect in OSC_PORTS]
    told: dict[LiveDialect, str] = {}
    for text in to:
        name, named, address = text.rpartition("=")
        if not over_osc:
            raise SettingsError(f"--to is for vmc and vrchat; {dialects[0].value} goes out on Zenoh: use --connect")
        if not named and len(over_osc) > 1:
            raise SettingsError(f"--to {text}: which of them? say for instance --to {over_osc[0].value}={text}")
        found = [dialect for dialect in over_osc if not named or dialect.value == name]
        if not found:
            raise SettingsError(f"--to {text}: {name} is not sent over OSC here; {', '.join(over_osc)} is")
        if found[0] in told:
            raise SettingsError(f"--to {text}: {found[0].value} is sent to {told[found[0]]} already")
        told[found[0]] = address
    return {dialect: _address(dialect, told.get(dialect, "")) for dialect in over_osc}


def _address(dialect: LiveDialect, to: str) -> tuple[str, int]:
    """Take HOST:PORT apart; the port alone or the host alone will do. Raises SettingsError."""
    from arm_ik_service.errors import SettingsError

    host, colon, port = to.rpartition(":")
    if not colon:
        host, port = (to, "") if not to.isdigit() else ("", to)
    if port and not (port.isdigit() and 0 < int(port) < 65536):
        raise SettingsError(f"--to {to}: HOST:PORT is needed, for instance 127.0.0.1:{OSC_PORTS[dialect]}")
    return host.strip("[]") or "127.0.0.1", int(port) if port else OSC_PORTS[dialect]
