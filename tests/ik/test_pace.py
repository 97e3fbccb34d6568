"""What no arm can follow must not throw it about: neither hands that turn too far nor hands that are out of reach."""

from __future__ import annotations

import numpy as np
import pytest
from streams import run, tumbling

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.body.state import TARGET
from arm_ik_service.geometry import batch
from arm_ik_service.ik.any_rotation import STUCK_M
from arm_ik_service.ik.jacobian_transpose import JacobianTranspose
from arm_ik_service.ik.pace import CATCH_UP_M_S, ELBOW_STEP_M

FRAMES, RATE_HZ = 1500, 90.0  # as tumbling's
CARRY_M = 0.015  # of the elbow on its circle, as the reach changes from frame to frame


@pytest.mark.parametrize("seed", range(5))
def test_the_elbow_moves_little_more_than_the_hand_and_the_hand_keeps_its_place(seed: int) -> None:
    arm = ArmModel.load(side="right")
    targets = tumbling(seed)
    track = JacobianTranspose(arm, frame_rate_hz=RATE_HZ).track(targets)
    assert np.mean(track.orientation_error_rad > 0.1) > 0.3  # the stream is as hostile as it is meant to be
    elbow = arm.forward(track.configuration)["elbow"][:, :3]
    steps = np.linalg.norm(np.diff(elbow, axis=0), axis=1)
    hand_steps = np.linalg.norm(np.diff(targets[:, :3], axis=0), axis=1)
    assert np.max(steps - hand_steps) < ELBOW_STEP_M + CARRY_M
    assert np.percentile(track.position_error_m, 99.0) < STUCK_M
    assert np.max(track.position_error_m) < 0.03


def roaming(seed: int) -> batch.Array:
    """Hands (FRAMES, 7) all around the right shoulder, behind the back and in the hole before it, that turn slowly."""
    rng = np.random.default_rng(seed)
    t = np.arange(FRAMES)[:, None] / RATE_HZ
    waves = [rng.normal(size=3) * np.sin(2 * np.pi * f * t + rng.uniform(0, 6, 3)) for f in (0.2, 0.3, 0.5, 0.6)]
    return np.concatenate([0.25 * (waves[0] + waves[1]), batch.exp(0.7 * (waves[2] + waves[3]))], axis=1)


@pytest.mark.parametrize("seed", range(8))
def test_a_hand_that_was_held_back_comes_back_no_faster_than_it_is_asked_to_move_or_may_catch_up(seed: int) -> None:
    arm = ArmModel.load(side="right")
    targets = roaming(seed)
    track = JacobianTranspose(arm, frame_rate_hz=RATE_HZ).track(targets)
    steps, asked = (
        np.linalg.norm(np.diff(hands[:, :3], axis=0), axis=1)
        for hands in (arm.forward(track.configuration)["hand"], targets)
    )
    assert np.mean(track.position_error_m > STUCK_M) > 0.05, "hands are held back in this stream"
    assert np.max(steps - np.maximum(asked, CATCH_UP_M_S / RATE_HZ)) < STUCK_M


def test_a_track_from_a_start_is_the_same_whatever_was_tracked_before() -> None:
    arm = ArmModel.load(side="right")
    fresh, used = (JacobianTranspose(arm, frame_rate_hz=RATE_HZ) for _ in range(2))
    targets = roaming(0)
    held_back = np.flatnonzero(used.track(targets).position_error_m > STUCK_M)
    used.track(targets[: held_back[-1] + 1])  # ends with a hand that would have to come back
    for n in held_back[::10]:  # from rest that is a leap to a hand that cannot be met
        one = targets[n : n + 1]
        np.testing.assert_array_equal(used.track(one, arm.rest).configuration, fresh.track(one, arm.rest).configuration)
        fresh = JacobianTranspose(arm, frame_rate_hz=RATE_HZ)


def test_the_budget_is_kept_on_the_most_hostile_stream() -> None:
    solver = JacobianTranspose(ArmModel.load(side="right"), iterations=20)
    assert solver.track(tumbling(7)).iterations.max() <= 20


@pytest.mark.parametrize("seed", range(4))
def test_a_trunk_that_turns_adds_nothing_to_the_speed_of_a_hand_on_its_way_back(seed: int) -> None:
    """The hand is measured in the world: of a trunk that spins at 10 rad/s about the shoulder."""
    arm, spin_rad_s, dt_s = ArmModel.load(side="right"), 10.0, 1.0 / RATE_HZ
    turns = np.outer(np.arange(FRAMES) * dt_s * spin_rad_s, [0.0, 1.0, 0.0])
    targets = np.zeros(FRAMES, TARGET)
    hands = batch.compose(np.concatenate([np.zeros((FRAMES, 3)), batch.exp(-turns)], axis=1), roaming(seed))
    targets["position"], targets["rotation"] = hands[:, :3], hands[:, 3:]
    targets["carried_angular_velocity"][:, 1] = spin_rad_s
    answer = run(arm, targets, dt_s)
    wrists = batch.rotate(batch.exp(turns), arm.forward(answer.configuration)["wrist"][:, :3])
    steps = np.linalg.norm(np.diff(wrists, axis=0), axis=1)
    asked = np.linalg.norm(np.diff(roaming(seed)[:, :3], axis=0), axis=1)
    carried = spin_rad_s * dt_s * np.linalg.norm(wrists[:-1], axis=1)
    assert np.mean(answer.position_error_m > STUCK_M) > 0.05, "hands are held back in this stream"
    assert np.max(steps - np.maximum(np.maximum(asked, carried), CATCH_UP_M_S * dt_s)) < 2.0 * STUCK_M
