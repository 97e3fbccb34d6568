"""Who is scheduled first where processors are scarce: a service and its clients, not those who only watch."""

from __future__ import annotations

import os

NICENESS = 10  # halfway to the least


def give_way() -> None:
    """Lower the priority of this process and of those it starts, where the system knows such a thing."""
    if hasattr(os, "nice"):
        os.nice(NICENESS)
