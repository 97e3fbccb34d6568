"""A quantity with its first and second derivative over one parameter, as tuples for compiled code: a 2-jet."""

from __future__ import annotations

import math

from arm_ik_service.compiled import inlined
from arm_ik_service.geometry.scalar import Vector, components, cross, dot, scale, subtract
from arm_ik_service.geometry.trigonometry import angle_of

Jet = Vector  # value, rate, bend: they add and scale as vectors do
VectorJet = tuple[Vector, Vector, Vector]

_NEAR_POLE = 1e-6  # squared radius about the origin within which an angle has no derivative to speak of


@inlined
def turning(axis: Vector, v: Vector) -> VectorJet:
    """Return a vector that turns about a unit axis, over the angle turned."""
    return v, cross(axis, v), subtract(scale(dot(axis, v), axis), v)


@inlined
def along(v: VectorJet, fixed: Vector) -> Jet:
    """Return the inner product with a fixed vector."""
    return components(v, fixed)


@inlined
def component(v: VectorJet, i: int) -> Jet:
    """Return one component."""
    return (v[0][i], v[1][i], v[2][i])


@inlined
def shift(a: Jet, by: float) -> Jet:
    """a + by."""
    return (a[0] + by, a[1], a[2])


@inlined
def angle(sine: Jet, cosine: Jet) -> Jet:
    """Return the angle of the point (cosine, sine), of any length, in (-pi, pi]."""
    (s, ds, dds), (c, dc, ddc) = sine, cosine
    squared = max(s * s + c * c, _NEAR_POLE)
    rate = (c * ds - s * dc) / squared
    bend = (c * dds - s * ddc) / squared - 2.0 * rate * (s * ds + c * dc) / squared
    return angle_of(s, c), rate, bend


@inlined
def arcsine(sine: Jet) -> Jet:
    """Return the angle in [-pi/2, pi/2] of a sine."""
    s, ds, dds = sine
    squared = max(1.0 - s * s, _NEAR_POLE)
    cosine = math.sqrt(squared)
    return angle_of(s, cosine), ds / cosine, (dds + ds * ds * s / squared) / cosine


@inlined
def square(weight: float, a: Jet) -> Jet:
    """weight a^2."""
    v, rate, bend = a
    return weight * v * v, 2.0 * weight * v * rate, 2.0 * weight * (rate * rate + v * bend)


@inlined
def cauchy(weight: float, scale: float, a: Jet) -> Jet:
    """weight scale^2 log(1 + (a / scale)^2): weight a^2 while small, flat when large."""
    v, rate, bend = a[0] / scale, a[1] / scale, a[2] / scale
    w, one = weight * scale * scale, 1.0 + v * v
    return w * math.log(one), 2.0 * w * v * rate / one, 2.0 * w * (rate * rate * (2.0 - one) / one + v * bend) / one


@inlined
def outside(a: Jet, lower: float, upper: float) -> Jet:
    """Return by how much a quantity lies outside a range, with sign; 0 inside."""
    if a[0] < lower:
        return shift(a, -lower)
    return shift(a, -upper) if a[0] > upper else (0.0, 0.0, 0.0)
