"""The default solver on reachable, unreachable and awkward targets, alone and in streams, all sizes, both sides."""

from __future__ import annotations

import numpy as np
import pytest
from streams import Array, random_stream

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.geometry import batch
from arm_ik_service.ik.jacobian_transpose import JacobianTranspose
from arm_ik_service.ik.solver import Status

RIGHT = ArmModel.load(upper_arm_m=0.30, forearm_m=0.26)
CHILD_M, TALL_M = 1.10, 2.05


def person(side: str, stature_m: float) -> ArmModel:
    return ArmModel.load(side, 0.186 * stature_m, 0.146 * stature_m)  # type: ignore[arg-type]


def hand_at(position: list[float], fingers: list[float], back: list[float]) -> Array:
    """OpenXR wrist pose from where the fingers and the back of the hand point."""
    z, y = -np.array(fingers, float), np.array(back, float)
    z /= np.linalg.norm(z)
    y -= z * (y @ z)
    y /= np.linalg.norm(y)
    return np.concatenate([position, batch.from_matrix(np.stack([np.cross(y, z), y, z], axis=-1))])


def elbow_steps(arm: ArmModel, q: Array) -> Array:
    return np.asarray(np.linalg.norm(np.diff(arm.forward(q)["elbow"][:, :3], axis=0), axis=1))


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("stature_m", [CHILD_M, 1.75, TALL_M])
def test_cold_starts_from_rest_reach_reachable_poses(side: str, stature_m: float) -> None:
    arm = person(side, stature_m)
    targets = arm.forward(arm.random_configurations(400, np.random.default_rng(0), 0.95))["hand"]
    solver = JacobianTranspose(arm, iterations=128)
    solutions = [solver.solve(target) for target in targets]
    assert np.mean([s.status == Status.SOLVED for s in solutions]) >= 0.995
    assert max(s.iterations for s in solutions) <= 128
    assert np.abs(arm.excess(np.array([s.configuration for s in solutions]))).max() < 1e-9


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("stature_m", [CHILD_M, 1.75, TALL_M])
def test_streams_over_all_ranges_are_followed(side: str, stature_m: float) -> None:
    arm = person(side, stature_m)
    tracks = [JacobianTranspose(arm).track(random_stream(arm, seed)[1]) for seed in range(3)]
    error = np.concatenate([track.position_error_m for track in tracks])
    iterations = np.concatenate([track.iterations for track in tracks])
    assert np.mean(error > 0.01) <= 5e-4
    assert np.percentile(error, 95) <= 5e-4
    assert np.percentile(iterations, 95) <= 12
    assert iterations.max() <= 32


@pytest.mark.slow
def test_long_streams_over_all_ranges_are_followed() -> None:
    errors = [
        JacobianTranspose(RIGHT).track(random_stream(RIGHT, seed, frames=5000)[1]).position_error_m
        for seed in range(60)
    ]
    assert np.mean(np.concatenate(errors) > 0.01) <= 5e-4


def test_the_left_arm_is_the_mirror_of_the_right_to_the_last_bit() -> None:
    left = ArmModel.load("left", upper_arm_m=0.30, forearm_m=0.26)
    targets = random_stream(RIGHT, 5, frames=500)[1]
    a = JacobianTranspose(RIGHT).track(targets)
    b = JacobianTranspose(left).track(batch.mirror_pose(targets))
    np.testing.assert_array_equal(a.configuration, b.configuration)
    np.testing.assert_array_equal(a.iterations, b.iterations)


def test_what_is_reported_is_the_error_of_the_configuration() -> None:
    targets = random_stream(RIGHT, 6, frames=300)[1]
    targets[::50, :3] *= 1.5  # some out of reach
    track = JacobianTranspose(RIGHT).track(targets)
    hands = RIGHT.forward(track.configuration)["hand"]
    np.testing.assert_allclose(np.linalg.norm(hands[:, :3] - targets[:, :3], axis=1), track.position_error_m, atol=1e-9)
    np.testing.assert_allclose(
        batch.angle_between(hands[:, 3:], targets[:, 3:]), track.orientation_error_rad, atol=1e-7
    )


def test_a_track_from_a_start_stays_with_it_and_one_without_is_at_ease() -> None:
    hand = hand_at([0.1, -0.2, -0.35], [0, 0, -1], [0, 1, 0])
    solver = JacobianTranspose(RIGHT)
    at_ease = solver.track(hand[None]).configuration[0]
    raised = solver.track(hand[None], start=RIGHT.random_configurations(1, np.random.default_rng(1))[0])
    assert raised.configuration.shape == (1, 10)
    elbow = RIGHT.forward(at_ease)["elbow"]
    assert elbow[1] < -0.1  # below the shoulder


@pytest.mark.parametrize("bad", [np.zeros((3, 6)), np.zeros((3, 7)), np.full((3, 7), np.nan), np.ones((3, 7))])
def test_targets_that_are_no_poses_are_refused(bad: Array) -> None:
    with pytest.raises(ValueError, match="targets"):
        JacobianTranspose(RIGHT).track(bad)


@pytest.mark.parametrize("beyond_m", [0.001, 0.03, 0.15])
def test_out_of_reach_the_arm_is_straight_towards_the_target(beyond_m: float) -> None:
    towards = np.array([0.4, -0.3, -0.86]) / np.linalg.norm([0.4, -0.3, -0.86])
    hand = hand_at(list((0.56 + beyond_m) * towards), [0.4, -0.3, -0.86], [0, 1, 0])
    solution = JacobianTranspose(RIGHT, iterations=64).solve(hand)
    assert solution.status == (Status.SOLVED if beyond_m < 5e-4 else Status.NEAREST)
    assert solution.position_error_m == pytest.approx(beyond_m, abs=1e-3)


def test_a_rotation_that_no_wrist_has_costs_no_position() -> None:
    fingers_to_the_face = hand_at([0.1, -0.1, -0.42], [0.3, 0.2, 1.0], [0, 1, 0])
    track = JacobianTranspose(RIGHT).track(np.repeat(fingers_to_the_face[None], 200, axis=0))
    assert track.position_error_m[-1] <= 1e-3
    assert track.orientation_error_rad[-1] > 0.3
    assert track.status[-1] != Status.SOLVED


@pytest.mark.parametrize(
    "hand",
    [
        hand_at([0.3, 0.1, -0.7], [0.3, 0.1, -0.7], [0, 1, 0]),  # out of reach
        hand_at([0.1, -0.1, -0.42], [0.3, 0.2, 1.0], [0, 1, 0]),  # no such wrist
        hand_at([0.0, -0.05, -0.06], [0, 1, 0], [0, 0, -1]),  # the elbow cannot bend so far
        hand_at([-0.1, 0.2, 0.45], [0, 0, 1], [0, 1, 0]),  # behind the head
        hand_at([0.2, -0.2, -0.3], [0, 0, -1], [0, 1, 0]),  # an easy one
    ],
)
def test_a_target_that_does_not_move_is_answered_by_an_arm_that_comes_to_rest(hand: Array) -> None:
    track = JacobianTranspose(RIGHT).track(np.repeat(hand[None], 600, axis=0), start=RIGHT.rest)
    q = track.configuration[-60:]
    assert np.abs(np.diff(q, axis=0)).max() < 3e-3  # single iterations, as the habit drifts out of the tolerance
    assert elbow_steps(RIGHT, q).max() < 1e-3
    assert np.ptp(track.position_error_m[-60:]) < 5e-4


def circle(centre: list[float], radius: float, fingers: list[float], frames: int = 360) -> Array:
    """A hand on a horizontal circle."""
    a = np.linspace(0, 2 * np.pi, frames, endpoint=False)
    hand = hand_at(centre, fingers, [0, 1, 0.2])
    path = np.repeat(hand[None], frames, axis=0)
    path[:, 0] += radius * np.cos(a)
    path[:, 2] += radius * np.sin(a)
    return path


@pytest.mark.parametrize(
    ("passage", "path"),
    [
        ("overhead", circle([0.05, 0.48, -0.05], 0.08, [0, 1, 0])),
        ("under the shoulder", circle([0.02, -0.45, 0.0], 0.06, [0, -1, -0.3])),
        ("close to the shoulder", circle([0.05, -0.08, -0.16], 0.06, [-0.5, 0.5, -0.5])),
        ("at full reach", circle([0.15, -0.1, -0.50], 0.04, [0, 0, -1])),
    ],
)
def test_slow_circles_through_awkward_places_move_the_elbow_slowly(passage: str, path: Array) -> None:
    track = JacobianTranspose(RIGHT).track(np.concatenate([path, path]))
    steps = elbow_steps(RIGHT, track.configuration)
    assert steps.max() < 0.05, passage
    assert np.abs(RIGHT.excess(track.configuration)).max() < 1e-9


def test_passing_through_the_straight_arm_the_hand_is_met_and_the_elbow_goes_on() -> None:
    reach = np.concatenate([np.linspace(0.45, 0.5599, 90), np.linspace(0.5599, 0.45, 90)])
    towards = np.array([0.3, -0.2, -0.9]) / np.linalg.norm([0.3, -0.2, -0.9])
    path = np.array([hand_at(list(r * towards), list(towards), [0, 1, 0]) for r in reach])
    track = JacobianTranspose(RIGHT).track(path)
    assert track.position_error_m.max() < 1e-3
    assert elbow_steps(RIGHT, track.configuration).max() < 0.05
    there, back = RIGHT.forward(track.configuration[[0, -1]])["elbow"][:, :3]
    assert np.linalg.norm(there - back) < 0.03


def test_the_elbow_of_a_still_hand_moves_no_faster_than_its_bound() -> None:
    hand = hand_at([0.1, -0.15, -0.3], [0, 0, -1], [0, 1, 0])
    solver = JacobianTranspose(RIGHT, frame_rate_hz=90.0)
    easy = solver.track(hand[None]).configuration[0]
    # the same hand with the elbow lifted about the line from shoulder to wrist
    axis = np.array([-hand[2], hand[1], hand[0]]) / np.linalg.norm(hand[:3])  # in ISB axes
    lifted = easy.copy()
    lifted[:4] = batch.multiply(batch.exp(0.9 * axis), easy[:4])
    track = solver.track(np.repeat(hand[None], 200, axis=0), start=RIGHT.clamp(lifted))
    bound = solver.settings.swivel_speed_rad_s / 90.0 * RIGHT.upper_arm_m
    assert elbow_steps(RIGHT, track.configuration)[1:].max() < 1.2 * bound
    settled = solver.track(np.repeat(hand[None], 200, axis=0)).configuration[-1]
    found, wanted = RIGHT.forward(track.configuration[-1])["elbow"][:3], RIGHT.forward(settled)["elbow"][:3]
    assert np.linalg.norm(found - wanted) < 0.01


def test_a_hand_that_moves_smoothly_takes_an_iteration_or_two() -> None:
    quick = [JacobianTranspose(RIGHT).track(random_stream(RIGHT, seed, share=0.5)[1]).iterations for seed in range(5)]
    assert np.median(quick) <= 2


def test_pulling_the_hand_on_does_not_amplify_the_noise_of_a_tracker() -> None:
    hands = random_stream(RIGHT, 3, share=0.5, most_m_s=1.0)[1]
    rng = np.random.default_rng(0)
    noisy = hands.copy()
    noisy[:, :3] += rng.normal(scale=1e-3, size=(len(hands), 3))
    noisy[:, 3:] = batch.multiply(noisy[:, 3:], batch.exp(rng.normal(scale=5e-3, size=(len(hands), 3))))
    solver = JacobianTranspose(RIGHT, position_tolerance_m=2e-5, orientation_tolerance_rad=2e-4)
    clean, shaken = (solver.track(path) for path in (hands, noisy))
    assert np.percentile(shaken.position_error_m, 99.0) < 1e-4
    elbows = [RIGHT.forward(track.configuration)["elbow"][:, :3] for track in (clean, shaken)]
    trembling = np.std(np.diff(elbows[1] - elbows[0], axis=0)[50:], axis=0)
    assert (
        np.linalg.norm(trembling) < 2.0 * np.sqrt(2 * 3) * 1e-3
    )  # twice what the hand itself trembles from frame to frame


def test_a_hand_that_stops_dead_is_met_at_once_and_the_elbow_with_it() -> None:
    hands = random_stream(RIGHT, 2, share=0.5, frames=200, most_m_s=3.0)[1]
    path = np.concatenate([hands[:100], np.repeat(hands[99:100], 60, axis=0)])
    track = JacobianTranspose(RIGHT).track(path)
    assert track.position_error_m[100:].max() < 5e-4
    elbow = RIGHT.forward(track.configuration)["elbow"][:, :3]
    moving, after = (np.linalg.norm(np.diff(elbow[part], axis=0), axis=1) for part in (slice(80, 100), slice(100, 160)))
    assert after[1:].max() < moving.max()
    assert after[-1] < 1e-3
