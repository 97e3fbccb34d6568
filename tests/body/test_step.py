"""What is asked of the arms: the wrist behind the grip, in the shoulder's frame, with its velocity."""

from __future__ import annotations

import numpy as np
import pytest
from persons import LEFT, RIGHT, Take, run, standing, stroke

from arm_ik_service.body.profile import GripOffset, Grips, Profile
from arm_ik_service.geometry import batch
from arm_ik_service.settings import TrackingSettings

UNFILTERED = TrackingSettings(smoothing="off")


def busy() -> Take:
    """Return someone whose hands and head turn and move within reach."""
    take = standing(2.0)
    t = take.t
    turning = batch.exp(np.stack([0.5 * np.sin(2 * t), 0.8 * np.sin(3 * t), 0.3 * np.cos(t)], axis=1))
    take = take.moved(LEFT, stroke(t, 0.3, 0.6, [0.1, 0.2, 0.05])).turned(LEFT, turning)
    return take.turned(0, batch.exp(np.stack([0 * t, 0.4 * np.sin(2 * t), 0 * t], axis=1)))


def test_the_wrist_carries_the_grip_where_the_profile_says() -> None:
    rng = np.random.default_rng(6)
    grips = [(rng.normal(0, 0.1, 3), batch.normalized(rng.normal(size=4))) for _ in range(2)]
    left, right = (GripOffset(tuple(p.tolist()), tuple(q.tolist())) for p, q in grips)
    made = run(busy().frames, profile=Profile(grip=Grips(left, right)), tracking=UNFILTERED)
    for k, device in ((0, LEFT), (1, RIGHT)):
        wrist = made.body["wrists"][:, k]
        world_from_wrist = np.concatenate([wrist["position"], wrist["rotation"]], axis=1)
        grip = batch.compose(world_from_wrist, np.concatenate(grips[k]))
        assert grip[:, :3] == pytest.approx(made.position(device), abs=1e-12)
        assert batch.angle_between(grip[:, 3:], made.device(device)["rotation"]).max() < 1e-7


def test_hands_that_hang_by_default_grips_point_their_fingers_down_and_their_backs_outwards() -> None:
    take = standing(0.1).flagged(LEFT, slice(None), 0).flagged(RIGHT, slice(None), 0)
    wrists = run(take.frames).body["wrists"][-1]
    assert batch.rotate(wrists["rotation"], [0.0, 0.0, -1.0]) == pytest.approx(np.array([[0, -1, 0]] * 2), abs=1e-12)
    assert batch.rotate(wrists["rotation"], [0.0, 1.0, 0.0]) == pytest.approx(np.array([[-1, 0, 0], [1, 0, 0]]))


def test_a_target_within_reach_is_the_wrist_in_the_shoulder_frame() -> None:
    body = run(busy().frames, tracking=UNFILTERED).body
    assert body["reach_ratio"].max() < 0.9
    for k in range(2):
        target, wrist = body["targets"][:, k], body["wrists"][:, k]
        back = body["shoulders"][:, k] + batch.rotate(body["chest_rotation"], target["position"])
        assert back == pytest.approx(wrist["position"], abs=1e-12)
        turned = batch.multiply(body["chest_rotation"], target["rotation"])
        assert batch.angle_between(turned, wrist["rotation"]).max() < 1e-7


def test_the_velocities_of_a_target_are_those_of_its_pose() -> None:
    take = busy()
    target = run(take.frames, tracking=UNFILTERED).body["targets"][:, 0]
    dt = np.diff(take.t)[:, None]
    assert target["linear_velocity"][1:] == pytest.approx(np.diff(target["position"], axis=0) / dt, abs=1e-5)
    turned = batch.log(batch.multiply(target["rotation"][1:], batch.conjugate(target["rotation"][:-1])))
    assert target["angular_velocity"][1:] == pytest.approx(turned / dt, abs=1e-5)


def test_reach_is_reported_as_asked_for_not_as_granted() -> None:
    take = standing(1.0).moved(RIGHT, [0.0, 0.0, -0.6])
    body = run(take.frames).body
    asked = np.linalg.norm(body["wrists"]["position"][:, 1] - body["shoulders"][:, 1], axis=1)
    assert body["reach_ratio"][:, 1] == pytest.approx(asked / body["arm_length"], abs=1e-12)
    assert body["reach_ratio"][-1, 1] > 1.1
    assert np.linalg.norm(body["targets"]["position"][-1, 1]) < body["arm_length"][-1]


def test_nothing_leaps_when_hands_come_and_go() -> None:
    take = standing(6.0).flagged(LEFT, slice(100, 130), 0).flagged(RIGHT, slice(200, 420), 0)
    body = run(take.frames).body
    assert np.linalg.norm(np.diff(body["shoulders"], axis=0), axis=2).max() < 0.01
    assert np.linalg.norm(np.diff(body["chest_position"], axis=0), axis=1).max() < 0.01
