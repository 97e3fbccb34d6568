"""What `arm-ik top` shows: every service and every avatar, from the health they publish."""

from __future__ import annotations

import time
from threading import Lock
from typing import NamedTuple

from arm_ik_service.errors import WireError
from arm_ik_service.io.zenoh_streams import Bus, subscribe
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys
from arm_ik_service.wire.messages import AvatarHealth, Health

SILENT_AFTER_S = 3.0  # a service tells its health once a second


class Row(NamedTuple):
    """One avatar, and who answers it."""

    service: str
    avatar: AvatarHealth


class Top:
    """Keeps the newest health of every service on an open session, which the caller closes."""

    def __init__(self, bus: Bus, keys: Keys) -> None:
        self._lock = Lock()
        self._newest: dict[str, tuple[Health, float]] = {}
        self._subscriber = subscribe(bus, keys.health(), self._receive)

    def _receive(self, _key: str, payload: bytes, _time_ns: int) -> None:
        try:
            health = codec.healths.decode(payload)
        except WireError:
            return  # of another version
        with self._lock:
            self._newest[health.service] = (health, time.monotonic())

    def services(self) -> list[Health]:
        """Return the newest health of each service that still speaks, by name."""
        now_s = time.monotonic()
        with self._lock:
            living = [health for health, at_s in self._newest.values() if now_s - at_s < SILENT_AFTER_S]
        return sorted(living, key=lambda health: health.service)

    def close(self) -> None:
        """Hear no more."""
        self._subscriber.undeclare()


def rows_of(services: list[Health]) -> list[Row]:
    """Return every avatar, those who need attention first: lost frames, then lost tracking, then by name."""
    rows = [Row(health.service, avatar) for health in services for avatar in health.avatars]
    return sorted(
        rows,
        key=lambda row: (round(row.avatar.answered_share, 2), row.avatar.tracking == "tracked", row.avatar.avatar),
    )
