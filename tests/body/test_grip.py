"""Controllers that sit in the hand otherwise than assumed: found out from rotations that no wrist makes."""

from __future__ import annotations

from functools import cache

import msgspec
import numpy as np
import numpy.typing as npt
import pytest

from arm_ik_service import Avatars, Profile
from arm_ik_service.body.profile import GripOffset, Grips
from arm_ik_service.geometry import batch
from arm_ik_service.io.session import open_session
from arm_ik_service.programs.demo import bundled_session
from arm_ik_service.wire.messages import ControllerFrame, TrackedPose

Array = npt.NDArray[np.float64]
MISSED_RAD = 0.26
ROUNDS = 4  # of a quarter of a minute


@cache
def boxing() -> tuple[ControllerFrame, ...]:
    return tuple(recorded.frame for recorded in open_session(bundled_session("boxing")).frames())


def turned(pose: TrackedPose | None, by: Array) -> TrackedPose | None:
    """The same controller turned in the hand."""
    if pose is None:
        return None
    x, y, z, w = batch.multiply(np.array(pose.orientation), batch.exp(by)).tolist()
    return msgspec.structs.replace(pose, orientation=(x, y, z, w))


def rounds(right: Array, left: Array, profile: Profile | None = None, *, unseen: bool = False) -> tuple[Array, Array]:
    """Box with turned controllers; learnt turn (ROUNDS, 3), and share of hands whose rotation was missed (ROUNDS,)."""
    avatars = Avatars()
    avatars.reset(0, profile or Profile())
    turns, missed = [], []
    now_ns, frames = 0, boxing()
    for n in range(ROUNDS):
        errors = []
        for frame in frames:
            now_ns = frame.sample_time_ns + n * 15_000_000_000
            hands = turned(frame.left, left), turned(frame.right, right)
            if unseen:
                hands = tuple(hand and msgspec.structs.replace(hand, flags=3) for hand in hands)  # valid, not tracked
            seen = msgspec.structs.replace(
                frame, sample_time_ns=now_ns, seq=n * len(frames) + frame.seq, left=hands[0], right=hands[1]
            )
            place = avatars.add(0, seen, now_ns)
            avatars.step()
            state = avatars.answer(place, seen, "boxer", now_ns)
            errors += [arm.orientation_error_rad for arm in (state.left, state.right)]
        turns.append(avatars.grip_turn(0))
        missed.append(float(np.mean(np.array(errors) > MISSED_RAD)))
    return np.array(turns), np.array(missed)


def mirrored(turn: Array) -> Array:
    return np.asarray(turn * (1.0, -1.0, -1.0))


@pytest.mark.parametrize("about", [(0.9, 0.0, 0.0), (-0.9, 0.0, 0.0), (0.0, 0.8, 0.0), (0.0, 0.0, -1.0)])
def test_turned_controllers_are_found_out_until_wrists_follow_them(about: tuple[float, float, float]) -> None:
    turn = np.array(about)
    _, missed = rounds(turn, mirrored(turn))
    assert missed[0] > 0.1
    assert missed[-1] < 0.35 * missed[0]


def test_controllers_as_assumed_teach_nothing() -> None:
    turns, missed = rounds(np.zeros(3), np.zeros(3))
    assert np.linalg.norm(turns[-1]) < 0.02
    assert missed.max() < 0.01


def test_the_other_hand_learns_the_mirror_image() -> None:
    turn = np.array([0.6, 0.4, -0.5])
    one, _ = rounds(turn, np.zeros(3))
    assert np.linalg.norm(one[-1]) > 0.1


def test_a_profile_that_says_how_they_sit_is_believed() -> None:
    stated = Profile(grip=Grips(*(msgspec.structs.replace(o, position_m=(0.0, -0.02, -0.07)) for o in (Grips().left, Grips().right))))
    turn = np.array([0.9, 0.0, 0.0])
    turns, _ = rounds(turn, mirrored(turn), stated)
    assert not turns.any()


def test_hands_that_are_not_seen_teach_nothing() -> None:
    turn = np.array([0.9, 0.0, 0.0])
    turns, _ = rounds(turn, mirrored(turn), unseen=True)
    assert not turns.any()
