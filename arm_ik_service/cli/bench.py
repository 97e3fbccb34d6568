"""`arm-ik bench`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from arm_ik_service.cli.options import Json, say, stopped_by_signals

if TYPE_CHECKING:
    from rich.console import Console

    from arm_ik_service.bench.contender import Contender
    from arm_ik_service.bench.solvers import Comparison

bench = typer.Typer(
    name="bench", help="Measure on this machine what the README claims.", no_args_is_help=True, rich_markup_mode="rich"
)


@bench.callback()
def _group() -> None:
    pass


@bench.command()
def solvers(
    sessions: Annotated[list[Path], typer.Argument(metavar="SESSION...", help="Recordings: .npz, .bsor or .mcap.")],
    solver: Annotated[
        list[str] | None,
        typer.Option("--solver", metavar="NAME[:OPTION=VALUE,...]", help="Only these, ours or peers; may be repeated."),
    ] = None,
    frames: Annotated[
        int, typer.Option(min=2, metavar="N", help="At most so many consecutive frames of each session, its middle.")
    ] = 1000,
    json_output: Json = False,
    save: Annotated[
        Path | None, typer.Option("--save", metavar="FILE.rrd", help="Write all arms, as ghosts, for Rerun.")
    ] = None,
) -> None:
    """Run all solvers over the same arms, targets and tolerances: ours, and peers where they are installed.

    Targets are the recorded wrists of motion-capture sessions, with the recorded shoulder; of other sessions, what the
    pipeline asks of the arms. Hands are solved to 0.5 mm and 0.3 degrees, frame by frame, each from the frame before.

    Example: [bold]arm-ik bench solvers dance.npz --solver jacobian_transpose --solver mink --save dance.rrd[/bold]
    """
    import json
    from threading import Event

    from arm_ik_service.bench.arm_tasks import read_tasks
    from arm_ik_service.bench.contender import Tolerances
    from arm_ik_service.bench.solvers import compare
    from arm_ik_service.cli.progress import frames_progress

    contenders, absent = _contenders(solver)
    tasks = [task for session in sessions for task in read_tasks(session, frames)]
    stopped = Event()
    total = len(contenders) * sum(len(task.targets) for task in tasks)
    with stopped_by_signals(stopped.set), frames_progress("bench solvers", total) as advance:
        comparison = compare(
            tasks, contenders, Tolerances(), progress=lambda _, done: advance(done), stopped=stopped.is_set
        )
    if comparison.interrupted:
        say(f"stopped: {len(comparison.tasks)} of {len(tasks)} arms were measured")
    if json_output:
        typer.echo(json.dumps(comparison.as_json(absent)))
    elif comparison.tasks:
        from rich.console import Console

        terminal = Console()
        # a pipe has no width of its own: give the tables what they need
        _show(terminal if terminal.is_terminal else Console(width=130), comparison)
        for name, why in absent.items():
            typer.echo(f"{name}: {why}")
    if save is not None and comparison.tasks:
        from arm_ik_service.bench.ghosts import save_ghosts

        save_ghosts(save, comparison)
        say(f"to look at all arms: rerun {save}")
    if comparison.interrupted:
        raise typer.Exit(1)


def _contenders(wanted: list[str] | None) -> tuple[list[Contender], dict[str, str]]:
    """What to measure, and the peers that cannot be, with the reason. Raises SettingsError for an unknown name."""
    from arm_ik_service.bench.contender import own
    from arm_ik_service.bench.peers import PEERS
    from arm_ik_service.errors import SettingsError
    from arm_ik_service.ik.registry import SOLVERS, parse_solver

    peers = {peer.name: peer for peer in PEERS}
    chosen: list[Contender] = []
    absent: dict[str, str] = {}
    for text in dict.fromkeys(wanted or [*SOLVERS, *peers]):
        choice = parse_solver(text)
        if choice.name in SOLVERS:
            chosen.append(own(choice))
        elif choice.name not in peers:
            raise SettingsError(
                f"solver {choice.name!r} is unknown: ours are {', '.join(SOLVERS)}; peers {', '.join(peers)}"
            )
        elif choice.options:
            raise SettingsError(f"{choice.name} is a peer and is run as its documentation recommends, without options")
        elif isinstance(peer := peers[choice.name].load(), str):
            absent[choice.name] = peer
        else:
            chosen.append(peer)
    if not chosen:
        raise SettingsError("; ".join(f"{name} is {why}" for name, why in absent.items()))
    return chosen, absent


# heading, field of Summary, format
COST = (
    ("µs p50", "us_p50", "{:.1f}"),
    ("p99", "us_p99", "{:.1f}"),
    ("iterations p50", "iterations_p50", "{:.0f}"),
    ("p95", "iterations_p95", "{:.0f}"),
    ("mm p50", "position_mm_p50", "{:.2f}"),
    ("p99", "position_mm_p99", "{:.2f}"),
    ("degrees p99", "orientation_deg_p99", "{:.2f}"),
)
BEHAVIOUR = (
    ("stuck", "stuck", "{:d}"),
    ("of it alone", "stuck_unlike_others", "{:d}"),
    ("outside limits %", "outside_limits_percent", "{:.2f}"),
    ("elbow off cm", "elbow_cm", "{:.2f}"),
    ("elbow steps", "elbow_steps", "{:d}"),
    ("elbow jerk m/s³", "elbow_jerk", "{:.0f}"),
)
LEGEND = """\
limits: all = the arm's own; box = its six hinges and a box around the shoulder's region; none.
Times are of one arm and frame; {name} is timed in blocks of {block} frames, the others frame by frame.
stuck: frames with the hand more than 10 mm off; of it alone: where another solver inside the limits met the target.
outside limits: frames beyond a limit of the arm by more than a degree. elbow off: from the recorded elbow.
elbow steps: frames into which it moves more than 5 cm. elbow jerk: root mean square."""


def _show(console: Console, comparison: Comparison) -> None:
    """Print two tables and what their headings mean."""
    from rich.table import Table

    from arm_ik_service.bench.contender import COMPILED_BLOCK
    from arm_ik_service.ik.registry import DEFAULT

    rows = comparison.summaries()
    about = {contender.name: contender for contender in comparison.contenders}
    frames = sum(len(task.targets) for task in comparison.tasks)
    position_mm = 1e3 * comparison.tolerances.position_m
    orientation_deg = math.degrees(comparison.tolerances.orientation_rad)
    console.print(f"{len(comparison.tasks)} arms, {frames} frames, to {position_mm:g} mm and {orientation_deg:.1f}°")
    for fact, columns in (("version", COST), ("limits", BEHAVIOUR)):
        table = Table()
        for heading in ("solver", fact):
            table.add_column(heading, no_wrap=True)
        for heading, _, _ in columns:
            table.add_column(heading, justify="right")
        for name, summary in rows.items():
            values = [(getattr(summary, field), form) for _, field, form in columns]
            texts = ["" if value is None else form.format(value) for value, form in values]
            if any(texts):
                table.add_row(name, str(getattr(about.get(name), fact, "")), *texts)
        console.print(table)
    console.print(LEGEND.format(name=DEFAULT, block=COMPILED_BLOCK), highlight=False, soft_wrap=True)
