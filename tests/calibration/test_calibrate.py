"""Profiles from frames: arms and grips of people whose measures are known, and refusals that say why."""

from __future__ import annotations

import numpy as np
import pytest
from movers import DEFAULT_GRIP, GRIP, PEOPLE, lively
from persons import LEFT, RIGHT, Take, standing

from arm_ik_service.body.profile import BodyMeasures
from arm_ik_service.calibration.calibrate import Calibration, calibrate
from arm_ik_service.errors import CalibrationError
from arm_ik_service.geometry import batch


def length_error(found: Calibration, body: BodyMeasures) -> float:
    length = body.upper_arm + body.forearm
    return (found.profile.body.upper_arm + found.profile.body.forearm) / length - 1.0


@pytest.mark.parametrize("body", PEOPLE)
def test_moving_about_shows_stature_and_arms_to_a_few_percent(body: BodyMeasures) -> None:
    found = calibrate(lively(40.0, body).frames, "moving")
    assert found.profile.body.stature_m == pytest.approx(body.stature_m, abs=0.02)
    assert abs(length_error(found, body)) < 0.04
    assert not found.grips_changed
    assert found.confidence > 0.4


def test_a_controller_held_like_a_sword_is_noticed_and_its_arm_still_measured() -> None:
    body = BodyMeasures(stature_m=1.75)
    sword = np.concatenate([GRIP.position_m, [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]])
    found = calibrate(lively(40.0, body, sword).frames, "moving")
    assert found.grips_changed
    assert abs(length_error(found, body)) < 0.05
    held = found.profile.grip
    assert batch.angle_between(held.right.orientation_xyzw, sword[3:]) < np.radians(30.0)
    mirrored = batch.mirror_pose(np.array([*held.right.position_m, *held.right.orientation_xyzw]))
    assert batch.angle_between(mirrored[3:], held.left.orientation_xyzw) < 1e-3


@pytest.mark.parametrize("stature", [1.5, 1.62, 1.75, 1.88, 2.0])
@pytest.mark.parametrize("flick", [0.0, 1.0, 2.5])
def test_whoever_moves_and_however_their_wrists_bend_gets_the_arms_of_a_person(stature: float, flick: float) -> None:
    body = BodyMeasures(stature_m=stature)
    found = calibrate(lively(30.0, body, flick=flick, seed=round(100 * stature)).frames, "moving")
    measured = found.profile.body
    length_m = measured.upper_arm + measured.forearm
    assert 1.0 < measured.upper_arm / measured.forearm < 1.4
    assert abs(length_error(found, body)) < (0.04 if flick <= 1.0 else 0.08)
    assert abs(length_m - body.upper_arm - body.forearm) < 2.5 * found.arm_length_deviation_m


def test_of_someone_who_hardly_shows_anything_little_is_claimed() -> None:
    body = BodyMeasures(stature_m=1.75)
    found = calibrate(lively(1.5, body).frames, "moving")
    sure = calibrate(lively(40.0, body).frames, "moving")
    assert abs(length_error(found, body)) < 0.1
    assert found.arm_length_deviation_m > sure.arm_length_deviation_m


def test_more_movement_makes_it_surer() -> None:
    body = BodyMeasures(stature_m=1.7)
    short, long = (calibrate(lively(seconds, body).frames, "moving") for seconds in (2.0, 20.0))
    assert long.arm_length_deviation_m < short.arm_length_deviation_m
    assert long.confidence > short.confidence


def test_the_same_frames_give_the_same_profile() -> None:
    frames = lively(5.0, PEOPLE[0]).frames
    assert calibrate(frames, "moving") == calibrate(frames, "moving")


def pose(body: BodyMeasures, below_degrees: float, seconds: float = 2.0) -> Take:
    """Return someone with straight arms in the frontal plane, palms down or inwards."""
    take = lively(seconds, body)
    length = 0.985 * (body.upper_arm + body.forearm)
    half = 0.5 * body.shoulder_width
    k = (body.upper_arm + body.forearm) / 0.56
    shoulder = np.array([half, 0.936 * body.stature_m - 0.165 * k - 0.26 * half, 0.13 * k])
    down = np.radians(below_degrees)
    out = np.array([np.cos(down), -np.sin(down), 0.0])
    hand = batch.multiply(batch.exp([0.0, 0.0, -down]), batch.exp([0.0, -0.5 * np.pi, 0.0]))
    grip = batch.compose(np.concatenate([shoulder + length * out, hand]), DEFAULT_GRIP)
    take.poses[:, RIGHT] = grip
    take.poses[:, LEFT] = batch.mirror_pose(grip)
    return take


@pytest.mark.parametrize("body", PEOPLE)
def test_a_t_pose_gives_the_arms_to_two_percent(body: BodyMeasures) -> None:
    found = calibrate(pose(body, 0.0).frames, "t_pose")
    assert found.method == "t_pose"
    assert abs(length_error(found, body)) < 0.025
    assert not found.grips_changed


def test_an_a_pose_gives_the_arms_to_four_percent() -> None:
    found = calibrate(pose(PEOPLE[0], 50.0).frames, "a_pose")
    assert abs(length_error(found, PEOPLE[0])) < 0.04


def test_the_method_is_found_by_itself() -> None:
    assert calibrate(pose(PEOPLE[0], 3.0).frames).method == "t_pose"
    assert calibrate(pose(PEOPLE[0], 45.0).frames).method == "a_pose"
    assert calibrate(lively(5.0, PEOPLE[0]).frames).method == "moving"


@pytest.mark.parametrize(
    ("take", "says"),
    [
        (pose(PEOPLE[0], 50.0), "below the horizontal"),
        (pose(PEOPLE[0], 0.0).moved(LEFT, [0.25, 0.0, 0.0]), "bent"),
        (pose(PEOPLE[0], 0.0).moved(LEFT, [0.4, 0.0, -0.45]), "away from sideways"),
        (pose(PEOPLE[0], 0.0).moved(LEFT, [0.3, 0.0, 0.0]).moved(RIGHT, [-0.3, 0.0, 0.0]), "bent, or not arms"),
        (lively(3.0, PEOPLE[0]), "never kept still"),
        (pose(PEOPLE[0], 0.0, seconds=0.4), "not tracked together"),
        (pose(PEOPLE[0], 0.0).in_space([0.0, -0.8, 0.0, 0.0, 0.0, 0.0, 1.0]), "nobody stands there"),
    ],
)
def test_a_t_pose_that_is_none_is_refused_with_the_reason(take: Take, says: str) -> None:
    with pytest.raises(CalibrationError, match=says):
        calibrate(take.frames, "t_pose")


def test_someone_who_is_not_there_or_does_not_move_is_refused() -> None:
    with pytest.raises(CalibrationError, match="never tracked together"):
        calibrate(standing(2.0).flagged(LEFT, slice(None), 0).frames)
    with pytest.raises(CalibrationError, match="hardly moved"):
        calibrate(standing(5.0).frames, "moving")


def test_hands_that_belong_to_nobody_are_refused_and_no_profile_is_made_of_them() -> None:
    rng = np.random.default_rng(4)
    take = standing(30.0, 60.0)
    for device in (LEFT, RIGHT):
        take.poses[:, device, :3] += np.cumsum(0.02 * rng.normal(size=(len(take.t), 3)), axis=0).clip(-0.4, 0.4)
        take.poses[:, device, 3:] = batch.normalized(rng.normal(size=(len(take.t), 4)))
    with pytest.raises(CalibrationError, match="in its own hand"):
        calibrate(take.frames, "moving")
