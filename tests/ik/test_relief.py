"""The turn of the trunk that relieves an arm: the way on which limits come no nearer, for either side."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from arm_ik_service.arm.chain import columns_of, spin_from_arm, spin_to_arm
from arm_ik_service.arm.limits import swing_excess, twist_of, twist_range
from arm_ik_service.arm.model import ArmModel
from arm_ik_service.geometry import batch
from arm_ik_service.geometry.scalar import Quaternion
from arm_ik_service.ik.relief import NEAR_RAD, relief
from arm_ik_service.ik.state import new_arm

Array = npt.NDArray[np.float64]
SIDES = [ArmModel.load(side="left"), ArmModel.load(side="right")]
STEP = 1e-5


def relief_of(model: ArmModel, shoulder: Array) -> Array:
    """Rotation vector (3,) for an arm whose shoulder has the rotation (4,)."""
    arm = new_arm(model)
    arm["configuration"][0] = [*shoulder, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0]
    return np.array(relief(arm[0]))


def strain(chain: Any, shoulder: Array) -> float:
    """Half the sum of the squared angles [rad] by which limits have come nearer than NEAR_RAD."""
    x, y, z, w = (float(v) for v in shoulder)
    q: Quaternion = (x, y, z, w)
    bone = columns_of(q)
    swing = max(swing_excess(chain, (-bone[1][0], -bone[1][1], -bone[1][2])) + NEAR_RAD, 0.0)
    lower, upper = twist_range(chain, -bone[1][1])
    twist = max(lower + NEAR_RAD - twist_of(bone), 0.0, twist_of(bone) - upper + NEAR_RAD)
    return 0.5 * (swing * swing + twist * twist)


def shoulders(seed: int, count: int = 200) -> Array:
    """Rotations (count, 4) all over the region, with the humerus below 40 degrees above the horizon."""
    rng = np.random.default_rng(seed)
    found = batch.exp(rng.uniform(-2.0, 2.0, (20 * count, 3)))
    return found[batch.rotate(found, [0.0, -1.0, 0.0])[:, 1] < 0.64][:count]


@pytest.mark.parametrize("model", SIDES, ids=["left", "right"])
def test_it_is_the_steepest_descent_of_the_strain_by_finite_differences(model: ArmModel) -> None:
    chain: Any = model.chains[0]
    strained = 0
    for shoulder in shoulders(1):
        slopes = []
        for axis in np.eye(3):
            turn = np.array(spin_to_arm(chain, tuple(axis)))  # a trunk that turns leaves the arm behind
            ahead, back = (strain(chain, batch.multiply(batch.exp(-s * turn), shoulder)) for s in (STEP, -STEP))
            slopes.append((ahead - back) / (2.0 * STEP))
        np.testing.assert_allclose(relief_of(model, shoulder), -np.array(slopes), atol=2e-4)
        strained += any(slopes)
    assert 50 < strained < 200


def test_left_is_the_mirror_of_right() -> None:
    for shoulder in shoulders(2, 50):
        left, right = (relief_of(model, shoulder) for model in SIDES)
        np.testing.assert_allclose(left, right * [1.0, -1.0, -1.0], atol=1e-12)


def test_an_arm_at_rest_asks_for_nothing() -> None:
    for model in SIDES:
        assert not relief_of(model, model.rest[:4]).any()


@pytest.mark.parametrize("model", SIDES, ids=["left", "right"])
def test_a_spin_comes_back_from_the_arms_axes_as_it_went(model: ArmModel) -> None:
    spin = (0.3, -1.2, 0.7)
    chain: Any = model.chains[0]
    np.testing.assert_allclose(spin_from_arm(chain, spin_to_arm(chain, spin)), spin, atol=1e-15)
