"""A leap of the solve's arm is shown as a way that an arm can go; the hand is kept where it should be."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from streams import Array, Run, elbow_leaps, random_stream, run, targets_of

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.body.report import jerk_rms
from arm_ik_service.geometry import batch
from arm_ik_service.ik.solver import Status
from arm_ik_service.settings import SolverSettings

RIGHT = ArmModel.load()
DT_S = 1.0 / 90.0
AT_ONCE = msgspec.structs.replace(SolverSettings(), elbow_lag_m=0.0)
ASTRAY_M = 0.02
SETTLES_S = 2.4
SEEDS = (0, 5, 6, 8, 10, 12)


def astray(seed: int) -> Array:
    """Hands (N,7) of an arm whose chest turns to and fro by 70 degrees and does not say so: limits are in the way."""
    hands = random_stream(RIGHT, seed, most_m_s=2.0)[1]
    t = np.arange(len(hands)) * DT_S
    turn = batch.exp(np.outer(np.deg2rad(70.0) * np.sin(2.0 * np.pi * 0.3 * t), [0.0, 1.0, 0.0]))
    return np.hstack([batch.rotate(turn, hands[:, :3]), batch.multiply(turn, hands[:, 3:])])


@pytest.fixture(scope="module")
def runs() -> list[tuple[Array, Run, Run]]:
    """Hands, what is shown for them, and what was solved."""
    hands = [astray(seed) for seed in SEEDS]
    targets = [targets_of(h, DT_S) for h in hands]
    return [(h[1:-1], run(RIGHT, t, DT_S), run(RIGHT, t, DT_S, AT_ONCE)) for h, t in zip(hands, targets, strict=True)]


def test_a_leap_is_shown_as_a_way(runs: list[tuple[Array, Run, Run]]) -> None:
    solved = sum(int((elbow_leaps(RIGHT, solved) > 0.0).sum()) for _, _, solved in runs)
    shown = sum(int((elbow_leaps(RIGHT, shown) > 0.0).sum()) for _, shown, _ in runs)
    assert solved >= 10
    assert shown <= 0.2 * solved


def test_the_elbows_jerk_is_a_fraction_of_the_solves(runs: list[tuple[Array, Run, Run]]) -> None:
    shares = []
    for _, shown, solved in runs:
        if (elbow_leaps(RIGHT, solved) > 0.0).any():
            t = np.asarray(np.arange(len(shown.elbow)) * DT_S, np.float64)
            shares.append(jerk_rms(t, shown.elbow) / jerk_rms(t, solved.elbow))
    assert len(shares) >= 5
    assert max(shares) < 1.0
    assert np.mean(shares) < 0.5


def test_limits_hold_on_the_way(runs: list[tuple[Array, Run, Run]]) -> None:
    for _, shown, _ in runs:
        assert np.abs(RIGHT.excess(shown.configuration)).max() < 1e-9


def test_a_hand_that_the_solve_meets_is_soon_met(runs: list[tuple[Array, Run, Run]]) -> None:
    longest = round(0.4 / DT_S)  # [frames]
    for hands, shown, solved in runs:
        place = [np.asarray(RIGHT.forward(answer.configuration)["wrist"][:, :3]) for answer in (shown, solved)]
        off, own = (np.linalg.norm(p - hands[:, :3], axis=1) for p in place)
        held_up = (off > ASTRAY_M) & (own < 1e-3)
        assert held_up.mean() < 0.05
        assert not np.lib.stride_tricks.sliding_window_view(held_up, longest).all(axis=1).any()
        assert (off - own).max() < 0.3


def test_what_is_missed_on_the_way_is_reported(runs: list[tuple[Array, Run, Run]]) -> None:
    for hands, shown, _ in runs:
        wrists = np.asarray(RIGHT.forward(shown.configuration)["wrist"][:, :3])
        off = np.linalg.norm(wrists - hands[:, :3], axis=1)
        assert (shown.status[off > 1e-3] != Status.SOLVED).all()


def test_it_arrives_when_the_hand_rests(runs: list[tuple[Array, Run, Run]]) -> None:
    arrived = 0
    for hands, _, solved in runs:
        for n in np.flatnonzero(elbow_leaps(RIGHT, solved) > 0.0)[:2]:
            rest = np.tile(hands[n + 2], (int(SETTLES_S / DT_S), 1))
            targets = targets_of(np.vstack([hands[: n + 2], rest]), DT_S)
            shown, goal = run(RIGHT, targets, DT_S), run(RIGHT, targets, DT_S, AT_ONCE)
            if goal.status[-1] == Status.SOLVED:
                assert np.linalg.norm(shown.elbow[-1] - goal.elbow[-1]) < 5e-3
                arrived += 1
    assert arrived >= 2
