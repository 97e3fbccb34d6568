"""Which way the chest faces: with the head and the hands, never by leaps, never the wrong way round."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from persons import HEAD, LEFT, RIGHT, Take, run, standing, stroke, yaw_degrees

from arm_ik_service.body.profile import Profile
from arm_ik_service.geometry import batch

Array = npt.NDArray[np.float64]


def chest_degrees(take: Take) -> Array:
    """Return the chest's yaw (N,) over time, unwrapped; positive to the left."""
    return yaw_degrees(run(take.frames).body["chest_rotation"])


def about_y(degrees: npt.ArrayLike) -> Array:
    return batch.exp(np.radians(np.asarray(degrees, float))[..., None] * np.array([0.0, 1.0, 0.0]))


def test_someone_at_ease_faces_straight_ahead_and_stands_upright() -> None:
    made = run(standing().frames)
    assert batch.angle_between(made.body["chest_rotation"], [0.0, 0.0, 0.0, 1.0]).max() < 1e-9
    assert made.body["chest_position"][-1, 0] == pytest.approx(0.0, abs=1e-12)
    assert 0.15 < 1.65 - made.body["chest_position"][-1, 1] < 0.3


def test_a_glance_turns_the_chest_less_than_the_head() -> None:
    take = standing(2.0)
    glance = 60.0 * stroke(take.t, 0.5, 0.4, [1.0, 0.0, 0.0])[:, 0]
    yaw = chest_degrees(take.turned(HEAD, about_y(glance)))
    assert 15.0 < yaw[-1] < 45.0


def test_turning_with_head_and_hands_turns_the_chest_as_far() -> None:
    take = standing(2.0)
    around = 100.0 * stroke(take.t, 0.3, 1.0, [1.0, 0.0, 0.0])[:, 0]
    poses = np.concatenate([np.zeros((len(take.t), 3)), about_y(around)], axis=1)
    turned = Take(take.t, batch.compose(poses[:, None], take.poses), take.flags)
    assert chest_degrees(turned)[-1] == pytest.approx(100.0, abs=0.5)


@pytest.mark.parametrize("pitch", [-90.0, -60.0, 60.0, 90.0])
def test_looking_down_or_up_does_not_turn_the_chest(pitch: float) -> None:
    take = standing(1.0)
    nod = np.radians(pitch) * stroke(take.t, 0.2, 0.5, [1.0, 0.0, 0.0])
    assert np.abs(chest_degrees(take.turned(HEAD, batch.exp(nod)))).max() < 1.0


@pytest.mark.parametrize("device", [LEFT, RIGHT])
def test_a_hand_that_goes_round_behind_the_head_spins_nobody(device: int) -> None:
    take = standing(4.0)
    angle = 2.0 * np.pi * take.t / 2.0
    around = np.stack([0.3 * np.sin(angle), 0.5 + 0.0 * angle, 0.3 - 0.3 * np.cos(angle)], axis=1)
    yaw = chest_degrees(take.moved(device, around))
    assert np.abs(yaw).max() < 45.0
    assert np.abs(np.diff(yaw)).max() < 3.0


def test_both_hands_crossed_behind_the_back_do_not_turn_the_chest_round() -> None:
    take = standing(2.0)
    take = take.moved(LEFT, stroke(take.t, 0.3, 0.5, [0.55, -0.1, 0.75]))
    take = take.moved(RIGHT, stroke(take.t, 0.3, 0.5, [-0.55, -0.1, 0.75]))
    assert np.abs(chest_degrees(take)).max() < 60.0


@pytest.mark.parametrize("turn_rad_s", [6.0, 15.0])
def test_a_spin_is_followed_all_the_way_round(turn_rad_s: float) -> None:
    take = standing(2.0)
    turned = np.degrees(turn_rad_s * np.maximum(take.t - 0.3, 0.0))
    spin = np.concatenate([np.zeros((len(take.t), 3)), about_y(turned)], axis=1)
    behind = turned - chest_degrees(take.in_space(spin[:, None]))
    assert np.abs(behind).max() < 45.0
    assert 0.0 < behind[-1] < 25.0


def test_a_forearm_across_the_body_brings_that_shoulder_ahead() -> None:
    grips = Profile().grip
    pointing = {LEFT: (-90.0, grips.left), RIGHT: (0.0, grips.right)}  # the left hand's fingers to the right
    take = standing(1.0)
    for device, (degrees, grip) in pointing.items():
        take = take.turned(device, batch.multiply(about_y(degrees), grip.orientation_xyzw))
    assert -25.0 < chest_degrees(take)[-1] < -5.0


@pytest.mark.parametrize("rate", [30.0, 72.0, 90.0, 120.0])
def test_the_chest_never_turns_more_than_20_degrees_in_a_frame(rate: float) -> None:
    rng = np.random.default_rng(2)
    take = standing(4.0, rate)
    n = len(take.t)
    spin = np.cumsum(rng.normal(0.0, 25.0, n))
    take = take.turned(HEAD, about_y(spin))
    for device in (LEFT, RIGHT):
        take = take.moved(device, rng.normal(0.0, 0.2, (n, 3)))
    steps = np.abs(np.diff(chest_degrees(take)))
    assert steps.max() <= 20.0
    assert steps.max() > 1.0


def test_the_same_person_elsewhere_is_the_same_person() -> None:
    rng = np.random.default_rng(4)
    take = standing(1.0)
    take = take.moved(LEFT, stroke(take.t, 0.2, 0.5, [0.2, 0.3, -0.2])).turned(HEAD, about_y(rng.normal(0, 3, 90)))
    pose = np.concatenate([[3.0, 0.0, -5.0], about_y(77.0)])
    here, there = run(take.frames), run(take.in_space(pose).frames)
    assert np.abs(batch.compose(pose, _shoulders(here))[..., :3] - there.body["shoulders"]).max() < 1e-6
    assert np.abs(here.body["targets"]["position"] - there.body["targets"]["position"]).max() < 1e-6


def _shoulders(made: object) -> Array:
    shoulders = np.asarray(getattr(made, "body")["shoulders"])  # noqa: B009
    return np.concatenate([shoulders, np.broadcast_to([0.0, 0.0, 0.0, 1.0], (*shoulders.shape[:2], 4))], axis=-1)


def test_left_and_right_are_mirror_images() -> None:
    take = standing(1.0)
    take = take.moved(LEFT, stroke(take.t, 0.1, 0.6, [0.1, 0.4, -0.3])).turned(HEAD, about_y(20.0))
    mirrored = Take(take.t, batch.mirror_pose(take.poses[:, [HEAD, RIGHT, LEFT]]), take.flags)
    one, other = run(take.frames).body, run(mirrored.frames).body
    flip = np.array([-1.0, 1.0, 1.0])
    assert np.abs(one["shoulders"] * flip - other["shoulders"][:, ::-1]).max() < 1e-9
    assert np.abs(one["targets"]["position"] * flip - other["targets"]["position"][:, ::-1]).max() < 1e-9
    assert one["reach_ratio"] == pytest.approx(other["reach_ratio"][:, ::-1], abs=1e-9)


def test_a_lost_hand_does_not_hold_the_chest_where_the_person_was() -> None:
    take = standing(3.0)
    away = np.radians(120.0) * stroke(take.t, 1.0, 1.0, [0.0, 1.0, 0.0])
    take = take.turned(HEAD, batch.exp(away)).flagged(LEFT, slice(60, None), 0).flagged(RIGHT, slice(60, None), 0)
    assert chest_degrees(take)[-1] == pytest.approx(120.0, abs=1.0)
