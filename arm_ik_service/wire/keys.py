"""The key expressions of the bus, and which avatar ids may stand in them."""

from __future__ import annotations

import re
from dataclasses import dataclass

from arm_ik_service.errors import WireError

_ID = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.-]*", re.ASCII)


def check_id(name: str, max_length: int = 64) -> str:
    """Return the avatar or service id, or raise WireError naming what is wrong with it.

    Letters, digits, `_`, `-` and `.` only: an id becomes one chunk of a key expression, a Rerun entity and a file name.
    """
    if len(name) > max_length:
        raise WireError(f"id {name[:24]!r}... has {len(name)} characters: at most {max_length} are allowed")
    if not _ID.fullmatch(name):
        raise WireError(f"id {name!r} is refused: use letters, digits, '_', '-' and '.', not starting with '.'")
    return name


@dataclass(frozen=True)
class Keys:
    """Every key expression, under an optional prefix such as `lab3`."""

    prefix: str = ""

    def _under(self, key: str) -> str:
        return f"{self.prefix}/{key}" if self.prefix else key

    def controllers(self, avatar: str = "*") -> str:
        """ControllerFrame, in."""
        return self._under(f"avatar/{avatar}/controllers")

    def arms(self, avatar: str = "*") -> str:
        """ArmsState, out."""
        return self._under(f"avatar/{avatar}/arms")

    def watched_controllers(self, avatar: str = "*") -> str:
        """ControllerFrame, out: each that was answered, a moment later, for whoever only watches."""
        return self._under(f"watched/{avatar}/controllers")

    def watched_arms(self, avatar: str = "*") -> str:
        """ArmsState, out: the answer once more, a moment later. Who listens here delays nobody who waits for it."""
        return self._under(f"watched/{avatar}/arms")

    def skeleton(self, avatar: str = "*") -> str:
        """Skeleton: published when somebody comes and when their lengths change, and answered to queries."""
        return self._under(f"avatar/{avatar}/skeleton")

    def calibration(self, avatar: str = "*") -> str:
        """The profile in use: answered to queries."""
        return self._under(f"avatar/{avatar}/calibration")

    def health(self, service: str = "*") -> str:
        """Health, once a second."""
        return self._under(f"arm_ik/{service}/health")

    def liveliness(self, service: str = "*") -> str:
        """Liveliness token of a running service."""
        return self._under(f"arm_ik/{service}")

    def service_of(self, key: str) -> str:
        """Return the service's name of its liveliness token's key."""
        return key.rsplit("/", 1)[1]

    def avatar_of(self, key: str) -> str:
        """Return the avatar id of a key made by one of the avatar methods."""
        return key.rsplit("/", 2)[1]
