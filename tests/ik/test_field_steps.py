"""What sets each method of the field apart: properties of its own step."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.ik.cyclic_coordinate_descent import JOINTS, CyclicCoordinateDescent, nearest_within
from arm_ik_service.ik.damped_least_squares import DampedLeastSquares
from arm_ik_service.ik.jacobian_transpose_plain import JacobianTransposePlain
from arm_ik_service.ik.pseudo_inverse import PseudoInverse
from arm_ik_service.ik.solver import Status

Array = npt.NDArray[np.float64]
ARM = ArmModel.load()


def linearised(seed: int) -> tuple[Array, Array]:
    """A Jacobian of the arm and a residual."""
    rng = np.random.default_rng(seed)
    return PseudoInverse(ARM).jacobian(ARM.random_configurations(1, rng)[0]), rng.normal(0.0, 0.05, 6)


seeds = st.integers(0, 10_000)


@given(seeds)
def test_busss_step_is_the_best_length_along_the_gradient(seed: int) -> None:
    jacobian, residual = linearised(seed)
    step = JacobianTransposePlain(ARM).step(jacobian, residual)
    left = np.linalg.norm(residual - jacobian @ step)
    for factor in (0.9, 1.1):
        assert left <= np.linalg.norm(residual - factor * (jacobian @ step)) + 1e-15
    np.testing.assert_allclose(np.cross(step[:3], (jacobian.T @ residual)[:3]), 0.0, atol=1e-12)


@given(seeds)
def test_the_fixed_gain_lowers_the_linearised_residual_of_an_adult_arm(seed: int) -> None:
    jacobian, residual = linearised(seed)
    step = JacobianTransposePlain(ARM, rule="fixed").step(jacobian, residual)
    assert np.linalg.norm(residual - jacobian @ step) < np.linalg.norm(residual)


@given(seeds)
def test_the_pseudo_inverse_removes_the_whole_linearised_residual_with_the_smallest_step(seed: int) -> None:
    jacobian, residual = linearised(seed)
    step = PseudoInverse(ARM).step(jacobian, residual)
    np.testing.assert_allclose(jacobian @ step, residual, atol=1e-9)
    null_space = np.linalg.svd(jacobian)[2][6:]
    np.testing.assert_allclose(null_space @ step, 0.0, atol=1e-6)


def test_finite_differences_measure_the_analytic_jacobian() -> None:
    solver = PseudoInverse(ARM, jacobian="finite_differences", difference_rad=1e-5)
    for q in ARM.random_configurations(10, np.random.default_rng(0)):
        target = solver._in_model(ARM.forward(q)["hand"])
        measured = solver.jacobian_at(q, target, solver.residual(q, target))
        np.testing.assert_allclose(measured, solver.jacobian(q), atol=1e-5)


@given(seeds, st.floats(0.001, 0.2))
def test_damping_shortens_the_step_and_never_turns_it_uphill(seed: int, damping_m: float) -> None:
    jacobian, residual = linearised(seed)
    whole = PseudoInverse(ARM).step(jacobian, residual)
    fixed = DampedLeastSquares(ARM, damping="fixed", damping_m=damping_m).step(jacobian, residual)
    scaled = DampedLeastSquares(ARM, damping="error_scaled", damping_m=damping_m).step(jacobian, residual)
    assert np.linalg.norm(scaled) <= np.linalg.norm(fixed) <= np.linalg.norm(whole) * (1.0 + 1e-9)
    for step in (fixed, scaled):
        assert residual @ jacobian @ step >= 0.0
        # |J^T (J J^T + mu)^-1| is at most 1 / (2 sqrt(mu)) however singular J is
        assert np.linalg.norm(step) <= np.linalg.norm(residual) / (2.0 * damping_m) * (1.0 + 1e-9)


def test_at_an_exact_singularity_the_pseudo_inverse_leaps_and_damping_does_not() -> None:
    almost_straight = ARM.rest.copy()
    almost_straight[4] = math.radians(0.05)
    jacobian = PseudoInverse(ARM).jacobian(almost_straight)
    pull = np.array([0.0, 0.01, 0.0, 0.0, 0.0, 0.0])  # a centimetre along the hanging arm, towards the shoulder
    assert np.abs(PseudoInverse(ARM).step(jacobian, pull)).max() > 10.0
    assert np.abs(DampedLeastSquares(ARM, damping_m=0.05).step(jacobian, pull)).max() < 0.2


@given(st.floats(-10.0, 10.0), st.floats(-math.pi, math.pi), st.floats(0.0, math.pi), st.floats(0.0, 1.0))
def test_the_nearest_angle_in_a_range_is_the_cheapest_there(
    angle: float, lower: float, width: float, at: float
) -> None:
    upper = lower + width
    found = nearest_within(angle, lower, upper)
    assert lower <= found <= upper
    assert math.cos(angle - found) >= math.cos(angle - (lower + at * width)) - 1e-9


@given(seeds)
def test_a_sweep_never_raises_the_cost(seed: int) -> None:
    rng = np.random.default_rng(seed)
    solver = CyclicCoordinateDescent(ARM)
    q, goal = ARM.random_configurations(2, rng)
    target = solver._in_model(ARM.forward(goal)["hand"])
    for _ in range(3):
        ahead = solver.improve(q, target, solver.residual(q, target))
        assert solver._cost(ahead, target) <= solver._cost(q, target) + 1e-12
        q = ahead


@pytest.mark.parametrize("joint", range(7))
def test_one_sweep_is_enough_where_one_joint_alone_is_wrong_and_comes_first(joint: int) -> None:
    start = ARM.random_configurations(1, np.random.default_rng(8), 0.5)[0]
    move = np.zeros(9)
    if joint == 0:
        move[:3] = (0.2, -0.1, 0.15)
    else:
        middle = 0.5 * (ARM.lower + ARM.upper)[joint - 1]
        move[2 + joint] = 0.8 * (middle - start[3 + joint]) + 0.02
    goal = pin.integrate(ARM.pinocchio, start, move)
    solver = CyclicCoordinateDescent(ARM, priority=())
    solver.order = [JOINTS[joint]]
    solution = solver.solve(ARM.forward(goal)["hand"], start)
    assert solution.status == Status.SOLVED
    assert solution.iterations == 1
    np.testing.assert_allclose(solution.configuration, goal, atol=1e-9)


def test_joints_with_priority_are_swept_more_often() -> None:
    solver = CyclicCoordinateDescent(ARM, priority=("shoulder", "pronation"), repeats=2)
    counts = {name: solver.order.count(name) for name in JOINTS}
    assert counts.pop("shoulder") == counts.pop("pronation") == 3
    assert set(counts.values()) == {1}


def test_priority_saves_sweeps() -> None:
    targets = ARM.forward(ARM.random_configurations(30, np.random.default_rng(9), 0.8))["hand"]
    swept = [
        sum(CyclicCoordinateDescent(ARM, priority=priority).solve(target).iterations for target in targets)
        for priority in ((), ("elbow_flexion", "shoulder"))
    ]
    assert swept[1] < swept[0]


def test_a_joint_that_does_not_exist_has_no_priority() -> None:
    with pytest.raises(ValueError, match="knee"):
        CyclicCoordinateDescent(ARM, priority=("knee",))
