"""What is measured: anything that follows an arm's targets frame by frame. Ours here, other people's in `peers`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from arm_ik_service import __version__
from arm_ik_service.arm.model import ArmModel
from arm_ik_service.bench.arm_tasks import ArmTask
from arm_ik_service.ik.jacobian_transpose import JacobianTranspose
from arm_ik_service.ik.registry import SolverChoice, make_solver, options_of
from arm_ik_service.ik.solver import Counts

Array = npt.NDArray[np.float64]

# A compiled frame costs less than the call of `track` around it, and `track` carries the hand's motion on from frame to
# frame: it is timed this many frames at once, as its users call it. Its p99 is therefore one of blocks.
COMPILED_BLOCK = 500


class Tolerances(NamedTuple):
    """When a hand is where it should be; the same for everybody."""

    position_m: float = 5e-4
    orientation_rad: float = math.radians(0.3)


class Run(Protocol):
    """One contender on one task, built and warm; only `advance` is timed."""

    def advance(self, first: int, last: int) -> None:
        """Solve targets `first` to `last` (exclusive), in order, each from the one before."""
        ...

    def result(self) -> tuple[Array, Counts]:
        """Return configurations (N, 10) of our arm and iterations (N,), for the targets solved."""
        ...


@dataclass(frozen=True)
class Contender:
    """A solver to measure; `begin(task, tolerances, start)` builds it for a task, warm at `start` (10,)."""

    name: str
    version: str
    limits: str  # which limits it holds
    begin: Callable[[ArmTask, Tolerances, Array], Run]
    block: int = 1  # frames a timed call


class _OwnRun:
    """One of our solvers through `track`, as users call it."""

    def __init__(self, choice: SolverChoice, task: ArmTask, tolerances: Tolerances, start: Array) -> None:
        known = options_of(choice.name)
        defaults = {
            "position_tolerance_m": tolerances.position_m,
            "orientation_tolerance_rad": tolerances.orientation_rad,
            "frame_rate_hz": task.rate_hz,
        }
        options = {name: value for name, value in defaults.items() if name in known}
        self._solver = make_solver(choice.name, task.arm, **(options | choice.options))
        self._targets, self._at = task.targets, start
        self._solver.track(task.targets[:1], start)  # compiles
        self._configurations = np.empty((len(task.targets), 10))
        self._iterations = np.zeros(len(task.targets), np.int64)

    def advance(self, first: int, last: int) -> None:
        track = self._solver.track(self._targets[first:last], self._at)
        self._at = track.configuration[-1]
        self._configurations[first:last] = track.configuration
        self._iterations[first:last] = track.iterations

    def result(self) -> tuple[Array, Counts]:
        return self._configurations, self._iterations


def own(choice: SolverChoice) -> Contender:
    """Make a contender of one of our solvers. Raises SettingsError, before anything is measured, for a wrong option."""
    make_solver(choice.name, ArmModel.load(), **choice.options)
    return Contender(
        name=choice.label,
        version=__version__,
        limits="all",
        begin=lambda task, tolerances, start: _OwnRun(choice, task, tolerances, start),
        block=COMPILED_BLOCK if choice.name == "jacobian_transpose" else 1,
    )


def first_posture(task: ArmTask, tolerances: Tolerances) -> Array:
    """Where everybody starts: the default solver's answer (10,) to the first target."""
    solver = JacobianTranspose(task.arm, 128, tolerances.position_m, tolerances.orientation_rad)
    return np.asarray(solver.track(task.targets[:1]).configuration[0])
