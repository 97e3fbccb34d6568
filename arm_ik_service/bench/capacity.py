"""How many people one process carries, beside the same process without its solve; and what happens at twice as many."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from arm_ik_service.bench.load import Load, Measured
from arm_ik_service.bench.processes import part
from arm_ik_service.io.zenoh_bus import BusOptions, open_client
from arm_ik_service.io.zenoh_streams import Bus
from arm_ik_service.programs.demo import free_endpoint
from arm_ik_service.wire.messages import Health

LEAST_SHARE = 0.99
MOST_SERVICE_MS = 13.9  # p99, one frame at 72 Hz
MOST_CLIENT_MS = 20.0
WARM_UP_S = 1.0  # connections, first solves; not counted
MAX_AVATARS = 2048
FIRST, STEP, LAST = 50, 25, 600  # avatars of the ramp

Progress = Callable[[str, Measured], None]


class Step(NamedTuple):
    """One number of people on one kind of service."""

    measured: Measured
    memory_mb: float
    memory_slope_mb_h: float  # over the span, the first health left out

    @property
    def carried(self) -> bool:
        """Whether they were all answered, and in time."""
        measured = self.measured
        return (
            measured.answered_share >= LEAST_SHARE
            and measured.service_p99_ms <= MOST_SERVICE_MS
            and measured.client_p99_ms <= MOST_CLIENT_MS
        )

    def as_json(self) -> dict[str, Any]:
        """All of it, by name."""
        return self._asdict() | {"measured": self.measured._asdict(), "carried": self.carried}


class Capacity(NamedTuple):
    """Both ramps, by the number of people, and the service at twice what it carries."""

    rate_hz: float
    service: list[Step]
    empty: list[Step]
    overload: Step | None

    @property
    def ratio(self) -> float:
        """People carried with the solve, over people carried without."""
        return most_carried(self.service) / max(most_carried(self.empty), 1)

    def as_json(self) -> dict[str, Any]:
        """All of it, by name."""
        return {
            "rate_hz": self.rate_hz,
            "carried": most_carried(self.service),
            "carried_empty": most_carried(self.empty),
            "ratio": self.ratio,
            "service": [step.as_json() for step in self.service],
            "empty": [step.as_json() for step in self.empty],
            "overload": self.overload.as_json() if self.overload else None,
        }


def most_carried(steps: list[Step]) -> int:
    """The largest number of people that was carried; 0 for none."""
    return max((step.measured.avatars for step in steps if step.carried), default=0)


@contextmanager
def serving(kind: str) -> Iterator[tuple[Bus, str]]:
    """Run the service, or the empty one, with room for everybody; yield a client's session and where it connects."""
    endpoint = free_endpoint()
    with tempfile.TemporaryDirectory() as folder:
        settings = Path(folder) / "settings.toml"
        settings.write_text(f"[service]\nmax_avatars = {MAX_AVATARS}\nforget_after_s = 2.0\n")
        arguments = ["arm_ik_service", "serve", "--name", kind, "--listen", endpoint, "--settings", str(settings)]
        if kind == "empty":
            arguments = ["arm_ik_service.bench.empty_service", endpoint, str(MAX_AVATARS)]
        with part(*arguments), open_client(BusOptions(connect=(endpoint,)), wait_s=10.0) as bus:
            yield bus, endpoint


def load(bus: Bus, endpoint: str, avatars: int, rate_hz: float, seconds: float) -> Step:
    """Load an open service with so many people for so long."""
    people = Load(bus, (endpoint,), avatars, rate_hz, WARM_UP_S + seconds)
    try:
        people.run()
    finally:
        people.close()
    return Step(people.measured(from_s=WARM_UP_S), *memory(people.healths))


def memory(healths: list[Health]) -> tuple[float, float]:
    """Return the last resident size [MB], and its slope [MB/h] by least squares."""
    seen = [(health.time_ns / 1e9, health.memory_bytes / 1e6) for health in healths[1:] if health.memory_bytes]
    if len(seen) < 2:
        return (seen[-1][1] if seen else 0.0), 0.0
    mean_s = sum(s for s, _ in seen) / len(seen)
    mean_mb = sum(mb for _, mb in seen) / len(seen)
    spread = sum((s - mean_s) ** 2 for s, _ in seen)
    slope = sum((s - mean_s) * (mb - mean_mb) for s, mb in seen) / spread
    return seen[-1][1], 3600.0 * slope


def measure_capacity(*, rate_hz: float, seconds: float, progress: Progress | None = None) -> Capacity:
    """Raise the number until frames are lost or late; then load the service with twice what it carries.

    Both kinds run all the time and are loaded in turns: a machine that gets busier or quieter does so for both.
    """
    ramps: dict[str, list[Step]] = {"service": [], "empty": []}
    with ExitStack() as stack:
        served = {kind: stack.enter_context(serving(kind)) for kind in ramps}

        def try_it(kind: str, avatars: int, *, told_as: str | None = None, again: bool = True) -> Step:
            step = load(*served[kind], avatars, rate_hz, seconds)
            if again and not step.carried:  # once more: the machine may have done something else
                step = load(*served[kind], avatars, rate_hz, seconds)
            if progress is not None:
                progress(told_as or kind, step.measured)
            return step

        rising = list(ramps)
        for avatars in range(FIRST, LAST + 1, STEP):
            for kind in tuple(rising):
                ramps[kind].append(try_it(kind, avatars))
                if not ramps[kind][-1].carried:
                    rising.remove(kind)
        for between in range(2):  # the first half of the gap, then a quarter
            for kind, steps in ramps.items():
                if kind not in rising and (carried := most_carried(steps)):
                    steps.append(try_it(kind, carried + STEP // 2 ** (between + 1)))
        carried = most_carried(ramps["service"])
        overload = try_it("service", 2 * carried, told_as="twice", again=False) if carried else None
    service, empty = (sorted(steps, key=lambda step: step.measured.avatars) for steps in ramps.values())
    return Capacity(rate_hz, service, empty, overload)
