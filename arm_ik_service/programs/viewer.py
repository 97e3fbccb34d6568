"""Showing in Rerun what is on the bus, in a process of its own: it watches, and never delays the service."""

from __future__ import annotations

from collections.abc import Callable
from threading import Event

from arm_ik_service.errors import WireError
from arm_ik_service.io.rerun_view import Overlay, RerunView, Sink, Skin
from arm_ik_service.io.rerun_view.live import LiveView
from arm_ik_service.io.zenoh_streams import Bus, query, subscribe
from arm_ik_service.programs.elbow_comfort import ElbowComforts
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys

SPACING_M = 1.2  # between people who were recorded at the same place


class Viewer:
    """Draws every avatar on an open Zenoh session, which the caller closes."""

    def __init__(
        self,
        bus: Bus,
        sinks: list[Sink],
        keys: Keys,
        skin: Skin | None = None,
        overlays: frozenset[Overlay] = frozenset(),
    ) -> None:
        """Open the sinks and subscribe; people are drawn as `skin`, or as solids. Raises ViewError."""
        self._keys = keys
        self._stopped = Event()
        comfort = ElbowComforts() if "swivel" in overlays else None
        view = RerunView(*sinks, name="arm-ik", spacing_m=SPACING_M, skin=skin, show=overlays, comfort=comfort)
        self._view = LiveView(view, when_gone=self.stop)
        self.refused = 0
        self._subscribers = [
            subscribe(bus, keys.watched_controllers(), self._guarded(self._take_frame)),
            subscribe(bus, keys.watched_arms(), self._guarded(self._take_arms)),
            subscribe(bus, keys.skeleton(), self._guarded(self._take_skeleton)),
        ]
        for key, payload in query(bus, keys.skeleton()):
            self._guarded(self._take_skeleton)(key, payload, 0)

    def stop(self) -> None:
        """Make `run` return; safe in a signal handler."""
        self._stopped.set()

    def run(self, duration_s: float | None = None) -> None:
        """Draw until `stop`, or for `duration_s`."""
        self._stopped.wait(duration_s)

    def close(self) -> str:
        """Draw the rest, let go of the sinks, and return one line that says what was shown.

        Raises ViewError where the viewer was closed, or does not take the rest.
        """
        for subscriber in self._subscribers:
            subscriber.undeclare()
        self._view.close()
        if self._view.error is not None:
            raise self._view.error
        return f"{self._view.shown} answers drawn, {self._view.dropped} pictures dropped"

    def _guarded(self, take: Callable[[str, bytes], None]) -> Callable[[str, bytes, int], None]:
        def receive(key: str, payload: bytes, _time_ns: int) -> None:
            try:
                take(key, payload)
            except WireError:
                self.refused += 1

        return receive

    def _take_frame(self, key: str, payload: bytes) -> None:
        self._view.offer_frame(self._keys.avatar_of(key), codec.controller_frames.decode(payload))

    def _take_arms(self, _key: str, payload: bytes) -> None:
        self._view.offer_arms(codec.arms_states.decode(payload))

    def _take_skeleton(self, _key: str, payload: bytes) -> None:
        self._view.offer_skeleton(codec.skeletons.decode(payload))
