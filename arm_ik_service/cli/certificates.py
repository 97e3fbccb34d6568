"""`arm-ik certificates`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from arm_ik_service.cli.options import say


def certificates(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Where all of it is written, and kept.")],
    service: Annotated[
        list[str] | None, typer.Option("--service", metavar="NAME", help="A service, or a router; may be repeated.")
    ] = None,
    host: Annotated[
        list[str] | None,
        typer.Option("--host", metavar="ADDRESS", help="Name or address at which services are reached; repeatable."),
    ] = None,
    headset: Annotated[
        list[str] | None, typer.Option("--headset", metavar="ID", help="An avatar's id; may be repeated.")
    ] = None,
    viewer: Annotated[
        list[str] | None, typer.Option("--viewer", metavar="NAME", help="Somebody who only looks; may be repeated.")
    ] = None,
    days: Annotated[int, typer.Option(min=1, max=3650, help="For how long they are valid.")] = 365,
    prefix: Annotated[str, typer.Option(help="Key prefix, as in the service's settings.")] = "",
) -> None:
    """Make an authority and certificates for a lab, and the access rules that go with them.

    Headset 7 may then write avatar/7/controllers and read avatar/7/arms, and nothing else. Run it again to add others:
    what is there is kept. Give each machine ca.pem and its own pair, nothing more; ca.key stays where it is.

    Example: [bold]arm-ik certificates lab --service main --host 192.168.1.5 --headset 7 --viewer screen[/bold]

    Then: [bold]arm-ik serve --listen tls/0.0.0.0:7447 --tls-ca lab/ca.pem --tls-cert lab/service-main.pem
    --tls-key lab/service-main.key --access lab/access.json[/bold]
    """
    import json

    from arm_ik_service.errors import SettingsError
    from arm_ik_service.wire.access import access_control, headset_name, service_name, viewer_name
    from arm_ik_service.wire.keys import Keys, check_id

    try:
        from arm_ik_service.io.certificates import Authority
    except ImportError as error:
        raise SettingsError(f"{error.name} is missing: pip install 'arm-ik-service[security]'") from error
    names = [
        (name_of(check_id(name)), listens)
        for given, name_of, listens in (
            (service, service_name, True),
            (headset, headset_name, False),
            (viewer, viewer_name, False),
        )
        for name in given or ()
    ]
    authority = Authority(folder, days)
    for common_name, listens in names:
        authority.issue(common_name, ["localhost", "127.0.0.1", *(host or ())] if listens else ())
    rules = folder / "access.json"
    rules.write_text(json.dumps(access_control(authority.identities(), Keys(prefix)), indent=1) + "\n")
    for path in (*authority.made, rules):
        say(str(path))
