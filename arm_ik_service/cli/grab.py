"""`arm-ik grab`."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from arm_ik_service.cli.options import (
    AvatarFile,
    ProfileName,
    Show,
    SkinningChoice,
    say,
    show_option,
    skin_options,
    stopped_by_signals,
)
from arm_ik_service.cli.zenoh_options import opens_hub

if TYPE_CHECKING:
    from arm_ik_service.io.zenoh_bus import BusOptions


@opens_hub
def grab(
    cube: Annotated[
        str, typer.Option(metavar="X,Y,Z", help="Where the cube is [m]; the person faces -z.")
    ] = "0.5,1,-3",
    goal: Annotated[str | None, typer.Option(metavar="X,Y,Z", help="Where to carry it; not given: it is kept.")] = None,
    solver: Annotated[
        str, typer.Option(metavar="NAME[:OPTION=VALUE,...]", help="Any solver that `arm-ik bench solvers` lists.")
    ] = "jacobian_transpose",
    save: Annotated[Path | None, typer.Option("--save", metavar="FILE", help="Write the view to this .rrd.")] = None,
    no_view: Annotated[bool, typer.Option("--no-view", help="Without a picture.")] = False,
    record: Annotated[
        Path | None, typer.Option("--record", metavar="FILE", help="Write frames, arms and the cube, .mcap.")
    ] = None,
    duration_s: Annotated[
        float, typer.Option("--duration", metavar="SECONDS", min=0.1, help="At most so long.")
    ] = 60.0,
    fast: Annotated[bool, typer.Option("--fast", help="As fast as it goes, without Zenoh.")] = False,
    avatar: AvatarFile = None,
    skinning: SkinningChoice = None,
    show: Show = None,
    profile: ProfileName = None,
    *,
    zenoh: BusOptions,
) -> None:
    """Somebody walks to a cube, takes it and carries it: inverse kinematics at work.

    While it runs the cube can be put elsewhere, by a JSON pose on the Zenoh key [bold]scene/cube/pose[/bold]:
    {"position": [0.4, 1.1, -2]}; a query of that key tells where it is.

    Example: [bold]arm-ik grab --cube 0.5,0.8,-3 --goal=-1,1.2,-2 --save grab.rrd[/bold]
    """
    import numpy as np

    from arm_ik_service.errors import SettingsError
    from arm_ik_service.ik.registry import parse_solver
    from arm_ik_service.io.profile_store import find_profile
    from arm_ik_service.io.rerun_view import Save, Sink, Spawn, has_display
    from arm_ik_service.io.zenoh_bus import open_hub
    from arm_ik_service.programs.grab.live import GrabShow
    from arm_ik_service.programs.grab.scene import Scene

    def place(name: str, text: str) -> np.ndarray:
        try:
            x, y, z = (float(word) for word in text.split(","))
        except ValueError as error:
            raise SettingsError(f"--{name} {text}: three numbers X,Y,Z are needed, in metres") from error
        return np.array([x, y, z])

    scene = Scene(
        place("cube", cube),
        place("goal", goal) if goal is not None else None,
        profile=find_profile(profile),
        choice=parse_solver(solver),
    )
    if save is None and not no_view and not has_display():
        save = Path("arm-ik-grab.rrd")
    overlays = show_option(show)
    sinks: list[Sink] = [] if no_view else [Save(save) if save is not None else Spawn()]
    with ExitStack() as stack:
        bus = None
        if not fast:
            bus = stack.enter_context(open_hub(zenoh, waiting=say))
        skin = skin_options(avatar, skinning) if sinks else None
        performance = GrabShow(scene, bus=bus, sinks=sinks, skin=skin, overlays=overlays, record=record, say=say)
        with stopped_by_signals(performance.stop):
            say("ready; Ctrl-C ends it")
            last = performance.run(duration_s, real_time=not fast)
        performance.close()
    if last is not None:
        x, y, z = last.cube[:3]
        typer.echo(f"{last.stage}: the cube is at {x:.3f}, {y:.3f}, {z:.3f}")
    if save is not None and not no_view:
        typer.echo(f"to look at it: rerun {save}")
