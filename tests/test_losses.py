"""Tracking losses of every kind, put into a recording that has none: how the published wrists take them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from losses import DURATIONS_S, KINDS, Kind, lose, publish, take_of, wrist_speeds
from persons import LEFT, Take

from arm_ik_service.body.profile import Profile
from arm_ik_service.programs.demo import bundled_session
from arm_ik_service.settings import TrackingSettings

LOOKING_UP = 3  # frames until velocities mean something


@cache
def clean() -> Take:
    return take_of(bundled_session("boxing"))


@cache
def fastest_m_s() -> tuple[float, ...]:
    """Of each wrist while it is tracked."""
    wrists = publish(clean(), Profile()).wrists
    return tuple(float(wrist_speeds(clean().t, wrists[:, hand])[LOOKING_UP:].max()) for hand in range(2))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("duration_s", DURATIONS_S)
@pytest.mark.parametrize("seed", [7, 9])  # with the second, limits let go of a hand that is held back
def test_no_loss_moves_a_wrist_faster_than_the_person_does_and_the_way_back_adds(
    kind: Kind, duration_s: float, seed: int
) -> None:
    lost, losses = lose(clean(), kind, duration_s, seed)
    assert {loss.device - LEFT for loss in losses} == {0, 1}
    wrists = publish(lost, Profile()).wrists
    assert np.isfinite(wrists).all()
    for hand, fastest in enumerate(fastest_m_s()):
        speeds = wrist_speeds(lost.t, wrists[:, hand])[LOOKING_UP:]
        assert speeds.max() <= 1.5 * fastest + TrackingSettings().reacquire_m_s
