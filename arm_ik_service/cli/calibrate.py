"""`arm-ik calibrate`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from arm_ik_service.cli.options import Json, ProfileName, say
from arm_ik_service.cli.zenoh_options import opens_client

if TYPE_CHECKING:
    import numpy as np

    from arm_ik_service.io.zenoh_bus import BusOptions
    from arm_ik_service.io.zenoh_streams import Bus
    from arm_ik_service.wire.keys import Keys

Pose = Literal["t_pose", "a_pose", "moving"]


@opens_client
def calibrate(
    session: Annotated[
        Path | None, typer.Argument(metavar="[SESSION]", help="A recording; without one, the person who is live.")
    ] = None,
    pose: Annotated[Pose, typer.Option(help="What the person does: stands in a pose, or just moves about.")] = "moving",
    avatar: Annotated[
        str | None, typer.Option(help="Whose controllers to listen to, or to take of a recording.")
    ] = None,
    seconds: Annotated[
        float, typer.Option(min=1.0, help="How long to listen, or what part of a recording to use.")
    ] = 60.0,
    name: Annotated[str | None, typer.Option(help="Save under this name, for --profile NAME.")] = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="FILE", help="Save to this file.")] = None,
    profile: ProfileName = None,
    prefix: Annotated[str, typer.Option(help="Key prefix, as in the service's settings.")] = "",
    json_output: Json = False,
    *,
    zenoh: BusOptions,
) -> None:
    """Measure a person: stature, arm lengths and how the controllers are held; says how sure it is.

    Live, what was measured is also put on avatar/<id>/calibration, and a running service takes it over at once.

    Example: [bold]arm-ik calibrate --avatar 7 --pose t_pose --seconds 5 --name anna[/bold]
    """
    import json
    from dataclasses import asdict

    import msgspec

    from arm_ik_service.calibration.calibrate import calibrate as measure
    from arm_ik_service.errors import SettingsError
    from arm_ik_service.io.profile_store import find_profile, profile_path, profile_toml, save_profile
    from arm_ik_service.programs.calibrator import describe
    from arm_ik_service.wire.keys import Keys, check_id

    if session is None and avatar is None:
        raise SettingsError("say whom to measure: a SESSION, or --avatar ID for someone who is live")
    path = profile_path(name) if name is not None else output
    start = find_profile(profile)
    if session is not None:
        calibration = measure(_recorded(session, avatar, seconds), pose, start)
    else:
        from arm_ik_service.io.zenoh_bus import open_client
        from arm_ik_service.io.zenoh_streams import put_once
        from arm_ik_service.wire.codec import encode

        who, keys = check_id(avatar or ""), Keys(prefix)
        with open_client(zenoh, waiting=say) as bus:
            calibration = measure(_live(bus, who, pose, seconds, keys), pose, start)
            put_once(bus, keys.calibration(who), encode(calibration.profile, "json"), "json")
    lines = describe(calibration)
    if path is not None:
        save_profile(calibration.profile, path, lines)
    if json_output:
        found = {**asdict(calibration), "profile": msgspec.to_builtins(calibration.profile)}
        typer.echo(json.dumps({**found, "confidence": calibration.confidence, "saved": str(path) if path else None}))
        return
    for line in lines:
        say(line)
    if path is None:
        typer.echo(profile_toml(calibration.profile, lines), nl=False)
    else:
        say(f"saved: {path}; use it with --profile {name or path}")


def _live(bus: Bus, avatar: str, pose: Pose, seconds: float, keys: Keys) -> np.ndarray[Any, Any]:
    """Tell the person what to do and listen."""
    import sys

    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    from arm_ik_service.programs.calibrator import POSES, as_records, gather_live

    say(POSES[pose])
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed:.0f} of {task.total:.0f} s"))
    with Progress(*columns, console=Console(stderr=True), disable=not sys.stderr.isatty()) as bar:
        task = bar.add_task(f"listening to {avatar}", total=seconds)
        frames = gather_live(bus, avatar, seconds, keys, lambda done: bar.update(task, completed=done))
    return as_records(frames)


def _recorded(session: Path, avatar: str | None, seconds: float) -> np.ndarray[Any, Any]:
    from itertools import takewhile

    from arm_ik_service.errors import SessionError
    from arm_ik_service.io.session import open_session
    from arm_ik_service.programs.calibrator import as_records

    recording = open_session(session)
    if avatar is None and len(recording.avatars) > 1:
        raise SessionError(f"{session} holds {', '.join(recording.avatars)}: choose with --avatar")
    frames = (recorded.frame for recorded in recording.frames() if avatar in (None, recorded.avatar))
    first = next(frames, None)
    if first is None:
        raise SessionError(f"{session}: no frame of {avatar!r} in it; it has {', '.join(recording.avatars)}")
    end_ns = first.sample_time_ns + int(seconds * 1e9)
    return as_records([first, *takewhile(lambda frame: frame.sample_time_ns <= end_ns, frames)])
