"""A network of its own for one process, with a link that can be cut (Linux, root)."""

from __future__ import annotations

import os
import subprocess

from arm_ik_service.errors import ArmIkError

OUTSIDE, INSIDE = "10.213.7.1", "10.213.7.2"  # addresses at both ends of the link


class Namespace:
    """A network namespace joined to ours by a pair of virtual interfaces."""

    def __init__(self) -> None:
        """Raises ArmIkError where it cannot be made."""
        self._name = f"arm-ik-{os.getpid()}"
        self._ours, self._theirs = f"aik{os.getpid() % 100_000}a", f"aik{os.getpid() % 100_000}b"
        self._ip("netns", "add", self._name)
        try:
            self._ip("link", "add", self._ours, "type", "veth", "peer", "name", self._theirs, "netns", self._name)
            self._ip("addr", "add", f"{OUTSIDE}/30", "dev", self._ours)
            self._ip("link", "set", self._ours, "up")
            self._ip("-n", self._name, "addr", "add", f"{INSIDE}/30", "dev", self._theirs)
            self._ip("-n", self._name, "link", "set", "lo", "up")
            self.join()
        except ArmIkError:
            self.close()
            raise

    @property
    def inside(self) -> tuple[str, ...]:
        """The command that runs another inside."""
        return ("ip", "netns", "exec", self._name)

    def cut(self) -> None:
        """Let nothing through; connections stay open and hear nothing."""
        self._ip("-n", self._name, "link", "set", self._theirs, "down")

    def join(self) -> None:
        """Let everything through."""
        self._ip("-n", self._name, "link", "set", self._theirs, "up")

    def close(self) -> None:
        """Remove it, and the link with it."""
        self._ip("netns", "del", self._name)

    @staticmethod
    def _ip(*arguments: str) -> None:
        try:
            subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True)
        except (OSError, subprocess.CalledProcessError) as error:
            why = getattr(error, "stderr", None) or error
            raise ArmIkError(f"no network namespace: {str(why).strip()}; this needs Linux, `ip` and root") from error
