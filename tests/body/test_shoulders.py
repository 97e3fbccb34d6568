"""The girdle follows the hand a little, and the shoulders settle where the arms can reach."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from persons import LEFT, RIGHT, run, standing, stroke

from arm_ik_service.body.profile import BodyMeasures, Profile
from arm_ik_service.body.shoulders import GIVES_FROM, girdle_gives
from arm_ik_service.geometry import batch

MEASURES = BodyMeasures(upper_arm_m=0.3, forearm_m=0.27, shoulder_width_m=0.36)
PERSON = Profile(body=MEASURES)


def test_reaching_ahead_and_up_brings_the_shoulder_ahead_and_up() -> None:
    take = standing(2.0)
    rest = run(take.frames, profile=PERSON).body["shoulders"][-1, 1]
    ahead = run(take.moved(RIGHT, [0.0, 0.2, -0.4]).frames, profile=PERSON).body["shoulders"][-1, 1]
    above = run(take.moved(RIGHT, [0.0, 0.9, 0.2]).frames, profile=PERSON).body["shoulders"][-1, 1]
    assert ahead[2] < rest[2] - 0.03
    assert above[1] > rest[1] + 0.03


@given(st.floats(0.0, 3.0), st.floats(1e-3, 0.1))
def test_the_girdle_gives_ever_more_but_less_than_is_asked_for(ratio: float, more: float) -> None:
    assert 0.0 <= girdle_gives(ratio + more) - girdle_gives(ratio) <= 0.5 * more + 1e-12


def test_the_girdle_sets_in_without_a_kink() -> None:
    assert girdle_gives(GIVES_FROM) == 0.0
    assert girdle_gives(GIVES_FROM + 1e-4) < 1e-6


def test_a_hand_that_leaves_does_not_take_the_shoulder_along() -> None:
    take = standing(4.0).moved(RIGHT, [0.0, 0.0, -30.0])
    body = run(take.frames, profile=PERSON).body
    width = np.linalg.norm(body["shoulders"][:, 1] - body["shoulders"][:, 0], axis=1)
    assert width.max() < 0.5
    assert np.linalg.norm(body["targets"]["position"][:, 1], axis=1).max() < 0.57


def test_shoulders_settle_until_hanging_arms_reach_the_hands() -> None:
    take = standing(40.0, 30.0)
    for device, side in ((LEFT, -1.0), (RIGHT, 1.0)):
        take = take.moved(device, [-0.07 * side, -0.47, 0.4])
    body = run(take.frames, profile=PERSON).body
    assert body["reach_ratio"][0].min() > 1.02
    assert body["reach_ratio"][-1].max() < 1.0
    assert (np.diff(body["settled"]) >= 0.0).all()


def test_shoulders_do_not_settle_for_a_hand_that_is_lost_or_out_of_this_world() -> None:
    far = standing(20.0).moved(RIGHT, [0.0, -5.0, 0.0])
    assert run(far.frames, profile=PERSON).body["settled"][-1] < 0.1
    lost = standing(20.0).moved(RIGHT, [0.0, -0.5, 0.0]).flagged(RIGHT, slice(1, None), 0)
    assert run(lost.frames, profile=PERSON).body["settled"][-1] < 0.01


def test_clavicles_run_from_the_breastbone_to_the_shoulders() -> None:
    take = standing(1.0)
    take = take.moved(LEFT, stroke(take.t, 0.1, 0.5, [-0.3, 0.5, -0.3]))
    body = run(take.frames, profile=PERSON).body
    for k, side in ((0, -1.0), (1, 1.0)):
        clavicle = body["clavicles"][:, k]
        bone = body["shoulders"][:, k] - clavicle["position"]
        assert batch.rotate(clavicle["rotation"], [0.0, 0.0, side]) == pytest.approx(batch.normalized(bone), abs=1e-9)
        assert (batch.rotate(clavicle["rotation"], [1.0, 0.0, 0.0])[:, 2] < -0.5).all()  # anterior
        assert (batch.rotate(clavicle["rotation"], [0.0, 1.0, 0.0])[:, 1] > 0.5).all()  # up
        assert (np.linalg.norm(bone, axis=1) > 0.1).all()
