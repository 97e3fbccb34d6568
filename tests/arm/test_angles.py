"""Joint angles and ISB angles say the same rotation as the configuration, and their rates are their derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from arm_ik_service.arm.angles import isb_shoulder, joint_angles
from arm_ik_service.arm.model import ANGLES, ArmModel
from arm_ik_service.geometry import batch

ARM = ArmModel.load()


def angles_of(q: np.ndarray, v: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    angles, rates = np.empty(9), np.empty(9)
    joint_angles(q, np.zeros(9) if v is None else v, angles, rates)
    return angles, rates


def test_swing_and_twist_put_together_are_the_shoulder() -> None:
    for q in ARM.random_configurations(200, np.random.default_rng(0)):
        flexion, abduction, twist = angles_of(q)[0][:3]
        swing = batch.exp([-abduction, 0.0, flexion])
        again = batch.multiply(swing, batch.exp([0.0, twist, 0.0]))
        assert batch.angle_between(q[:4], again) < 1e-7


def test_rates_are_the_derivatives_of_the_angles() -> None:
    rng, dt = np.random.default_rng(1), 1e-6
    for q in [*ARM.random_configurations(200, rng), np.array([0, 0, 0, 1.0, *np.zeros(6)])]:
        v = rng.normal(size=9)
        ahead, behind = q.copy(), q.copy()
        for row, sign in ((ahead, 1.0), (behind, -1.0)):
            row[:4] = batch.multiply(q[:4], batch.exp(sign * dt * v[:3]))
            row[4:] += sign * dt * v[3:]
        angles, rates = angles_of(q, v)
        if np.hypot(angles[0], angles[1]) > 3.0:
            continue  # straight up: the swing's rotation vector has a fold there
        change = (angles_of(ahead)[0] - angles_of(behind)[0] + np.pi) % (2 * np.pi) - np.pi
        np.testing.assert_allclose(rates, change / (2 * dt), atol=1e-5)


def test_isb_angles_put_together_are_the_shoulder() -> None:
    isb = np.empty(3)
    for q in ARM.random_configurations(200, np.random.default_rng(2)):
        isb_shoulder(q, isb)
        plane, elevation, axial = isb
        again = batch.multiply(
            batch.multiply(batch.exp([0, plane, 0]), batch.exp([-elevation, 0, 0])), batch.exp([0, axial, 0])
        )
        assert batch.angle_between(q[:4], again) < 1e-7


def test_isb_angles_are_singular_hanging_and_straight_up_and_name_the_planes() -> None:
    isb = np.empty(3)
    for elevation, singular in ((0.0, 1), (0.05, 1), (0.5, 0), (3.0, 0), (3.1, 1)):
        q = np.array([*batch.exp([0, 0, elevation]), *np.zeros(6)])
        assert isb_shoulder(q, isb) == singular
        assert isb[1] == pytest.approx(elevation)
    isb_shoulder(np.array([*batch.exp([0, 0, 1.0]), *np.zeros(6)]), isb)
    assert isb[0] == pytest.approx(np.pi / 2)  # forward flexion
    isb_shoulder(np.array([*batch.exp([-1.0, 0, 0]), *np.zeros(6)]), isb)
    assert isb[0] == pytest.approx(0.0)  # abduction


def test_names_match_what_moves() -> None:
    for index, name in enumerate(ANGLES[3:]):
        q = np.zeros(10)
        q[3], q[4 + index] = 1.0, 0.3
        angles = angles_of(q)[0]
        assert angles[ANGLES.index(name)] == pytest.approx(0.3)
        assert np.count_nonzero(angles) == 1
