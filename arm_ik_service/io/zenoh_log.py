"""Zenoh's own log, brought into ours: whom it turns away, and why.

Zenoh logs to standard output, a line for every message it denies. Standard output becomes a pipe that is emptied once a
second and summed up; what does not fit into it is lost rather than waited for, so that a flood of denied messages costs
no more than the pipe holds.
"""

from __future__ import annotations

import logging
import os
import re
import time
from collections import Counter
from collections.abc import Callable
from threading import Thread

import zenoh

log = logging.getLogger("arm_ik.zenoh")

_PERIOD_S = 1.0
_PIPE_BYTES = 65_536
_LINE = re.compile(r"^\S+Z\s+(?P<level>[A-Z]+) .*?ThreadId\((?P<thread>\d+)\) [\w:]+: (?P<text>.*)$")
_DENIED = re.compile(r"(?P<who>[0-9a-f]+) is unauthorized to (?P<what>\w+) \((?P<flow>\w+)\) on (?P<key>.*)$")
_HINT = re.compile(r"\. Hint: .*$")  # about open files, whatever the cause
_NOISE = "zenoh::net::routing::hat=error"  # that gossip is off, which is what we asked for
_DENIALS = "zenoh::net::routing::interceptor=trace"
_INTERCEPTED = "Msg intercepted!"  # follows on the same thread: somebody did try, it was not only looked up in advance


def log_zenoh(*, denials: bool) -> Callable[[], None]:
    """Log Zenoh's warnings, and what access rules deny, for the rest of the process. Before the first session.

    Returns what begins to pass them on, for when the session is open: if it cannot be, our own error says why.
    Where RUST_LOG is set it is left alone, and so is standard output.
    """
    if "RUST_LOG" in os.environ:
        zenoh.try_init_log_from_env()
        return lambda: None
    os.environ.setdefault("NO_COLOR", "1")
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    os.dup2(writing, 1)
    os.close(writing)
    zenoh.init_log_from_env_or(",".join(["warn", _NOISE, *([_DENIALS] if denials else [])]))
    return Thread(target=_forward, args=(reading,), name="zenoh-log", daemon=True).start


def _forward(reading: int) -> None:
    while chunk := os.read(reading, _PIPE_BYTES):
        for text, count in summed_up(chunk.decode(errors="replace")).items():
            log.warning("%s%s", text, f" ({count} times)" if count > 1 else "")
        time.sleep(_PERIOD_S)


def summed_up(lines: str) -> Counter[str]:
    """Return what the lines say, in our words, and how often each was said."""
    said: Counter[str] = Counter()
    last_denied: dict[str, str] = {}  # by thread
    for line in lines.splitlines():
        found = _LINE.match(line)
        if found is None:
            continue
        denied = _DENIED.search(found["text"])
        if denied is not None:
            direction = "from" if denied["flow"] == "ingress" else "to"
            last_denied[found["thread"]] = f"{denied['what']} on {denied['key']} {direction} session {denied['who']}"
        elif found["text"] == _INTERCEPTED:
            tried = last_denied.pop(found["thread"], "Delete")
            if not tried.startswith("Delete"):  # nobody deletes: that is the last of what is looked up in advance
                said[f"denied by access rules: {tried}"] += 1
        elif found["level"] in ("WARN", "ERROR"):
            said[_HINT.sub("", found["text"])] += 1
    return said
