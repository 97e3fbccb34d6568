"""The compiled loop: the same iterates as with Pinocchio, a gradient that is the gradient, limits and budgets kept."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from arm_ik_service.arm import tangent
from arm_ik_service.arm.chain import columns_of, hand_to_arm, position_to_arm
from arm_ik_service.arm.configuration import read_configuration
from arm_ik_service.arm.model import ArmModel
from arm_ik_service.geometry import batch
from arm_ik_service.geometry.scalar import scale, subtract
from arm_ik_service.ik.conjugate import WORK, converge, rotation_error
from arm_ik_service.ik.jacobian import jacobian_at, transposed_times
from arm_ik_service.ik.jacobian_transpose import JacobianTranspose
from arm_ik_service.ik.reference import PinocchioReference
from arm_ik_service.ik.solver import Status
from arm_ik_service.ik.velocity import ITERATIONS, velocity_from_twist

Array = npt.NDArray[np.float64]
ARMS = {side: ArmModel.load(side) for side in ("left", "right")}
RIGHT = ARMS["right"]
LAM = 0.14**2


def loop(arm: ArmModel, start: Array, target: Array, budget: int) -> tuple[Array, int, Any]:
    """Run the compiled loop; return configuration, status and its work record."""
    q, works, chain = start.copy(), np.zeros(1, WORK), arm.chains[0]
    position = position_to_arm(chain, (target[0], target[1], target[2]))
    rotation = columns_of(hand_to_arm(chain, (target[3], target[4], target[5], target[6])))
    status = converge(chain, works[0], q, position, rotation, budget, LAM, 5e-4, 5e-3, 0)
    return q, status, works[0]


def apart(a: Array, b: Array) -> float:
    """Largest difference of two configurations, whichever sign their quaternions have."""
    sign = np.sign(a[:4] @ b[:4])
    return float(np.abs(np.concatenate([a[:4] - sign * b[:4], a[4:] - b[4:]])).max())


def check_against_reference(cases: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    for arm in ARMS.values():
        targets = arm.forward(arm.random_configurations(cases // 2, rng))["hand"]
        starts = arm.random_configurations(cases // 2, rng)
        reference = PinocchioReference(arm)
        for target, start in zip(targets, starts, strict=True):
            reference.iterations = int(rng.integers(1, 33))  # any prefix: every iterate is compared over the cases
            wanted = reference.solve(target, start)
            q, status, work = loop(arm, start, target, reference.iterations)
            assert apart(q, wanted.configuration) < 1e-9
            assert (status, work["iterations"]) == (wanted.status, wanted.iterations)
            assert work["position_error_m"] == pytest.approx(wanted.position_error_m, abs=1e-9)


def test_the_compiled_loop_and_pinocchio_make_the_same_iterates() -> None:
    check_against_reference(200, 0)


@pytest.mark.slow
def test_the_compiled_loop_and_pinocchio_make_the_same_iterates_ten_thousand_times() -> None:
    check_against_reference(10_000, 1)


UNIT = st.floats(0.0, 1.0)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), corner=st.lists(st.sampled_from([0.0, 0.5, 1.0]), min_size=6, max_size=6))
def test_the_compiled_loop_and_pinocchio_agree_from_the_corners_of_the_ranges_too(
    seed: int, corner: list[float]
) -> None:
    target, start = RIGHT.random_configurations(2, np.random.default_rng(seed))
    start[4:] = RIGHT.lower + np.array(corner) * (RIGHT.upper - RIGHT.lower)
    hand = RIGHT.forward(target)["hand"]
    wanted = PinocchioReference(RIGHT, 6).solve(hand, start)
    assert apart(loop(RIGHT, start, hand, 6)[0], wanted.configuration) < 1e-9


def gradient_at(start: Array, hand: Array) -> Array:
    """J^T e by the compiled products, (9,)."""
    chain = RIGHT.chains[0]
    here = jacobian_at(chain, read_configuration(start))
    position = position_to_arm(chain, (hand[0], hand[1], hand[2]))
    rotation = columns_of(hand_to_arm(chain, (hand[3], hand[4], hand[5], hand[6])))
    turn = scale(LAM, rotation_error(here.hand, rotation))
    return np.array(transposed_times(here, (subtract(position, here.from_shoulder), turn))).ravel()


def test_the_gradient_is_the_finite_difference_of_half_the_squared_error() -> None:
    rng = np.random.default_rng(2)
    # inside all limits, so that nothing is held and clamping does not touch the differences
    starts, ends = RIGHT.random_configurations(30, rng, 0.8), RIGHT.random_configurations(30, rng, 0.8)
    model, step = RIGHT.pinocchio, 1e-6

    def half_squared_error(q: Array, hand: Array) -> float:
        at = RIGHT.forward(q)["hand"]
        turn = batch.log(batch.multiply(hand[3:], batch.conjugate(at[3:])))
        return 0.5 * float(np.sum((hand[:3] - at[:3]) ** 2) + LAM * np.sum(turn**2))

    for start, end in zip(starts, ends, strict=True):
        hand = RIGHT.forward(end)["hand"]
        gradient = gradient_at(start, hand)
        for i, axis in enumerate(np.eye(9)):
            ahead, behind = (half_squared_error(pin.integrate(model, start, s * step * axis), hand) for s in (1, -1))
            assert gradient[i] == pytest.approx(-(ahead - behind) / (2 * step), abs=1e-7)


def test_rotation_error_is_the_logarithm_up_to_half_a_turn() -> None:
    rng = np.random.default_rng(3)
    for angle in (0.0, 1e-10, 1e-6, 0.1, 1.0, 2.5, 2.9, 3.1, 3.14):
        axis = batch.normalized(rng.normal(size=3))
        a = batch.normalized(rng.normal(size=4))
        b = batch.multiply(batch.exp(angle * axis), a)
        found = rotation_error(columns_of(tuple(a)), columns_of(tuple(b)))
        np.testing.assert_allclose(found, angle * axis, atol=1e-7)


def test_more_budget_never_makes_the_error_larger() -> None:
    rng = np.random.default_rng(4)
    for _ in range(20):
        start, end = RIGHT.random_configurations(2, rng)
        hand = RIGHT.forward(end)["hand"]
        sizes = []
        for budget in range(30):
            work = loop(RIGHT, start, hand, budget)[2]
            sizes.append(work["position_error_m"] ** 2 + LAM * work["orientation_error_rad"] ** 2)
        assert (np.diff(sizes) <= 1e-15).all()


def test_every_iterate_keeps_every_limit() -> None:
    rng = np.random.default_rng(5)
    for _ in range(100):
        start, end = RIGHT.random_configurations(2, rng)
        for budget in (1, 2, 5, 30):
            q = loop(RIGHT, start, RIGHT.forward(end)["hand"], budget)[0]
            assert np.abs(RIGHT.excess(q)).max() < 1e-9
            assert np.linalg.norm(q[:4]) == pytest.approx(1.0, abs=1e-12)


def test_a_target_already_met_takes_no_iteration() -> None:
    q, status, work = loop(RIGHT, RIGHT.rest, RIGHT.forward(RIGHT.rest)["hand"], 32)
    assert (status, work["iterations"]) == (Status.SOLVED, 0)
    np.testing.assert_array_equal(q, RIGHT.rest)


def test_a_time_limit_ends_the_solve_with_the_best_so_far() -> None:
    end = RIGHT.random_configurations(1, np.random.default_rng(6))[0]
    hand = RIGHT.forward(end)["hand"]
    hurried = JacobianTranspose(RIGHT, iterations=10_000, time_limit_us=1e-3).solve(hand)
    assert hurried.status == Status.OUT_OF_TIME
    assert hurried.iterations <= 1
    patient = JacobianTranspose(RIGHT, iterations=128, time_limit_us=1e6).solve(hand)
    assert patient.status == Status.SOLVED


def test_velocity_gives_the_hand_its_twist_and_is_the_jacobians() -> None:
    rng, data, chain = np.random.default_rng(7), RIGHT.pinocchio.createData(), RIGHT.chains[0]
    for q in RIGHT.random_configurations(100, rng, 0.7):
        if q[4] < 0.3:
            continue  # nearly straight: damped
        twist = rng.normal(size=6)
        recent = tangent.read(rng.normal(size=9))
        linear, angular = (position_to_arm(chain, tuple(part)) for part in (twist[:3], twist[3:]))
        v, held = velocity_from_twist(chain, read_configuration(q), recent, linear, angular, LAM, ITERATIONS)
        assert held == 0
        jacobian = pin.computeFrameJacobian(
            RIGHT.pinocchio, data, q, RIGHT.hand_frame_id, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        np.testing.assert_allclose(jacobian @ np.ravel(v), twist, atol=0.02)
