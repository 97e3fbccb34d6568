"""`arm-ik replay`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from arm_ik_service.cli.options import Json, say, stopped_by_signals
from arm_ik_service.cli.zenoh_options import opens_client
from arm_ik_service.wire.messages import Encoding

if TYPE_CHECKING:
    from arm_ik_service.io.zenoh_bus import BusOptions


@opens_client
def replay(
    session: Annotated[Path, typer.Argument(metavar="SESSION", help="A .mcap, .bsor or .npz recording.")],
    speed: Annotated[float, typer.Option(min=0.01, max=100.0, help="2 plays twice as fast.")] = 1.0,
    loop: Annotated[bool, typer.Option("--loop", help="Begin again at the end, until Ctrl-C.")] = False,
    from_s: Annotated[float, typer.Option("--from", metavar="SECONDS", min=0.0, help="Where to begin.")] = 0.0,
    to_s: Annotated[float | None, typer.Option("--to", metavar="SECONDS", help="Where to end.")] = None,
    avatar: Annotated[str | None, typer.Option(help="Publish under this id instead of the recorded one.")] = None,
    encoding: Annotated[Encoding, typer.Option(help="How the frames are encoded.")] = "msgpack",
    prefix: Annotated[str, typer.Option(help="Key prefix, as in the service's settings.")] = "",
    json_output: Json = False,
    *,
    zenoh: BusOptions,
) -> None:
    """Publish a recorded session to Zenoh at the pace at which it was recorded.

    Example: [bold]arm-ik replay boxing.mcap --speed 0.25 --from 3 --to 5 --loop[/bold]
    """
    import json
    from dataclasses import asdict

    from arm_ik_service.cli.progress import frames_progress
    from arm_ik_service.errors import SettingsError
    from arm_ik_service.io.session import open_session
    from arm_ik_service.io.zenoh_bus import open_client
    from arm_ik_service.programs.replayer import Replayer, ReplayOptions
    from arm_ik_service.wire.keys import Keys, check_id

    if to_s is not None and to_s <= from_s:
        raise SettingsError(f"--to {to_s:g} is not after --from {from_s:g}: nothing would be played")
    if avatar is not None:
        check_id(avatar)
    recording = open_session(session)
    options = ReplayOptions(speed, loop, from_s, to_s, avatar, encoding)
    with open_client(zenoh, waiting=say) as bus:
        whole = not loop and from_s == 0.0 and to_s is None
        with frames_progress(session.name, recording.frame_count if whole else None) as progress:
            replayer = Replayer(bus, recording, options, Keys(prefix), progress=progress, warn=say)
            with stopped_by_signals(replayer.stop):
                result = replayer.run()
    for warning in recording.warnings:
        say(f"warning: {warning}")
    if json_output:
        typer.echo(json.dumps(asdict(result)))
    else:
        say(
            f"{result.frames} frames in {result.duration_s:.1f} s; "
            f"99 % were put within {result.late_p99_ms:.2f} ms of their time"
        )
