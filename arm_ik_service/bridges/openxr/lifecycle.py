"""The states of an OpenXR session and what each asks of us."""

from __future__ import annotations

from enum import Enum, IntEnum, auto


class State(IntEnum):
    """XrSessionState."""

    UNKNOWN = 0
    IDLE = 1
    READY = 2
    SYNCHRONIZED = 3
    VISIBLE = 4
    FOCUSED = 5
    STOPPING = 6
    LOSS_PENDING = 7
    EXITING = 8


class Step(Enum):
    """What has to be called because of a state."""

    BEGIN = auto()
    END = auto()
    LEAVE = auto()


class Lifecycle:
    """Follows one session. `running` between begin and end: only then may actions be synced."""

    def __init__(self) -> None:
        self.state = State.UNKNOWN
        self.running = False
        self.over = False

    def enter(self, state: State) -> Step | None:
        """Take note of a state event and return what to do about it, once."""
        self.state = state
        if state is State.READY and not self.running:
            self.running = True
            return Step.BEGIN
        if state is State.STOPPING and self.running:
            self.running = False
            return Step.END
        if state in (State.EXITING, State.LOSS_PENDING):
            self.running = False
            self.over = True
            return Step.LEAVE
        return None
