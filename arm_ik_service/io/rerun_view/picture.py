"""A moment of an .rrd as a picture, without a display: a headless viewer is started, told the time, and asked."""

from __future__ import annotations

import contextlib
import os
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from rerun.experimental import ViewerClient

from arm_ik_service.errors import ViewError
from arm_ik_service.io.rerun_view.sinks import free_port, viewer_binary

RRD_MAGIC = b"RRF"
START_WITHIN_S = 60.0  # software rendering on a busy machine takes its time
LOOK_EVERY_S = 0.7  # longer than a plot rests between two steps of its glide
SETTLES_WITHIN_S = 20.0  # a picture that never rests is one of something that moves by itself


def write_picture(
    recording: Path, picture: Path, *, frame: int | None = None, width: int = 1600, height: int = 900
) -> None:
    """Write what the viewer shows of `recording` (.rrd) at `frame` (the last one if None) as a .png.

    Needs a Vulkan driver; Mesa's software one (lavapipe) will do.
    Raises ViewError.
    """
    try:
        with recording.open("rb") as file:
            magic = file.read(len(RRD_MAGIC))
    except OSError as error:
        raise ViewError(f"cannot read {recording}: {error.strerror}") from error
    if magic != RRD_MAGIC:
        raise ViewError(f"{recording} is no Rerun recording")
    with _headless_viewer(recording, width, height) as viewer:
        last = _last_frame(viewer)
        _hide_bars(viewer)
        viewer.set_time("frame", sequence=last if frame is None else frame, play_state="paused")
        _save_at_rest(viewer, picture)
    if not picture.is_file():
        raise ViewError(f"the viewer wrote no picture to {picture}: may it write there?")


@contextlib.contextmanager
def _headless_viewer(recording: Path, width: int, height: int) -> Iterator[ViewerClient]:
    port = free_port()
    options = ["--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", f"{width}x{height}"]
    with tempfile.TemporaryDirectory() as folder, (Path(folder) / "log").open("w+") as log:
        # What the viewer logs it also shows, over the plots: hence only errors. The folder stands in for a session's.
        environment = {"XDG_RUNTIME_DIR": folder, **os.environ, "RUST_LOG": "error"}
        process = subprocess.Popen(
            [str(viewer_binary()), str(recording), *options], stdout=log, stderr=log, env=environment
        )
        try:
            yield _wait_until_loaded(f"rerun+http://127.0.0.1:{port}/proxy", process, Path(log.name))
        except (RuntimeError, ConnectionError) as error:
            raise ViewError(f"the headless viewer failed: {error}") from error
        finally:
            process.terminate()
            process.wait(timeout=10.0)


def _wait_until_loaded(url: str, process: subprocess.Popen[bytes], log: Path) -> ViewerClient:
    give_up = time.monotonic() + START_WITHIN_S
    viewer: ViewerClient | None = None
    while time.monotonic() < give_up:
        if process.poll() is not None:
            raise ViewError(f"the headless viewer ended: {_why(log.read_text(), process.returncode)}")
        with contextlib.suppress(RuntimeError, ConnectionError):
            viewer = viewer or ViewerClient.connect(url)
            state = viewer.get_state()
            if not state.loading and any(recording.timelines for recording in state.recordings):
                return viewer
        time.sleep(0.1)
    raise ViewError(f"the headless viewer was not ready within {START_WITHIN_S:.0f} s")


def _why(said: str, code: int) -> str:
    if "adapter" in said:
        return "it found no Vulkan driver; mesa-vulkan-drivers holds one that needs no graphics card"
    telling = [line for line in said.splitlines() if "error" in line.lower()]
    return telling[0] if telling else f"exit code {code}"


def _hide_bars(viewer: ViewerClient) -> None:
    """Leave only views: the menu's warnings about this machine's graphics say nothing about the recording."""
    blueprint = viewer.get_blueprint("recording").blueprint
    blueprint["/top_panel"] = {"PanelBlueprint": {"state": "Hidden"}}
    blueprint["/time_panel"]["TimePanelBlueprint"]["state"] = "Hidden"
    viewer.set_blueprint(blueprint, "recording")


def _save_at_rest(viewer: ViewerClient, picture: Path) -> None:
    """Save what is shown once it no longer changes: plots glide to their new ranges, slowly on a busy machine."""
    before, give_up = b"", time.monotonic() + SETTLES_WITHIN_S
    while time.monotonic() < give_up:
        time.sleep(LOOK_EVERY_S)
        viewer.save_screenshot(str(picture.resolve()))
        now = picture.read_bytes() if picture.is_file() else b""
        if now == before:
            return
        before = now


def _last_frame(viewer: ViewerClient) -> int:
    for recording in viewer.get_state().recordings:
        for timeline in recording.timelines:
            if timeline.name == "frame" and timeline.end is not None:
                return timeline.end
    raise ViewError("the recording has no timeline `frame`: it was not written by this view")
