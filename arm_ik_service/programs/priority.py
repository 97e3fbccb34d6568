"""Who is scheduled first where processors are scarce: a service and its clients, not those who only watch."""

from __future__ import annotations

import os
from contextlib import suppress

NICENESS = 10  # halfway to the least


def give_way(*, entirely: bool = False) -> None:
    """Lower the priority of this thread, and of threads and processes that it starts from now on.

    Where the system knows such a thing. To be called before anything that works.

    `entirely` is for what nobody waits for, such as a file: it runs where nobody else wants to, and ends its turn at
    once for whoever does. A merely nice process keeps a processor for some milliseconds (measured on two cores, a view
    that writes a file: p99 of the round trips beside it 0.8 to 2.1 ms, and 0.8 to 0.9 ms with this).
    """
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    if entirely and hasattr(os, "SCHED_IDLE"):
        with suppress(OSError):  # a sandbox may forbid it
            os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
