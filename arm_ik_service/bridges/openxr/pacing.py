"""When the next sample is due, and which sample time it gets.

In a headless session xrWaitFrame does not wait and its time cannot be trusted, so the bridge keeps time itself.
"""

from __future__ import annotations


class Pacer:
    """Absolute deadlines at a fixed rate: lateness of one frame does not delay the next, and none is made up for."""

    def __init__(self, rate_hz: float, now_ns: int) -> None:
        self._period_ns = round(1e9 / rate_hz)
        self._next_ns = now_ns

    def next_deadline(self, now_ns: int) -> int:
        """Return the moment of the next sample [ns]: on the grid, and in the past by less than a period."""
        behind = max(0, (now_ns - self._next_ns) // self._period_ns)
        deadline_ns = self._next_ns + behind * self._period_ns
        self._next_ns = deadline_ns + self._period_ns
        return deadline_ns


class SampleClock:
    """Sample times: they run with the monotonic clock, and begin at the wall clock's time.

    The wall clock itself may be set at any moment; velocities are taken against sample times.
    """

    def __init__(self, monotonic_ns: int, wall_ns: int) -> None:
        self._offset_ns = wall_ns - monotonic_ns

    def sample_time_ns(self, monotonic_ns: int) -> int:
        """Return the sample time of a moment of the monotonic clock."""
        return monotonic_ns + self._offset_ns


def timespec(time_ns: int) -> tuple[int, int]:
    """Return seconds and nanoseconds, the latter within 0..999999999 for moments before zero as well."""
    return divmod(time_ns, 1_000_000_000)


class Backoff:
    """How long to wait before the next attempt: twice as long each time, up to a limit, until one succeeds."""

    def __init__(self, first_s: float = 0.25, longest_s: float = 2.0) -> None:
        self._first_s = first_s
        self._longest_s = longest_s
        self._next_s = first_s

    def failed(self) -> float:
        """Return the wait [s] after a failure."""
        wait_s, self._next_s = self._next_s, min(2.0 * self._next_s, self._longest_s)
        return wait_s

    def succeeded(self) -> None:
        """Begin again from the shortest wait."""
        self._next_s = self._first_s
