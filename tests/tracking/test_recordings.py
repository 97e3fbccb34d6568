"""Against real headsets: real motion is followed, snaps are not, and both are told apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from persons import LEFT, RIGHT, Records, run, speeds

from arm_ik_service.geometry import batch
from arm_ik_service.io.session import open_session
from arm_ik_service.settings import TrackingSettings
from arm_ik_service.tracking.frame import FRAME, pack_frame
from arm_ik_service.tracking.report import report_session
from arm_ik_service.tracking.state import ACCEPTED, TRACKED

FAST = (
    "aframe_grab_left.npz",
    "aframe_vive_grab_jittery.npz",
    "beatsaber_quest1_72hz_tracking_loss.bsor",
    "beatsaber_quest2_90hz.bsor",
    "beatsaber_rifts_80hz_gap.bsor",
    "beatsaber_vive_90hz.bsor",
)


def frames_of(path: Path) -> Records:
    """Read all frames of a recording as FRAME records."""
    recorded = list(open_session(path).frames())
    frames = np.zeros(len(recorded), FRAME)
    for k, one in enumerate(recorded):
        pack_frame(one.frame, frames.view(np.uint8).data, k * FRAME.itemsize)
    return frames


@pytest.mark.parametrize("name", FAST)
def test_fast_play_is_not_mistaken_for_glitches(recordings: Path, name: str) -> None:
    frames = frames_of(recordings / "vr" / name)
    made = run(frames)
    assert (made.verdicts == ACCEPTED).all()
    sent = frames["hands"]["location_flags"] == 15
    for k in range(2):
        followed = made.tracking["hands"]["position_state"][sent[:, k], k] == TRACKED
        assert 1.0 - followed.mean() <= 1e-3


def test_hands_that_snap_back_half_a_metre_come_back_at_a_bounded_speed(recordings: Path) -> None:
    frames = frames_of(recordings / "vr" / "beatsaber_quest1_72hz_tracking_loss.bsor")
    made = run(frames)
    t = made.tracking["sample_time_ns"] * 1e-9
    fastest_m_s = 12.8  # of the real strokes in this recording, p99.9
    for snap, device in ((2393, LEFT), (6339, LEFT), (6339, RIGHT)):
        near = slice(snap - 5, snap + 30)
        data = frames["hands"]["position"][near, device - 1]
        assert np.linalg.norm(np.diff(data, axis=0), axis=1).max() > 0.45
        speed = speeds(t[near], made.position(device)[near])
        assert speed.max() < 1.5 * fastest_m_s + TrackingSettings().reacquire_m_s
        back = (t > t[snap] + 0.15) & (t < t[snap] + 0.4)
        away = np.linalg.norm(made.position(device)[back] - frames["hands"]["position"][back, device - 1], axis=1)
        assert away.max() < 5e-3


def test_devices_that_come_and_go_are_followed_whenever_they_are_there(recordings: Path) -> None:
    frames = frames_of(recordings / "vr" / "iwer_quest3_controllers_hands.npz")
    made = run(frames)
    present = frames["hands"]["location_flags"] == 15
    assert 0.5 < present.mean() < 1.0
    assert (made.tracking["hands"]["position_state"][present] == TRACKED).mean() > 0.99
    assert (made.tracking["hands"]["position_state"][~present] < TRACKED).all()


def test_the_gap_of_a_recording_is_reported_and_lived_through(recordings: Path) -> None:
    frames = frames_of(recordings / "vr" / "beatsaber_rifts_80hz_gap.bsor")
    report = report_session(frames)
    assert report.rate_hz == pytest.approx(79.0, abs=2.0)
    assert [length for _, length in report.gaps if length > 2.0] == pytest.approx([2.72], abs=0.02)
    rotation = run(frames).tracking["hands"]["rotation"]
    assert batch.angle_between(rotation, rotation).max() == 0.0  # finite and unit, garbage first frame and all
    assert np.linalg.norm(rotation, axis=2) == pytest.approx(1.0, abs=1e-9)
