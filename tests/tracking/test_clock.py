"""Order is by sample time; clocks that repeat, step back or run away are lived with."""

from __future__ import annotations

import numpy as np
from persons import MS, run, standing

from arm_ik_service.tracking.state import ACCEPTED, DUPLICATE, OUT_OF_ORDER

PERIOD_NS = round(1e9 / 90)


def test_frames_that_share_a_time_are_accepted_without_time_passing() -> None:
    frames = standing(0.2).frames
    frames["sample_time_ns"][:5] = frames["sample_time_ns"][5]
    made = run(frames)
    assert (made.verdicts == ACCEPTED).all()
    assert (made.tracking["dt_s"][:6] == 0.0).all()
    assert (made.tracking["dt_s"][6:] > 0.0).all()


def test_an_exact_repeat_is_a_duplicate_and_changes_nothing() -> None:
    frames = standing(0.2).frames
    made = run(np.concatenate([frames[:10], frames[9:]]))
    assert made.verdicts[10] == DUPLICATE
    assert (np.delete(made.verdicts, 10) == ACCEPTED).all()
    assert made.tracking[10].tobytes() == made.tracking[9].tobytes()


def test_a_frame_that_was_overtaken_is_refused_and_leaves_no_trace() -> None:
    frames = standing(0.2).moved(1, np.linspace([0, 0, 0], [0.1, 0, 0], 18)).frames
    order = np.array([*range(10), 7, *range(10, 18)])
    made = run(frames[order], receive_ns=1_000 * MS + PERIOD_NS * np.arange(19))
    assert made.verdicts[10] == OUT_OF_ORDER
    without = run(frames, receive_ns=np.delete(1_000 * MS + PERIOD_NS * np.arange(19), 10))
    assert made.tracking[-1].tobytes() == without.tracking[-1].tobytes()


def test_a_sender_that_restarts_with_an_older_clock_is_followed_within_200_ms() -> None:
    frames = standing(1.0).frames
    frames["sample_time_ns"][45:] -= 3_600_000 * MS
    receive_ns = 5_000 * MS + PERIOD_NS * np.arange(90)
    made = run(frames, receive_ns=receive_ns)
    resumed = 45 + int(np.argmax(made.verdicts[45:] == ACCEPTED))
    assert receive_ns[resumed] - receive_ns[44] <= 200 * MS
    assert (made.verdicts[resumed:] == ACCEPTED).all()
    assert made.tracking["dt_s"][resumed] == 0.0
    assert made.tracking["clock"]["steps"][-1] == 1


def test_one_sample_from_the_far_future_stops_nobody() -> None:
    frames = standing(1.0).frames
    frames["sample_time_ns"][45] = 2**61
    receive_ns = 5_000 * MS + PERIOD_NS * np.arange(90)
    made = run(frames, receive_ns=receive_ns)
    late = receive_ns > receive_ns[45] + 200 * MS
    assert (made.verdicts[late] == ACCEPTED).all()
    assert np.isfinite(made.body["targets"]["linear_velocity"]).all()


def test_times_that_jitter_do_not_make_speed_of_noise() -> None:
    take = standing(2.0)
    rng = np.random.default_rng(3)
    frames = take.moved(1, rng.normal(0.0, 1e-3, (180, 3))).frames
    frames["sample_time_ns"] += rng.integers(-5 * MS, 5 * MS, 180)
    velocity = run(frames).tracking["hands"]["linear_velocity"][:, 0]
    assert np.linalg.norm(velocity, axis=1).max() < 0.5
