"""One avatar being served, and what its health is told from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import msgspec
import numpy as np

from arm_ik_service.body.profile import BodyMeasures, Profile
from arm_ik_service.geometry.batch import Array
from arm_ik_service.io.zenoh_streams import Stream
from arm_ik_service.wire.codec import MapDecoder
from arm_ik_service.wire.messages import TRACKING_STATES, AvatarHealth, TrackingState

NOTICEABLE = 0.01  # of a length: 3 mm of an upper arm, less than a view of it shows


class _Hand(msgspec.Struct):
    """What of an arm its health tells; the rest is skipped while reading."""

    tracking: TrackingState
    position_error_m: float


class _Hands(msgspec.Struct):
    left: _Hand
    right: _Hand


_both_hands = MapDecoder(_Hands)


@dataclass(slots=True)
class Seat:
    """One avatar being served; counts run since it sat down."""

    name: str
    index: int
    publisher: Stream
    profile: Profile
    measures: BodyMeasures  # as its skeleton tells them
    last_arrival_ns: int
    answered: int = 0
    overtaken: int = 0
    refused: int = 0
    last_payload: bytes | None = None  # of the last answer: for whoever joins late or takes over
    latency_max_ns: int = 0
    _before: tuple[int, int, int] = (0, 0, 0)  # answered, overtaken, refused at the last health

    def health(self, now_ns: int, period_s: float, refused_at_door: int) -> AvatarHealth:
        """Return what the last period brought, and begin the next."""
        refused = self.refused + refused_at_door
        counts = (self.answered, self.overtaken, refused)
        answered, overtaken, turned_away = (count - before for count, before in zip(counts, self._before, strict=True))
        arrived = answered + overtaken + turned_away
        latency_max_ns = self.latency_max_ns
        self._before, self.latency_max_ns = counts, 0
        hands = self._hands()
        return AvatarHealth(
            avatar=self.name,
            frames_per_s=answered / period_s,
            answered=self.answered,
            overtaken=self.overtaken,
            refused=refused,
            silent_s=max(0.0, (now_ns - self.last_arrival_ns) / 1e9),
            answered_share=answered / arrived if arrived else 1.0,
            latency_max_ms=latency_max_ns / 1e6,
            position_error_m=max((hand.position_error_m for hand in hands), default=0.0),
            tracking=min((hand.tracking for hand in hands), key=TRACKING_STATES.index, default="lost"),
        )

    def _hands(self) -> tuple[_Hand, ...]:
        """Both hands as the last answer told them."""
        if self.last_payload is None:
            return ()
        hands = _both_hands.decode(self.last_payload)
        return hands.left, hands.right


def outgrown(seats: Sequence[Seat], lengths: Array) -> list[Seat]:
    """Return those whose `Avatars.lengths` (N, 4) are noticeably others than their skeletons tell."""
    told = np.array([_lengths(seat.measures) for seat in seats])
    noticeable = (np.abs(lengths - told) > NOTICEABLE * told).any(axis=1)
    return [seat for seat, new in zip(seats, noticeable, strict=True) if new]


def _lengths(measures: BodyMeasures) -> tuple[float, ...]:
    return measures.stature_m, measures.upper_arm, measures.forearm, 0.5 * measures.shoulder_width


@dataclass(slots=True)
class Latencies:
    """Receive-to-publish times of the last health period, in a ring that is allocated once."""

    ring_ns: Any = field(default_factory=lambda: np.zeros(32_768, np.int64))
    count: int = 0

    def add(self, nanoseconds: int) -> None:
        """Take in one frame's."""
        self.ring_ns[self.count % len(self.ring_ns)] = nanoseconds
        self.count += 1

    def take_ms(self) -> tuple[float, float]:
        """Return p50 and p99 [ms] since the last call."""
        seen = self.ring_ns[: min(self.count, len(self.ring_ns))]
        self.count = 0
        if len(seen) == 0:
            return 0.0, 0.0
        p50, p99 = np.percentile(seen, [50, 99]) / 1e6
        return float(p50), float(p99)
