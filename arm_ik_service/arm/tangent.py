"""Tangents of the arm as tuples, for compiled code: in the hot loop they stay in registers.

A tangent (9,) is an angular velocity of the humerus in its own axes, and the rates of three hinges at the elbow and of
three at the wrist. Imported as a module: `tangent.add(a, b)`.
"""

from __future__ import annotations

from typing import Any

from arm_ik_service.compiled import inlined
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Vector

Tangent = tuple[Vector, Vector, Vector]

STILL: Tangent = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@inlined
def read(a: Any) -> Tangent:
    """Read a tangent from an array (9,)."""
    return (a[0], a[1], a[2]), (a[3], a[4], a[5]), (a[6], a[7], a[8])


@inlined
def store(out: Any, t: Tangent) -> None:
    """Write a tangent into an array (9,)."""
    for i in range(3):
        out[i], out[3 + i], out[6 + i] = t[0][i], t[1][i], t[2][i]


@inlined
def add(a: Tangent, b: Tangent) -> Tangent:
    """a + b."""
    return g.add(a[0], b[0]), g.add(a[1], b[1]), g.add(a[2], b[2])


@inlined
def subtract(a: Tangent, b: Tangent) -> Tangent:
    """a - b."""
    return g.subtract(a[0], b[0]), g.subtract(a[1], b[1]), g.subtract(a[2], b[2])


@inlined
def scale(s: float, a: Tangent) -> Tangent:
    """s a."""
    return g.scale(s, a[0]), g.scale(s, a[1]), g.scale(s, a[2])


@inlined
def times(a: Tangent, b: Tangent) -> Tangent:
    """Entry by entry product: a diagonal matrix times a tangent."""
    return g.times(a[0], b[0]), g.times(a[1], b[1]), g.times(a[2], b[2])


@inlined
def over(a: Tangent, b: Tangent) -> Tangent:
    """Entry by entry quotient."""
    return g.over(a[0], b[0]), g.over(a[1], b[1]), g.over(a[2], b[2])


@inlined
def dot(a: Tangent, b: Tangent) -> float:
    """Inner product."""
    return g.dot(a[0], b[0]) + g.dot(a[1], b[1]) + g.dot(a[2], b[2])


@inlined
def largest(a: Tangent) -> float:
    """Largest magnitude of an entry."""
    return max(g.largest(a[0]), g.largest(a[1]), g.largest(a[2]))
