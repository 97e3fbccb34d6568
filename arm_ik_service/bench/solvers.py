"""All solvers on the same arms and targets, in one run: `arm-ik bench solvers`.

Contenders take turns on each arm, so that a noisy minute of the machine falls on all of them. Garbage collection is off
while the clock runs. Every contender starts at the same posture and is warm: what it does once is done.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from arm_ik_service.bench.arm_tasks import ArmTask
from arm_ik_service.bench.contender import Contender, Tolerances, first_posture
from arm_ik_service.bench.measures import ArmResult, Summary, evaluate, recorded, summarise

CHUNK = 64  # frames at least between two looks at whether somebody wants to stop
RECORDED = "recorded"

Progress = Callable[[str, int], None]


class Comparison(NamedTuple):
    """What was measured; `results[contender][k]` belongs to `tasks[k]`. Only whole tasks are in it."""

    tasks: list[ArmTask]
    contenders: list[Contender]
    results: list[list[ArmResult]]
    tolerances: Tolerances
    interrupted: bool

    def summaries(self) -> dict[str, Summary]:
        """Summary by contender, and of the recorded person where one is known."""
        if not self.tasks:
            return {}
        met = self._met()
        rows = {
            contender.name: summarise(self.tasks, results, met)
            for contender, results in zip(self.contenders, self.results, strict=True)
        }
        person = recorded(self.tasks)
        return rows | ({RECORDED: person} if person else {})

    def _met(self) -> list[npt.NDArray[np.bool_]]:
        """For each task, whether any contender put the hand there without leaving the limits (N,)."""
        return [
            np.any(
                [
                    ~one.outside
                    & (one.position_error_m < 2.0 * self.tolerances.position_m)
                    & (one.orientation_error_rad < 2.0 * self.tolerances.orientation_rad)
                    for one in (results[k] for results in self.results)
                ],
                axis=0,
            )
            for k in range(len(self.tasks))
        ]

    def as_json(self, absent: dict[str, str]) -> dict[str, Any]:
        """One object for machines; `absent` says which peers were not measured and why."""
        versions = {contender.name: contender for contender in self.contenders}
        solvers = {}
        for name, summary in self.summaries().items():
            contender = versions.get(name)
            about = {"version": contender.version, "limits": contender.limits} if contender else {}
            solvers[name] = about | summary._asdict()
        return {
            "position_tolerance_m": self.tolerances.position_m,
            "orientation_tolerance_rad": self.tolerances.orientation_rad,
            "arms": [
                {"session": task.session, "side": task.side, "rate_hz": task.rate_hz, "frames": len(task.targets)}
                for task in self.tasks
            ],
            "solvers": solvers,
            "absent": absent,
            "interrupted": self.interrupted,
        }


def compare(
    tasks: Sequence[ArmTask],
    contenders: Sequence[Contender],
    tolerances: Tolerances,
    *,
    progress: Progress | None = None,
    stopped: Callable[[], bool] = lambda: False,
) -> Comparison:
    """Measure every contender on every task. When `stopped` says so, the task under way is dropped and the rest kept.

    `progress` is told the contender's name and how many frames it has just done.
    """
    done: list[ArmTask] = []
    results: list[list[ArmResult]] = [[] for _ in contenders]
    for task in tasks:
        start = first_posture(task, tolerances)
        measured = []
        for contender in contenders:
            one = _measure(contender, task, tolerances, start, progress, stopped)
            if one is None:
                return Comparison(done, list(contenders), results, tolerances, interrupted=True)
            measured.append(one)
        for mine, one in zip(results, measured, strict=True):
            mine.append(one)
        done.append(task)
    return Comparison(done, list(contenders), results, tolerances, interrupted=False)


def _measure(
    contender: Contender,
    task: ArmTask,
    tolerances: Tolerances,
    start: npt.NDArray[np.float64],
    progress: Progress | None,
    stopped: Callable[[], bool],
) -> ArmResult | None:
    count, block = len(task.targets), contender.block
    chunk = max(CHUNK, block)
    contender.begin(task._replace(targets=task.targets[:block]), tolerances, start).advance(0, min(block, count))
    run = contender.begin(task, tolerances, start)
    microseconds: list[float] = []
    for first in range(0, count, chunk):
        if stopped():
            return None
        last = min(first + chunk, count)
        with _no_garbage_collection():
            for at in range(first, last, block):
                end = min(at + block, last)
                began = time.perf_counter_ns()
                run.advance(at, end)
                microseconds.append(1e-3 * (time.perf_counter_ns() - began) / (end - at))
        if progress is not None:
            progress(contender.name, last - first)
    return evaluate(task, np.array(microseconds), *run.result())


@contextmanager
def _no_garbage_collection() -> Iterator[None]:
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
