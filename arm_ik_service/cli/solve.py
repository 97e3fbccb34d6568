"""`arm-ik solve`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from arm_ik_service.cli.options import Json, ProfileName, SettingsFile, say

if TYPE_CHECKING:
    from arm_ik_service.body.profile import Profile
    from arm_ik_service.io.session import Session
    from arm_ik_service.settings import Settings


def solve(
    session: Annotated[Path, typer.Argument(metavar="SESSION", help="A .mcap, .bsor or .npz recording.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Where the result goes: .npz or .mcap.")
    ] = None,
    profile: ProfileName = None,
    settings: SettingsFile = None,
    avatar: Annotated[str | None, typer.Option(help="Solve only this one of several people.")] = None,
    verify: Annotated[
        bool, typer.Option("--verify", help="Compare with the answers in the recording, byte by byte.")
    ] = False,
    json_output: Json = False,
) -> None:
    """Solve a recording without Zenoh, as fast as it goes.

    --verify solves the frames that a service answered while it was recorded, at the times at which it received them,
    and exits with 1 if any answer differs.

    Example: [bold]arm-ik solve session.bsor -o arms.npz --profile me.toml[/bold]
    """
    import json

    from arm_ik_service.errors import SettingsError
    from arm_ik_service.io.profile_store import find_profile
    from arm_ik_service.io.session import open_session
    from arm_ik_service.settings import load_settings

    if output is None and not verify:
        raise SettingsError("say where the result goes with -o FILE.npz or -o FILE.mcap, or compare with --verify")
    if output is not None and output.suffix not in (".npz", ".mcap"):
        raise SettingsError(f"-o {output}: the result is a .npz or an .mcap file")
    used_settings = load_settings(settings)
    used_profile = find_profile(profile) if profile else None
    recording = open_session(session)
    report: dict[str, Any] = {}
    if output is not None:
        report |= _solve(recording, output, used_profile, used_settings, avatar)
    if verify:
        report |= _verify(recording, used_profile, used_settings)
    for warning in recording.warnings:
        say(f"warning: {warning}")
    if json_output:
        typer.echo(json.dumps({"session": str(session), **report, "warnings": recording.warnings}))
    if report.get("different") or report.get("compared") == 0:
        raise typer.Exit(1)


def _solve(
    recording: Session, output: Path, profile: Profile | None, settings: Settings, avatar: str | None
) -> dict[str, Any]:
    import time

    from arm_ik_service.cli.progress import frames_progress
    from arm_ik_service.programs.offline import profiles_for, save_solution, solve_frames

    used = profiles_for(recording, profile)
    frames = (recorded for recorded in recording.frames() if avatar in (None, recorded.avatar))
    began_s = time.perf_counter()
    with frames_progress(recording.path.name, recording.frame_count) as progress:
        count = save_solution(output, recording, solve_frames(frames, used, settings, progress), used, avatar)
    elapsed_s = time.perf_counter() - began_s
    say(f"{output}: {count} frames solved in {elapsed_s:.1f} s, {1e6 * elapsed_s / max(count, 1):.0f} us each")
    return {"output": str(output), "frames": count, "elapsed_s": elapsed_s}


def _verify(recording: Session, profile: Profile | None, settings: Settings) -> dict[str, Any]:
    from dataclasses import asdict

    from arm_ik_service.cli.progress import frames_progress
    from arm_ik_service.programs.verifier import verify_session

    with frames_progress(f"{recording.path.name}: verifying", recording.frame_count) as progress:
        result = verify_session(recording, profile, settings, progress)
    if result.compared == 0:
        say("the recording holds no answers of a service to compare with")
    elif result.different:
        say(f"{result.different} of {result.compared} answers differ, the first: {result.first_difference}")
    else:
        anew = f", {result.measured_anew} times with a new profile" if result.measured_anew else ""
        say(f"all {result.compared} answers are the same bytes again{anew}, times of solving and publishing aside")
    return asdict(result)
