"""The solids: closed, outside out, of the size that was asked for, and left the mirror image of right."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from arm_ik_service.geometry import batch
from arm_ik_service.io.rerun_view import figure
from arm_ik_service.io.rerun_view.entities import between_y
from arm_ik_service.io.rerun_view.solids import Solid
from arm_ik_service.wire.messages import SIDES, Side

PARTS: dict[str, Solid] = {
    "torso": figure.torso(0.36),
    "neck": figure.neck(),
    "head": figure.head(),
    "girdle": figure.shoulder_girdle(),
    "controller": figure.controller(),
    **{f"{side} upper arm": figure.upper_arm(side, 0.30) for side in SIDES},
    **{f"{side} forearm": figure.forearm(side, 0.26) for side in SIDES},
    **{f"{side} hand": figure.hand(side, 0.19) for side in SIDES},
}


def volume(solid: Solid) -> float:
    a, b, c = (solid.vertices[solid.triangles[:, k]] for k in range(3))
    return float(np.sum(np.cross(a, b) * c)) / 6.0


@pytest.mark.parametrize("solid", PARTS.values(), ids=PARTS.keys())
def test_every_part_has_its_outside_outside(solid: Solid) -> None:
    assert volume(solid) > 0.0
    a, b, c = (solid.vertices[solid.triangles[:, k]] for k in range(3))
    faces = np.cross(b - a, c - a)
    mean = solid.normals[solid.triangles].mean(axis=1)
    wide = np.linalg.norm(faces, axis=1) > 1e-9
    assert np.mean(np.sum(faces * mean, axis=1)[wide] > 0.0) > 0.99


@pytest.mark.parametrize("solid", PARTS.values(), ids=PARTS.keys())
def test_every_part_is_finite_with_unit_normals_and_a_colour_a_vertex(solid: Solid) -> None:
    assert np.isfinite(solid.vertices).all()
    np.testing.assert_allclose(np.linalg.norm(solid.normals, axis=1), 1.0, atol=1e-6)
    assert solid.colours.shape == solid.vertices.shape == solid.normals.shape
    assert solid.triangles.max() < len(solid.vertices)


@pytest.mark.parametrize(("part", "axis"), [("upper arm", 2), ("forearm", 2), ("hand", 0)])
def test_left_is_the_mirror_image_of_right(part: str, axis: int) -> None:
    left, right = PARTS[f"left {part}"], PARTS[f"right {part}"]
    flip = np.ones(3)
    flip[axis] = -1.0
    np.testing.assert_array_equal(left.vertices * flip, right.vertices)
    assert volume(left) == pytest.approx(volume(right))


@pytest.mark.parametrize(("side", "thumb"), [("right", -1.0), ("left", 1.0)])
def test_the_thumb_is_on_the_inner_side_and_the_fist_on_the_palms(side: Side, thumb: float) -> None:
    hand = figure.hand(side, figure.HAND_M)
    reach = thumb * hand.vertices[:, 0]
    assert reach.max() > 1.5 * -reach.min()
    assert hand.vertices[:, 1].min() < -2.0 * hand.vertices[:, 1].max()
    assert hand.vertices[:, 2].min() < -0.1


@given(st.floats(0.1, 0.5))
def test_a_bone_reaches_from_its_joint_to_the_next(length_m: float) -> None:
    for solid in (figure.upper_arm("right", length_m), figure.forearm("right", length_m)):
        assert solid.vertices[:, 1].max() > 0.0
        assert solid.vertices[:, 1].min() == pytest.approx(-length_m, abs=0.05)


@example((3e-5, -1.0, 0.0))  # straight down but for a little
@given(st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3))
def test_a_spanning_solid_points_along_its_direction(direction: tuple[float, float, float]) -> None:
    axis = np.array([direction, (0.0, -1.0, 0.0)])
    np.testing.assert_allclose(batch.rotate(between_y(axis), (0.0, 1.0, 0.0)), batch.normalized(axis), atol=1e-6)
