"""The trunk comes after the head by what is stated, at any frame rate, and leaves its trembling behind."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from persons import HEAD, Array, run, standing, stroke

from arm_ik_service.body.follow import follow, predicted_follow, start_at
from arm_ik_service.body.report import jerk_rms
from arm_ik_service.body.state import FOLLOWER
from arm_ik_service.geometry import batch

TIME_S = 0.04
Filter = Callable[[Any, Any, float, float, float], Any]


def followed(way: Filter, goals: npt.NDArray[Any], dt_s: float) -> Array:
    """Where a follower is in each frame of goals (N, 3)."""
    follower = np.zeros(1, FOLLOWER)[0]
    start_at(follower, tuple(goals[0]))
    places = [goals[0]]
    for k, goal in enumerate(goals[1:]):
        places.append(np.array(way(follower, tuple(goal), TIME_S, k * dt_s, dt_s)))
    return np.array(places)


@pytest.mark.parametrize("rate", [30.0, 72.0, 120.0, 500.0])
@pytest.mark.parametrize(("way", "late_s"), [(follow, TIME_S), (predicted_follow, 0.0)])
def test_a_steady_motion_is_trailed_by_what_is_stated(way: Filter, late_s: float, rate: float) -> None:
    t = np.arange(round(2.0 * rate)) / rate
    goals = np.outer(np.maximum(t - 0.5, 0.0), [1.0, -0.5, 0.0])
    late = (goals - followed(way, goals, 1.0 / rate))[-1]
    assert late == pytest.approx(late_s * np.array([1.0, -0.5, 0.0]), abs=0.5 / rate if late_s else 1e-6)


def test_a_motion_that_is_under_way_is_taken_up_at_once() -> None:
    goals = np.outer(np.arange(60.0) / 90.0, [1.0, 0.0, 2.0])
    assert followed(predicted_follow, goals, 1.0 / 90.0)[1:] == pytest.approx(goals[1:], abs=1e-6)
    late = np.linalg.norm(goals - followed(follow, goals, 1.0 / 90.0), axis=1)
    assert (np.diff(late) > -1e-9).all()  # it falls back to its delay, it does not start from a stop and catch up


@given(st.lists(st.floats(-100.0, 100.0), min_size=2, max_size=50), st.floats(1e-3, 0.1))
def test_no_goal_and_no_length_of_a_frame_throws_a_follower_off(goals: list[float], dt_s: float) -> None:
    way = np.array([[goal, 0.0, 0.0] for goal in goals])
    for filtered in (follow, predicted_follow):
        assert np.abs(followed(filtered, way, dt_s)).max() <= 4.0 * np.abs(way).max()


@pytest.mark.parametrize("rate", [90.0, 120.0])
def test_shoulders_tremble_less_than_the_head(rate: float) -> None:
    rng = np.random.default_rng(3)
    take = standing(3.0, rate)
    n = len(take.t)
    nod = np.stack([0.3 * np.sin(4.0 * take.t), 0.2 * np.sin(3.0 * take.t), 0.0 * take.t], axis=1)
    calm = take.moved(HEAD, 0.2 * np.stack([np.sin(3.0 * take.t), 0.0 * take.t, np.cos(2.0 * take.t)], axis=1))
    trembling = calm.moved(HEAD, rng.normal(0.0, 3e-4, (n, 3)))
    noise = rng.normal(0.0, 2e-3, (n, 3))
    here = run(calm.turned(HEAD, batch.exp(nod)).frames).body["shoulders"][:, 0]
    there = run(trembling.turned(HEAD, batch.exp(nod + noise)).frames).body["shoulders"][:, 0]
    stiff = 3e-4 * np.sqrt(60.0) * rate**3  # of a point that is fixed to the head
    assert jerk_rms(take.t, there - here) < 0.65 * stiff
    assert np.linalg.norm(there - here, axis=1).max() < 3e-3


def test_a_recentre_takes_the_neck_along_in_the_midst_of_a_step() -> None:
    take = standing(2.0)
    take = take.moved(HEAD, stroke(take.t, 0.5, 0.8, [0.0, 0.0, -0.6]))
    pose = np.array([3.0, 0.0, -1.0, *batch.exp([0.0, 2.0, 0.0])])
    here, there = run(take.frames), run(take.in_space(pose, slice(80, None)).frames)
    assert there.tracking["recentres"][-1] == 1
    expected = batch.compose(pose, np.concatenate([here.body["chest_position"], here.body["chest_rotation"]], axis=1))
    assert np.abs(there.body["chest_position"][80:] - expected[80:, :3]).max() < 0.01  # a frame's way
