"""The parts of a measurement that must not share a Python process: services, echoes, load generators."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import Any

from arm_ik_service.errors import ArmIkError

READY_WITHIN_S = 180.0  # a first start compiles
ENDS_WITHIN_S = 10.0


class Part:
    """One Python module running beside us. It says `ready` on standard error, and its result on standard output."""

    def __init__(self, module: str, *arguments: str, inside: tuple[str, ...] = ()) -> None:
        """`inside` is a command that runs another, such as `ip netns exec NAME`."""
        self._name = " ".join((module, *arguments[:1]))
        self.popen = subprocess.Popen(
            [*inside, sys.executable, "-P", "-m", module, *arguments],
            stdin=subprocess.PIPE,  # it closes with us, and a part that reads it ends then
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._ready = Event()
        self._said_ready = False
        self._last_lines: deque[str] = deque(maxlen=3)
        self._reader = Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.popen.stderr is not None
        for line in self.popen.stderr:
            self._last_lines.append(line.strip())
            if line.startswith("ready"):
                self._said_ready = True
                self._ready.set()
        self._ready.set()

    def wait_ready(self) -> None:
        """Raises ArmIkError with its last lines if it ends instead."""
        if not self._ready.wait(READY_WITHIN_S) or not self._said_ready:
            raise ArmIkError(f"{self._name} ended early: {' | '.join(self._last_lines) or 'it said nothing'}")

    def result(self) -> dict[str, Any]:
        """Wait for its end and return the JSON object it printed."""
        assert self.popen.stdout is not None
        text = self.popen.stdout.read()
        self.popen.wait()
        try:
            found: dict[str, Any] = json.loads(text)
        except ValueError as error:
            raise ArmIkError(f"{self._name} measured nothing: {' | '.join(self._last_lines)}") from error
        return found

    def end(self) -> None:
        """Ask it to end as Ctrl-C does, and make sure that it does."""
        if self.popen.poll() is None:
            self.popen.send_signal(signal.SIGTERM)
        try:
            self.popen.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self.popen.kill()
            self.popen.wait()
        self._reader.join(timeout=1.0)


@contextmanager
def part(module: str, *arguments: str) -> Iterator[Part]:
    """Run a module for the length of the block, ready when it begins."""
    running = Part(module, *arguments)
    try:
        running.wait_ready()
        yield running
    finally:
        running.end()


def say_ready() -> None:
    """Tell, from a part, whoever started it."""
    sys.stderr.write("ready\n")
    sys.stderr.flush()


def wait_for_end() -> None:
    """Wait, in a part, until it is asked to end or whoever started it is gone."""
    ended = Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: ended.set())

    def watch() -> None:
        sys.stdin.read()
        ended.set()

    Thread(target=watch, daemon=True).start()
    say_ready()
    ended.wait()
