"""The Zenoh options, which every command that opens a session takes alike.

A command states one argument, `zenoh: BusOptions`; the decorator gives the command line the options that make it up.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

if TYPE_CHECKING:
    from arm_ik_service.io.zenoh_bus import BusOptions

_PANEL = "Zenoh"
_ARGUMENT = "zenoh"

Connect = Annotated[
    list[str] | None,
    typer.Option(
        "--connect",
        metavar="ENDPOINT",
        help="Zenoh endpoint to connect to, e.g. tcp/127.0.0.1:7447.",
        rich_help_panel=_PANEL,
    ),
]
Listen = Annotated[
    list[str] | None,
    typer.Option("--listen", metavar="ENDPOINT", help="Zenoh endpoint to listen on.", rich_help_panel=_PANEL),
]
Scouting = Annotated[
    bool,
    typer.Option("--scouting/--no-scouting", help="Find other Zenoh peers by multicast.", rich_help_panel=_PANEL),
]
ZenohConfig = Annotated[
    Path | None,
    typer.Option("--zenoh-config", metavar="FILE", help="A whole Zenoh configuration, JSON5.", rich_help_panel=_PANEL),
]
TlsCertificate = Annotated[
    Path | None,
    typer.Option("--tls-cert", metavar="FILE", help="Our own certificate, PEM.", rich_help_panel=_PANEL),
]
TlsKey = Annotated[
    Path | None,
    typer.Option("--tls-key", metavar="FILE", help="The key of --tls-cert, PEM.", rich_help_panel=_PANEL),
]
TlsAuthority = Annotated[
    Path | None,
    typer.Option(
        "--tls-ca",
        metavar="FILE",
        help="The authority that signs everybody's certificates, PEM; see arm-ik certificates.",
        rich_help_panel=_PANEL,
    ),
]
Access = Annotated[
    Path | None,
    typer.Option(
        "--access",
        metavar="FILE",
        help="Who may read and write what, by certificate: access.json of arm-ik certificates.",
        rich_help_panel=_PANEL,
    ),
]


def _gathered(
    connect: Connect = None,
    listen: Listen = None,
    scouting: Scouting = False,
    zenoh_config: ZenohConfig = None,
    tls_cert: TlsCertificate = None,
    tls_key: TlsKey = None,
    tls_ca: TlsAuthority = None,
    access: Access = None,
) -> BusOptions:
    """Gather the options. Raises SettingsError where some of what TLS needs is missing."""
    from arm_ik_service.errors import SettingsError
    from arm_ik_service.io.zenoh_bus import BusOptions, TlsFiles

    tls = None
    if tls_cert and tls_key and tls_ca:
        tls = TlsFiles(tls_cert, tls_key, tls_ca)
    elif tls_cert or tls_key or tls_ca:
        raise SettingsError(
            "--tls-cert, --tls-key and --tls-ca belong together: both sides of a link show who they are"
        )
    if access and not tls:
        raise SettingsError("--access tells people apart by their certificates: it needs --tls-cert --tls-key --tls-ca")
    return BusOptions(tuple(connect or ()), tuple(listen or ()), scouting, zenoh_config, tls, access)


def _taking(command: Callable[..., None], *, without: frozenset[str]) -> Callable[..., None]:
    """Put the parameters of `_gathered` but some in the place of the command's `zenoh`."""
    names = {"BusOptions": object}  # imported for the type checker alone: the help does not wait for Zenoh
    options = [one for name, one in inspect.signature(_gathered).parameters.items() if name not in without]

    @functools.wraps(command)
    def run(**given: Any) -> None:
        zenoh = _gathered(**{option.name: given.pop(option.name) for option in options})
        command(**given, **{_ARGUMENT: zenoh})

    hints = get_type_hints(command, localns=names, include_extras=True)
    hints |= get_type_hints(_gathered, localns=names, include_extras=True)
    own = [parameter for parameter in inspect.signature(command).parameters.values() if parameter.name != _ARGUMENT]
    parameters = [
        parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY, annotation=hints[parameter.name])
        for parameter in (*own, *options)
    ]
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run


def opens_client(command: Callable[..., None]) -> Callable[..., None]:
    """Let a command that connects to a service take the Zenoh options."""
    return _taking(command, without=frozenset({"access"}))


def opens_hub(command: Callable[..., None]) -> Callable[..., None]:
    """Let a command that others connect to take the Zenoh options and `--access`."""
    return _taking(command, without=frozenset())
