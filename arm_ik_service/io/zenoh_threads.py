"""Zenoh's network threads keep what Python makes for them, instead of having it made again for every callback.

A thread that is not Python's own gets a thread state when it calls into Python, and loses it when it returns
(PyGILState_Ensure and PyGILState_Release). With it go its stack's pages: CPython maps them for the first frame and
unmaps them after the last, two system calls, page faults and an interrupt to the other cores for every sample. A thread
that has called Ensure once more than Release keeps its state. Measured on two cores, 225 people at 72 Hz: the service's
system time 26 -> 11 us a frame, p99 in the service 10 -> 3.6 ms; 450 people: 92 % answered instead of 22 %.
"""

from __future__ import annotations

import ctypes
from threading import get_ident

# Of threads that have their state for good. Zenoh has as many threads for receiving as its runtime is told, and they
# live as long as the process.
_keeping: set[int] = set()


def keep_thread_state() -> None:
    """Let the calling thread keep its thread state; to be called in a callback, as often as one likes."""
    ident = get_ident()
    if ident not in _keeping:
        _keeping.add(ident)
        ctypes.pythonapi.PyGILState_Ensure()
