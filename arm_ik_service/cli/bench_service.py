"""`arm-ik bench latency`, `capacity`, `failover` and `soak`: the service as its clients see it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from arm_ik_service.cli.bench import bench
from arm_ik_service.cli.options import Json, say

if TYPE_CHECKING:
    from arm_ik_service.bench.attached import Attached
    from arm_ik_service.bench.capacity import Step
    from arm_ik_service.bench.load import Measured

__all__ = ["bench"]  # with the commands below

Rate = Annotated[float, typer.Option("--rate", min=1.0, max=1000.0, metavar="HZ", help="Frames a second and person.")]


@bench.command()
def latency(
    rate: Rate = 90.0,
    frames: Annotated[int, typer.Option(min=10, metavar="N", help="Frames to the service, and as many echoes.")] = 2000,
    view: Annotated[bool, typer.Option("--view", help="With a viewer attached, which writes to a file.")] = False,
    sinks: Annotated[
        bool, typer.Option("--sinks", help="Instead of an echo: the same service with all of `arm-ik export` attached.")
    ] = False,
    json_output: Json = False,
) -> None:
    """Controllers-in to arms-out of one person, beside a bare Python Zenoh echo of the same sizes.

    Service and echo run as processes; frames and echoes take turns, so that noise falls on both alike. With --sinks
    blocks of frames take turns: nobody else, a process that listens and does nothing, and the sinks of all dialects.

    Example: [bold]arm-ik bench latency --frames 5000 --view[/bold]

    Example: [bold]arm-ik bench latency --frames 5000 --sinks[/bold]
    """
    import json
    import tempfile
    from pathlib import Path

    from arm_ik_service.bench.latency import measure_latency
    from arm_ik_service.cli.progress import frames_progress
    from arm_ik_service.errors import SettingsError

    if sinks:
        if view:
            raise SettingsError("--view or --sinks: one at a time tells what each costs")
        _latency_with_sinks(rate, frames, json_output=json_output)
        return
    with tempfile.TemporaryDirectory() as folder, frames_progress("bench latency", frames) as advance:
        file = str(Path(folder) / "view.rrd") if view else None
        result = measure_latency(rate_hz=rate, frames=frames, view=file, progress=advance)
    if json_output:
        typer.echo(json.dumps(result.as_json()))
        return
    rows: list[tuple[str, ...]] = [
        (name, f"{trips.p50_ms:.3f}", f"{trips.p99_ms:.3f}", f"{trips.max_ms:.1f}", f"{trips.answered}/{trips.sent}")
        for name, trips in (("service", result.service), ("bare echo", result.echo))
    ]
    rows.append(("ratio", f"{result.p50_ratio:.2f}", f"{result.p99_ratio:.2f}", "", ""))
    title = f"{result.frame_bytes} bytes in, {result.answer_bytes} out, {rate:g} Hz"
    _print(title + (", with a viewer" if view else ""), ("", "p50 ms", "p99 ms", "max ms", "answered"), rows)


BLOCK_S = 10.0  # of one arrangement at a time: the machine's own noise changes more slowly


def _latency_with_sinks(rate: float, frames: int, *, json_output: bool) -> None:
    import json

    from arm_ik_service.bench.attached import ARRANGEMENTS, measure_attached
    from arm_ik_service.cli.progress import frames_progress

    rounds = max(1, round(frames / (BLOCK_S * rate)))
    each = frames // rounds
    with frames_progress("bench latency --sinks", len(ARRANGEMENTS) * rounds * each) as advance:
        result = measure_attached(rate_hz=rate, frames=each, rounds=rounds, progress=advance)
    if json_output:
        typer.echo(json.dumps(result.as_json()))
        return
    rows = [_arrangement_row(result, name) for name in ARRANGEMENTS]
    title = f"{rounds} rounds of {each} frames at {rate:g} Hz: medians of blocks, ratios within a round"
    _print(title, ("", "p50 ms", "ratio", "p99 ms", "ratio"), rows)


def _arrangement_row(result: Attached, name: str) -> tuple[str, ...]:
    called = {"alone": "nobody else", "listener": "a silent listener", "sinks": "all sinks"}[name]
    numbers = (result.p50_ms(name), result.p50_ratio(name), result.p99_ms(name), result.p99_ratio(name))
    return (called, *(f"{number:.3f}" for number in numbers))


@bench.command()
def capacity(
    rate: Rate = 72.0,
    seconds: Annotated[float, typer.Option(min=1.0, help="For each number of people.")] = 10.0,
    json_output: Json = False,
) -> None:
    """Raise the number of people until frames are lost or late; the same without the solve; then twice that many.

    Carried are those of whom 99 % of the frames are answered, 99 % of these within 13.9 ms in the service and 20 ms at
    the client. Both kinds of service are loaded in turns, by processes that share the machine.

    Example: [bold]arm-ik bench capacity --seconds 20[/bold]
    """
    import json

    from arm_ik_service.bench.capacity import measure_capacity, most_carried

    def progress(kind: str, measured: Measured) -> None:
        say(f"{kind}: {measured.avatars} people, {measured.answered_share:.1%} answered")

    result = measure_capacity(rate_hz=rate, seconds=seconds, progress=progress)
    if json_output:
        typer.echo(json.dumps(result.as_json()))
        return
    rows = [_row("service", step) for step in result.service] + [_row("without solve", step) for step in result.empty]
    if result.overload is not None:
        rows.append(_row("service, twice", result.overload))
    _print(f"{rate:g} Hz, {seconds:g} s each", _HEADINGS, rows)
    carried, empty = most_carried(result.service), most_carried(result.empty)
    typer.echo(f"carried: {carried} people; without solve: {empty}; ratio {result.ratio:.2f}")


@bench.command()
def soak(
    avatars: Annotated[int, typer.Option(min=1, max=2000, help="People.")] = 100,
    rate: Rate = 72.0,
    seconds: Annotated[float, typer.Option(min=3.0, help="For how long.")] = 1200.0,
    json_output: Json = False,
) -> None:
    """Load one service for long, and see whether its memory or its latency grows.

    Example: [bold]arm-ik bench soak --avatars 100 --seconds 1200[/bold]
    """
    import json

    from arm_ik_service.bench.soak import measure_soak

    result = measure_soak(avatars=avatars, rate_hz=rate, seconds=seconds)
    if json_output:
        typer.echo(json.dumps(result.as_json()))
        return
    _print(f"{rate:g} Hz, {seconds:g} s", _HEADINGS, [_row("service", result.step)])
    typer.echo(
        f"memory {result.step.memory_mb:.0f} MB, slope {result.step.memory_slope_mb_h:+.2f} MB/h once settled; "
        f"p99 of the first third {result.first_p99_ms:.2f} ms, of the last {result.last_p99_ms:.2f} ms"
    )


@bench.command()
def failover(
    avatars: Annotated[int, typer.Option(min=2, max=1000, help="People, shared by two services.")] = 100,
    rate: Rate = 72.0,
    cut: Annotated[
        bool, typer.Option("--cut", help="Cut the link of a network namespace instead (Linux, root).")
    ] = False,
    json_output: Json = False,
) -> None:
    """Kill one of two services that share people, start it again, and see how long nobody answered.

    Example: [bold]arm-ik bench failover --avatars 100[/bold]
    """
    import json

    from arm_ik_service.bench.failover import measure_failover

    result = measure_failover(avatars=avatars, rate_hz=rate, cut=cut)
    if json_output:
        typer.echo(json.dumps(result.as_json()))
        return
    happened = "link cut" if cut else "kill -9"
    rows = [
        ("longest without an answer, before", f"{1e3 * result.steady_gap_s:.0f} ms"),
        (f"after {happened}", f"{1e3 * result.lost_gap_s:.0f} ms"),
        ("people left without an answer", str(result.unanswered)),
        ("when it came back", f"{1e3 * result.joined_gap_s:.0f} ms"),
        ("frames answered twice, while it came back", str(result.doubles_joining)),
        ("frames answered twice, settled", str(result.doubles_settled)),
        ("people of each service", ", ".join(f"{name} {share}" for name, share in result.shares.items())),
        ("people who are not where they belong", str(result.misplaced)),
    ]
    _print(f"{avatars} people at {rate:g} Hz", ("", ""), rows)


_HEADINGS = (
    "",
    "people",
    "answered %",
    "least %",
    "most %",
    "service p50 ms",
    "p99",
    "client p50 ms",
    "p99",
    "max",
    "MB",
    "carried",
)


def _row(name: str, step: Step) -> tuple[str, ...]:
    measured = step.measured
    shares = (measured.answered_share, measured.least_share, measured.most_share)
    times = (
        measured.service_p50_ms,
        measured.service_p99_ms,
        measured.client_p50_ms,
        measured.client_p99_ms,
        measured.client_max_ms,
    )
    return (
        name,
        str(measured.avatars),
        *(f"{100.0 * share:.1f}" for share in shares),
        *(f"{ms:.2f}" for ms in times),
        f"{step.memory_mb:.0f}",
        "yes" if step.carried else "no",
    )


def _print(title: str, headings: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, show_header=any(headings))
    for n, heading in enumerate(headings):
        table.add_column(heading, justify="left" if n == 0 else "right")
    for row in rows:
        table.add_row(*row)
    # a pipe has no width of its own: give the table what it needs
    wide = Console()
    (wide if wide.is_terminal else Console(width=160)).print(table)
