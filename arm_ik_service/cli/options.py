"""Options that several commands share, and how each becomes what the programs take."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

if TYPE_CHECKING:
    from arm_ik_service.io.rerun_view import Skin

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
