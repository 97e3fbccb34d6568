"""One load for long: does anything grow?"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from arm_ik_service.bench.capacity import Step, memory, serving
from arm_ik_service.bench.load import Load

SETTLING_S = 60.0  # pools and buffers grow to their size; a third of a shorter run


class Soak(NamedTuple):
    """The whole run but its beginning; memory is of what came after."""

    step: Step
    first_p99_ms: float  # of the service's own stamps: median over the seconds of a third of the run
    last_p99_ms: float

    def as_json(self) -> dict[str, Any]:
        """All of it, by name."""
        return self.step.as_json() | {"first_p99_ms": self.first_p99_ms, "last_p99_ms": self.last_p99_ms}


def measure_soak(*, avatars: int, rate_hz: float, seconds: float) -> Soak:
    """Load one service with so many people for so long."""
    with serving("service") as (bus, endpoint):
        people = Load(bus, (endpoint,), avatars, rate_hz, seconds)
        people.run()
        people.close()
    settling_s = min(SETTLING_S, seconds / 3.0)
    began_ns = people.healths[0].time_ns if people.healths else 0
    settled = [health for health in people.healths if health.time_ns > began_ns + settling_s * 1e9]
    p99_ms = [health.latency_p99_ms for health in settled if health.latency_p99_ms > 0.0]
    third = max(1, len(p99_ms) // 3)
    return Soak(
        Step(people.measured(from_s=settling_s), *memory(settled)),
        float(np.median(p99_ms[:third])) if p99_ms else float("nan"),
        float(np.median(p99_ms[-third:])) if p99_ms else float("nan"),
    )
