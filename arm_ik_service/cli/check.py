"""`arm-ik check`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from arm_ik_service.cli.options import Json, ProfileName, SettingsFile, say

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.console import Console
    from rich.table import Table

    from arm_ik_service.body.report import ArmReport
    from arm_ik_service.io.session import RecordedFrame
    from arm_ik_service.programs.checker import PersonReport
    from arm_ik_service.tracking.report import DeviceReport
    from arm_ik_service.wire.messages import ArmsState

SHOWN = 4  # glitches and gaps listed by time; --json has them all


def check(
    session: Annotated[Path, typer.Argument(metavar="SESSION", help="A .mcap, .bsor or .npz recording.")],
    avatar: Annotated[str | None, typer.Option(help="Only this one of several people.")] = None,
    profile: ProfileName = None,
    settings: SettingsFile = None,
    save: Annotated[
        Path | None, typer.Option("--save", metavar="FILE", help="Also write the solve as plots to this Rerun .rrd.")
    ] = None,
    json_output: Json = False,
) -> None:
    """Report on a recording: rates, gaps, glitches, losses, speeds, reach; and on how well it solves.

    Example: [bold]arm-ik check session.bsor --save session.rrd[/bold]
    """
    import json
    from contextlib import ExitStack
    from dataclasses import asdict

    from rich.console import Console as Terminal

    from arm_ik_service.cli.progress import frames_progress
    from arm_ik_service.io.profile_store import find_profile
    from arm_ik_service.io.session import open_session
    from arm_ik_service.programs.checker import check_avatar
    from arm_ik_service.programs.offline import profiles_for
    from arm_ik_service.settings import load_settings

    recording = open_session(session)
    used_settings = load_settings(settings)
    used = profiles_for(recording, find_profile(profile) if profile else None)
    reports = []
    with ExitStack() as stack:
        also: Callable[[RecordedFrame, ArmsState], None] | None = None
        if save is not None:
            from arm_ik_service.io.rerun_view import RerunView, Save
            from arm_ik_service.skeleton import skeleton_of

            view = stack.enter_context(RerunView(Save(save), name=session.name))
            for name in recording.avatars:
                view.describe(skeleton_of(name, used[name]))

            def also(recorded: RecordedFrame, state: ArmsState) -> None:
                view.add(state, recorded.frame)

        for name in [avatar] if avatar is not None else recording.avatars:
            with frames_progress(f"{session.name}: {name}", recording.frame_count) as progress:
                reports.append(check_avatar(recording, name, used, used_settings, progress=progress, also=also))
    if json_output:
        report = {"session": str(session), "avatars": [asdict(one) for one in reports], "warnings": recording.warnings}
        typer.echo(json.dumps(report))
    else:
        console = Terminal()
        for one in reports:
            _print(console, one)
    for warning in recording.warnings:
        say(f"warning: {warning}")
    if save is not None:
        say(f"to look at it: rerun {save}")


def _times(times: tuple[float, ...]) -> str:
    """Return the first few times, and how many more there are."""
    if not times:
        return "none"
    more = f" and {len(times) - SHOWN} more" if len(times) > SHOWN else ""
    return f"{len(times)}, at " + ", ".join(f"{time:.2f}" for time in times[:SHOWN]) + f" s{more}"


def _print(console: Console, report: PersonReport) -> None:
    """Show one avatar: the stream, its devices, its arms."""
    stream = report.devices
    console.print(
        f"[bold]{report.avatar}[/bold]: {stream.frames} frames in {stream.seconds:.1f} s, {stream.rate_hz:.1f} Hz; "
        f"intervals p1 {1e3 * stream.interval_p1_s:.1f} ms, p99 {1e3 * stream.interval_p99_s:.1f} ms"
    )
    gaps = tuple(start for start, _ in stream.gaps)
    longest = max((length for _, length in stream.gaps), default=0.0)
    console.print(
        f"refused {stream.refused}, repeated times {stream.repeated_times}, clock steps {stream.clock_steps}; "
        f"gaps: {_times(gaps)}{f', the longest {longest:.2f} s' if gaps else ''}; "
        f"recentres: {_times(stream.recentre_times_s)}"
    )
    console.print(_table(dict(zip(stream.devices, map(_device, stream.devices.values()), strict=True))))
    console.print(_table(dict(zip(report.arms, map(_arm, report.arms.values()), strict=True))))


def _table(columns: dict[str, dict[str, str]]) -> Table:
    """Return a table with a measure a row and a device or an arm a column: it fits a narrow terminal."""
    from rich.table import Table

    table = Table("", *columns)
    for measure in next(iter(columns.values())):
        table.add_row(measure, *(column[measure] for column in columns.values()))
    return table


def _device(device: DeviceReport) -> dict[str, str]:
    return {
        "tracked": f"{100 * device.tracked:.1f} %",
        "inferred": f"{100 * device.inferred:.1f} %",
        "held": f"{100 * device.held:.1f} %",
        "lost": f"{100 * device.lost:.1f} %",
        "longest loss": f"{device.longest_loss_s:.2f} s",
        "speed p50": f"{device.speed_p50_m_s:.2f} m/s",
        "speed p99, max": f"{device.speed_p99_m_s:.2f}, {device.speed_max_m_s:.2f} m/s",
        "turn p99, max": f"{57.3 * device.turn_p99_rad_s:.0f}, {57.3 * device.turn_max_rad_s:.0f} °/s",
        "glitches": _times(device.glitch_times_s),
    }


def _arm(arm: ArmReport) -> dict[str, str]:
    limits = [f"{name} {100 * share:.0f} %" for name, share in list(arm.limit_time.items())[:SHOWN]]
    return {
        "residual p50, p99": f"{1e3 * arm.position_error_p50_m:.2f}, {1e3 * arm.position_error_p99_m:.2f} mm",
        "rotation p50, p99": f"{57.3 * arm.orientation_error_p50_rad:.2f}, {57.3 * arm.orientation_error_p99_rad:.2f}°",
        "reach p50, p99": f"{100 * arm.reach_p50:.0f}, {100 * arm.reach_p99:.0f} %",
        "beyond reach": f"{100 * arm.out_of_reach:.1f} %",
        "iterations p50, p99": f"{arm.iterations_p50:.0f}, {arm.iterations_p99:.0f}",
        "longest elbow step": f"{100 * arm.elbow_step_max_m:.1f} cm",
        "elbow flips": str(arm.elbow_flips),
        "elbow jerk": f"{arm.elbow_jerk_rms_m_s3:.0f} m/s³",
        "time at limits": "\n".join(limits) or "none",
    }
