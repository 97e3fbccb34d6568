"""Profiles from frames: arms and grips of people whose measures are known, and refusals that say why."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from persons import HEAD, LEFT, RIGHT, Take, run, standing

from arm_ik_service.body.calibration import Calibration, calibrate
from arm_ik_service.body.profile import BodyMeasures, Grips, Profile
from arm_ik_service.errors import CalibrationError
from arm_ik_service.geometry import batch

Array = npt.NDArray[np.float64]
GRIP = Grips().right
DEFAULT_GRIP = np.array([*GRIP.position_m, *GRIP.orientation_xyzw])


def sway(rng: np.random.Generator, t: Array, lower: npt.ArrayLike, upper: npt.ArrayLike) -> Array:
    """Smooth random angles (N, k) [rad] between bounds [degrees]."""
    lower, upper = np.radians(lower), np.radians(upper)
    phase = rng.uniform(0.0, 2.0 * np.pi, (3, len(lower)))
    speed = rng.uniform(0.5, 4.0, (3, len(lower)))
    wave = np.sin(speed[:, None] * t[None, :, None] + phase[:, None]).sum(axis=0)
    return np.asarray(0.5 * (lower + upper) + 0.5 * (upper - lower) * np.tanh(wave))


def turns(x: Array, y: Array, z: Array) -> Array:
    """Rotations (N, 4): about x, then about z, then about y."""
    zero = np.zeros_like(x)
    about = [np.stack(v, axis=-1) for v in ((x, zero, zero), (zero, zero, z), (zero, y, zero))]
    return batch.multiply(batch.exp(about[2]), batch.multiply(batch.exp(about[1]), batch.exp(about[0])))


def arm(
    rng: np.random.Generator,
    t: Array,
    upper_arm: float,
    forearm: float,
    shoulder: npt.ArrayLike,
    grip: Array,
    flick: float = 1.0,
) -> Array:
    """Grip poses (N, 7) of a right arm that moves about its shoulder; its wrist bends by 25 degrees times `flick`."""
    abduction, flexion, bend, roll = sway(rng, t, [5, -30, 0, -60], [80, 120, 110, 60]).T
    chest_from_upper = turns(flexion, -0.3 * abduction, abduction)
    elbow = np.asarray(shoulder) + batch.rotate(chest_from_upper, [0.0, -upper_arm, 0.0])
    chest_from_fore = batch.multiply(chest_from_upper, turns(bend, 0.0 * bend, 0.0 * bend))
    down = batch.rotate(chest_from_fore, [0.0, -1.0, 0.0])
    # the wrist frame of a straight wrist has its -z along the forearm; then it bends
    hand = batch.multiply(chest_from_fore, batch.exp([-0.5 * np.pi, 0.0, 0.0]))
    hand = batch.multiply(hand, batch.exp(np.stack([0 * roll, 0 * roll, roll], axis=1)))
    bent = flick * sway(rng, t, [-25, -15, -1], [25, 15, 1])
    wrist = np.concatenate([elbow + forearm * down, batch.multiply(hand, batch.exp(bent))], axis=1)
    return batch.compose(wrist, grip)


def lively(seconds: float, body: BodyMeasures, grip: Array = DEFAULT_GRIP, seed: int = 0, flick: float = 1.0) -> Take:
    """Return someone of these measures who stands and moves both arms about; left grips are mirrored."""
    rng = np.random.default_rng(seed)
    take = standing(seconds, 60.0)
    length = body.upper_arm + body.forearm
    eyes = 0.936 * body.stature_m
    half = 0.5 * body.shoulder_width
    shoulder = np.array([half, eyes - 0.165 * length / 0.56 - 0.26 * half, 0.13 * length / 0.56])
    take.poses[:, HEAD, 1] = eyes
    take.poses[:, RIGHT] = arm(rng, take.t, body.upper_arm, body.forearm, shoulder, grip, flick)
    take.poses[:, LEFT] = batch.mirror_pose(arm(rng, take.t, body.upper_arm, body.forearm, shoulder, grip, flick))
    return take


def length_error(found: Calibration, body: BodyMeasures) -> float:
    length = body.upper_arm + body.forearm
    return (found.profile.body.upper_arm + found.profile.body.forearm) / length - 1.0


PEOPLE = [
    BodyMeasures(stature_m=1.6),
    BodyMeasures(stature_m=1.9),
    BodyMeasures(stature_m=1.75, upper_arm_m=0.35, forearm_m=0.27),
    BodyMeasures(stature_m=1.75, upper_arm_m=0.3, forearm_m=0.23),
]


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
