"""`arm-ik demo`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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

if TYPE_CHECKING:
    from rich.table import Table

    from arm_ik_service.programs.summary import Summary


def demo(
    session: Annotated[
        str, typer.Argument(metavar="SESSION", help="A bundled recording by name, or any recording.")
    ] = "reach_and_grab",
    save: Annotated[
        Path | None, typer.Option("--save", metavar="FILE", help="Write the view to this .rrd, display or not.")
    ] = None,
    no_view: Annotated[bool, typer.Option("--no-view", help="Without a picture: the table only.")] = False,
    avatar: AvatarFile = None,
    skinning: SkinningChoice = None,
    overlays: Show = None,
) -> None:
    """Play a recording through a service and watch both arms move, all of it on this machine.

    Opens the Rerun viewer where there is a display, and writes an .rrd file where there is none.

    Example: [bold]arm-ik demo boxing[/bold]
    """
    from threading import Event

    from rich.console import Console
    from rich.live import Live

    from arm_ik_service.io.rerun_view.sinks import has_display
    from arm_ik_service.programs.demo import bundled_session, run_demo
    from arm_ik_service.wire.messages import ArmsState

    path = bundled_session(session)
    if save is None and not no_view and not has_display():
        save = Path(f"arm-ik-demo-{path.stem}.rrd")
    view = [] if no_view else (["--save", str(save)] if save else ["--spawn"])
    if view:
        skin_options(avatar, skinning)  # one that cannot be used is refused before anything starts
        view += ["--avatar", str(avatar)] if avatar is not None else []
        view += ["--skinning", skinning] if skinning is not None else []
        show_option(overlays)
        view += ["--show", overlays] if overlays is not None else []
    stopped = Event()
    console = Console(stderr=True)
    say(f"{path.stem}: replay -> Zenoh -> service -> Zenoh -> {'nobody' if no_view else save or 'Rerun'}")
    with stopped_by_signals(stopped.set), Live(console=console, refresh_per_second=5, transient=True) as live:

        def show(summary: Summary, state: ArmsState) -> None:
            live.update(_table(summary, state))

        summary = run_demo(path, view, say=say, show=show, stopped=stopped)
    typer.echo(f"{path.stem}: summary")
    for name, text in summary.rows():
        typer.echo(f"  {name:38s} {text}")
    if save is not None and not no_view:
        typer.echo(f"to look at it: rerun {save}    (or in a browser: rerun --web-viewer {save})")


def _table(summary: Summary, state: Any) -> Table:
    """Return the live table: how it goes, and both arms as they are now."""
    from rich.table import Table

    p50, p99 = _latency(summary)
    table = Table(
        title=f"{summary.frames} frames, {summary.rate_hz:.0f} Hz, latency p50 {p50:.2f} ms, p99 {p99:.2f} ms"
    )
    for heading in ("", "tracking", "residual", "reach", "elbow", "pronation", "iterations", "at its limit"):
        table.add_column(heading, justify="left" if heading in ("", "tracking", "at its limit") else "right")
    for side, arm in (("left", state.left), ("right", state.right)):
        table.add_row(
            side,
            arm.tracking,
            f"{1e3 * arm.position_error_m:.1f} mm",
            f"{100 * arm.reach_ratio:.0f} %",
            f"{57.29578 * arm.angles.elbow_flexion:.0f}°",
            f"{57.29578 * arm.angles.pronation:.0f}°",
            str(arm.iterations),
            ", ".join(arm.limits),
        )
    return table


def _latency(summary: Summary) -> tuple[float, float]:
    from arm_ik_service.programs.summary import percentiles

    p50, p99 = percentiles(summary.service_ms[-500:], 50, 99)
    return p50, p99
