"""What a stream of answers amounts to: rate, latency, residuals, iterations, limits, tracking."""

from __future__ import annotations

from array import array
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from arm_ik_service.wire.messages import SIDES, ArmsState


def percentiles(values: Any, *ranks: float) -> list[float]:
    """Return percentiles of a sequence of numbers; zeros for an empty one."""
    return np.percentile(values, ranks).tolist() if len(values) else [0.0] * len(ranks)


@dataclass
class Summary:
    """Grows by one answer at a time; a minute of 120 Hz takes half a megabyte."""

    first_s: float = 0.0
    last_s: float = 0.0
    frames: int = 0
    service_ms: Any = field(default_factory=lambda: array("d"))  # received to published
    solve_us: Any = field(default_factory=lambda: array("d"))
    residual_mm: dict[str, Any] = field(default_factory=lambda: {side: array("d") for side in SIDES})
    iterations: Any = field(default_factory=lambda: array("d"))
    limits: Counter[str] = field(default_factory=Counter)
    tracking: dict[str, Counter[str]] = field(default_factory=lambda: {side: Counter() for side in SIDES})

    def add(self, state: ArmsState, arrived_s: float) -> None:
        """Take in one answer that arrived at `arrived_s` of any steady clock."""
        if self.frames == 0:
            self.first_s = arrived_s
        self.last_s = arrived_s
        self.frames += 1
        self.service_ms.append((state.publish_time_ns - state.receive_time_ns) / 1e6)
        self.solve_us.append(state.solve_time_ns / 1e3)
        for side, arm in (("left", state.left), ("right", state.right)):
            self.tracking[side][arm.tracking] += 1
            self.residual_mm[side].append(arm.position_error_m * 1e3)
            self.iterations.append(arm.iterations)
            self.limits.update(f"{side} {name}" for name in arm.limits)

    @property
    def rate_hz(self) -> float:
        """Answers per second."""
        span_s = self.last_s - self.first_s
        return (self.frames - 1) / span_s if span_s > 0.0 else 0.0

    def rows(self) -> list[tuple[str, str]]:
        """Return what to show a person: a name and a text each."""
        p50, p99 = percentiles(self.service_ms, 50, 99)
        solve50, solve99 = percentiles(self.solve_us, 50, 99)
        iterations50, iterations99 = percentiles(self.iterations, 50, 99)
        rows = [
            ("frames answered", f"{self.frames}"),
            ("rate", f"{self.rate_hz:.1f} Hz"),
            ("latency in the service", f"p50 {p50:.2f} ms, p99 {p99:.2f} ms"),
            ("of it decoding and solving both arms", f"p50 {solve50:.0f} us, p99 {solve99:.0f} us"),
            ("iterations an arm", f"p50 {iterations50:.0f}, p99 {iterations99:.0f}"),
        ]
        for side in SIDES:
            residual50, residual99 = percentiles(self.residual_mm[side], 50, 99)
            states = ", ".join(
                f"{name} {100 * count / self.frames:.1f} %" for name, count in self.tracking[side].most_common()
            )
            rows.append((f"{side} hand residual", f"p50 {residual50:.2f} mm, p99 {residual99:.2f} mm"))
            rows.append((f"{side} hand", states))
        hit = ", ".join(f"{name} {100 * count / self.frames:.1f} %" for name, count in self.limits.most_common(6))
        rows.append(("joint limits rested on", hit or "none"))
        return rows
