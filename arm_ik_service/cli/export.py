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
    dialect: Annotated[
        LiveDialect,
        typer.Argument(
            help="vmc: VRM avatars over OSC. vrchat: OSC trackers. ros2: JointState and TF in CDR on Zenoh. "
            "openxr: XR_FB_body_tracking joints in JSON on Zenoh."
        ),
    ],
    to: Annotated[
        str | None,
        typer.Option("--to", metavar="HOST:PORT", help="Where vmc and vrchat send: 127.0.0.1:39539, 127.0.0.1:9000."),
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
    """Send everybody's arms on to programs that speak another dialect, until Ctrl-C. For files: arm-ik convert.

    Example: [bold]arm-ik export vmc --to 127.0.0.1:39539[/bold]
    """
    import json
    from dataclasses import asdict

    from arm_ik_service.io.zenoh_bus import open_client
    from arm_ik_service.programs.exporter import Exporter, give_way
    from arm_ik_service.programs.sinks import BodyTrackingSink, Ros2Sink, VmcSink, VrChatSink
    from arm_ik_service.wire.keys import Keys

    host, port = _address(dialect, to)
    give_way()

    def sink_on(bus: Bus) -> Sink:
        if dialect is LiveDialect.VMC:
            return VmcSink(host, port, lower_arm_twist)
        if dialect is LiveDialect.VRCHAT:
            return VrChatSink(host, port, chest=chest)
        if dialect is LiveDialect.ROS2:
            return Ros2Sink(bus, domain=domain, rmw_zenoh=way is not RosWay.ROS2DDS, bridge=way is not RosWay.RMW_ZENOH)
        return BodyTrackingSink(bus, prefix)

    with open_client(zenoh, waiting=say) as bus:
        exporter = Exporter(bus, sink_on(bus), Keys(prefix), avatar=avatar, mirror=mirror, most_hz=most_hz)
        with stopped_by_signals(exporter.stop):
            where = f" to {host}:{port}" if host else ""
            say(f"ready; sending {dialect.value}{where}; Ctrl-C ends it")
            result = exporter.run(duration_s)
    if json_output:
        typer.echo(json.dumps(asdict(result)))
    else:
        say(f"{result.sent} states sent of {', '.join(result.avatars) or 'nobody'}, {result.overtaken} overtaken")


def _address(dialect: LiveDialect, to: str | None) -> tuple[str, int]:
    """Take HOST:PORT apart; the port alone or the host alone will do."""
    from arm_ik_service.errors import SettingsError

    if dialect not in OSC_PORTS:
        if to is not None:
            raise SettingsError(f"--to is for vmc and vrchat; {dialect.value} goes out on Zenoh: use --connect")
        return "", 0
    host, colon, port = (to or "").rpartition(":")
    if not colon:
        host, port = (to or "", "") if not (to or "").isdigit() else ("", to or "")
    if port and not (port.isdigit() and 0 < int(port) < 65536):
        raise SettingsError(f"--to {to}: HOST:PORT is needed, for instance 127.0.0.1:{OSC_PORTS[dialect]}")
    return host.strip("[]") or "127.0.0.1", int(port) if port else OSC_PORTS[dialect]
