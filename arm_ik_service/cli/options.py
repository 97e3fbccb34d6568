"""Options that several commands share, and how each becomes what the programs take."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

if TYPE_CHECKING:
    from arm_ik_service.io.rerun_view import Overlay, Skin

ProfileName = Annotated[
    str | None,
    typer.Option("--profile", metavar="NAME|FILE", help="Calibration profile: a saved one by name, or a TOML file."),
]
SettingsFile = Annotated[
    Path | None,
    typer.Option("--settings", metavar="FILE", help="Settings that differ from the defaults, TOML."),
]
AvatarFile = Annotated[
    Path | None,
    typer.Option(
        "--avatar",
        metavar="FILE",
        help="Draw people as this humanoid: .glb, .gltf, .vrm, or .obj with a .weights.json beside it.",
        rich_help_panel="Skin",
    ),
]
SkinningChoice = Annotated[
    Literal["linear", "dual_quaternion"] | None,
    typer.Option(
        "--skinning",
        help="How the skin follows the bones (dual_quaternion). Without --avatar: draw our own skinned arms.",
        rich_help_panel="Skin",
    ),
]
Show = Annotated[
    str | None,
    typer.Option(
        "--show",
        metavar="WHAT,...",
        help="What else is drawn of each arm: [bold]reach[/bold], the ball around the shoulder that the wrist cannot "
        "leave; [bold]swivel[/bold], the circle on which the elbow can go for this wrist, bright where the shoulder "
        "lets it, in a bracket where it is comfortable; "
        "[bold]limits[/bold], the region of the shoulder and a dial for each joint, red where the arm rests "
        "on a limit; [bold]ghost[/bold], the hand where the raw target has it; or [bold]all[/bold].",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object for machines instead of text.")]


def skin_options(avatar: Path | None, skinning: Literal["linear", "dual_quaternion"] | None) -> Skin | None:
    """Return what people are drawn as; None, as solids, where nothing was asked. Raises SkinError."""
    if avatar is None and skinning is None:
        return None
    from arm_ik_service.io.rerun_view import Skin
    from arm_ik_service.skin.load import load_avatar, load_built_in_arms

    character = load_avatar(avatar) if avatar is not None else load_built_in_arms()
    for note in character.notes:
        say(f"{avatar}: {note}")
    return Skin(character, skinning or "dual_quaternion")


def show_option(show: str | None) -> frozenset[Overlay]:
    """Return the overlays that were asked for by name. Raises SettingsError."""
    if show is None:
        return frozenset()
    from arm_ik_service.errors import SettingsError
    from arm_ik_service.io.rerun_view import OVERLAYS

    names = {name.strip() for name in show.split(",")}
    if "all" in names:
        return frozenset(OVERLAYS)
    if unknown := names - set(OVERLAYS):
        raise SettingsError(f"--show {', '.join(sorted(unknown))}: choose from {', '.join(OVERLAYS)}, or all")
    return frozenset(overlay for overlay in OVERLAYS if overlay in names)


@contextmanager
def stopped_by_signals(stop: Callable[[], None]) -> Iterator[None]:
    """Within the block Ctrl-C and SIGTERM call `stop`, so that the work ends cleanly; a second Ctrl-C interrupts."""

    def handle(number: int, frame: Any) -> None:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        stop()

    previous = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


def say(text: str) -> None:
    """Write a line for people: to standard error, so that output stays clean for machines."""
    typer.echo(text, err=True)
