"""Our commands as real processes on real Zenoh sessions: what every test of the programs uses."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from threading import Event, Thread

from arm_ik_service.io.zenoh_streams import Bus, Stream, declare_stream
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys
from arm_ik_service.wire.messages import VERSION, ArmsState, ControllerFrame, Health, TrackedPose

COMMAND = [sys.executable, "-P", "-m", "arm_ik_service"]
KEYS = Keys()


def wait_for(condition: Callable[[], bool], seconds: float = 10.0) -> bool:
    """Return whether the condition came true in time."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.002)
    return True


def may_idle() -> bool:
    """Return whether processes here may ask to run only where nobody else wants to."""
    ask = "import os; os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))"
    return subprocess.run([sys.executable, "-c", ask], capture_output=True, check=False).returncode == 0


class Running:
    """`arm-ik ...` as a process; its standard error is kept, line by line."""

    def __init__(self, *arguments: str) -> None:
        self.popen = subprocess.Popen([*COMMAND, *arguments], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.lines: list[str] = []
        self._ready = Event()
        self._thread = Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        assert self.popen.stderr is not None
        for line in self.popen.stderr:
            self.lines.append(line.rstrip())
            if line.startswith("ready"):
                self._ready.set()
        self._ready.set()

    def wait_ready(self) -> None:
        assert self._ready.wait(120.0)
        assert self.popen.poll() is None, self.lines

    def says(self, text: str, seconds: float = 10.0) -> bool:
        return wait_for(lambda: any(text in line for line in self.lines), seconds)

    def end(self, number: signal.Signals = signal.SIGTERM) -> int:
        self.popen.send_signal(number)
        return self.finish()

    def finish(self, seconds: float = 60.0) -> int:
        code = self.popen.wait(seconds)
        self._thread.join(5.0)
        return code


@dataclass
class Service:
    """A running service and a client's ear on its answers."""

    process: Running
    endpoint: str
    bus: Bus
    answers: SimpleQueue[ArmsState]
    healths: list[Health]
    newest: dict[str, int]  # seq of each avatar's last answer

    def take(self, count: int, seconds: float = 10.0) -> list[ArmsState]:
        """Return the next answers, as many as come in time but no more than `count`."""
        wait_for(lambda: self.answers.qsize() >= count, seconds)
        return [self.answers.get_nowait() for _ in range(min(count, self.answers.qsize()))]

    def answered_and_overtaken(self, avatar: str) -> int:
        """How many of an avatar's frames the last health accounts for: on a busy machine the newest frame wins."""
        seats = (seat for health in self.healths[-1:] for seat in health.avatars if seat.avatar == avatar)
        return sum(seat.answered + seat.overtaken for seat in seats)

    def stream(self, avatar: str) -> Stream:
        return declare_stream(self.bus, KEYS.controllers(avatar), "msgpack")

    def ask(self, stream: Stream, avatar: str, frame: ControllerFrame) -> None:
        """Put a frame and wait for its answer: on a busy machine it comes late, but no later frame overtakes it."""
        stream.put(codec.encode(frame))
        assert wait_for(lambda: self.newest.get(avatar) == frame.seq), f"{avatar}: frame {frame.seq} is not answered"

    def memory_kib(self) -> int:
        status = Path(f"/proc/{self.process.popen.pid}/status").read_text()
        return int(next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS")))


def standing(seq: int, sample_time_ns: int, raised_m: float = 0.0) -> ControllerFrame:
    """Return a frame of a person who stands with both hands before the body."""
    level = (0.0, 0.0, 0.0, 1.0)
    return ControllerFrame(
        version=VERSION,
        seq=seq,
        sample_time_ns=sample_time_ns,
        publish_time_ns=time.time_ns(),
        space="stage",
        head=TrackedPose((0.0, 1.6, 0.0), level),
        left=TrackedPose((-0.2, 1.1 + raised_m, -0.3), level),
        right=TrackedPose((0.2, 1.1 + raised_m, -0.3), level),
    )
