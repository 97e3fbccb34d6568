"""The report on a recording finds what was put into it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from persons import HEAD, LEFT, RIGHT, standing, stroke

from arm_ik_service.geometry import batch
from arm_ik_service.tracking.report import report_session


def test_a_clean_recording_is_called_clean() -> None:
    report = report_session(standing(10.0, 72.0).frames)
    assert report.rate_hz == pytest.approx(72.0, abs=0.01)
    assert report.seconds == pytest.approx(10.0 - 1.0 / 72.0, abs=1e-6)
    assert (report.refused, report.repeated_times, report.clock_steps) == (0, 0, 0)
    assert report.gaps == ()
    assert report.recentre_times_s == ()
    for device in report.devices.values():
        assert device.tracked == 1.0
        assert device.glitches == 0
        assert device.longest_loss_s == 0.0


def test_losses_gaps_glitches_and_recentres_are_found_where_they_are() -> None:
    take = standing(10.0)
    take.poses[180, RIGHT, :3] += (0.0, 0.5, 0.0)
    take = take.flagged(LEFT, slice(270, 360), 0)
    moved = np.concatenate([[1.0, 0.0, 0.0], batch.exp([0.0, 1.5, 0.0])])
    take = take.in_space(moved, slice(450, None))
    take = replace(take, t=take.t + np.where(np.arange(900) >= 630, 2.5, 0.0))
    frames = take.frames
    frames["sample_time_ns"][720] = frames["sample_time_ns"][719]
    report = report_session(frames)
    assert report.devices["right"].glitches == 1
    assert report.devices["right"].glitch_times_s == pytest.approx((2.0,), abs=0.02)
    assert report.devices["left"].held + report.devices["left"].lost == pytest.approx(0.1, abs=1e-9)
    assert report.devices["left"].longest_loss_s == pytest.approx(1.0, abs=0.02)
    assert report.recentre_times_s == pytest.approx((5.0,), abs=0.02)
    assert len(report.gaps) == 1
    assert report.gaps[0] == pytest.approx((7.0, 2.5), abs=0.03)
    assert report.repeated_times == 1


def test_speeds_are_those_of_the_motion() -> None:
    take = standing(4.0)
    take = take.moved(LEFT, stroke(take.t, 1.0, 0.5, [0.0, 0.5, 0.0]))
    take = take.turned(HEAD, batch.exp(np.outer(take.t, [0.0, 0.5, 0.0])))
    report = report_session(take.frames)
    assert report.devices["left"].speed_max_m_s == pytest.approx(1.875, rel=0.02)
    assert report.devices["right"].speed_max_m_s == pytest.approx(0.0, abs=1e-9)
    assert report.devices["head"].turn_p99_rad_s == pytest.approx(0.5, rel=0.01)


def test_refused_frames_are_counted_and_left_out() -> None:
    frames = standing(2.0).frames
    report = report_session(frames[np.array([*range(100), 50, *range(100, 180)])])
    assert (report.frames, report.refused) == (181, 1)
    assert report.seconds == pytest.approx(2.0 - 1.0 / 90.0, abs=1e-6)
