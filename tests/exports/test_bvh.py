"""BVH, read back by bvhio: every joint where it was published, to a millimetre and less."""

from __future__ import annotations

from collections import defaultdict
from itertools import islice
from pathlib import Path
from typing import Any

import bvhio
import numpy as np
import pytest
from postures import BENT, HANGING, RAISED, T, motion, person

from arm_ik_service.body.profile import Profile
from arm_ik_service.exports.bvh import BvhWriter
from arm_ik_service.exports.mirror import mirrored
from arm_ik_service.io.session import open_session
from arm_ik_service.programs.demo import bundled_session
from arm_ik_service.programs.offline import solve_frames
from arm_ik_service.settings import Settings
from arm_ik_service.wire.messages import ArmsState

MILLIMETRE = 1e-3


def write(path: Path, states: list[ArmsState], fps: float | None = None) -> Path:
    writer = BvhWriter(path, fps)
    for state in states:
        writer.add(state)
    writer.close()
    return path


def joints(path: Path, frame: int) -> dict[str, Any]:
    """Return bvhio's joints, posed as in a frame."""
    root = bvhio.readAsHierarchy(str(path))
    root.loadPose(frame)
    return {joint.Name: joint for joint, _, _ in root.layout()}


def position(joint: Any) -> np.ndarray:
    return np.array(joint.PositionWorld)


def published(state: ArmsState) -> dict[str, tuple[float, float, float]]:
    out = {"Chest": state.chest.position, "Head": state.head.position}
    for side, arm in (("Left", state.left), ("Right", state.right)):
        bones = arm.bones
        out |= {
            f"{side}Shoulder": bones.clavicle.position,
            f"{side}UpperArm": bones.upper_arm.position,
            f"{side}LowerArm": bones.forearm.position,
            f"{side}Hand": bones.hand.position,
        }
    return out


def test_positions_read_back_are_the_published_ones(tmp_path: Path) -> None:
    states = motion(60)
    path = write(tmp_path / "moving.bvh", states)
    container = bvhio.readAsBvh(str(path))
    assert container.FrameCount == len(states)
    assert pytest.approx(1 / 90, rel=1e-3) == container.FrameTime
    root = bvhio.readAsHierarchy(str(path))
    for frame in range(0, 60, 7):
        root.loadPose(frame)
        for joint, _, _ in root.layout():
            np.testing.assert_allclose(
                position(joint), published(states[frame])[joint.Name], atol=0.1 * MILLIMETRE, err_msg=joint.Name
            )


def test_measures_that_are_learned_on_the_way_and_shoulders_that_slide_are_followed(tmp_path: Path) -> None:
    session = open_session(bundled_session("boxing"))  # nobody calibrated: arms grow by centimetres
    states = [state for _, state in solve_frames(islice(session.frames(), 400), defaultdict(Profile), Settings())]
    path = write(tmp_path / "learned.bvh", states)
    assert bvhio.readAsBvh(str(path), loadKeyFrames=False).FrameCount == len(states)
    root = bvhio.readAsHierarchy(str(path))
    for frame in range(0, len(states), 60):
        root.loadPose(frame)
        for joint, _, _ in root.layout():
            np.testing.assert_allclose(
                position(joint), published(states[frame])[joint.Name], atol=0.1 * MILLIMETRE, err_msg=joint.Name
            )


def test_in_a_t_pose_all_rotation_channels_are_zero(tmp_path: Path) -> None:
    path = write(tmp_path / "t.bvh", [person(T, T), person(T, T, sample_time_ns=5_011_000_000)])
    names = [name for line in path.read_text().splitlines() if "CHANNELS" in line for name in line.split()[2:]]
    numbers = [float(number) for number in path.read_text().splitlines()[-1].split()]
    rotations = [number for name, number in zip(names, numbers, strict=True) if name.endswith("rotation")]
    assert len(rotations) == 3 * 10
    np.testing.assert_allclose(rotations, 0.0, atol=1e-5)


@pytest.mark.parametrize(("mirror", "side", "sign"), [(False, "Right", 1.0), (True, "Left", -1.0)])
def test_a_raised_right_arm_is_on_the_right_and_up(tmp_path: Path, mirror: bool, side: str, sign: float) -> None:
    state = person(HANGING, RAISED)
    found = joints(write(tmp_path / "raised.bvh", [mirrored(state) if mirror else state]), 0)
    x, y, _ = position(found[f"{side}Hand"])
    assert sign * x > 0.1
    assert y > 1.8
    assert position(found["LeftHand" if side == "Right" else "RightHand"])[1] < 1.0


def test_a_bent_elbow_brings_the_hand_forward(tmp_path: Path) -> None:
    found = joints(write(tmp_path / "bent.bvh", [person(BENT, BENT)]), 0)
    for side in ("Left", "Right"):
        assert position(found[f"{side}Hand"])[2] < position(found[f"{side}LowerArm"])[2] - 0.2  # -z is forward


def test_channels_run_without_jumps_through_whole_turns(tmp_path: Path) -> None:
    path = write(tmp_path / "turning.bvh", motion(200))  # the person turns by 600 degrees
    lines = path.read_text().splitlines()
    motion_lines = lines[lines.index("MOTION") + 3 :]
    numbers = np.array([[float(n) for n in line.split()] for line in motion_lines])
    assert np.abs(np.diff(numbers, axis=0)).max() < 45.0


def test_a_pause_is_held_and_time_is_kept(tmp_path: Path) -> None:
    states = motion(40)
    late = [s for s in motion(160) if s.seq >= 130]  # 90 frames later
    path = write(tmp_path / "paused.bvh", [*states, *late])
    assert bvhio.readAsBvh(str(path)).FrameCount == 160
    np.testing.assert_allclose(
        position(joints(path, 100)["RightHand"]), states[39].right.bones.hand.position, atol=MILLIMETRE
    )
    np.testing.assert_allclose(
        position(joints(path, 159)["RightHand"]), late[-1].right.bones.hand.position, atol=MILLIMETRE
    )


def test_jitter_of_the_sample_times_moves_no_state_out_of_its_frame(tmp_path: Path) -> None:
    import msgspec

    jitter = np.random.default_rng(5).normal(0.0, 2e6, 300)
    states = [
        msgspec.structs.replace(state, sample_time_ns=state.sample_time_ns + int(late))
        for state, late in zip(motion(300), jitter, strict=True)
    ]
    assert bvhio.readAsBvh(str(write(tmp_path / "jitter.bvh", states)), loadKeyFrames=False).FrameCount == 300


def test_a_frame_rate_that_is_asked_for_is_kept(tmp_path: Path) -> None:
    container = bvhio.readAsBvh(str(write(tmp_path / "slow.bvh", motion(180), fps=30.0)))
    assert pytest.approx(60, abs=1) == container.FrameCount
    assert pytest.approx(1 / 30) == container.FrameTime


def test_a_clock_that_is_set_forward_by_a_year_does_not_fill_the_disk(tmp_path: Path) -> None:
    far = [person(sample_time_ns=1_000_000_000 + k * 11_000_000 + (k > 20) * 31_536_000 * 10**9) for k in range(40)]
    assert bvhio.readAsBvh(str(write(tmp_path / "far.bvh", far)), loadKeyFrames=False).FrameCount < 40_000
