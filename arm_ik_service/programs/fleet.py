"""Which service answers which avatar: rendezvous hashing over the services whose liveliness token is there.

Every service computes the same owner from the same list of names; nobody is asked and nobody decides. A service that
comes or goes moves only its own share: the scores of the others do not change.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from hashlib import blake2b
from threading import Lock

from arm_ik_service.errors import BusError
from arm_ik_service.io.zenoh_streams import Bus, announce, living, watch_liveliness
from arm_ik_service.wire.keys import Keys


def score(service: str, avatar: str) -> int:
    """How much a service wants an avatar: the same number on every machine, for every Python."""
    return int.from_bytes(blake2b(f"{service}/{avatar}".encode(), digest_size=8).digest(), "big")


def owner_of(avatar: str, services: Iterable[str]) -> str:
    """Return the service that answers an avatar: the highest score (Thaler and Ravishankar 1998)."""
    return max(services, key=lambda service: (score(service, avatar), service))


class Fleet:
    """The services on the bus as this one sees them, itself among them from the start."""

    def __init__(self, bus: Bus, keys: Keys, name: str, changed: Callable[[], None]) -> None:
        """Look who is there. `changed` is called on a Zenoh thread: store and return.

        Raises BusError where a service of this name is running: two would both answer the same avatars.
        """
        self._bus = bus
        self._keys = keys
        self._name = name
        self._changed = changed
        self._lock = Lock()
        present = {keys.service_of(key) for key in living(bus, keys.liveliness())}
        if name in present:
            raise BusError(f"a service named {name!r} is running already: give this one another --name")
        self._services = frozenset({name, *present})
        self._token: object | None = None
        self._watch = watch_liveliness(bus, keys.liveliness(), self._see)

    @property
    def services(self) -> frozenset[str]:
        """The names of all services."""
        return self._services

    @property
    def alone(self) -> bool:
        """Whether every avatar is ours."""
        return len(self._services) == 1

    def owns(self, avatar: str) -> bool:
        """Whether the avatar is ours to answer."""
        return len(self._services) == 1 or owner_of(avatar, self._services) == self._name

    def join(self) -> None:
        """Say that we are there, as long as this process is: the others give up what is ours from now on."""
        self._token = announce(self._bus, self._keys.liveliness(self._name))

    def leave(self) -> None:
        """Say that we are gone: the others take over."""
        if self._token is not None:
            self._token.undeclare()  # type: ignore[attr-defined]
            self._token = None
        self._watch.undeclare()

    def _see(self, key: str, alive: bool) -> None:
        service = self._keys.service_of(key)
        with self._lock:
            services = self._services | {service} if alive else self._services - {service}
            services |= {self._name}  # our own token may be reported gone where a link flickers
            if services == self._services:
                return
            self._services = services
        self._changed()
