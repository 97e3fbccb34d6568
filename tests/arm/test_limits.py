"""The shoulder's limits: a smooth star-shaped region of directions, and a twist that opens where it loses meaning."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from arm_ik_service.arm.chain import columns_of
from arm_ik_service.arm.limits import swing_edge, swing_excess, swing_gradient, twist_excess, twist_gradient, twist_of
from arm_ik_service.arm.model import ArmModel
from arm_ik_service.geometry.scalar import exp, multiply, twist_y

ARM = ArmModel.load()
CHAIN: Any = ARM.chains[0]
STEP = 1e-6


def direction(forward: float, up: float, right: float) -> tuple[float, float, float]:
    u = np.array([forward, up, right]) / np.linalg.norm([forward, up, right])
    return (float(u[0]), float(u[1]), float(u[2]))


def towards(azimuth_deg: float, degrees: float) -> tuple[float, float, float]:
    """Humerus raised by `degrees` from hanging, 0 to the front, 90 to the person's right."""
    a, b = np.radians(azimuth_deg), np.radians(degrees)
    return direction(np.sin(b) * np.cos(a), -np.cos(b), np.sin(b) * np.sin(a))


@pytest.mark.parametrize(
    ("movement", "u"),
    [
        ("hanging", towards(0, 0)),
        ("flexion 90", towards(0, 90)),
        ("flexion 180", towards(0, 180)),
        ("abduction 90", towards(90, 90)),
        ("abduction 170", towards(90, 170)),
        ("extension 60", towards(180, 60)),
        ("horizontal adduction to 130", towards(-40, 90)),
        ("forward and out", towards(45, 90)),
    ],
)
def test_what_a_shoulder_can_do_is_inside(movement: str, u: tuple[float, float, float]) -> None:
    assert swing_excess(CHAIN, u) <= 0.0, movement


@pytest.mark.parametrize(
    ("movement", "u"),
    [
        ("straight back at shoulder height", towards(180, 90)),
        ("behind the other shoulder", towards(-90, 90)),
        ("extension 80", towards(180, 80)),
        ("horizontal adduction to 150", towards(-60, 90)),
    ],
)
def test_what_no_shoulder_can_do_is_outside(movement: str, u: tuple[float, float, float]) -> None:
    assert swing_excess(CHAIN, u) > 0.0, movement


def test_the_edge_runs_through_the_angles_of_the_model_file_and_has_their_slope() -> None:
    for index, degrees in enumerate([92, 95, 105, 112, 125, 140, 112, 98]):
        azimuth = index * np.pi / 4
        assert swing_edge(CHAIN, np.cos(azimuth), np.sin(azimuth))[0] == pytest.approx(np.radians(degrees))
    for azimuth in np.linspace(-3.0, 3.0, 13):
        ahead = swing_edge(CHAIN, np.cos(azimuth + STEP), np.sin(azimuth + STEP))[0]
        behind = swing_edge(CHAIN, np.cos(azimuth - STEP), np.sin(azimuth - STEP))[0]
        slope = swing_edge(CHAIN, np.cos(azimuth), np.sin(azimuth))[1]
        assert slope == pytest.approx((ahead - behind) / (2 * STEP), abs=1e-7)


def test_gradients_are_the_finite_differences() -> None:
    checked = 0
    for row in ARM.random_configurations(200, np.random.default_rng(0)):
        q = (row[0], row[1], row[2], row[3])
        bone = columns_of(q)
        u = (-bone[1][0], -bone[1][1], -bone[1][2])
        swing, twist = swing_gradient(CHAIN, bone), twist_gradient(q)
        for axis in np.eye(3):
            ahead, behind = (columns_of(multiply(q, exp(tuple(s * STEP * axis)))) for s in (1.0, -1.0))
            if swing_excess(CHAIN, u) > -1.0:  # deep inside it is not computed
                checked += 1
                a, b = (swing_excess(CHAIN, (-c[1][0], -c[1][1], -c[1][2])) for c in (ahead, behind))
                assert axis @ swing == pytest.approx((a - b) / (2 * STEP), abs=1e-6)
            if bone[1][1] > -0.98:  # not straight up
                turned = twist_of(ahead) - twist_of(behind)
                turned = (turned + np.pi) % (2 * np.pi) - np.pi
                assert axis @ twist == pytest.approx(turned / (2 * STEP), abs=1e-5)
    assert checked > 100


def test_twist_from_columns_is_the_twist_of_the_quaternion() -> None:
    for row in ARM.random_configurations(100, np.random.default_rng(1)):
        q = (row[0], row[1], row[2], row[3])
        assert twist_of(columns_of(q)) == pytest.approx(twist_y(q), abs=1e-9)


def test_twist_is_limited_below_the_horizon_and_free_straight_up() -> None:
    lower, upper = ARM.twist_range
    for height in (-1.0, 0.0, 0.7):
        assert twist_excess(CHAIN, upper + 0.1, height) == pytest.approx(0.1)
        assert twist_excess(CHAIN, lower - 0.1, height) == pytest.approx(-0.1)
        assert twist_excess(CHAIN, 0.5 * (lower + upper), height) == 0.0
    assert twist_excess(CHAIN, 3.1, 0.99) == 0.0
    assert twist_excess(CHAIN, -3.1, 0.99) == 0.0


def test_the_twist_range_opens_without_a_step() -> None:
    heights = np.linspace(0.7, 1.0, 301)
    excess = np.array([twist_excess(CHAIN, 2.5, height) for height in heights])
    assert np.abs(np.diff(excess)).max() < 0.03
    assert (np.diff(excess) <= 1e-12).all()
