"""Configurations of the arm as tuples, for compiled code; see `tangent` for the steps between them.

A configuration (10,) is the shoulder's quaternion, three hinges at the elbow and three at the wrist.
"""

from __future__ import annotations

from typing import Any

from arm_ik_service.arm.limits import clamp_group, clamp_shoulder
from arm_ik_service.arm.tangent import Tangent
from arm_ik_service.compiled import Record, inlined
from arm_ik_service.geometry.scalar import (
    Quaternion,
    Vector,
    add,
    conjugate,
    exp,
    log,
    multiply,
    renormalized,
    subtract,
)

Configuration = tuple[Quaternion, Vector, Vector]


@inlined
def read_configuration(a: Any) -> Configuration:
    """Read a configuration from an array (10,)."""
    return (a[0], a[1], a[2], a[3]), (a[4], a[5], a[6]), (a[7], a[8], a[9])


@inlined
def store_configuration(out: Any, q: Configuration) -> None:
    """Write a configuration into an array (10,)."""
    for i in range(4):
        out[i] = q[0][i]
    for i in range(3):
        out[4 + i], out[7 + i] = q[1][i], q[2][i]


@inlined
def difference(before: Configuration, after: Configuration) -> Tangent:
    """Return the tangent that leads from one configuration to another."""
    turn = log(multiply(conjugate(before[0]), after[0]))
    return turn, subtract(after[1], before[1]), subtract(after[2], before[2])


@inlined
def clamped(chain: Record, q: Configuration) -> Configuration:
    """Return the configuration with every limit brought in."""
    return clamp_shoulder(chain, q[0]), clamp_group(chain, 0, q[1]), clamp_group(chain, 3, q[2])


@inlined
def integrate(chain: Record, q: Configuration, t: Tangent) -> Configuration:
    """Step along a tangent, and bring every limit back in."""
    shoulder = renormalized(multiply(q[0], exp(t[0])))
    return clamped(chain, (shoulder, add(q[1], t[1]), add(q[2], t[2])))
