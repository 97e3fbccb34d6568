"""The hand's Jacobian, never written out: its products with a tangent and, transposed, with a wrench.

Joints come in three groups that share a point: the shoulder at the origin, the elbow's hinges, the wrist's hinges. The
column of a joint with axis a is (a x r, a), r the way from its point to the wrist. Right arm, ISB axes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from arm_ik_service.arm.chain import Columns, columns_of, turn_group
from arm_ik_service.arm.configuration import Configuration
from arm_ik_service.arm.tangent import Tangent
from arm_ik_service.compiled import Record, inlined
from arm_ik_service.geometry.scalar import Vector, add, combine, components, cross, dot, scale, subtract

# The carrying angle and the axial play of the wrist are soft tissue giving way: they move a tenth as readily.
MOBILITY: Tangent = ((1.0, 1.0, 1.0), (1.0, 0.1, 1.0), (1.0, 1.0, 0.1))

Wrench = tuple[Vector, Vector]  # force and moment at the wrist, in whatever unit the error is weighted to

NO_WRENCH: Wrench = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class Jacobian(NamedTuple):
    """The axes of the joints at one configuration and their ways to the wrist, and the hand they lead to."""

    shoulder: Columns
    elbow: Columns
    wrist: Columns
    from_shoulder: Vector  # to the wrist [m]: the wrist's position
    from_elbow: Vector
    hand: Columns


@inlined
def jacobian_at(chain: Record, q: Configuration) -> Jacobian:
    """Return the Jacobian at a configuration."""
    bone = columns_of(q[0])
    x1, y1, lower = turn_group(bone, q[1][0], q[1][1], q[1][2])
    x2, y2, hand = turn_group(lower, q[2][0], q[2][1], q[2][2])
    from_elbow = scale(-chain.forearm_m, lower[1])
    from_shoulder = subtract(from_elbow, scale(chain.upper_arm_m, bone[1]))
    return Jacobian(bone, (bone[2], x1, y1), (lower[2], x2, y2), from_shoulder, from_elbow, hand)


@inlined
def transposed_times(j: Jacobian, wrench: Wrench) -> Tangent:
    """J^T w: what a wrench at the wrist does to every joint."""
    force, moment = wrench
    at_shoulder = add(cross(j.from_shoulder, force), moment)
    at_elbow = add(cross(j.from_elbow, force), moment)
    return components(j.shoulder, at_shoulder), components(j.elbow, at_elbow), components(j.wrist, moment)


@inlined
def times(j: Jacobian, t: Tangent) -> tuple[Vector, Vector]:
    """J t: linear and angular velocity of the hand."""
    shoulder, elbow, wrist = combine(t[0], j.shoulder), combine(t[1], j.elbow), combine(t[2], j.wrist)
    linear = add(cross(shoulder, j.from_shoulder), cross(elbow, j.from_elbow))
    return linear, add(add(shoulder, elbow), wrist)


@inlined
def preconditioner(j: Jacobian, lam: float) -> Tangent:
    """Mobility over squared column norm |a x r|^2 + lam, joint by joint."""
    a, b, m = components(j.shoulder, j.from_shoulder), components(j.elbow, j.from_elbow), MOBILITY
    ra, rb = lam + dot(j.from_shoulder, j.from_shoulder), lam + dot(j.from_elbow, j.from_elbow)
    return (
        (m[0][0] / (ra - a[0] * a[0]), m[0][1] / (ra - a[1] * a[1]), m[0][2] / (ra - a[2] * a[2])),
        (m[1][0] / (rb - b[0] * b[0]), m[1][1] / (rb - b[1] * b[1]), m[1][2] / (rb - b[2] * b[2])),
        (m[2][0] / lam, m[2][1] / lam, m[2][2] / lam),
    )


@inlined
def read_wrench(a: Any) -> Wrench:
    """Read a wrench from an array (6,)."""
    return (a[0], a[1], a[2]), (a[3], a[4], a[5])


@inlined
def store_wrench(out: Any, wrench: Wrench) -> None:
    """Write a wrench into an array (6,)."""
    for i in range(3):
        out[i], out[3 + i] = wrench[0][i], wrench[1][i]
