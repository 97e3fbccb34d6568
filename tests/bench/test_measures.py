"""Every number in the table means what its heading says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.bench.arm_tasks import ArmTask, read_tasks
from arm_ik_service.bench.measures import elbow_steps, evaluate, jerk_rms, recorded, summarise

ARM = ArmModel.load()


def task_of(configurations: np.ndarray, *, elbow_off_m: float = 0.0) -> ArmTask:
    poses = ARM.forward(configurations)
    elbow = poses["elbow"][:, :3] + np.array([elbow_off_m, 0.0, 0.0])
    place = np.tile((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0), (len(configurations), 1))
    return ArmTask("made up", "right", 100.0, ARM, poses["hand"], elbow, place)


def test_jerk_of_a_cubic_is_its_third_derivative() -> None:
    t = np.arange(50)[:, None] / 100.0
    assert jerk_rms(t**3 * np.array([1.0, 0.0, 0.0]), 100.0) == pytest.approx(6.0)
    assert jerk_rms(t**2 * np.ones(3), 100.0) == pytest.approx(0.0, abs=1e-6)
    assert np.isnan(jerk_rms(np.zeros((3, 3)), 100.0))


def test_only_steps_over_five_centimetres_count() -> None:
    path = np.cumsum([[0.0, 0, 0], [0.049, 0, 0], [0.051, 0, 0], [0, 0.2, 0]], axis=0)
    assert elbow_steps(path) == 2


def test_the_exact_configuration_has_no_error_and_a_shifted_one_has_the_shift() -> None:
    q = ARM.random_configurations(20, np.random.default_rng(0), 0.9)
    exact = evaluate(task_of(q), np.ones(20), q, np.ones(20, np.int64))
    assert exact.position_error_m.max() < 1e-12
    assert exact.orientation_error_rad.max() < 1e-7
    assert not exact.outside.any()
    bent = q.copy()
    bent[:, 6] += 0.1  # pronation turns the hand about the forearm and leaves the wrist where it is
    turned = evaluate(task_of(q), np.ones(20), bent, np.ones(20, np.int64))
    np.testing.assert_allclose(turned.orientation_error_rad, 0.1, atol=1e-9)
    assert turned.position_error_m.max() < 1e-12


def test_a_limit_left_by_more_than_a_degree_counts_as_outside() -> None:
    q = np.tile(ARM.rest, (3, 1))
    q[1, 4], q[2, 4] = ARM.upper[0] + np.radians(0.5), ARM.upper[0] + np.radians(2.0)
    np.testing.assert_array_equal(evaluate(task_of(q), np.ones(3), q, np.ones(3, np.int64)).outside, [0, 0, 1])


def test_stuck_frames_are_told_apart_from_targets_that_nobody_meets() -> None:
    q = np.tile(ARM.rest, (4, 1))
    task = task_of(q, elbow_off_m=0.03)
    task.targets[:3, 0] += 0.02
    result = evaluate(task, np.array([1.0, 2.0, 3.0]), q, np.array([1, 2, 3, 4]))
    summary = summarise([task], [result], [np.array([True, False, False, True])])
    assert summary.stuck == 3
    assert summary.stuck_unlike_others == 1
    assert summary.elbow_cm == pytest.approx(3.0)
    assert summary.us_p50 == pytest.approx(2.0)
    assert summary.iterations_p50 == pytest.approx(2.5)
    assert summary.outside_limits_percent == 0.0


def test_the_recorded_person_is_a_row_only_where_an_elbow_is_known(capture: Path, headset_session: Path) -> None:
    person = recorded(read_tasks(capture, 50))
    assert person is not None
    assert person.frames == 100
    assert person.us_p50 is None
    assert recorded(read_tasks(headset_session, 50)) is None
