"""`arm-ik schema`."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

MessageName = Literal["ControllerFrame", "ArmsState", "Skeleton", "Health"]


def schema(
    message: Annotated[MessageName | None, typer.Argument(help="One message; default: all of them.")] = None,
) -> None:
    """Print the JSON Schema of the messages on the bus. MessagePack carries the same maps.

    Example: [bold]arm-ik schema ControllerFrame > controller_frame.schema.json[/bold]
    """
    import json
    from typing import get_args

    from arm_ik_service.wire import messages
    from arm_ik_service.wire.codec import json_schema

    if message is not None:
        typer.echo(json.dumps(json_schema(getattr(messages, message)), indent=2))
        return
    every = {name: json_schema(getattr(messages, name)) for name in get_args(MessageName)}
    typer.echo(json.dumps(every, indent=2))
