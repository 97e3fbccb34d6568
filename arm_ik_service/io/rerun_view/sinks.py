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
import rerun_cli  # type: ignore[import-untyped]  # only its folder is asked for

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
    """Start a desktop viewer of our own."""


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
    opened = [_open(sink, recording) for sink in sinks]
    try:
        recording.set_sinks(*opened)
    except (ValueError, RuntimeError, OSError) as error:
        raise ViewError(f"Rerun refuses these sinks: {first_line(error)}") from error
    for sink in sinks:
        if isinstance(sink, Web):
            _serve_web(sink)


def _open(sink: Sink, recording: rr.RecordingStream) -> rr.FileSink | rr.GrpcSink | rr.GrpcServerSink:
    match sink:
        case Save(path):
            return _open_file(path)
        case Spawn():
            return _spawn(recording)
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
        reason = error.strerror if isinstance(error, OSError) and error.strerror else first_line(error)
        raise ViewError(f"cannot write {path}: {reason}") from error


def _spawn(recording: rr.RecordingStream) -> rr.GrpcSink:
    if not has_display():
        raise ViewError(
            "no display to open the Rerun viewer on: write a file with --save FILE.rrd, or serve with --web"
        )
    port = VIEWER_PORT if _is_free(VIEWER_PORT) else free_port()
    try:
        rr.spawn(
            port=port,
            connect=False,
            memory_limit=VIEWER_MEMORY,
            hide_welcome_screen=True,
            executable_path=str(viewer_binary()),
            recording=recording,
        )
    except (RuntimeError, OSError, ValueError) as error:
        raise ViewError(f"the Rerun viewer did not start: {first_line(error)}") from error
    return _reach(
        f"rerun+http://127.0.0.1:{port}/proxy",
        "the Rerun viewer ended at once: it needs a display and a graphics driver; else use --save FILE.rrd or --web",
    )


def _connect(url: str) -> rr.GrpcSink:
    return _reach(url, f"no Rerun viewer answers at {url}: start one with `rerun`, or write --save FILE.rrd")


def _reach(url: str, otherwise: str) -> rr.GrpcSink:
    """Return a sink to a viewer that answers: the sink itself would wait for one and keep what it cannot send."""
    try:
        sink = rr.GrpcSink(url)
        parts = urlsplit(url.removeprefix("rerun+"))
        host, port = parts.hostname or "127.0.0.1", parts.port or VIEWER_PORT
    except (ValueError, RuntimeError) as error:
        raise ViewError(f"{url} is no address of a viewer: it looks like rerun+http://127.0.0.1:9876/proxy") from error
    try:
        socket.create_connection((host, port), timeout=2.0).close()
    except OSError as error:
        raise ViewError(otherwise) from error
    return sink


def _serve(sink: Web) -> rr.GrpcServerSink:
    for port in (sink.data_port, sink.port):
        if not _is_free(port):
            raise ViewError(f"port {port} is in use: is another viewer running? choose another port")
    try:
        return rr.GrpcServerSink("0.0.0.0", sink.data_port, server_memory_limit=VIEWER_MEMORY)
    except (RuntimeError, OSError, ValueError) as error:
        raise ViewError(f"cannot serve the view's data on port {sink.data_port}: {first_line(error)}") from error


def _serve_web(sink: Web) -> None:
    try:
        rr.serve_web_viewer(
            web_port=sink.port,
            open_browser=sink.open_browser,
            connect_to=f"rerun+http://localhost:{sink.data_port}/proxy",
        )
    except (RuntimeError, OSError, ValueError) as error:
        raise ViewError(f"cannot serve the web viewer on port {sink.port}: {first_line(error)}") from error


def _is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("0.0.0.0", port))
        except OSError:
            return False
    return True


def free_port() -> int:
    """Return a TCP port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def first_line(error: BaseException) -> str:
    """Return the first line of what an error says."""
    return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
