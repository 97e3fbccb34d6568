"""The report on a solve says what the arrays hold."""

from __future__ import annotations

import numpy as np
import pytest

from arm_ik_service.body.report import jerk_rms, report_arm


@pytest.mark.parametrize("rate", [30.0, 90.0])
def test_jerk_is_the_third_derivative(rate: float) -> None:
    t = np.arange(0.0, 4.0, 1.0 / rate)
    path = np.stack([t**3, 0.0 * t, np.sin(2.0 * t)], axis=1)
    exact = np.sqrt(np.mean(36.0 + (8.0 * np.cos(2.0 * t)) ** 2))
    assert jerk_rms(t, path) == pytest.approx(exact, rel=0.05)


def test_jerk_does_not_mind_frames_that_share_a_time() -> None:
    t = np.arange(0.0, 4.0, 0.02)
    path = np.stack([t**3, t, 0.0 * t], axis=1)
    doubled = np.sort(np.concatenate([t, t[::7]]))
    again = np.stack([doubled**3, doubled, 0.0 * doubled], axis=1)
    assert jerk_rms(doubled, again) == pytest.approx(jerk_rms(t, path), rel=1e-6)


def test_a_flip_of_the_elbow_and_the_limits_are_counted() -> None:
    n = 100
    t = np.arange(n) / 90.0
    hand = np.outer(t, [1.0, 0.0, 0.0])
    elbow = hand + np.array([0.0, 0.3, 0.0])
    elbow[50:, 2] += 0.2
    limits = np.zeros(n, np.int64)
    limits[:25] |= 0b10
    limits[:5] |= 0b01
    report = report_arm(
        t,
        elbow=elbow,
        hand=hand,
        position_error_m=np.linspace(0.0, 1e-3, n),
        orientation_error_rad=np.zeros(n),
        reach_ratio=np.where(np.arange(n) < 10, 1.1, 0.8),
        iterations=np.arange(n),
        limits=limits,
        limit_names=("elbow", "wrist", "shoulder"),
    )
    assert report.elbow_flips == 1
    assert report.elbow_step_max_m == pytest.approx(np.hypot(0.2, 1.0 / 90.0))
    assert report.limit_time == {"wrist": 0.25, "elbow": 0.05}
    assert report.out_of_reach == pytest.approx(0.1)
    assert report.position_error_p50_m == pytest.approx(5e-4)
    assert report.iterations_p50 == pytest.approx(49.5)
    assert report.hand_jerk_rms_m_s3 < 1e-6 * report.elbow_jerk_rms_m_s3
