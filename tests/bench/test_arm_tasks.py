"""What is asked of the solvers is what was recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from arm_ik_service.bench.arm_tasks import read_tasks
from arm_ik_service.errors import SessionError
from arm_ik_service.geometry import batch


def test_motion_capture_gives_the_persons_lengths_and_targets_that_this_arm_reaches(capture: Path) -> None:
    left, right = read_tasks(capture, 1000)
    assert (left.side, right.side) == ("left", "right")
    for task in (left, right):
        assert task.arm.side == task.side
        assert task.rate_hz == pytest.approx(100.0)
        assert task.arm.upper_arm_m == pytest.approx(0.29)
        assert task.arm.forearm_m == pytest.approx(0.25)
        assert task.elbow is not None
        np.testing.assert_allclose(np.linalg.norm(task.elbow, axis=1), 0.29, atol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(task.targets[:, :3] - task.elbow, axis=1), 0.25, atol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(task.targets[:, 3:], axis=1), 1.0, atol=1e-9)


def test_targets_are_the_recorded_hands_seen_from_the_shoulder(capture: Path) -> None:
    for task in read_tasks(capture, 1000):
        with np.load(capture) as archive:
            world = batch.compose(task.shoulder, task.targets)
            np.testing.assert_allclose(world[:, :3], archive[f"{task.side}_wrist"], atol=1e-9)
            turned = batch.angle_between(world[:, 3:], archive[f"{task.side}_wrist_q"])
            np.testing.assert_allclose(turned, 0.0, atol=1e-6)


def test_fewer_frames_are_the_middle_of_the_session(capture: Path) -> None:
    whole, middle = read_tasks(capture, 1000)[0], read_tasks(capture, 20)[0]
    np.testing.assert_allclose(middle.targets, whole.targets[50:70], atol=2e-4)  # lengths are means of what is read


@pytest.mark.slow
def test_a_session_without_truth_gives_what_the_pipeline_asks_and_no_elbow(headset_session: Path) -> None:
    for task in read_tasks(headset_session, 40):
        assert task.elbow is None
        assert len(task.targets) == 40
        assert np.isfinite(task.targets).all()
        reach = task.arm.upper_arm_m + task.arm.forearm_m
        assert (np.linalg.norm(task.targets[:, :3], axis=1) <= reach + 1e-9).all()
        wrist = batch.compose(task.shoulder, task.targets)[:, :3]
        with np.load(headset_session) as archive:
            grip = archive[task.side][40:80, :3]
        assert np.median(np.linalg.norm(wrist - grip, axis=1)) < 0.15  # the wrist is a palm's length behind the grip


def test_a_file_that_is_no_session_is_a_session_error(tmp_path: Path) -> None:
    (tmp_path / "x.npz").write_bytes(b"nothing")
    with pytest.raises(SessionError):
        read_tasks(tmp_path / "x.npz", 10)
