"""Solvers by name, with options as text: what `--solver NAME[:option=value,...]` means everywhere.

>>> make_solver("damped_least_squares", arm, damping="fixed", damping_m="0.02")
"""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import Any, NamedTuple, cast, get_type_hints

import msgspec

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.errors import SettingsError
from arm_ik_service.ik.cyclic_coordinate_descent import CyclicCoordinateDescent
from arm_ik_service.ik.damped_least_squares import DampedLeastSquares
from arm_ik_service.ik.jacobian_transpose import JacobianTranspose
from arm_ik_service.ik.jacobian_transpose_plain import JacobianTransposePlain
from arm_ik_service.ik.pseudo_inverse import PseudoInverse
from arm_ik_service.ik.solver import Solver

SOLVERS: dict[str, type[Solver]] = {
    "jacobian_transpose": JacobianTranspose,
    "jacobian_transpose_plain": JacobianTransposePlain,
    "pseudo_inverse": PseudoInverse,
    "damped_least_squares": DampedLeastSquares,
    "cyclic_coordinate_descent": CyclicCoordinateDescent,
}
DEFAULT = "jacobian_transpose"

_NOT_TEXT = {"self", "arm", "settings"}  # parameters that are not options of a command line


class SolverChoice(NamedTuple):
    """A solver as it was asked for."""

    name: str
    options: dict[str, str]

    @property
    def label(self) -> str:
        """The choice as it is written: what `parse_solver` reads."""
        options = ",".join(f"{option}={value}" for option, value in self.options.items())
        return f"{self.name}:{options}" if options else self.name


def parse_solver(text: str) -> SolverChoice:
    """Read `name` or `name:option=value,option=value`. Raises SettingsError for text that is neither."""
    name, _, rest = text.partition(":")
    options = {}
    for pair in filter(None, rest.split(",")):
        option, equals, value = pair.partition("=")
        if not equals:
            raise SettingsError(f"solver {text!r}: options are written name=value, found {pair!r}")
        options[option.strip()] = value.strip()
    return SolverChoice(name.strip(), options)


def options_of(name: str) -> dict[str, inspect.Parameter]:
    """Return what a solver's constructor takes besides the arm. Raises SettingsError for an unknown name."""
    if name not in SOLVERS:
        raise SettingsError(f"solver {name!r} is unknown: one of {', '.join(SOLVERS)}")
    parameters = inspect.signature(SOLVERS[name].__init__).parameters
    return {option: parameter for option, parameter in parameters.items() if option not in _NOT_TEXT}


def make_solver(name: str, arm: ArmModel, **options: Any) -> Solver:
    """Build a solver by name. Values may be text; lists are written `a+b`.

    Raises SettingsError for an unknown name or option and for a value that the solver refuses.
    """
    known = options_of(name)
    kind = SOLVERS[name]
    hints = get_type_hints(kind.__init__)
    values: dict[str, Any] = {}
    for option, value in options.items():
        if option not in known:
            raise SettingsError(f"solver {name} has no option {option!r}: it takes {', '.join(known)}")
        values[option] = _value(name, option, value, hints[option]) if isinstance(value, str) else value
    build = cast(Any, kind)
    try:
        return cast(Solver, build(arm, **values))
    except ValueError as error:
        raise SettingsError(f"solver {name}: {error}") from error


def _value(solver: str, option: str, text: str, hint: Any) -> Any:
    """Read an option's text as the type that the constructor wants."""
    try:
        if hint == Sequence[str]:
            return tuple(filter(None, text.split("+")))
        return msgspec.convert(text, hint, strict=False)
    except msgspec.ValidationError as error:
        raise SettingsError(f"solver {solver}: {option}={text}: {error}") from error
