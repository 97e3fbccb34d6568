"""What a service counts, and the health that it tells from it once a period."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Collection, Iterable
from pathlib import Path

import arm_ik_service
from arm_ik_service.programs.seats import Latencies, Seat
from arm_ik_service.wire.messages import VERSION, AvatarHealth, Health

log = logging.getLogger("arm_ik.service")


class Tally:
    """Counts of a service since its start; whoever calls holds the service's lock."""

    def __init__(self) -> None:
        self._answered = 0
        self._overtaken = 0
        self._refused: dict[str, int] = {}
        self._details: dict[str, tuple[int, str]] = {}  # of what was refused since it was logged last
        self._before = (0, 0, 0)  # answered, overtaken, refused at the last health
        self._latencies = Latencies()
        self._started_s = time.monotonic()

    def arrived(self, seat: Seat | None, receive_time_ns: int, overtaken: int) -> None:
        """Count a frame, and those that it replaced."""
        self._overtaken += overtaken
        if seat is not None:
            seat.last_arrival_ns = receive_time_ns
            seat.overtaken += overtaken

    def answered(self, seat: Seat, payload: bytes, latency_ns: int) -> None:
        """Count an answer that was put, receive to publish."""
        seat.last_payload = payload
        seat.answered += 1
        self._answered += 1
        seat.latency_max_ns = max(seat.latency_max_ns, latency_ns)
        self._latencies.add(latency_ns)

    def refused(self, cause: str, detail: str, seat: Seat | None = None, count: int = 1) -> None:
        """Count what cannot be used; the detail is for the log."""
        self._refused[cause] = self._refused.get(cause, 0) + count
        self._details[cause] = (self._details.get(cause, (0, ""))[0] + count, detail)
        if seat is not None:
            seat.refused += count

    def log_refused(self) -> None:
        """Log what was refused since the last call, a line a cause."""
        for cause, (count, detail) in self._details.items():
            log.warning("refused %d frame(s), %s; the last: %s", count, cause, detail)
        self._details.clear()

    def health(self, service: str, now_ns: int, avatars: Iterable[AvatarHealth], services: Collection[str]) -> Health:
        """Return what the last period brought, and begin the next."""
        p50_ms, p99_ms = self._latencies.take_ms()
        counts = (self._answered, self._overtaken, sum(self._refused.values()))
        answered, overtaken, refused = (count - before for count, before in zip(counts, self._before, strict=True))
        self._before = counts
        arrived = answered + overtaken + refused
        return Health(
            version=VERSION,
            service=service,
            software=f"arm-ik-service {arm_ik_service.__version__}",
            time_ns=now_ns,
            uptime_s=time.monotonic() - self._started_s,
            answered=self._answered,
            overtaken=self._overtaken,
            refused=dict(self._refused),
            latency_p50_ms=p50_ms,
            latency_p99_ms=p99_ms,
            avatars=tuple(avatars),
            answered_share=answered / arrived if arrived else 1.0,
            services=tuple(sorted(services)),
            memory_bytes=_resident_bytes(),
        )

    def farewell(self) -> str:
        """Return one line that says what was served."""
        refused = ", ".join(f"{count} {cause}" for cause, count in self._refused.items()) or "none"
        return f"answered {self._answered} frames, overtaken {self._overtaken}, refused: {refused}"


def _resident_bytes() -> int:
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, AttributeError):
        return 0
