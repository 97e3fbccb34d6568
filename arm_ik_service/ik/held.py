"""The limits that a configuration rests on, and steps that do not lead out through them.

A hinge at its bound is held: its part of the step is zero. The shoulder's swing and twist limits are held by projecting
the step onto their tangents, orthogonally in the metric of the solve, as active constraints are (Gould, Hribar &
Nocedal 2001).
"""

from __future__ import annotations

from typing import NamedTuple

from arm_ik_service.arm.chain import Columns
from arm_ik_service.arm.configuration import Configuration
from arm_ik_service.arm.limits import (
    swing_excess,
    swing_gradient,
    swing_surely_inside,
    twist_excess,
    twist_gradient,
    twist_of,
    twist_surely_inside,
)
from arm_ik_service.arm.tangent import Tangent
from arm_ik_service.compiled import Record, compiled, inlined
from arm_ik_service.geometry.scalar import Vector, dot, largest, scale, subtract, times

AT_LIMIT = 1e-9  # [rad]
FREE: Vector = (0.0, 0.0, 0.0)


class Walls(NamedTuple):
    """The ways out of the limits at one configuration; all zero where it rests on none.

    Gradients of swing and twist excess over the humerus' angular velocity; for each hinge -1, 0 or 1.
    """

    swing: Vector
    twist: Vector
    elbow: Vector
    wrist: Vector


@inlined
def _bound(angle: float, lower: float, upper: float) -> float:
    return -1.0 if angle <= lower + AT_LIMIT else (1.0 if angle >= upper - AT_LIMIT else 0.0)


@inlined
def walls_at(chain: Record, q: Configuration, bone: Columns) -> Walls:
    """Return the walls at a configuration whose humerus has the columns `bone`."""
    swing = FREE if swing_surely_inside(chain, bone) else _swing_wall(chain, bone)
    twist = FREE if twist_surely_inside(chain, bone) else _twist_wall(chain, q, bone)
    a, b = chain.lower, chain.upper
    (flexion, carrying, pronation), (bend, deviation, play) = q[1], q[2]
    elbow = (_bound(flexion, a[0], b[0]), _bound(carrying, a[1], b[1]), _bound(pronation, a[2], b[2]))
    wrist = (_bound(bend, a[3], b[3]), _bound(deviation, a[4], b[4]), _bound(play, a[5], b[5]))
    return Walls(swing, twist, elbow, wrist)


@inlined
def rests(walls: Walls) -> bool:
    """Tell whether there is any wall."""
    a, b, c, d = walls
    return largest(a) > 0.0 or largest(b) > 0.0 or largest(c) > 0.0 or largest(d) > 0.0


@compiled
def _swing_wall(chain: Record, bone: Columns) -> Vector:
    return swing_gradient(chain, bone) if swing_excess(chain, scale(-1.0, bone[1])) > -AT_LIMIT else FREE


@compiled
def _twist_wall(chain: Record, q: Configuration, bone: Columns) -> Vector:
    twist, height = twist_of(bone), -bone[1][1]
    if twist_excess(chain, twist - AT_LIMIT, height) < 0.0:
        return scale(-1.0, twist_gradient(q[0]))
    return twist_gradient(q[0]) if twist_excess(chain, twist + AT_LIMIT, height) > 0.0 else FREE


@inlined
def project(w: Vector, normal: Vector, inverse: Vector) -> Vector:
    """Remove from an angular velocity what moves along `normal`, orthogonally in the metric 1 / inverse."""
    n = times(inverse, normal)
    return subtract(w, scale(dot(w, normal) / dot(n, normal), n))


@inlined
def _project_twist(w: Vector, walls: Walls, inverse: Vector, swing_held: int) -> Vector:
    """Remove what moves along the twist's wall; if the swing's is held too, without undoing that."""
    normal = walls.twist
    if swing_held:
        n = times(inverse, walls.swing)
        normal = subtract(normal, scale(dot(normal, n) / dot(walls.swing, n), walls.swing))
    return project(w, normal, inverse)


@inlined
def hold(walls: Walls, step: Tangent, inverse: Tangent) -> tuple[Tangent, int]:
    """Remove from a step what would leave the limits; return it, and which those were: bits of arm.model.LIMITS."""
    w, held = step[0], 0
    if dot(walls.swing, w) > 0.0:
        w = project(w, walls.swing, inverse[0])
        held |= 1
    if dot(walls.twist, w) > 0.0:
        w = _project_twist(w, walls, inverse[0], held)
        held |= 2
    at_elbow, at_wrist = _blocked(walls.elbow, step[1]), _blocked(walls.wrist, step[2])
    free = w, _lock_group(step[1], at_elbow), _lock_group(step[2], at_wrist)
    return free, held | at_elbow << 2 | at_wrist << 5


@inlined
def _blocked(walls: Vector, t: Vector) -> int:
    return (
        (1 if walls[0] * t[0] > 0.0 else 0) | (2 if walls[1] * t[1] > 0.0 else 0) | (4 if walls[2] * t[2] > 0.0 else 0)
    )


@inlined
def lock(walls: Walls, step: Tangent, inverse: Tangent, locked: int) -> Tangent:
    """Remove from a step what moves limits that `hold` named, either way."""
    w = step[0]
    if locked & 1:
        w = project(w, walls.swing, inverse[0])
    if locked & 2:
        w = _project_twist(w, walls, inverse[0], locked & 1)
    return w, _lock_group(step[1], locked >> 2), _lock_group(step[2], locked >> 5)


@inlined
def _lock_group(t: Vector, locked: int) -> Vector:
    return (0.0 if locked & 1 else t[0], 0.0 if locked & 2 else t[1], 0.0 if locked & 4 else t[2])
