"""Polynomials instead of the C library: as exact as a double is."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from arm_ik_service.geometry.trigonometry import angle_of, arc, half_turn, sine_cosine

EXACT = 5e-16


@given(st.floats(-1e3, 1e3))
@example(0.25 * math.pi)
@example(-0.75 * math.pi)
@example(1e3)
def test_sine_and_cosine_are_those_of_the_c_library(angle: float) -> None:
    assert sine_cosine(angle) == pytest.approx((math.sin(angle), math.cos(angle)), abs=EXACT, rel=0.0)


@given(st.floats(-math.pi, math.pi), st.floats(1e-6, 1e6))
def test_the_angle_of_a_point_is_its_angle_at_any_distance(angle: float, distance: float) -> None:
    y, x = distance * math.sin(angle), distance * math.cos(angle)
    assert angle_of(y, x) == pytest.approx(math.atan2(y, x), abs=EXACT, rel=0.0)


@pytest.mark.parametrize(
    ("y", "x", "angle"),
    [
        (0.0, 0.0, 0.0),
        (0.0, 2.0, 0.0),
        (0.0, -2.0, math.pi),
        (3.0, 0.0, math.pi / 2),
        (-3.0, 0.0, -math.pi / 2),
        (1.0, 1.0, math.pi / 4),
        (-1.0, -1.0, -3 * math.pi / 4),
    ],
)
def test_the_axes_and_the_diagonals_have_their_angles(y: float, x: float, angle: float) -> None:
    assert angle_of(y, x) == pytest.approx(angle, abs=EXACT, rel=0.0)


@given(st.floats(1e-9, 2 * math.pi))
@example(0.5)
def test_half_a_turn_is_what_the_exponential_needs(angle: float) -> None:
    expected = (math.sin(0.5 * angle) / angle, math.cos(0.5 * angle))
    assert half_turn(angle * angle) == pytest.approx(expected, abs=EXACT, rel=0.0)


def test_no_turn_has_a_half_too() -> None:
    assert half_turn(0.0) == (0.5, 1.0)


@given(st.floats(1e-9, math.pi - 1e-3))
@example(0.1)
def test_an_arc_is_its_angle_over_its_sine(angle: float) -> None:
    sine, cosine = math.sin(angle), math.cos(angle)
    assert arc(sine, cosine) * sine == pytest.approx(angle, abs=2 * EXACT, rel=0.0)
    assert arc(0.0, 1.0) == 1.0
