"""The comfortable stretch of an elbow's circle: held to the discomfort that the solver itself goes by."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from arm_ik_service.arm.chain import columns_of, hand_to_arm, position_to_arm
from arm_ik_service.arm.model import ArmModel
from arm_ik_service.geometry import batch
from arm_ik_service.ik.comfort import COMFORT, discomfort
from arm_ik_service.ik.comfortable import COMFORTABLE, SWIVELS, ElbowComfort
from arm_ik_service.ik.swivel import elbow_swivel, reach_to, side_at
from arm_ik_service.wire.messages import SIDES, Side

Floats = npt.NDArray[np.float64]
LENGTHS = (0.30, 0.26)


def arms(side: Side, count: int = 60) -> tuple[ArmModel, Floats]:
    """A model and configurations (N,10) that people use, their elbows well off the line of reach."""
    model = ArmModel.load(side, *LENGTHS)
    q = model.random_configurations(count, np.random.default_rng(5), share=0.6)
    q[:, 4] = np.clip(q[:, 4], 0.6, 2.2)
    return model, q


def stretches(model: ArmModel, q: Floats) -> Floats:
    found = model.forward(q)
    comfort = ElbowComfort(model.side, *LENGTHS, {})
    still = np.zeros(len(q))  # no time passes, no habit is learnt
    return comfort.stretches(still, np.zeros((len(q), 9)), found["elbow"][:, :3], found["hand"])


@pytest.mark.parametrize("side", SIDES)
def test_discomfort_is_least_within_the_stretch_and_larger_by_the_bound_at_its_ends(side: Side) -> None:
    model, configurations = arms(side)
    ends = stretches(model, configurations)
    found = model.forward(configurations)
    chain, comfort, habit = model.chains[0], np.array(list(COMFORT.values())), np.zeros(2)
    sign = 1.0 if side == "right" else -1.0
    for q, (lower, upper), hand in zip(configurations, ends, found["hand"], strict=True):
        position = position_to_arm(chain, tuple(hand[:3].tolist()))
        rotation = columns_of(hand_to_arm(chain, tuple(hand[3:].tolist())))
        reach = reach_to(chain, position)
        here = elbow_swivel(reach, columns_of(tuple(q[:4].tolist())))

        def cost(swivel: float) -> float:
            return discomfort(comfort, habit, chain, reach, rotation, side_at(reach, here + sign * swivel))[0]  # noqa: B023

        around = np.array([cost(swivel) for swivel in np.linspace(-np.pi, np.pi, 721)])
        least = around.min()
        inside = np.array([cost(swivel) for swivel in np.linspace(lower, upper, 60)])
        assert inside.min() < least + 0.005
        if upper - lower < 2.0 * np.pi * (1.0 - 1.0 / SWIVELS):
            assert inside.max() < least + 1.3 * COMFORTABLE
            assert cost(lower) == pytest.approx(least + COMFORTABLE, abs=0.3 * COMFORTABLE)
            assert cost(upper) == pytest.approx(least + COMFORTABLE, abs=0.3 * COMFORTABLE)


def test_a_left_arm_is_the_mirror_image_of_the_right_one() -> None:
    (left, q), (right, _) = arms("left"), arms("right")
    np.testing.assert_allclose(stretches(left, q), -stretches(right, q)[:, ::-1], atol=1e-9)


def test_where_the_wrist_is_usually_bent_the_comfortable_stretch_moves_along() -> None:
    model, q = arms("right", 1)
    found = model.forward(q)
    comfort = ElbowComfort("right", *LENGTHS, {})
    count = 900  # ten seconds
    angles = np.zeros((count, 9))
    angles[:, 6] = 0.6
    elbows, wrists = np.repeat(found["elbow"][:, :3], count, axis=0), np.repeat(found["hand"], count, axis=0)
    ends = comfort.stretches(np.full(count, 1 / 90), angles, elbows, wrists)
    np.testing.assert_allclose(comfort.habit, [0.6 * (1.0 - np.exp(-2.0)), 0.0], atol=0.01)
    assert np.abs(ends[-1] - ends[0]).max() > np.radians(2.0)


def test_the_elbow_that_the_swivels_count_from_is_the_one_that_is_given() -> None:
    """Turned about the line to the wrist the elbow finds the stretch nearer by as much."""
    model, q = arms("right", 20)
    found = model.forward(q)
    comfort, still, angles = ElbowComfort("right", *LENGTHS, {}), np.zeros(20), np.zeros((20, 9))
    before = comfort.stretches(still, angles, found["elbow"][:, :3], found["hand"])
    axis = batch.normalized(found["hand"][:, :3])
    turned = batch.rotate(batch.exp(0.05 * axis), found["elbow"][:, :3])
    after = comfort.stretches(still, angles, turned, found["hand"])
    middle = 0.5 * np.ptp(after, axis=1) < 2.5  # all around there is no nearer
    np.testing.assert_allclose(after[middle], before[middle] - 0.05, atol=0.05)
