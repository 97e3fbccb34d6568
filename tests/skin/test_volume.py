"""What bending and twisting leave of an arm's cross-sections, with both skinnings and with and without spread twist."""

from __future__ import annotations

import numpy as np
import pytest
from arm_poses import MEASURES, configuration, poses
from cross_sections import section_area

from arm_ik_service.geometry import batch
from arm_ik_service.skin.blend import Skinning
from arm_ik_service.skin.load import load_built_in_arms
from arm_ik_service.skin.puppet import Puppet
from arm_ik_service.skin.twist import SEGMENTS

PLACES = (-0.02, 0.0, 0.02, 0.04, 0.08, 0.15, 0.3, 0.5, 0.7, 0.85, 0.95, 1.0, 1.04)  # elbow 0, wrist 1


def areas_left(how: Skinning, segments: int = SEGMENTS, **angles: float) -> dict[float, float]:
    """Share of its area at rest that each section of the right forearm has in a posture of these angles [deg]."""
    puppet = Puppet(load_built_in_arms(), MEASURES, how, segments=segments)
    vertices, _ = puppet.skin(puppet.motions(poses(configuration(**angles)))[0])
    mesh, arm = puppet.mesh, puppet.arms["right"]
    axis = batch.normalized(arm.wrist - arm.elbow)
    left = {}
    for place in PLACES:
        point = arm.elbow + place * (arm.wrist - arm.elbow)
        now, rest = (section_area(mesh, v, point, axis, mesh.vertices[:, 0] > 0.0) for v in (vertices, mesh.vertices))
        left[place] = now / rest
    return left


@pytest.mark.parametrize("pronation", [5.0, 165.0])
def test_dual_quaternions_keep_elbow_and_wrist_where_linear_blending_halves_them(pronation: float) -> None:
    """Bent by 120 degrees, pronated 80 degrees to either side of rest, the wrist flexed by 60."""
    dual = areas_left("dual_quaternion", elbow=120.0, pronation=pronation, wrist=60.0)
    linear = areas_left("linear", elbow=120.0, pronation=pronation, wrist=60.0)
    assert min(dual.values()) > 0.97
    assert linear[0.0] < 0.55
    assert linear[1.0] < 0.9
    assert all(dual[place] >= linear[place] - 0.002 for place in PLACES)


def test_twist_that_is_spread_costs_linear_blending_next_to_nothing() -> None:
    spread = areas_left("linear", elbow=0.0, pronation=165.0)
    wrung = areas_left("linear", segments=1, elbow=0.0, pronation=165.0)
    assert min(spread.values()) > 0.96
    assert min(wrung.values()) < 0.65


def test_the_area_of_a_section_is_that_of_its_outline() -> None:
    """The measure itself: a section of the forearm at rest is nearly the ellipse that it was made from."""
    puppet = Puppet(load_built_in_arms(), MEASURES)
    mesh, arm = puppet.mesh, puppet.arms["right"]
    axis = batch.normalized(arm.wrist - arm.elbow)
    point = arm.elbow + 0.45 * (arm.wrist - arm.elbow)
    scale = (MEASURES.upper_arm + MEASURES.forearm) / (0.332 * 1.75)
    area = section_area(mesh, mesh.vertices, point, axis, mesh.vertices[:, 0] > 0.0)
    assert area == pytest.approx(np.pi * 0.038 * 0.041 * scale**2, rel=0.04)
