"""Vectors (x, y, z) and unit quaternions (x, y, z, w) as tuples, for compiled code: nothing here allocates.

`rotate(world_from_hand, v)` turns a vector given in hand axes into world axes; `multiply(world_from_a, a_from_b)`
chains. Tangents are rotation vectors [rad] in the body's own axes: `multiply(q, exp(w))`.
"""

from __future__ import annotations

import math
from typing import Any

from arm_ik_service.compiled import compiled, inlined
from arm_ik_service.geometry.trigonometry import angle_of, half_turn, sine_cosine

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

X: Vector = (1.0, 0.0, 0.0)
Y: Vector = (0.0, 1.0, 0.0)
Z: Vector = (0.0, 0.0, 1.0)
IDENTITY: Quaternion = (0.0, 0.0, 0.0, 1.0)


@inlined
def vector(a: Any) -> Vector:
    """Read three numbers of an array into a vector."""
    return (a[0], a[1], a[2])


@inlined
def quaternion(a: Any) -> Quaternion:
    """Read four numbers of an array into a quaternion."""
    return (a[0], a[1], a[2], a[3])


@compiled
def store(out: Any, value: Any) -> None:
    """Write a vector, a quaternion or an array into an array, in place: a slice costs 0.4 s to compile, once a type."""
    for i in range(len(value)):
        out[i] = value[i]


@compiled
def store_pose(out: Any, position: Vector, rotation: Quaternion) -> None:
    """Write a pose x y z qx qy qz qw into an array (7,), in place."""
    for i in range(3):
        out[i] = position[i]
    for i in range(4):
        out[3 + i] = rotation[i]


@inlined
def add(a: Vector, b: Vector) -> Vector:
    """a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@inlined
def subtract(a: Vector, b: Vector) -> Vector:
    """a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@inlined
def scale(s: float, a: Vector) -> Vector:
    """s a."""
    return (s * a[0], s * a[1], s * a[2])


@inlined
def lerp(a: Vector, b: Vector, s: float) -> Vector:
    """a at s = 0, b at s = 1."""
    return (a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2]))


@inlined
def dot(a: Vector, b: Vector) -> float:
    """Inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@inlined
def times(a: Vector, b: Vector) -> Vector:
    """Entry by entry product."""
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])


@inlined
def over(a: Vector, b: Vector) -> Vector:
    """Entry by entry quotient."""
    return (a[0] / b[0], a[1] / b[1], a[2] / b[2])


@inlined
def largest(a: Vector) -> float:
    """Largest magnitude of an entry."""
    return max(abs(a[0]), abs(a[1]), abs(a[2]))


@inlined
def norm(a: Vector) -> float:
    """Length."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@inlined
def clip(x: float, lower: float, upper: float) -> float:
    """Return x held to [lower, upper]."""
    return lower if x < lower else (upper if x > upper else x)


@inlined
def smoothstep(x: float) -> float:
    """From 0 at 0 to 1 at 1 without a kink, and no farther on either side."""
    x = clip(x, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


@compiled
def wrap(angle: float) -> float:
    """Return the angle in (-pi, pi] for an angle in (-3 pi, 3 pi)."""
    if angle > math.pi:
        return angle - 2.0 * math.pi
    if angle <= -math.pi:
        return angle + 2.0 * math.pi
    return angle


@inlined
def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product: first b, then a."""
    return (
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
        a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
        a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
        a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
    )


@inlined
def combine(weights: Vector, axes: tuple[Vector, Vector, Vector]) -> Vector:
    """Sum of three vectors, weighted: a matrix given by its columns times a vector."""
    (a, b, c), (x, y, z) = weights, axes
    return (
        a * x[0] + b * y[0] + c * z[0],
        a * x[1] + b * y[1] + c * z[1],
        a * x[2] + b * y[2] + c * z[2],
    )


@inlined
def components(axes: tuple[Vector, Vector, Vector], v: Vector) -> Vector:
    """Inner products of a vector with three others: a transposed matrix, given by its columns, times a vector."""
    return (dot(axes[0], v), dot(axes[1], v), dot(axes[2], v))


@inlined
def conjugate(q: Quaternion) -> Quaternion:
    """Inverse of a unit quaternion."""
    return (-q[0], -q[1], -q[2], q[3])


@inlined
def normalized(q: Quaternion) -> Quaternion:
    """Scale to unit length; q must not be zero."""
    n = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return (q[0] * n, q[1] * n, q[2] * n, q[3] * n)


@inlined
def renormalized(q: Quaternion) -> Quaternion:
    """Undo what rounding does to a length: one Newton step of 1 / length, exact for a length within 1e-8 of one."""
    n = 1.5 - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return (q[0] * n, q[1] * n, q[2] * n, q[3] * n)


@inlined
def rotate(q: Quaternion, v: Vector) -> Vector:
    """Turn v by the unit quaternion q."""
    tx = 2.0 * (q[1] * v[2] - q[2] * v[1])
    ty = 2.0 * (q[2] * v[0] - q[0] * v[2])
    tz = 2.0 * (q[0] * v[1] - q[1] * v[0])
    return (
        v[0] + q[3] * tx + q[1] * tz - q[2] * ty,
        v[1] + q[3] * ty + q[2] * tx - q[0] * tz,
        v[2] + q[3] * tz + q[0] * ty - q[1] * tx,
    )


@inlined
def exp(w: Vector) -> Quaternion:
    """Rotation vector [rad] to unit quaternion."""
    s, c = half_turn(dot(w, w))
    return (s * w[0], s * w[1], s * w[2], c)


@compiled
def log(q: Quaternion) -> Vector:
    """Unit quaternion to the shortest rotation vector [rad], length at most pi."""
    sign = -1.0 if q[3] < 0.0 else 1.0
    n = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
    s = sign * (2.0 if n < 1e-12 else 2.0 * angle_of(n, sign * q[3]) / n)
    return (s * q[0], s * q[1], s * q[2])


@compiled
def rotation_x(angle: float) -> Quaternion:
    """Rotation about x."""
    s, c = sine_cosine(0.5 * angle)
    return (s, 0.0, 0.0, c)


@compiled
def rotation_y(angle: float) -> Quaternion:
    """Rotation about y."""
    s, c = sine_cosine(0.5 * angle)
    return (0.0, s, 0.0, c)


@compiled
def twist_y(q: Quaternion) -> float:
    """Angle [rad] in (-pi, pi] of the twist about y in the decomposition q = swing * twist."""
    return wrap(2.0 * angle_of(q[1], q[3]))


@compiled
def heading(q: Quaternion) -> Vector:
    """Horizontal direction that the front of an OpenXR pose, -z, faces; unit length at any pitch, short with roll."""
    z, y = rotate(q, Z), rotate(q, Y)
    return (z[1] * y[0] - y[1] * z[0], 0.0, z[1] * y[2] - y[1] * z[2])


@compiled
def swing_y(q: Quaternion) -> Quaternion:
    """The swing of q = swing * twist about y: the shortest rotation that takes y where q takes it."""
    return multiply(q, rotation_y(-twist_y(q)))


@compiled
def between(a: Vector, b: Vector) -> Quaternion:
    """Shortest rotation from the unit vector a to the unit vector b; half a turn about some normal if opposite."""
    w, c = 1.0 + dot(a, b), cross(a, b)
    if w * w + dot(c, c) < 1e-20:
        helper = X if abs(a[0]) < 0.6 else Y
        n = cross(a, helper)
        n = scale(1.0 / norm(n), n)
        return (n[0], n[1], n[2], 0.0)
    return normalized((c[0], c[1], c[2], w))


@compiled
def from_columns(x: Vector, y: Vector, z: Vector) -> Quaternion:
    """Quaternion of the rotation whose matrix has the orthonormal columns x, y, z (Shepperd's method)."""
    trace = x[0] + y[1] + z[2]
    if trace > 0.0:
        s = math.sqrt(trace + 1.0) * 2.0
        return ((y[2] - z[1]) / s, (z[0] - x[2]) / s, (x[1] - y[0]) / s, 0.25 * s)
    if x[0] > y[1] and x[0] > z[2]:
        s = math.sqrt(1.0 + x[0] - y[1] - z[2]) * 2.0
        return (0.25 * s, (y[0] + x[1]) / s, (z[0] + x[2]) / s, (y[2] - z[1]) / s)
    if y[1] > z[2]:
        s = math.sqrt(1.0 + y[1] - x[0] - z[2]) * 2.0
        return ((y[0] + x[1]) / s, 0.25 * s, (z[1] + y[2]) / s, (z[0] - x[2]) / s)
    s = math.sqrt(1.0 + z[2] - x[0] - y[1]) * 2.0
    return ((z[0] + x[2]) / s, (z[1] + y[2]) / s, 0.25 * s, (x[1] - y[0]) / s)


@compiled
def mirror_vector(v: Vector) -> Vector:
    """Reflect a vector in the sagittal plane: x (to the right) changes sign."""
    return (-v[0], v[1], v[2])


@compiled
def mirror_rotation(q: Quaternion) -> Quaternion:
    """Reflect a rotation, or an axial vector's quaternion, in the sagittal plane."""
    return (q[0], -q[1], -q[2], q[3])
