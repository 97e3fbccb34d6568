"""Controllers that sit in the hand otherwise than assumed: found out from rotations that no wrist makes."""

from __future__ import annotations

from functools import cache

import msgspec
import numpy as np
import numpy.typing as npt
import pytest

from arm_ik_service import Avatars, Profile
from arm_ik_service.body.profile import Grips
from arm_ik_service.exports.mirror import mirrored_frame
from arm_ik_service.geometry import batch
from arm_ik_service.io.session import open_session
from arm_ik_service.programs.demo import bundled_session
from arm_ik_service.wire.messages import FULLY_TRACKED, ControllerFrame, TrackedPose

Array = npt.NDArray[np.float64]
MISSED_RAD = 0.26
VALID = 3  # position and orientation are, and neither is tracked
ROUND_NS = 15_000_000_000


@cache
def boxing() -> tuple[ControllerFrame, ...]:
    return tuple(recorded.frame for recorded in open_session(bundled_session("boxing")).frames())


def turned(pose: TrackedPose | None, by: Array, flags: int) -> TrackedPose:
    """The same controller turned in the hand."""
    assert pose is not None
    x, y, z, w = batch.multiply(np.array(pose.orientation), batch.exp(by)).tolist()
    return msgspec.structs.replace(pose, orientation=(x, y, z, w), flags=flags)


def boxing_with(turn: Array, flags: int = FULLY_TRACKED) -> list[ControllerFrame]:
    """The right controller turned, and the left one as its mirror image."""
    mirror = turn * (1.0, -1.0, -1.0)
    return [
        msgspec.structs.replace(frame, left=turned(frame.left, mirror, flags), right=turned(frame.right, turn, flags))
        for frame in boxing()
    ]


def rounds(frames: list[ControllerFrame], count: int, profile: Profile | None = None) -> tuple[Array, Array]:
    """Box several rounds; the turn learnt by the end of each (count, 3), and the share of rotations missed (count,)."""
    avatars = Avatars()
    avatars.reset(0, profile or Profile())
    turns, missed = [], []
    for n in range(count):
        errors = []
        for frame in frames:
            now_ns, seq = frame.sample_time_ns + n * ROUND_NS, frame.seq + n * len(frames)
            seen = msgspec.structs.replace(frame, sample_time_ns=now_ns, seq=seq)
            place = avatars.add(0, seen, now_ns)
            avatars.step()
            state = avatars.answer(place, seen, "boxer", now_ns)
            errors += [arm.orientation_error_rad for arm in (state.left, state.right)]
        turns.append(avatars.grip_turn(0))
        missed.append(float(np.mean(np.array(errors) > MISSED_RAD)))
    return np.array(turns), np.array(missed)


@pytest.mark.parametrize("turn", [(0.9, 0.0, 0.0), (-0.9, 0.0, 0.0), (0.0, 0.0, 1.5), (-0.6, 0.0, 0.8)])
def test_turned_controllers_are_found_out_until_wrists_follow_them(turn: tuple[float, float, float]) -> None:
    """In two minutes."""
    turns, missed = rounds(boxing_with(np.array(turn)), 8)
    assert np.linalg.norm(turns[-1]) > 0.1
    assert missed[-1] < min(0.03, 0.5 * missed[0])


def test_controllers_as_assumed_teach_nothing() -> None:
    turns, missed = rounds(list(boxing()), 2)
    assert np.linalg.norm(turns[-1]) < 0.01
    assert missed.max() < 0.01


def test_a_mirrored_person_learns_the_mirror_image() -> None:
    frames = boxing_with(np.array([0.9, 0.0, 0.0]))[:250]  # later what was rounded otherwise comes to show in the arms
    plain, _ = rounds(frames, 1)
    mirror, _ = rounds([mirrored_frame(frame) for frame in frames], 1)
    assert np.linalg.norm(plain) > 0.05
    np.testing.assert_allclose(mirror, plain, atol=1e-7)


def test_a_profile_that_says_how_they_sit_is_believed() -> None:
    hands = (msgspec.structs.replace(hand, position_m=(0.0, -0.02, -0.07)) for hand in (Grips().left, Grips().right))
    turns, _ = rounds(boxing_with(np.array([0.9, 0.0, 0.0])), 1, Profile(grip=Grips(*hands)))
    assert not turns.any()


def test_hands_that_are_not_seen_teach_nothing() -> None:
    turns, _ = rounds(boxing_with(np.array([0.9, 0.0, 0.0]), flags=VALID), 1)
    assert not turns.any()
