"""The command line: arguments to calls, progress, exit codes; nothing else.

Exit codes: 0 done; 1 done, and what was asked to be found was not (a verification that differs); 2 could not be done,
with one line that names the cause.
"""

from __future__ import annotations

import sys

import typer

from arm_ik_service.cli.bench_service import bench
from arm_ik_service.cli.bridge import bridge
from arm_ik_service.cli.calibrate import calibrate
from arm_ik_service.cli.certificates import certificates
from arm_ik_service.cli.check import check
from arm_ik_service.cli.convert import convert
from arm_ik_service.cli.demo import demo
from arm_ik_service.cli.doctor import doctor
from arm_ik_service.cli.export import export
from arm_ik_service.cli.grab import grab
from arm_ik_service.cli.record import record
from arm_ik_service.cli.replay import replay
from arm_ik_service.cli.router import router
from arm_ik_service.cli.schema import schema
from arm_ik_service.cli.serve import serve
from arm_ik_service.cli.solve import solve
from arm_ik_service.cli.top import top
from arm_ik_service.cli.view import view
from arm_ik_service.errors import ArmIkError

app = typer.Typer(
    name="arm-ik",
    help="Real-time VR arms: headset and controller poses in, two human arms out.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (
    demo,
    serve,
    replay,
    record,
    view,
    solve,
    check,
    calibrate,
    convert,
    export,
    schema,
    router,
    certificates,
    top,
    doctor,
    grab,
):
    app.command()(command)
app.add_typer(bench)
app.add_typer(bridge, name="bridge")


def _version(asked: bool) -> None:
    if asked:
        from arm_ik_service import __version__

        typer.echo(f"arm-ik {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: bool = typer.Option(False, "--version", callback=_version, is_eager=True, help="Print the version."),
) -> None:
    pass


def main() -> None:
    """Run the command line; an error that a user can mend is one line and exit code 2."""
    try:
        app()
    except ArmIkError as error:
        sys.stderr.write(f"arm-ik: {error}\n")
        sys.exit(2)


if __name__ == "__main__":
    main()
