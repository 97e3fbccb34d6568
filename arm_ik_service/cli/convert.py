"""`arm-ik convert`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from arm_ik_service.cli.options import say


def convert(
    session: Annotated[Path, typer.Argument(metavar="SESSION", help="A .mcap, .bsor or .npz recording.")],
    output: Annotated[Path, typer.Argument(metavar="OUT", help="The file to write, .mcap or .npz.")],
    avatar: Annotated[str | None, typer.Option(help="Only this one of several people.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing file.")] = False,
) -> None:
    """Turn a recording into another form, its frames and their times unchanged.

    Example: [bold]arm-ik convert session.bsor session.mcap[/bold]
    """
    from arm_ik_service.cli.progress import frames_progress
    from arm_ik_service.errors import SessionError
    from arm_ik_service.io.convert import convert_session
    from arm_ik_service.io.session import open_session

    if output.exists() and not overwrite:
        raise SessionError(f"{output} exists: choose another name, or --overwrite")
    recording = open_session(session)
    with frames_progress(session.name, recording.frame_count) as progress:
        count = convert_session(recording, output, avatar=avatar, progress=progress)
    say(f"{output}: {count} frames")
    for warning in recording.warnings:
        say(f"warning: {warning}")
