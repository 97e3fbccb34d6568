"""`arm-ik view`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from arm_ik_service.cli.options import (
    AvatarFile,
    Show,
    SkinningChoice,
    say,
    show_option,
    skin_options,
    stopped_by_signals,
)
from arm_ik_service.cli.zenoh_options import opens_client

if TYPE_CHECKING:
    from arm_ik_service.io.zenoh_bus import BusOptions


@opens_client
def view(
    save: Annotated[Path | None, typer.Option("--save", metavar="FILE", help="Write an .rrd file.")] = None,
    spawn: Annotated[bool, typer.Option("--spawn", help="Open the Rerun viewer (the default).")] = False,
    web: Annotated[bool, typer.Option("--web", help="Serve the viewer to a web browser.")] = False,
    connect_rerun: Annotated[
        str | None, typer.Option("--connect-rerun", metavar="URL", help="Stream to a viewer that runs already.")
    ] = None,
    record: Annotated[
        Path | None, typer.Option("--record", metavar="FILE", help="Write frames and arms beside it, .mcap.")
    ] = None,
    duration_s: Annotated[
        float | None, typer.Option("--duration", metavar="SECONDS", min=0.1, help="Stop after so long.")
    ] = None,
    avatar: AvatarFile = None,
    skinning: SkinningChoice = None,
    show: Show = None,
    prefix: Annotated[str, typer.Option(help="Key prefix, as in the service's settings.")] = "",
    *,
    zenoh: BusOptions,
) -> None:
    """Show everybody's arms in Rerun, until Ctrl-C. Several outputs may be given together.

    Example: [bold]arm-ik view --save session.rrd --web[/bold]

    Example: [bold]arm-ik view --record session.mcap[/bold]
    """
    from arm_ik_service.errors import SessionError
    from arm_ik_service.io.rerun_view import Connect as ConnectTo
    from arm_ik_service.io.rerun_view import Save, Sink, Spawn, Web
    from arm_ik_service.io.zenoh_bus import open_client
    from arm_ik_service.programs.priority import give_way
    from arm_ik_service.programs.recorder import recorded_beside
    from arm_ik_service.programs.viewer import Viewer
    from arm_ik_service.wire.keys import Keys

    sinks: list[Sink] = []
    if save is not None:
        sinks.append(Save(save))
    if web:
        sinks.append(Web())
    if connect_rerun is not None:
        sinks.append(ConnectTo(connect_rerun))
    if spawn or not sinks:
        sinks.append(Spawn())
    if record is not None and record.exists():
        raise SessionError(f"{record} exists: choose another name")
    give_way(entirely=record is None and all(isinstance(sink, Save) for sink in sinks))
    skin, overlays = skin_options(avatar, skinning), show_option(show)
    with open_client(zenoh, waiting=say) as bus, recorded_beside(bus, record, Keys(prefix)) as recorded:
        viewer = Viewer(bus, sinks, Keys(prefix), skin, overlays)
        for sink in sinks:
            if isinstance(sink, Web):
                say(f"view: open {sink.address} in a browser")
        with stopped_by_signals(viewer.stop):
            say("ready; Ctrl-C ends it")
            viewer.run(duration_s)
        say(viewer.close())
    if record is not None:
        say(f"{record}: {recorded.frames} frames, {recorded.answers} answers")
