"""`arm-ik convert`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from arm_ik_service.cli.options import ProfileName, SettingsFile, say
from arm_ik_service.exports.dialects import McapDialect


def convert(
    session: Annotated[Path, typer.Argument(metavar="SESSION", help="A .mcap, .bsor or .npz recording.")],
    output: Annotated[
        Path,
        typer.Argument(
            metavar="OUT", help="A session again: .mcap, .npz. Its arms: .bvh, .csv, .parquet, .mcap with --dialect."
        ),
    ],
    dialect: Annotated[McapDialect | None, typer.Option(help="For .mcap: the arms, for another program.")] = None,
    avatar: Annotated[str | None, typer.Option(help="Only this one of several people.")] = None,
    mirror: Annotated[bool, typer.Option("--mirror", help="Arms: left and right as in a mirror.")] = False,
    fps: Annotated[
        float | None, typer.Option(min=1.0, max=1000.0, help="For .bvh: frames a second; else the recording's own.")
    ] = None,
    profile: ProfileName = None,
    settings: SettingsFile = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing file.")] = False,
) -> None:
    """Turn a recording into another form, or its arms into another program's format.

    Sessions keep their frames and times unchanged. Arms are the recorded answers; a recording without any, or a
    --profile or --settings, makes them be solved.

    Example: [bold]arm-ik convert session.bsor session.mcap[/bold]

    Example: [bold]arm-ik convert session.mcap arms.bvh[/bold]
    """
    from arm_ik_service.cli.progress import frames_progress
    from arm_ik_service.errors import SessionError, SettingsError
    from arm_ik_service.io.session import open_session
    from arm_ik_service.programs.export_session import is_export

    if output.exists() and not overwrite:
        raise SessionError(f"{output} exists: choose another name, or --overwrite")
    arms = is_export(output, dialect)
    if not arms and (mirror or fps is not None or profile is not None or settings is not None):
        raise SettingsError("--mirror, --fps, --profile and --settings are for arms: .bvh, .csv, .parquet or --dialect")
    recording = open_session(session)
    if output.exists() and output.samefile(session):
        raise SessionError(f"{output}: is the session itself; write to another file")
    with frames_progress(session.name, recording.frame_count) as progress:
        if arms:
            from arm_ik_service.io.profile_store import find_profile
            from arm_ik_service.programs.export_session import export_session
            from arm_ik_service.settings import load_settings

            count = export_session(
                recording,
                output,
                dialect=dialect,
                avatar=avatar,
                mirror=mirror,
                fps=fps,
                profile=find_profile(profile) if profile else None,
                settings=load_settings(settings) if settings else None,
                progress=progress,
            )
        else:
            from arm_ik_service.io.convert import convert_session

            count = convert_session(recording, output, avatar=avatar, progress=progress)
    say(f"{output}: {count} {'states' if arms else 'frames'}")
    for warning in recording.warnings:
        say(f"warning: {warning}")
