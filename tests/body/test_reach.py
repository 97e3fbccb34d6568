"""The soft reach clamp: exact within reach, smooth at its edge, never out of reach."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from arm_ik_service.body.reach import FULLY_STRETCHED, soft_reach

edges = st.floats(0.6, 0.998)


@given(st.floats(0.0, 1.0), edges)
def test_within_reach_nothing_is_changed(part: float, edge: float) -> None:
    assert soft_reach(part * edge, edge) == part * edge


@given(st.floats(0.0, 1e6), edges)
def test_no_more_is_granted_than_asked_for_nor_than_there_is(ratio: float, edge: float) -> None:
    assert soft_reach(ratio, edge) <= min(ratio, FULLY_STRETCHED)


@given(st.floats(0.5, 1.3), st.floats(1e-4, 0.2), edges)
def test_reaching_farther_never_takes_the_hand_back(ratio: float, more: float, edge: float) -> None:
    assert soft_reach(ratio + more, edge) >= soft_reach(ratio, edge)


@given(st.floats(-1.0, 8.0), edges)
def test_around_full_reach_the_hand_never_freezes(beyond: float, edge: float) -> None:
    room = FULLY_STRETCHED - edge
    ratio = edge + beyond * room
    assert soft_reach(ratio + 0.01 * room, edge) > soft_reach(ratio, edge)


@given(edges)
def test_the_clamp_sets_in_without_a_kink(edge: float) -> None:
    h = 1e-6
    before = (soft_reach(edge, edge) - soft_reach(edge - h, edge)) / h
    after = (soft_reach(edge + h, edge) - soft_reach(edge, edge)) / h
    assert before == pytest.approx(1.0, abs=1e-6)
    assert after == pytest.approx(1.0, abs=h / (FULLY_STRETCHED - edge))


def test_an_edge_of_one_is_a_hard_clamp() -> None:
    assert soft_reach(0.99, 1.0) == 0.99
    assert soft_reach(1.5, 1.0) == FULLY_STRETCHED
