"""The shoulder's limits: where the humerus may point, and how far it may turn about itself.

Swing: the directions the humerus may take form a region that is star-shaped around a centre direction: the angle from
the centre to the edge is a smooth function of azimuth (a Fourier series through eight angles of the model file).
Twist: the angle about the humerus in the decomposition q = swing * twist from the hanging arm. That angle is singular
with the arm straight up, where the direction of approach alone would decide it, so the twist range opens smoothly to a
full turn between 140 and 165 degrees of elevation.

Both are functions of the shoulder quaternion; gradients are with respect to the humerus' angular velocity in its own
axes (the model's tangent), so `gradient . omega` is the rate at which the limit is approached.
"""

from __future__ import annotations

import math

from arm_ik_service.arm.chain import Columns, columns_of
from arm_ik_service.compiled import Record, compiled, inlined
from arm_ik_service.geometry.scalar import (
    Quaternion,
    Vector,
    clip,
    dot,
    exp,
    multiply,
    normalized,
    rotation_y,
    scale,
    smoothstep,
)
from arm_ik_service.geometry.trigonometry import angle_of

_OPENS_AT = 0.766  # height of the humerus' direction, sine of 50 degrees above horizontal
_OPEN_AT = 0.966  # sine of 75 degrees


@compiled
def twist_of(bone: Columns) -> float:
    """Twist about y [rad] in (-pi, pi] of a rotation given as columns."""
    return angle_of(bone[2][0] - bone[0][2], bone[0][0] + bone[2][2])


@compiled
def _opening(height: float) -> float:
    """How far the twist range has opened: 0 below _OPENS_AT, 1 above _OPEN_AT."""
    return smoothstep((height - _OPENS_AT) / (_OPEN_AT - _OPENS_AT))


@compiled
def twist_range(chain: Record, height: float) -> tuple[float, float]:
    """Range of the humerus' twist [rad] at a height, the y of its direction: -1 hanging, 1 straight up."""
    open_ = _opening(height)
    lower = chain.twist_lower - open_ * (math.pi + chain.twist_lower)
    return lower, chain.twist_upper + open_ * (math.pi - chain.twist_upper)


@compiled
def twist_excess(chain: Record, twist: float, height: float) -> float:
    """Angle [rad] by which a twist leaves its range: negative below, positive above, 0 inside."""
    lower, upper = twist_range(chain, height)
    return twist - lower if twist < lower else (twist - upper if twist > upper else 0.0)


@compiled
def twist_beyond(chain: Record, twist: float, height: float, margin: float) -> float:
    """Angle [rad] by which a twist leaves its range drawn in by `margin`, signed as that of `twist_excess`."""
    lower, upper = twist_range(chain, height)
    return max(twist + margin - upper, 0.0) + min(twist - margin - lower, 0.0)


@inlined
def octant(cosine: float, sine: float) -> int:
    """Which eighth of a turn a point lies in; in no order."""
    return (1 if cosine > 0.0 else 0) | (2 if sine > 0.0 else 0) | (4 if abs(sine) > abs(cosine) else 0)


@inlined
def swing_surely_inside(chain: Record, bone: Columns) -> bool:
    """Tell without an arc tangent that a humerus is inside its swing region, by 0.1 rad at least."""
    y, centre, a, b = bone[1], chain.swing_centre, chain.swing_side, chain.swing_up
    along = y[0] * centre[0] + y[1] * centre[1] + y[2] * centre[2]
    where = octant(-(y[0] * a[0] + y[1] * a[1] + y[2] * a[2]), -(y[0] * b[0] + y[1] * b[1] + y[2] * b[2]))
    return bool(-along > chain.swing_surely_inside[where])


@inlined
def twist_surely_inside(chain: Record, bone: Columns) -> bool:
    """Tell without an arc tangent that a humerus is inside its twist range, by 1e-6 rad at least."""
    cosine, sine = bone[0][0] + bone[2][2], bone[2][0] - bone[0][2]
    along = cosine * chain.twist_middle[0] + sine * chain.twist_middle[1]
    return bool(along > chain.twist_surely_inside * math.sqrt(cosine * cosine + sine * sine))


@compiled
def twist_gradient(q: Quaternion) -> Vector:
    """Rate of the twist angle per unit angular velocity of the humerus in its own axes; singular straight up."""
    x, y, z, w = q
    n = 1.0 / max(y * y + w * w, 1e-12)
    return ((w * z + x * y) * n, 1.0, (y * z - w * x) * n)


@compiled
def swing_edge(chain: Record, cosine: float, sine: float) -> tuple[float, float]:
    """Angle from the centre to the edge [rad] at an azimuth given by cosine and sine, and its slope over azimuth."""
    c, s = 1.0, 0.0
    angle, slope = chain.swing_cosines[0], 0.0
    for k in range(1, 5):
        c, s = c * cosine - s * sine, s * cosine + c * sine
        angle += chain.swing_cosines[k] * c + chain.swing_sines[k] * s
        slope += k * (chain.swing_sines[k] * c - chain.swing_cosines[k] * s)
    return angle, slope


@compiled
def swing_excess(chain: Record, direction: Vector) -> float:
    """Angle [rad] by which the humerus' unit direction lies beyond the edge; negative inside."""
    centre, a, b = chain.swing_centre, chain.swing_side, chain.swing_up
    along = direction[0] * centre[0] + direction[1] * centre[1] + direction[2] * centre[2]
    x = direction[0] * a[0] + direction[1] * a[1] + direction[2] * a[2]
    y = direction[0] * b[0] + direction[1] * b[1] + direction[2] * b[2]
    n = max(math.sqrt(x * x + y * y), 1e-9)
    return angle_of(n, along) - swing_edge(chain, x / n, y / n)[0]


@compiled
def swing_gradient(chain: Record, bone: Columns) -> Vector:
    """Rate of `swing_excess` per unit angular velocity of the humerus in its own axes."""
    u = scale(-1.0, bone[1])
    centre, side, up = chain.swing_centre, chain.swing_side, chain.swing_up
    c = (centre[0], centre[1], centre[2])
    a = (side[0], side[1], side[2])
    b = (up[0], up[1], up[2])
    along, x, y = dot(u, c), dot(u, a), dot(u, b)
    n = max(math.sqrt(x * x + y * y), 1e-9)
    slope = swing_edge(chain, x / n, y / n)[1]
    # theta = atan2(n, along) has the gradient along * n' - n * c over u, with n' = (x a + y b) / n;
    # azimuth has (x b - y a) / n^2
    px, py = along * x / n + slope * y / (n * n), along * y / n - slope * x / (n * n)
    g = (px * a[0] + py * b[0] - n * c[0], px * a[1] + py * b[1] - n * c[1], px * a[2] + py * b[2] - n * c[2])
    # u' = omega x u in body axes: u = -y, so omega = (wx, 0, wz) moves it by wz x - wx z
    return (-dot(g, bone[2]), 0.0, dot(g, bone[0]))


@compiled
def clamp_twist(chain: Record, q: Quaternion, bone: Columns) -> Quaternion:
    """Return the humerus turned back about itself to the edge of the twist range, if it lies beyond."""
    if twist_surely_inside(chain, bone):
        return q
    excess = twist_excess(chain, twist_of(bone), -bone[1][1])
    return q if excess == 0.0 else multiply(q, rotation_y(-excess))


@compiled
def clamp_swing(chain: Record, q: Quaternion, bone: Columns) -> Quaternion:
    """Return the humerus swung straight towards the centre to the edge of its region, if it lies beyond."""
    excess = swing_excess(chain, scale(-1.0, bone[1]))
    if excess <= 0.0:
        return q
    centre = chain.swing_centre
    c = (centre[0], centre[1], centre[2])
    # body-axis rotation that takes u towards the centre: axis u x c, here in body axes with u = -y
    cx, cz = dot(c, bone[0]), dot(c, bone[2])
    n = max(math.sqrt(cx * cx + cz * cz), 1e-9)
    return normalized(multiply(q, exp((-cz * excess / n, 0.0, cx * excess / n))))


@inlined
def clamp_shoulder(chain: Record, q: Quaternion) -> Quaternion:
    """Return the humerus brought inside its swing and twist limits: swung back first, then turned back."""
    bone = columns_of(q)
    if swing_surely_inside(chain, bone) and twist_surely_inside(chain, bone):
        return q
    q = clamp_swing(chain, q, bone)
    return clamp_twist(chain, q, columns_of(q))


@inlined
def clamp_group(chain: Record, first: int, angles: Vector) -> Vector:
    """Return three hinges, the first of them at an index of the ranges, clipped to these."""
    lower, upper = chain.lower, chain.upper
    return (
        clip(angles[0], lower[first], upper[first]),
        clip(angles[1], lower[first + 1], upper[first + 1]),
        clip(angles[2], lower[first + 2], upper[first + 2]),
    )
