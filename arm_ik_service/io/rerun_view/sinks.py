"""Where a view goes: into a file, to a viewer it starts, to a viewer that runs, to a browser."""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

import rerun as rr
import rerun_cli

from arm_ik_service.errors import ViewError

VIEWER_PORT = 9876  # Rerun's own
WEB_PORT = 9090
VIEWER_MEMORY = "2GB"  # what a viewer keeps of a live view: about half an hour of one avatar at 90 Hz


@dataclass(frozen=True)
class Save:
    """Write an .rrd file."""

    path: Path


@dataclass(frozen=True)
class Spawn:
    """Start the desktop viewer, or use the one that listens on this port already."""

    port: int = VIEWER_PORT


@dataclass(frozen=True)
class Connect:
    """Stream to a running viewer, such as `rerun+http://127.0.0.1:9876/proxy`."""

    url: str


@dataclass(frozen=True)
class Web:
    """Serve the web viewer, and the data to it."""

    port: int = WEB_PORT
    data_port: int = VIEWER_PORT
    open_browser: bool = False

    @property
    def address(self) -> str:
        """What to open in a browser."""
        data = f"rerun%2Bhttp%3A%2F%2Flocalhost%3A{self.data_port}%2Fproxy"
        return f"http://localhost:{self.port}/?url={data}"


Sink = Save | Spawn | Connect | Web


def viewer_binary() -> Path:
    """Return the viewer that came with the installed rerun-sdk, so that PATH does not matter. Raises ViewError."""
    folder = Path(rerun_cli.__file__).parent
    bundled = folder / "Rerun.app" / "Contents" / "MacOS" / "Rerun"
    for binary in (bundled, folder / "rerun", folder / "rerun.exe"):
        if binary.is_file():
            return binary
    raise ViewError(
        f"the Rerun viewer is missing from {folder}: reinstall with `pip install --force-reinstall rerun-sdk`"
    )


def has_display() -> bool:
    """Whether a window can be opened here."""
    return sys.platform in ("win32", "darwin") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def attach(recording: rr.RecordingStream, sinks: Sequence[Sink]) -> None:
    """Open all `sinks` and send everything to each. Raises ViewError with the cause and what to do about it."""
    if not sinks:
        raise ViewError("the view has nowhere to go: give it a file, a viewer or the web")
    opened = [_open(sink) for sink in sinks]
    try:
        recording.set_sinks(*opened)
    except (ValueError, RuntimeError, OSError) as error:
        raise ViewError(f"Rerun refuses these sinks: {_first_line(error)}") from error
    for sink in sinks:
        if isinstance(sink, Web):
            _serve_web(sink)


def _open(sink: Sink) -> rr.FileSink | rr.GrpcSink | rr.GrpcServerSink:
    match sink:
        case Save(path):
            return _open_file(path)
        case Spawn(port):
            return _spawn(port)
        case Connect(url):
            return _connect(url)
        case Web():
            return _serve(sink)


def _open_file(path: Path) -> rr.FileSink:
    try:
        with path.open("ab"):
            pass
        return rr.FileSink(str(path))
    except (OSError, RuntimeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else _first_line(error)
        raise ViewError(f"cannot write {path}: {reason}") from error


def _spawn(port: int) -> rr.GrpcSink:
    if not has_display():
        raise ViewError(
            "no display to open the Rerun viewer on: write a file with --save FILE.rrd, or serve with --web"
        )
    try:
        rr.spawn(
            port=port,
            connect=False,
            memory_limit=VIEWER_MEMORY,
            hide_welcome_screen=True,
            executable_path=str(viewer_binary()),
        )
        return rr.GrpcSink(f"rerun+http://127.0.0.1:{port}/proxy")
    except (RuntimeError, OSError, ValueError) as error:
        raise ViewError(f"the Rerun viewer did not start on port {port}: {_first_line(error)}") from error


def _connect(url: str) -> rr.GrpcSink:
    try:
        sink = rr.GrpcSink(url)
        parts = urlsplit(url.removeprefix("rerun+"))
        host, port = parts.hostname, parts.port or VIEWER_PORT
    except (ValueError, RuntimeError) as error:
        raise ViewError(f"{url} is no address of a viewer: it looks like rerun+http://127.0.0.1:9876/proxy") from error
    try:
        # The sink itself would wait for a viewer for ever, and keep what it cannot send.
        socket.create_connection((host or "127.0.0.1", port), timeout=2.0).close()
    except OSError as error:
        raise ViewError(
            f"no Rerun viewer answers at {url}: start one with `rerun`, or write --save FILE.rrd"
        ) from error
    return sink


def _serve(sink: Web) -> rr.GrpcServerSink:
    for port in (sink.data_port, sink.port):
        _require_free(port)
    try:
        return rr.GrpcServerSink("0.0.0.0", sink.data_port, server_memory_limit=VIEWER_MEMORY)
    except (RuntimeError, OSError, ValueError) as error:
        raise ViewError(f"cannot serve the view's data on port {sink.data_port}: {_first_line(error)}") from error


def _serve_web(sink: Web) -> None:
    try:
        rr.serve_web_viewer(
            web_port=sink.port,
            open_browser=sink.open_browser,
            connect_to=f"rerun+http://localhost:{sink.data_port}/proxy",
        )
    except (RuntimeError, OSError, ValueError) as error:
        raise ViewError(f"cannot serve the web viewer on port {sink.port}: {_first_line(error)}") from error


def _require_free(port: int) -> None:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("0.0.0.0", port))
        except OSError as error:
            raise ViewError(f"port {port} is in use: is another viewer running? choose another port") from error


def _first_line(error: BaseException) -> str:
    return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
