"""The whole system on one machine: service, viewer and replay as processes of their own, over Zenoh on loopback."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Event, Thread
from typing import IO

from arm_ik_service.errors import ArmIkError, WireError
from arm_ik_service.io.zenoh_bus import BusOptions, open_client
from arm_ik_service.io.zenoh_streams import subscribe
from arm_ik_service.programs.summary import Summary
from arm_ik_service.resources import resource_folder
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys
from arm_ik_service.wire.messages import ArmsState

READY_WITHIN_S = 180.0  # a first start compiles
ENDS_WITHIN_S = 10.0
SETTLE_S = 0.3  # for the last answers to arrive


def bundled_session(name: str) -> Path:
    """Return the bundled recording of that name, or the file so named. Raises ArmIkError with the names there are."""
    folder = resource_folder("replay_logs")
    path = folder / f"{name}.mcap"
    if path.is_file():
        return path
    if Path(name).is_file():
        return Path(name)
    bundled = ", ".join(sorted(path.stem for path in folder.glob("*.mcap")))
    raise ArmIkError(f"no recording {name!r}: neither a file nor one of the bundled ones, {bundled}")


def free_endpoint() -> str:
    """Return a loopback endpoint whose port was free a moment ago."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@dataclass
class Process:
    """One of our commands running beside us; its last line is kept for an error that names the cause."""

    name: str
    popen: subprocess.Popen[str]
    ready: Event
    last_line: str = ""

    def watch(self, stream: IO[str], say: Callable[[str], None]) -> None:
        """Read its standard error until it closes; runs on a thread of its own."""
        for line in stream:
            self.last_line = line.strip()
            if self.last_line.startswith("ready"):
                self.ready.set()
            elif self.last_line.startswith(("compiling", "view:")):
                say(self.last_line.removeprefix("view: "))
        self.ready.set()

    def end(self) -> None:
        """Ask it to end as Ctrl-C does, and make sure that it does."""
        if self.popen.poll() is None:
            self.popen.send_signal(signal.SIGTERM)
        try:
            self.popen.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self.popen.kill()
            self.popen.wait()

    def fail(self) -> ArmIkError:
        """Return the error that says what it said last."""
        return ArmIkError(f"{self.name} ended early: {self.last_line.removeprefix('arm-ik: ') or 'it said nothing'}")


@contextmanager
def running(name: str, arguments: list[str], say: Callable[[str], None]) -> Iterator[Process]:
    """Run `arm-ik ...` as a process for the length of the block."""
    command = [sys.executable, "-P", "-m", "arm_ik_service", *arguments]
    popen = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    process = Process(name, popen, Event())
    assert popen.stderr is not None
    watcher = Thread(target=process.watch, args=(popen.stderr, say), daemon=True)
    watcher.start()
    try:
        yield process
    finally:
        process.end()
        watcher.join(timeout=1.0)


def run_demo(
    session: Path,
    view: list[str],
    *,
    say: Callable[[str], None],
    show: Callable[[Summary, ArmsState], None],
    stopped: Event,
) -> Summary:
    """Play the recording through a service to a viewer; `show` is called a few times a second.

    `view` are the arguments of `arm-ik view`, none for no view. Raises ArmIkError if any part ends early.
    """
    endpoint = free_endpoint()
    connect = ["--connect", endpoint]
    summary = Summary()
    arrivals: SimpleQueue[tuple[bytes, float]] = SimpleQueue()
    with running("the service", ["serve", "--name", "demo", "--listen", endpoint], say) as service:
        if not service.ready.wait(READY_WITHIN_S) or service.popen.poll() is not None:
            raise service.fail()
        with open_client(BusOptions(connect=(endpoint,)), wait_s=5.0) as bus:
            subscriber = subscribe(
                bus, Keys().arms(), lambda _key, payload, _time_ns: arrivals.put((payload, time.monotonic()))
            )
            with _optional_view(view, connect, say):
                with running("the replay", ["replay", str(session), *connect], say) as replay:
                    while replay.popen.poll() is None and not stopped.is_set():
                        if service.popen.poll() is not None:
                            raise service.fail()
                        _gather(arrivals, summary, show)
                    if replay.popen.returncode not in (0, None):
                        raise replay.fail()
                time.sleep(SETTLE_S)
                _gather(arrivals, summary, show)
            subscriber.undeclare()
    if summary.frames == 0 and not stopped.is_set():
        raise ArmIkError("no answer came back from the service: run `arm-ik serve` by hand to see what it says")
    return summary


@contextmanager
def _optional_view(view: list[str], connect: list[str], say: Callable[[str], None]) -> Iterator[None]:
    if not view:
        yield
        return
    with running("the view", ["view", *view, *connect], say) as process:
        if not process.ready.wait(READY_WITHIN_S) or process.popen.poll() is not None:
            raise process.fail()
        yield


def _gather(
    arrivals: SimpleQueue[tuple[bytes, float]], summary: Summary, show: Callable[[Summary, ArmsState], None]
) -> None:
    """Take in what has arrived, waiting a moment for the first."""
    latest: ArmsState | None = None
    try:
        payload, arrived_s = arrivals.get(timeout=0.1)
        while True:
            try:
                latest = codec.arms_states.decode(payload)
                summary.add(latest, arrived_s)
            except WireError:
                pass  # not ours: somebody else publishes on the same key
            payload, arrived_s = arrivals.get_nowait()
    except Empty:
        pass
    if latest is not None:
        show(summary, latest)
    time.sleep(0.1)
