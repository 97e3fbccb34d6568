"""`arm-ik record`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from arm_ik_service.cli.options import Json, say, stopped_by_signals
from arm_ik_service.cli.zenoh_options import opens_client

if TYPE_CHECKING:
    from arm_ik_service.io.zenoh_bus import BusOptions


@opens_client
def record(
    output: Annotated[Path, typer.Argument(metavar="FILE", help="The .mcap file to write.")],
    duration_s: Annotated[
        float | None, typer.Option("--duration", metavar="SECONDS", min=0.1, help="Stop after so long.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing file.")] = False,
    prefix: Annotated[str, typer.Option(help="Key prefix, as in the service's settings.")] = "",
    json_output: Json = False,
    *,
    zenoh: BusOptions,
) -> None:
    """Record everybody's controllers and arms to an MCAP file, until Ctrl-C.

    What was received is on disk a second later: a recorder that is killed leaves a log that still plays.

    Example: [bold]arm-ik record session.mcap --duration 60[/bold]
    """
    import json
    from dataclasses import asdict

    from arm_ik_service.cli.progress import frames_progress
    from arm_ik_service.errors import SessionError
    from arm_ik_service.io.zenoh_bus import open_client
    from arm_ik_service.programs.recorder import Recorded, Recorder
    from arm_ik_service.wire.keys import Keys

    if output.exists() and not overwrite:
        raise SessionError(f"{output} exists: choose another name, or --overwrite")
    with (
        open_client(zenoh, waiting=say) as bus,
        frames_progress(output.name, None) as advance,
    ):
        shown = 0

        def progress(recorded: Recorded) -> None:
            nonlocal shown
            advance(recorded.frames - shown)
            shown = recorded.frames

        recorder = Recorder(bus, output, Keys(prefix), progress=progress)
        with stopped_by_signals(recorder.stop):
            say("ready; Ctrl-C ends it")
            result = recorder.run(duration_s)
    if json_output:
        typer.echo(json.dumps(asdict(result)))
    else:
        say(f"{output}: {result.frames} frames, {result.answers} answers, {result.refused} not readable")
