"""Solvers by name: every option by its own name, every mistake with a cure."""

from __future__ import annotations

import numpy as np
import pytest

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.errors import SettingsError
from arm_ik_service.ik.cyclic_coordinate_descent import CyclicCoordinateDescent
from arm_ik_service.ik.damped_least_squares import DampedLeastSquares
from arm_ik_service.ik.registry import SOLVERS, make_solver, options_of, parse_solver
from arm_ik_service.ik.solver import Solver

ARM = ArmModel.load()


def build(text: str) -> Solver:
    choice = parse_solver(text)
    return make_solver(choice.name, ARM, **choice.options)


@pytest.mark.parametrize("name", SOLVERS)
def test_every_solver_is_built_by_name_and_solves(name: str) -> None:
    solution = make_solver(name, ARM).solve(ARM.forward(ARM.rest)["hand"], ARM.rest)
    assert solution.position_error_m < 5e-4
    np.testing.assert_allclose(solution.configuration, ARM.rest, atol=1e-9)


@pytest.mark.parametrize("name", SOLVERS)
def test_every_solver_takes_the_common_options(name: str) -> None:
    common = {"iterations", "position_tolerance_m", "orientation_tolerance_rad", "rotation_weight_m", "time_limit_us"}
    assert common <= set(options_of(name))


def test_options_are_read_from_text_as_what_they_are() -> None:
    damped = make_solver("damped_least_squares", ARM, iterations="7", damping="fixed", damping_m="0.25")
    assert isinstance(damped, DampedLeastSquares)
    assert (damped.iterations, damped.damping, damped.damping_m) == (7, "fixed", 0.25)
    cyclic = make_solver("cyclic_coordinate_descent", ARM, priority="shoulder+pronation", repeats=1)
    assert isinstance(cyclic, CyclicCoordinateDescent)
    assert cyclic.order[-2:] == ["shoulder", "pronation"]


def test_a_choice_reads_back_as_it_is_written() -> None:
    for text in ("pseudo_inverse", "pseudo_inverse:jacobian=finite_differences,gain=0.5"):
        assert parse_solver(text).label == text
        build(text)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("newton", "'newton' is unknown: one of jacobian_transpose"),
        ("pseudo_inverse:speed=1", "no option 'speed': it takes iterations"),
        ("pseudo_inverse:gain", "name=value"),
        ("pseudo_inverse:gain=much", "gain=much"),
        ("pseudo_inverse:gain=7", "gain = 7"),
        ("pseudo_inverse:jacobian=exact", "jacobian=exact"),
        ("damped_least_squares:iterations=0", "iterations = 0"),
        ("cyclic_coordinate_descent:priority=knee", "knee: the joints are shoulder"),
        ("jacobian_transpose:settings=x", "no option 'settings'"),
    ],
)
def test_a_mistake_names_what_is_wrong_and_what_is_known(text: str, what: str) -> None:
    with pytest.raises(SettingsError, match=what):
        build(text)
