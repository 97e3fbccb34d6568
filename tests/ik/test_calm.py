"""What is shown: the solve's hand, its elbow without the starts and stops that limits make of it."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from streams import Array, Run, elbow_leaps, random_stream, run, targets_of, tumbling

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.body.report import jerk_rms
from arm_ik_service.geometry import batch
from arm_ik_service.ik.any_rotation import STUCK_M
from arm_ik_service.ik.calm import LONGEST_S, MOST_MISSED_RAD2
from arm_ik_service.ik.pace import ELBOW_STEP_M
from arm_ik_service.ik.state import new_arm
from arm_ik_service.ik.step import step_arm
from arm_ik_service.settings import SolverSettings, to_record

RIGHT = ArmModel.load()
DT_S = 1.0 / 90.0
AT_ONCE = msgspec.structs.replace(SolverSettings(), elbow_lag_m=0.0)


def waving(frames: int = 270) -> Array:
    """A hand (N,7) in front of the shoulder that turns in its place, three times a second, farther than a wrist can."""
    posture = (np.array([angle]) for angle in (0.7, 0.3, 0.0, 1.6, 0.0, 1.5, 0.0, 0.0, 0.0))
    rest = RIGHT.forward(RIGHT.configurations_at(*posture))["hand"][0]
    t = np.arange(frames) * DT_S
    turns = np.deg2rad(40.0) * np.sin(2 * np.pi * 3.0 * t) * np.minimum(t, 1.0)
    spin = batch.exp(turns[:, None] * np.array([0.0, 1.0, 0.0]))
    return np.hstack([np.tile(rest[:3], (frames, 1)), batch.multiply(np.tile(rest[3:], (frames, 1)), spin)])


def both(hands: Array) -> tuple[Run, Run]:
    """The same targets with the elbow calmed, and as it was solved."""
    targets = targets_of(hands, DT_S)
    return run(RIGHT, targets, DT_S), run(RIGHT, targets, DT_S, AT_ONCE)


def going_on(solved: Run) -> Array:
    """Which frames are longer than a second after a leap of the solve's arm, or a hand that it could not meet."""
    upset = np.concatenate([[False], elbow_leaps(RIGHT, solved) > 0.0]) | (solved.position_error_m > STUCK_M)
    since = np.arange(len(upset)) - np.maximum.accumulate(np.where(upset, np.arange(len(upset)), -len(upset)))
    return np.asarray(since * DT_S > 1.0)


def wrists(answer: Run) -> Array:
    return np.asarray(RIGHT.forward(answer.configuration)["wrist"][:, :3])


@pytest.mark.parametrize("seed", range(4))
def test_the_hand_is_where_the_solve_has_it(seed: int) -> None:
    calm, solved = both(random_stream(RIGHT, seed, most_m_s=3.0)[1])
    goes_on = going_on(solved)
    assert goes_on.mean() > 0.9
    apart = np.linalg.norm(wrists(calm) - wrists(solved), axis=1)[goes_on]
    assert np.mean(apart > 1e-9) < 0.002  # where limits would have had the elbow leap
    assert apart.max() < 5e-3


@pytest.mark.parametrize("seed", range(4))
def test_no_limit_is_exceeded_and_little_of_the_rotation_missed_for_the_elbows_sake(seed: int) -> None:
    calm, solved = both(random_stream(RIGHT, seed, most_m_s=5.0)[1])
    assert np.abs(RIGHT.excess(calm.configuration)).max() < 1e-9
    hands = [RIGHT.forward(answer.configuration)["hand"][:, 3:] for answer in (calm, solved)]
    missed = batch.angle_between(*hands)
    shoulders = calm.configuration[:, :4]
    assert (np.sum(shoulders[1:] * shoulders[:-1], axis=1) > 0.0).all()  # a quaternion that does not flip its sign
    most = 1.2 * np.sqrt(MOST_MISSED_RAD2)  # the root is of three joints, which do not just add up
    assert np.percentile(missed, 99) < most
    assert missed.max() < 2.0 * most  # where the elbow would have to leap for more
    assert np.median(missed) < 1e-6


def test_an_elbow_beside_a_hand_that_waves_hardly_moves() -> None:
    t = np.asarray(np.arange(268) * DT_S, np.float64)
    calm, solved = both(waving())
    assert (solved.limits != 0).any()  # else there would be nothing to calm
    assert jerk_rms(t, calm.elbow) < 0.5 * jerk_rms(t, solved.elbow)


def test_the_elbow_is_never_far_from_the_solves() -> None:
    for hands in (waving(), random_stream(RIGHT, 5, most_m_s=5.0)[1]):
        calm, solved = both(hands)
        apart = np.linalg.norm(calm.elbow - solved.elbow, axis=1)[going_on(solved)]
        assert 0.0 < apart.max() < 0.35 * float(RIGHT.chains[0]["upper_arm_m"])


def test_what_no_arm_can_follow_does_not_throw_the_elbow_about() -> None:
    calmer = []
    for seed in range(5):
        hands = tumbling(seed)
        calm, solved = both(hands)
        hand_steps = np.linalg.norm(np.diff(hands[1:-1, :3], axis=0), axis=1)
        steps, theirs = (np.linalg.norm(np.diff(run.elbow, axis=0), axis=1) - hand_steps for run in (calm, solved))
        assert steps.max() < max(2.0 * ELBOW_STEP_M, theirs.max())
        t = np.asarray(np.arange(len(hands) - 2) * DT_S, np.float64)
        calmer.append(jerk_rms(t, calm.elbow) / jerk_rms(t, solved.elbow))
    assert np.mean(calmer) < 0.85


def test_an_elbow_comes_to_the_solves_when_the_hand_rests() -> None:
    moved = random_stream(RIGHT, 7, most_m_s=3.0)[1][:200]
    rests = np.tile(moved[-1], (int(8 * LONGEST_S / DT_S), 1))
    calm, solved = both(np.vstack([moved, rests]))
    apart = np.linalg.norm(calm.elbow - solved.elbow, axis=1)
    assert apart[:200].max() > 1e-3
    assert apart[-1] < 1e-3


def test_the_solve_does_not_know_what_is_shown() -> None:
    targets = targets_of(random_stream(RIGHT, 8, most_m_s=3.0)[1], DT_S)
    calm, at_once = new_arm(RIGHT), new_arm(RIGHT)
    for target in targets[:300]:
        step_arm(calm[0], target, DT_S, to_record(SolverSettings()))
        step_arm(at_once[0], target, DT_S, to_record(AT_ONCE))
        np.testing.assert_array_equal(calm[0].configuration, at_once[0].configuration)
        np.testing.assert_array_equal(at_once[0].shown[4:], at_once[0].configuration[4:])
        np.testing.assert_array_equal(np.abs(at_once[0].shown[:4]), np.abs(at_once[0].configuration[:4]))
    assert (calm[0].shown != calm[0].configuration).any()
