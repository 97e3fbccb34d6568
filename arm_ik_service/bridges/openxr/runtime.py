"""What the bridge asks of a runtime: the words between the part that decides and the part that calls OpenXR."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

from arm_ik_service.bridges.openxr.lifecycle import State
from arm_ik_service.wire.messages import Quaternion, Side, Space, Vector


class RuntimeAwayError(Exception):
    """The runtime cannot be reached, or left in the middle of a session; the text says what it answered."""


@dataclass(frozen=True)
class Located:
    """What xrLocateSpace said; its XrSpaceLocationFlags and XrSpaceVelocityFlags tell which numbers mean anything."""

    flags: int
    position: Vector = (0.0, 0.0, 0.0)
    orientation: Quaternion = (0.0, 0.0, 0.0, 1.0)
    velocity_flags: int = 0
    linear_velocity: Vector = (0.0, 0.0, 0.0)
    angular_velocity: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class LocatedHand:
    """One hand: its grip action and, where the runtime tracks hands, its wrist joint."""

    grip_active: bool
    grip: Located
    wrist: Located | None = None


@dataclass(frozen=True)
class Sample:
    """Everything located at one moment."""

    head: Located
    hands: dict[Side, LocatedHand]


@dataclass(frozen=True)
class Description:
    """What a runtime is and what it agreed to."""

    runtime: str
    version: str
    system: str
    extensions: tuple[str, ...]
    enabled: tuple[str, ...]
    spaces: tuple[str, ...]
    space: Space
    profiles: dict[str, str] = field(default_factory=dict)  # suggested profile -> "accepted", or why not


class Runtime(Protocol):
    """An OpenXR runtime. Every method but `destroy` raises RuntimeAwayError when the runtime fails."""

    def create(self, space: Space | None) -> Description:
        """Make instance, session, actions and spaces; None takes the best space there is.

        Raises BridgeError for what waiting does not mend: no runtime installed, an extension or the space missing.
        """

    def poll_states(self) -> list[State]:
        """Return the session states entered since the last call, oldest first."""

    def begin(self) -> None:
        """Begin the session, which is READY."""

    def end(self) -> None:
        """End the session, which is STOPPING."""

    def request_exit(self) -> None:
        """Ask for the states that lead to EXITING."""

    def sync(self) -> bool:
        """Sync the actions; False while the session is not focused, when poses mean nothing."""

    def xr_time(self, monotonic_ns: int) -> int:
        """Convert a moment of CLOCK_MONOTONIC to this instance's XrTime."""

    def locate(self, xr_time: int) -> Sample:
        """Locate head and hands at a moment."""

    def profiles_in_use(self) -> dict[Side, str]:
        """Return the interaction profile that each hand's controller has now, empty where there is none."""

    def destroy(self) -> None:
        """Let go of everything, whatever state the runtime is in; never raises."""
