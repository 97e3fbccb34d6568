"""Nothing a sender can put into a pose gets through to the numbers behind it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from persons import HEAD, LEFT, RIGHT, Run, run, standing

from arm_ik_service.tracking.state import HELD, LOST, TRACKED

anything = st.floats(allow_nan=True, allow_infinity=True)
hostile = st.one_of(anything, st.sampled_from([math.nan, math.inf, -math.inf, 1e30, -1e308, 5e-324, 0.0]))


def assert_sane(made: Run) -> None:
    """Finite, unit, and a person."""
    for device in (HEAD, LEFT, RIGHT):
        records = made.device(device)
        for field in ("position", "rotation", "linear_velocity", "angular_velocity"):
            assert np.isfinite(records[field]).all(), field
        assert np.linalg.norm(records["rotation"], axis=1) == pytest.approx(1.0, abs=1e-9)
    for field in ("chest_position", "chest_rotation", "shoulders", "reach_ratio"):
        assert np.isfinite(made.body[field]).all(), field
    for field in ("position", "rotation", "linear_velocity", "angular_velocity"):
        assert np.isfinite(made.body["targets"][field]).all(), field
    reach = np.linalg.norm(made.body["targets"]["position"], axis=2)
    assert (reach < made.body["arm_length"][:, None]).all()


@settings(max_examples=60)
@given(st.lists(st.lists(hostile, min_size=7, max_size=7), min_size=1, max_size=6), st.integers(0, 2))
def test_whatever_a_pose_holds_the_person_stays_finite(garbage: list[list[float]], device: int) -> None:
    take = standing(0.3)
    take.poses[5 : 5 + len(garbage), device] = garbage
    assert_sane(run(take.frames))


@settings(max_examples=30)
@given(st.lists(st.lists(hostile, min_size=21, max_size=21), min_size=1, max_size=4))
def test_garbage_from_the_very_first_frame_is_survived(garbage: list[list[float]]) -> None:
    take = standing(0.3)
    take.poses[: len(garbage)] = np.reshape(garbage, (len(garbage), 3, 7))
    assert_sane(run(take.frames))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e30, 1000.1])
def test_a_position_that_cannot_be_costs_that_position_alone(bad: float) -> None:
    take = standing(0.3)
    take.poses[10, LEFT, 1] = bad
    made = run(take.frames)
    assert made.device(LEFT)["position_state"][10] == HELD
    assert made.device(LEFT)["rotation_state"][10] == TRACKED
    assert made.device(RIGHT)["position_state"][10] == TRACKED
    assert made.position(LEFT)[10] == pytest.approx(take.poses[9, LEFT, :3], abs=1e-6)


@pytest.mark.parametrize("norm", [0.0, 0.97, 1.03, 2.0, math.nan, math.inf, 1e200])
def test_a_rotation_that_is_none_costs_that_rotation_alone(norm: float) -> None:
    take = standing(0.3)
    take.poses[10, LEFT, 3:] = (0.0, 0.0, 0.0, norm)
    made = run(take.frames)
    assert made.device(LEFT)["rotation_state"][10] == HELD
    assert made.device(LEFT)["position_state"][10] == TRACKED


@pytest.mark.parametrize("norm", [0.985, 1.0, 1.015])
def test_a_rotation_that_was_rounded_is_taken_and_made_unit(norm: float) -> None:
    take = standing(0.3)
    take.poses[:, LEFT, 3:] *= norm
    made = run(take.frames)
    assert (made.device(LEFT)["rotation_state"] == TRACKED).all()
    assert_sane(made)


def test_before_any_data_someone_stands_there_and_is_lost() -> None:
    made = run(standing(0.3).flagged(HEAD, slice(None), 0).flagged(1, slice(None), 0).flagged(2, slice(None), 0).frames)
    assert (made.tracking["hands"]["position_state"] == LOST).all()
    head, left, right = (made.position(k)[-1] for k in (HEAD, LEFT, RIGHT))
    assert 1.4 < head[1] < 1.9
    assert left[0] < -0.1 < 0.1 < right[0]
    assert left[1] == right[1] < head[1] - 0.6


def test_a_pose_of_zeros_was_never_filled_in() -> None:
    take = standing(0.3)
    take.poses[0] = 0.0
    made = run(take.frames)
    assert made.device(LEFT)["position_state"][0] == LOST
    assert made.position(LEFT)[1] == pytest.approx(take.poses[1, LEFT, :3])
