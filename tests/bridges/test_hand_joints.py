"""A bare hand goes out as the grip from which the service gets the tracked wrist back."""

from __future__ import annotations

import numpy as np
import pytest

from arm_ik_service.body.profile import Profile
from arm_ik_service.bridges.hand_joints import grip_from_wrist
from arm_ik_service.geometry import batch
from arm_ik_service.wire.messages import SIDES, Side, TrackedPose

TURN = batch.exp([0.3, -0.7, 1.1])


def wrist(time_s: float) -> TrackedPose:
    """Return a wrist that moves and turns steadily."""
    velocity, spin = np.array([0.4, -0.2, 0.1]), np.array([0.5, 1.5, -0.8])
    q = batch.multiply(batch.exp(spin * time_s), TURN)
    p = np.array([0.2, 1.1, -0.3]) + velocity * time_s
    return TrackedPose(tuple(p), tuple(q), 7, tuple(velocity), tuple(spin))


@pytest.mark.parametrize("side", SIDES)
def test_the_default_profile_takes_the_grip_back_to_the_wrist(side: Side) -> None:
    grip = grip_from_wrist(side, wrist(0.0))
    offset = getattr(Profile().grip, side)
    grip_from_world = batch.inverse([*grip.position, *grip.orientation])
    wrist_from_grip = np.array([*offset.position_m, *offset.orientation_xyzw])
    back = batch.inverse(batch.compose(wrist_from_grip, grip_from_world))
    assert back[:3] == pytest.approx(wrist(0.0).position, abs=1e-12)
    assert batch.angle_between(back[3:], TURN) < 1e-7
    assert grip.flags == 7


@pytest.mark.parametrize("side", SIDES)
def test_its_velocity_is_the_derivative_of_its_position(side: Side) -> None:
    step_s = 1e-5
    before, after = (np.array(grip_from_wrist(side, wrist(t)).position) for t in (-step_s, step_s))
    grip = grip_from_wrist(side, wrist(0.0))
    assert grip.linear_velocity == pytest.approx((after - before) / (2 * step_s), abs=1e-6)
    assert grip.angular_velocity == wrist(0.0).angular_velocity


def test_a_velocity_that_cannot_be_known_is_not_made_up() -> None:
    at = wrist(0.0)
    assert grip_from_wrist("left", TrackedPose(at.position, at.orientation, 3)).linear_velocity is None
