"""A comparison as arms in world axes, for the picture."""

from __future__ import annotations

from pathlib import Path

from arm_ik_service.bench.solvers import RECORDED, Comparison
from arm_ik_service.geometry import batch
from arm_ik_service.io.rerun_view.ghosts import Ghosts, write_ghosts


def save_ghosts(path: Path, comparison: Comparison) -> None:
    """Write every contender's arms, and the recorded ones, to an .rrd. Raises ViewError."""
    arms = []
    for k, task in enumerate(comparison.tasks):
        place = task.shoulder
        elbow, wrist, residual = {}, {}, {}
        target = batch.compose(place, task.targets)
        if task.elbow is not None:
            elbow[RECORDED] = place[:, :3] + batch.rotate(place[:, 3:], task.elbow)
            wrist[RECORDED] = target[:, :3]
        for contender, results in zip(comparison.contenders, comparison.results, strict=True):
            poses = task.arm.forward(results[k].configuration)
            elbow[contender.name] = batch.compose(place, poses["elbow"])[:, :3]
            wrist[contender.name] = batch.compose(place, poses["hand"])[:, :3]
            residual[contender.name] = results[k].position_error_m
        arms.append(Ghosts(task.session, task.side, place[:, :3], target, elbow, wrist, residual))
    write_ghosts(path, arms, recorded=RECORDED)
