"""`arm-ik solve`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from arm_ik_service.cli.options import Json, ProfileFile, SettingsFile, say


def solve(
    session: Annotated[Path, typer.Argument(metavar="SESSION", help="A .mcap, .bsor or .npz recording.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Where the result goes: .npz or .mcap.")
    ] = None,
    profile: ProfileFile = None,
    settings: SettingsFile = None,
    verify: Annotated[
        bool, typer.Option("--verify", help="Compare with the answers in the recording, byte by byte.")
    ] = False,
    json_output: Json = False,
) -> None:
    """Solve a recording without Zenoh, as fast as it goes.

    Example: [bold]arm-ik solve session.bsor -o arms.npz --profile me.toml[/bold]
    """
    from arm_ik_service.body.profile import load_profile
    from arm_ik_service.errors import SettingsError
    from arm_ik_service.io.session import open_session
    from arm_ik_service.settings import load_settings

    if output is None and not verify:
        raise SettingsError("say where the result goes with -o FILE.npz or -o FILE.mcap, or --verify")
    used_settings = load_settings(settings)
    used_profile = load_profile(profile) if profile else None
    recording = open_session(session)
    if verify:
        _verify(recording, used_profile, used_settings, json_output)
    if output is not None:
        _solve(recording, output, used_profile, used_settings, json_output)
    for warning in recording.warnings:
        say(f"warning: {warning}")
