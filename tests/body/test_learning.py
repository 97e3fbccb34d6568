"""The running estimate: whoever has no profile is measured while they move."""

from __future__ import annotations

import numpy as np
import pytest
from movers import PEOPLE, lively
from persons import LEFT, RIGHT, run, standing

from arm_ik_service.body.arm_fit import ARM_PER_STATURE
from arm_ik_service.body.profile import BodyMeasures, Profile
from arm_ik_service.geometry import batch


def test_who_never_calibrates_is_measured_while_they_move() -> None:
    for stature in (1.6, 1.9):
        body = BodyMeasures(stature_m=stature)
        learnt = run(lively(60.0, body).frames).body
        settled = learnt[len(learnt) // 2 :]
        assert settled["stature"] == pytest.approx(stature, abs=0.03)
        assert settled["arm_length"] == pytest.approx(body.upper_arm + body.forearm, rel=0.06)
        assert (settled["reach_ratio"] > 1.02).mean() < 0.01


def test_longer_arms_than_stature_says_are_learnt_from_reach() -> None:
    body = BodyMeasures(stature_m=1.75, upper_arm_m=0.38, forearm_m=0.29)
    learnt = run(lively(60.0, body).frames).body
    assert learnt["arm_length"][0] < 0.59
    assert learnt["arm_length"][-1] > 0.63
    assert np.abs(np.diff(learnt["arm_length"])).max() < 0.01


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
