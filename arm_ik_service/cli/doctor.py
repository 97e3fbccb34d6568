"""`arm-ik doctor`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from arm_ik_service.cli.options import Json
from arm_ik_service.cli.zenoh_options import opens_client

if TYPE_CHECKING:
    from arm_ik_service.io.zenoh_bus import BusOptions


_SIGNS = {"well": "[green]well[/green]", "note": "[yellow]note[/yellow]", "ill": "[red]ill[/red]"}


@opens_client
def doctor(
    prefix: Annotated[str, typer.Option(help="Key prefix, as in the service's settings.")] = "",
    json_output: Json = False,
    *,
    zenoh: BusOptions,
) -> None:
    """Look at everything that is known to go wrong: versions, kernels, viewer, certificates, ports, Zenoh.

    Exit code 1 if anything is ill; each finding comes with its cure.

    Example: [bold]arm-ik doctor --connect tcp/192.168.1.5:7447[/bold]
    """
    import json

    from rich.console import Console

    from arm_ik_service.programs.doctor import examine
    from arm_ik_service.wire.keys import Keys

    console = Console(highlight=False, soft_wrap=True)
    findings = []
    for finding in examine(zenoh, Keys(prefix)):
        findings.append(finding)
        if not json_output:
            console.print(f"{_SIGNS[finding.state]}  {finding.what}: ", end="")
            console.print(finding.found, markup=False)
            if finding.cure:
                console.print(f"      {finding.cure}", markup=False)
    if json_output:
        typer.echo(json.dumps({"findings": [finding._asdict() for finding in findings]}))
    if any(finding.state == "ill" for finding in findings):
        raise typer.Exit(1)
