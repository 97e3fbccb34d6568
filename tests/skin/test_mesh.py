"""Weights as every mesh holds them, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from arm_ik_service.errors import SkinError
from arm_ik_service.skin.mesh import pack_weights


@given(st.integers(0, 10_000), st.integers(1, 6))
def test_packing_keeps_every_bone_s_share(seed: int, influences: int) -> None:
    rng = np.random.default_rng(seed)
    bones = rng.integers(0, 5, (12, influences))
    weights = rng.uniform(0.0, 2.0, (12, influences)) * (rng.uniform(size=(12, influences)) > 0.3)
    weights[:, 0] += 0.1
    packed_bones, packed = pack_weights(bones, weights, 5)
    for before_b, before_w, after_b, after_w in zip(bones, weights, packed_bones, packed, strict=True):
        shares = np.bincount(before_b, before_w / before_w.sum(), 5)
        np.testing.assert_allclose(np.bincount(after_b, after_w, 5), shares, atol=1e-12)
        used = after_b[after_w > 0.0]
        assert len(set(used)) == len(used)
    assert (np.diff(packed, axis=1) <= 0.0).all()


@pytest.mark.parametrize(
    ("bones", "weights", "said"),
    [
        ([[0], [1]], [[1.0], [float("nan")]], "vertex 1 has a weight that is not a number"),
        ([[0], [1]], [[-0.5], [1.0]], "vertex 0 has a negative weight"),
        ([[0, 0], [1, 0]], [[0.0, 0.0], [1.0, 0.0]], r"vertex 0 has no weight.*\(1 of 2 vertices\)"),
        ([[0], [7]], [[1.0], [1.0]], r"vertex 1 has a bone outside 0\.\.2"),
    ],
)
def test_broken_weights_are_refused_with_the_first_vertex(
    bones: list[list[int]], weights: list[list[float]], said: str
) -> None:
    with pytest.raises(SkinError, match=said):
        pack_weights(bones, weights, 3)


def test_a_bone_that_carries_nothing_may_be_any() -> None:
    bones, weights = pack_weights([[2, 999]], [[0.5, 0.0]], 3)
    assert bones.tolist() == [[2]]
    assert weights.tolist() == [[1.0]]
