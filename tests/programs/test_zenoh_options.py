"""Every command that opens a Zenoh session takes the same options: who can reach one service can use all of it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import typer

from arm_ik_service.cli import app

OPTIONS = {
    "--connect",
    "--listen",
    "--scouting",
    "--no-scouting",
    "--zenoh-config",
    "--tls-cert",
    "--tls-key",
    "--tls-ca",
}


def commands(group: Any, path: str = "") -> Iterator[tuple[str, set[str]]]:
    """Yield the full name and the options of every command."""
    for name, command in getattr(group, "commands", {}).items():
        if hasattr(command, "commands"):
            yield from commands(command, f"{path}{name} ")
        else:
            yield path + name, {flag for p in command.params for flag in (*p.opts, *p.secondary_opts)}


EVERY = dict(commands(typer.main.get_command(app)))


@pytest.mark.parametrize("command", [name for name, options in EVERY.items() if options & OPTIONS])
def test_a_command_that_takes_one_of_the_zenoh_options_takes_them_all(command: str) -> None:
    assert EVERY[command] >= OPTIONS


def test_services_and_clients_are_among_them() -> None:
    on_the_bus = {name for name, options in EVERY.items() if options >= OPTIONS}
    assert {"serve", "router", "replay", "record", "view", "calibrate", "export", "grab", "top", "doctor"} <= on_the_bus
    assert {"bridge web", "bridge openxr"} <= on_the_bus
