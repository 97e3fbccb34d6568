"""`arm-ik bridge web` and `arm-ik bridge openxr`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from arm_ik_service.cli.options import say, stopped_by_signals
from arm_ik_service.cli.zenoh_options import opens_client
from arm_ik_service.wire.messages import Encoding, Space

if TYPE_CHECKING:
    from arm_ik_service.io.zenoh_bus import BusOptions


bridge = typer.Typer(help="Publish controller frames live from a headset.", no_args_is_help=True)


@bridge.command()
@opens_client
def web(
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to serve on; 0 takes a free one.")] = 8443,
    host: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Interface to serve on; default: all of them.")
    ] = None,
    names: Annotated[
        list[str] | None,
        typer.Option("--name", metavar="NAME", help="Name or address under which headsets open the page."),
    ] = None,
    code: Annotated[str | None, typer.Option(help="Pairing code; default: a new one each time.")] = None,
    state: Annotated[
        Path | None, typer.Option("--state", metavar="FOLDER", help="Where certificate and pairings are kept.")
    ] = None,
    encoding: Annotated[Encoding, typer.Option(help="How the frames are encoded.")] = "msgpack",
    prefix: Annotated[str, typer.Option(help="Key prefix, as in the service's settings.")] = "",
    *,
    zenoh: BusOptions,
) -> None:
    """Serve a page that a headset's browser opens: poses come from it, and it draws both arms in VR.

    A desktop browser will do as well: mouse and keyboard drive both hands. Any number of headsets may be paired.

    Example: [bold]arm-ik bridge web --connect tcp/127.0.0.1:7447[/bold]
    """
    import asyncio
    import logging

    import platformdirs

    from arm_ik_service.errors import BridgeError, SettingsError
    from arm_ik_service.io.zenoh_bus import open_client
    from arm_ik_service.wire.keys import Keys

    try:
        from arm_ik_service.bridges.web.addresses import own_names
        from arm_ik_service.bridges.web.certificate import papers
        from arm_ik_service.bridges.web.invitation import invitation
        from arm_ik_service.bridges.web.pairing import new_code
        from arm_ik_service.bridges.web.server import WebBridge
    except ImportError as error:
        raise BridgeError(f"{error.name} is missing: pip install 'arm-ik-service[web]'") from error
    if code is not None and not code.strip():
        raise SettingsError("--code is empty: anybody could pair")
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    used_code = code or new_code()
    used_names = list(dict.fromkeys([*(name.lower() for name in names or ()), *own_names()]))
    used_papers = papers(state or platformdirs.user_state_path("arm-ik") / "web", used_names)

    async def serve() -> None:
        loop, stopped = asyncio.get_running_loop(), asyncio.Event()

        def ready(actual_port: int) -> None:
            typer.echo(invitation(used_names, actual_port, used_code, used_papers.fingerprint))
            say(f"ready: port {actual_port}; Ctrl-C ends it")

        def stop() -> None:
            loop.call_soon_threadsafe(stopped.set)

        with stopped_by_signals(stop):
            await web_bridge.run(host, stopped, ready)

    with open_client(zenoh, waiting=say) as bus:
        web_bridge = WebBridge(
            bus,
            Keys(prefix),
            names=used_names,
            port=port,
            papers=used_papers,
            code=used_code,
            encoding=encoding,
        )
        asyncio.run(serve())
        say(web_bridge.farewell())


@bridge.command()
@opens_client
def openxr(
    avatar: Annotated[str, typer.Option(help="Avatar id to publish under.")] = "openxr",
    rate_hz: Annotated[
        float, typer.Option("--rate", metavar="HZ", min=1.0, max=1000.0, help="Frames a second.")
    ] = 90.0,
    space: Annotated[
        Space | None, typer.Option(help="Space of the poses; default: the first of these that the runtime has.")
    ] = None,
    frozen_after_s: Annotated[
        float,
        typer.Option(
            "--frozen-after",
            metavar="SECONDS",
            min=0.0,
            help="A pose unchanged to the bit for so long is called inferred, not tracked; 0 never.",
        ),
    ] = 0.5,
    probe: Annotated[
        bool, typer.Option("--probe", help="Show the runtime and a few seconds of poses; publish nothing.")
    ] = False,
    probe_s: Annotated[float, typer.Option("--probe-for", metavar="SECONDS", min=0.0, help="How long to show.")] = 3.0,
    encoding: Annotated[Encoding, typer.Option(help="How the frames are encoded.")] = "msgpack",
    prefix: Annotated[str, typer.Option(help="Key prefix, as in the service's settings.")] = "",
    *,
    zenoh: BusOptions,
) -> None:
    """Publish head and grips of the installed OpenXR runtime (Monado, SteamVR) from a session without a window.

    A runtime that dies is waited for, and its controllers are lost meanwhile. Where no controller is held, tracked
    hands are used if the runtime tracks them.

    Example: [bold]arm-ik bridge openxr --rate 120 --space stage[/bold]
    """
    from threading import Event

    from arm_ik_service.bridges.frames import FramePublisher
    from arm_ik_service.bridges.openxr import bridge as loop
    from arm_ik_service.bridges.openxr.pyopenxr import PyOpenXr, load_xr
    from arm_ik_service.io.zenoh_bus import open_client
    from arm_ik_service.wire.keys import Keys, check_id

    check_id(avatar)
    runtime = PyOpenXr(load_xr())
    if probe:
        stopped = Event()
        with stopped_by_signals(stopped.set):
            loop.probe(runtime, space=space, seconds=probe_s, show=typer.echo, stopped=stopped)
        return
    loop.check(runtime, space)  # before the bus is waited for
    with open_client(zenoh, waiting=say) as bus:
        publisher = FramePublisher(bus, Keys(prefix), avatar, encoding)
        running = loop.OpenXrBridge(
            runtime, publisher, rate_hz=rate_hz, space=space, frozen_after_s=frozen_after_s, say=say
        )
        with stopped_by_signals(running.stop):
            say(f"ready: {avatar} at {rate_hz:g} Hz; Ctrl-C ends it")
            running.run(lambda found: say(f"{found.runtime} {found.version}: {found.system}, {found.space} space"))
        say(f"published {publisher.published} frames")
