"""How people move: along minimum-jerk strokes that overlap.

A hand that goes from one place to another does so with the least jerk there is (Flash & Hogan, J Neurosci 1985); one
that changes its mind adds a second such stroke to the first before that is over (Flash & Henis, J Cogn Neurosci 1991).
So a movement is a start and a list of strokes, each from the target before it to its own, all added up; where strokes
overlap, corners become curves.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from arm_ik_service.geometry.batch import Array

PEAK_SPEED = 1.875  # of a minimum-jerk stroke, in distances a duration


def minimum_jerk(phase: npt.ArrayLike) -> Array:
    """Return how much of the way is done (...,) at a phase of the stroke: 0 before it, 1 after it."""
    s = np.clip(np.asarray(phase, float), 0.0, 1.0)
    return np.asarray(s * s * s * (10.0 + s * (6.0 * s - 15.0)))


class Movement:
    """A vector-valued function of time. Units are those of the values."""

    def __init__(self, start: Sequence[float]) -> None:
        self._start = np.array(start, float)
        self._last = self._start
        self._strokes: list[tuple[float, float, Array]] = []  # begin [s], duration [s], change

    def stroke(self, begin_s: float, duration_s: float, target: Sequence[float]) -> Movement:
        """Add a stroke to `target`; returns itself, so that a movement can be written as one expression."""
        to = np.array(target, float)
        self._strokes.append((begin_s, duration_s, to - self._last))
        self._last = to
        return self

    def at(self, time_s: Array) -> Array:
        """Values (N, k) at times (N,)."""
        value = np.broadcast_to(self._start, (len(time_s), len(self._start))).copy()
        for begin_s, duration_s, change in self._strokes:
            value += minimum_jerk((time_s - begin_s) / duration_s)[:, None] * change
        return value
