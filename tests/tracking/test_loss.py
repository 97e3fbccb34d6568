"""Held, lost, dead-reckoned and found again: each device, and its position and rotation, apart."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from persons import HEAD, LEFT, RIGHT, Array, run, speeds, standing, stroke

from arm_ik_service.geometry import batch
from arm_ik_service.settings import TrackingSettings
from arm_ik_service.tracking.state import HELD, INFERRED, LOST, TRACKED
from arm_ik_service.wire.messages import ORIENTATION_TRACKED, ORIENTATION_VALID, POSITION_VALID

DEAD_RECKONED = POSITION_VALID | ORIENTATION_VALID | ORIENTATION_TRACKED
GONE = slice(90, 180)  # the second second
Policy = Literal["freeze", "follow", "fade_to_rest"]


def test_a_hand_that_is_gone_is_held_then_lost_then_found() -> None:
    made = run(standing(3.0).flagged(LEFT, GONE, 0).frames, tracking=TrackingSettings(lost_after_s=0.5))
    state = made.device(LEFT)["position_state"]
    assert (state[:90] == TRACKED).all()
    assert (state[90:134] == HELD).all()
    assert (state[137:180] == LOST).all()
    assert (state[180:] == TRACKED).all()
    assert (made.device(RIGHT)["position_state"] == TRACKED).all()


def test_a_controller_the_cameras_lost_still_turns() -> None:
    take = standing(3.0).flagged(LEFT, GONE, DEAD_RECKONED)
    turning = batch.exp(np.linspace([0, 0, 0], [0, 2.0, 0], len(take.t)))
    made = run(take.turned(LEFT, turning).frames)
    assert (made.device(LEFT)["position_state"][GONE] == HELD).all()
    assert (made.device(LEFT)["rotation_state"][GONE] == TRACKED).all()
    assert batch.angle_between(made.device(LEFT)["rotation"], turning).max() < 0.021


def drifting(policy: Policy) -> tuple[Array, Array, Array]:
    """Return where a left hand was dead-reckoned to, what came out, and its states."""
    take = standing(3.0)
    take = take.moved(LEFT, np.where((np.arange(270) // 90 == 1)[:, None], np.linspace([0] * 3, [0.6] * 3, 270), 0.0))
    take = take.flagged(LEFT, GONE, DEAD_RECKONED)
    made = run(take.frames, tracking=TrackingSettings(dead_reckoning=policy, lost_after_s=0.2))
    return take.poses[:, LEFT, :3], made.position(LEFT), made.device(LEFT)["position_state"]


def test_freeze_stays_where_the_hand_was_seen() -> None:
    data, out, state = drifting("freeze")
    assert np.abs(out[GONE] - data[89]).max() < 1e-3
    assert (state[GONE] < INFERRED).all()


def test_follow_goes_where_the_runtime_guesses() -> None:
    data, out, state = drifting("follow")
    assert np.abs(out[110:180] - data[110:180]).max() < 0.005
    assert (state[GONE] == INFERRED).all()


def test_fade_to_rest_lowers_the_hand_gently() -> None:
    data, out, state = drifting("fade_to_rest")
    assert out[179, 1] < data[89, 1] - 0.25
    assert speeds(np.arange(90) / 90.0, out[GONE]).max() < 1.05
    assert state[179] == LOST


@pytest.mark.parametrize("policy", ["freeze", "follow", "fade_to_rest"])
@pytest.mark.parametrize("frames", [9, 45, 270])
def test_coming_back_is_bounded_in_speed_and_exact_within_150_ms(policy: Policy, frames: int) -> None:
    rng = np.random.default_rng(frames)
    take = standing(5.0)
    sway = 0.2 * np.sin(2.0 * np.pi * 0.7 * take.t)[:, None] * np.array([1.0, 0.5, 0.3])
    take = take.moved(RIGHT, sway)
    gone = slice(100, 100 + frames)
    way = rng.normal(size=3)
    drift = np.zeros((len(take.t), 3))
    drift[gone] = np.linspace(0.0, 0.9, frames)[:, None] * way / np.linalg.norm(way)
    made = run(
        take.moved(RIGHT, drift).flagged(RIGHT, gone, DEAD_RECKONED).frames,
        tracking=TrackingSettings(dead_reckoning=policy),
    )
    out = made.position(RIGHT)
    settings = TrackingSettings()
    data_speed = 0.9 * 90.0 / frames + 2.0 if policy == "follow" else 2.0
    assert speeds(take.t, out).max() < 1.5 * data_speed + settings.reacquire_m_s
    back = take.t > take.t[gone.stop] + 0.15
    assert np.linalg.norm(out[back] - take.poses[back, RIGHT, :3], axis=1).max() < 5e-3


def test_a_hand_lost_in_a_stroke_coasts_to_a_stop() -> None:
    take = standing(2.0)
    take = take.moved(LEFT, stroke(take.t, 0.5, 0.4, [0.0, 0.0, -0.5]))
    lost_at = int(np.searchsorted(take.t, 0.7))
    made = run(take.flagged(LEFT, slice(lost_at, 120), 0).frames)
    speed = speeds(take.t, made.position(LEFT))
    assert 0.5 * speed[lost_at - 2] < speed[lost_at - 1] < speed[lost_at - 2]
    assert speed[lost_at + 20] < 0.01


def test_the_first_sight_of_a_hand_is_taken_as_it_is() -> None:
    take = standing(1.0).flagged(LEFT, slice(0, 45), 0)
    made = run(take.frames)
    assert (made.device(LEFT)["position_state"][:45] == LOST).all()
    assert made.position(LEFT)[45] == pytest.approx(take.poses[45, LEFT, :3])


def test_hands_never_seen_hang_by_the_head_wherever_it_goes() -> None:
    take = standing(1.0).flagged(LEFT, slice(None), 0).flagged(RIGHT, slice(None), 0)
    take = take.moved(HEAD, stroke(take.t, 0.2, 0.5, [2.0, -0.4, 1.0]))
    made = run(take.frames)
    hang = made.position(LEFT) - made.position(HEAD)
    assert np.abs(hang - hang[0]).max() < 1e-12
    assert made.position(RIGHT)[0, 0] > made.position(LEFT)[0, 0]


def test_a_hand_that_is_held_goes_along_when_the_person_walks() -> None:
    take = standing(3.0).flagged(LEFT, slice(45, None), 0)
    take = take.moved(HEAD, stroke(take.t, 1.0, 0.9, [1.5, 0.0, 0.0]))
    made = run(take.frames)
    assert made.position(LEFT)[-1] - take.poses[44, LEFT, :3] == pytest.approx([1.5, 0.0, 0.0], abs=0.02)


def test_a_hand_that_is_held_goes_round_with_a_person_who_turns_but_not_with_a_glance() -> None:
    take = standing(1.5).flagged(LEFT, slice(45, None), 0)
    about = stroke(take.t, 0.6, 0.4, [0.0, 1.0, 0.0])
    held = take.poses[44, LEFT, :3] - take.poses[44, HEAD, :3]

    def yaw_of_hand(turn: float) -> float:
        made = run(take.turned(HEAD, batch.exp(turn * about)).frames)
        x, _, z = (made.position(LEFT) - made.position(HEAD))[-1]
        return float(np.arctan2(x, z) - np.arctan2(held[0], held[2])) % (2.0 * np.pi)

    assert yaw_of_hand(0.5) < 0.25
    assert yaw_of_hand(3.0) == pytest.approx(2.6, abs=0.3)


def test_a_hand_that_is_held_is_not_swung_faster_than_a_hand_goes() -> None:
    take = standing(2.0).flagged(LEFT, slice(45, None), 0).moved(LEFT, np.tile([-0.6, 0.0, -0.3], (180, 1)))
    spins = np.maximum(take.t - 0.7, 0.0)[:, None] * np.array([0.0, 25.0, 0.0])
    made = run(take.turned(HEAD, batch.exp(spins)).frames)
    hand = made.position(LEFT) - made.position(HEAD)
    fastest = speeds(take.t, hand)[50:].max()
    assert 9.0 < fastest < 12.1
    reach = np.linalg.norm(hand[45:, [0, 2]], axis=1)
    assert np.ptp(reach) < 1e-9


def test_a_hand_that_is_held_comes_after_a_turn_that_was_too_fast_for_it() -> None:
    take = standing(2.0).flagged(LEFT, slice(45, None), 0).moved(LEFT, np.tile([-0.6, 0.0, -0.3], (180, 1)))
    turns = np.minimum(np.maximum(take.t - 0.7, 0.0) * 25.0, 2.5)[:, None] * np.array([0.0, 1.0, 0.0])
    made = run(take.turned(HEAD, batch.exp(turns)).frames)
    before, after = (made.position(LEFT) - made.position(HEAD))[[44, -1]]
    turned = np.arctan2(after[0], after[2]) - np.arctan2(before[0], before[2])
    heading = made.tracking["heading"]
    assert turned % (2 * np.pi) == pytest.approx((heading[-1] - heading[44]) % (2 * np.pi), abs=0.02)
    assert batch.angle_between(made.device(LEFT)["rotation"][-1], batch.exp([0.0, turned, 0.0])) < 0.02
