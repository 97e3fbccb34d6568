"""The running estimate: whoever has no profile is measured while they move."""

from __future__ import annotations

import numpy as np
import pytest
from movers import PEOPLE, lively
from persons import HEAD, LEFT, RIGHT, Take, run, standing

from arm_ik_service.body.arm_fit import ARM_PER_STATURE
from arm_ik_service.body.profile import BodyMeasures, Profile
from arm_ik_service.geometry import batch

LONG_ARMS = BodyMeasures(stature_m=1.75, upper_arm_m=0.37, forearm_m=0.31)  # 1.2 times what stature says
SHORT_ARMS = BodyMeasures(stature_m=1.75, upper_arm_m=0.26, forearm_m=0.22)  # 0.85 times


@pytest.mark.parametrize("body", [*PEOPLE, LONG_ARMS, SHORT_ARMS])
def test_who_never_calibrates_is_measured_while_they_move(body: BodyMeasures) -> None:
    learnt = run(lively(60.0, body).frames).body
    settled = learnt[len(learnt) // 2 :]
    assert settled["stature"] == pytest.approx(body.stature_m, abs=0.03)
    assert settled["arm_length"] == pytest.approx(body.upper_arm + body.forearm, rel=0.05)
    assert (settled["reach_ratio"] > 1.02).mean() < 0.01
    assert np.abs(np.diff(learnt["arm_length"])).max() < 0.01


@pytest.mark.parametrize("lower_m", [0.0, 0.06])
def test_hands_that_rest_after_they_moved_teach_nothing_new(lower_m: float) -> None:
    """Neither short arms where they rest in front, nor long ones where they hang from low shoulders."""
    moving, rest = lively(40.0, PEOPLE[1]), standing(300.0, 60.0)
    for device, x in ((LEFT, -1.0), (RIGHT, 1.0)):
        rest.poses[:, device, :3] = (0.13 * x, 1.25, -0.15) if lower_m == 0.0 else (0.19 * x, 0.99 - lower_m, 0.1)
    rest.poses[:, HEAD] = moving.poses[-1, HEAD]
    rest.poses[:, 1:, :3] += np.random.default_rng(1).normal(0.0, 0.0005, rest.poses[:, 1:, :3].shape)
    t = np.concatenate([moving.t, moving.t[-1] + 1 / 60 + rest.t])
    take = Take(t, np.concatenate([moving.poses, rest.poses]), np.concatenate([moving.flags, rest.flags]))
    learnt = run(take.frames).body["arm_length"]
    assert learnt[-1] == pytest.approx(learnt[len(moving.t)], rel=0.01)


def test_shoulders_that_sit_lower_than_thought_settle_and_the_arms_are_still_measured() -> None:
    low = lively(60.0, LONG_ARMS)
    low.poses[:, HEAD, 1] += 0.07
    settled = run(low.frames).body[-1]
    assert settled["settled"] > 0.02
    assert settled["arm_length"] == pytest.approx(LONG_ARMS.upper_arm + LONG_ARMS.forearm, rel=0.05)


def test_where_the_shoulders_have_settled_changes_nothing_of_what_the_hands_show() -> None:
    frames = lively(3.0, LONG_ARMS).frames
    plain, lower = (run(frames, settled_m=settled_m).body["learning"]["fit"]["moments"][-1] for settled_m in (0.0, 0.1))
    np.testing.assert_allclose(lower, plain, atol=1e-3)


def test_a_controller_that_is_thrown_lengthens_nobody() -> None:
    take = lively(40.0, PEOPLE[1])
    flies = np.zeros((len(take.t), 3))
    flies[1800:] = np.stack([3.0 + np.sin(5.0 * take.t[1800:])] * 3, axis=1)
    learnt = run(take.moved(RIGHT, flies).frames).body["arm_length"]
    assert learnt[-1] == pytest.approx(learnt[1799], rel=0.02)


def test_one_hand_is_enough_and_either_does() -> None:
    take = lively(60.0, LONG_ARMS)
    take.poses[:, LEFT] = batch.mirror_pose(take.poses[:, RIGHT])
    left, right = (run(take.flagged(other, slice(None), 0).frames).body["arm_length"] for other in (RIGHT, LEFT))
    assert left[-1] == pytest.approx(LONG_ARMS.upper_arm + LONG_ARMS.forearm, rel=0.06)
    np.testing.assert_allclose(left, right, atol=1e-9)


@pytest.mark.parametrize("name", ["arm_length", "half_width"])
def test_nobody_trembles_while_they_are_measured(name: str) -> None:
    lengths = run(lively(10.0, PEOPLE[1]).frames).body[name]
    assert np.ptp(lengths) > 0.005
    assert np.abs(np.diff(lengths, 2)).max() < 3e-4


def test_measures_that_are_stated_are_never_touched() -> None:
    body = BodyMeasures(stature_m=1.7, upper_arm_m=0.29, forearm_m=0.25, shoulder_width_m=0.35)
    made = run(lively(20.0, PEOPLE[1]).frames, profile=Profile(body=body)).body
    assert (made["arm_length"] == body.upper_arm + body.forearm).all()
    assert (made["half_width"] == 0.175).all()
    assert (made["stature"] == 1.7).all()


def test_someone_seated_keeps_the_stature_they_had() -> None:
    take = standing(20.0).in_space([0.0, -0.5, 0.0, 0.0, 0.0, 0.0, 1.0])
    assert run(take.frames).body["stature"][-1] == 1.75


def test_hands_that_lie_still_teach_little() -> None:
    """However long, with wrists bent."""
    still = standing(120.0, 30.0)
    for device, x in ((LEFT, -0.12), (RIGHT, 0.12)):
        still.poses[:, device, :3] = (x, 1.1, -0.2)
        still.poses[:, device, 3:] = batch.exp([0.6, 0.0, 0.0])
    learnt = run(still.frames).body
    expected = ARM_PER_STATURE * learnt["stature"][-1]
    assert learnt["arm_length"][-1] == pytest.approx(expected, rel=0.01)


def test_bones_keep_their_proportion_however_hands_flail() -> None:
    rng = np.random.default_rng(2)
    take = standing(20.0, 60.0)
    for device in (LEFT, RIGHT):
        take.poses[:, device, :3] += np.cumsum(0.03 * rng.normal(size=(len(take.t), 3)), axis=0).clip(-0.4, 0.4)
        take.poses[:, device, 3:] = batch.normalized(np.cumsum(rng.normal(size=(len(take.t), 4)), axis=0))
    learnt = run(take.frames).body
    proportion = learnt["upper_arm"] / learnt["forearm"]
    assert proportion.min() > 0.9
    assert proportion.max() < 1.5
