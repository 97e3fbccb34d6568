"""Sine, cosine and arc by polynomials, for compiled code: a call of the C library costs as much as thirty products.

Sums are grouped so that few of them wait for one another (Estrin 1960). Each is as exact as a double is, to a few units
in the last place; the tests hold them to the C library. Being only sums, products and square roots they are also the
same bits on every machine, which the C library's are not.
"""

from __future__ import annotations

import math

from arm_ik_service.compiled import inlined

_PER_QUARTER = 2.0 / math.pi
# A quarter turn in three parts, the first two short enough that a count of quarters times them is exact
# (Cody & Waite 1980).
_QUARTER_1 = 1.5707963267341256
_QUARTER_2 = 6.077100506303966e-11
_QUARTER_3 = 2.0222662487959506e-21
_TAN_22_5 = math.sqrt(2.0) - 1.0
_TINY = 1e-300
_SMALL_TURN = 0.25  # squared angle [rad^2] up to which half_turn's series are taken
_SMALL_SINE = 0.01  # squared sine up to which arc's series is taken


@inlined
def sine_cosine(angle: float) -> tuple[float, float]:
    """Sine and cosine of an angle [rad] of at most some thousands."""
    quarters = math.floor(angle * _PER_QUARTER + 0.5)
    r = ((angle - quarters * _QUARTER_1) - quarters * _QUARTER_2) - quarters * _QUARTER_3
    s, c = _sine(r), _cosine(r * r)
    n = int(quarters) & 3
    if n & 1:
        s, c = c, -s
    return (-s, -c) if n & 2 else (s, c)


@inlined
def _sine(r: float) -> float:
    """Sine up to an eighth of a turn."""
    z = r * r
    w = z * z
    a = -1.0 / 6.0 + z * (1.0 / 120.0) + w * (-1.0 / 5040.0 + z * (1.0 / 362880.0))
    b = -1.0 / 39916800.0 + z * (1.0 / 6227020800.0) + w * (-1.0 / 1307674368000.0 + z * (1.0 / 355687428096000.0))
    return r + r * z * (a + w * w * b)


@inlined
def _cosine(z: float) -> float:
    """Cosine up to an eighth of a turn, from the squared angle."""
    w = z * z
    a = 1.0 / 24.0 + z * (-1.0 / 720.0) + w * (1.0 / 40320.0 + z * (-1.0 / 3628800.0))
    b = 1.0 / 479001600.0 + z * (-1.0 / 87178291200.0) + w * (1.0 / 20922789888000.0)
    return 1.0 - 0.5 * z + w * (a + w * w * b)


@inlined
def angle_of(sine: float, cosine: float) -> float:
    """Angle [rad] in [-pi, pi] of a point given by multiples of its sine and cosine: what atan2 is, but for zeros."""
    y, x = abs(sine), abs(cosine)
    low, high = min(y, x), max(y, x)
    steep = low > _TAN_22_5 * high
    t = (low - high) / (low + high) if steep else low / max(high, _TINY)
    angle = _arc_tangent(t) + (0.25 * math.pi if steep else 0.0)
    angle = 0.5 * math.pi - angle if y > x else angle
    angle = math.pi - angle if cosine < 0.0 else angle
    return -angle if sine < 0.0 else angle


@inlined
def _arc_tangent(t: float) -> float:
    """Arc tangent up to 22.5 degrees: arctan(t) / t interpolated in t^2 at twelve Chebyshev nodes, to 2e-18."""
    z = t * t
    w = z * z
    a = 1.0 + z * -0.3333333333333312 + w * (0.19999999999940893 + z * -0.14285714279250245)
    b = 0.11111110744919658 + z * -0.09090896809064027 + w * (0.07692045330902225 + z * -0.06662951813629191)
    c = 0.05846878297330872 + z * -0.05035102456601552 + w * (0.03796525745386593 + z * -0.017805397205419446)
    w = w * w
    return t * (a + w * (b + w * c))


@inlined
def half_turn(squared: float) -> tuple[float, float]:
    """Return sin(a / 2) / a and cos(a / 2) of an angle given by its square [rad^2]: what a rotation vector needs."""
    if squared > _SMALL_TURN:
        angle = math.sqrt(squared)
        s, c = sine_cosine(0.5 * angle)
        return s / angle, c
    z = 0.25 * squared
    w = z * z
    a = 1.0 / 120.0 + z * (-1.0 / 5040.0) + w * (1.0 / 362880.0 + z * (-1.0 / 39916800.0 + z * (1.0 / 6227020800.0)))
    return 0.5 - z * (1.0 / 12.0) + 0.5 * w * a, _cosine(z)


@inlined
def arc(sine: float, cosine: float) -> float:
    """Return angle over sine of an angle of at most half a turn, given both (sine >= 0)."""
    z = sine * sine
    if cosine > 0.0 and z < _SMALL_SINE:
        w = z * z
        a = 3.0 / 40.0 + z * (5.0 / 112.0)
        b = 35.0 / 1152.0 + z * (63.0 / 2816.0) + w * (231.0 / 13312.0 + z * (143.0 / 10240.0))
        return 1.0 + z * (1.0 / 6.0) + w * (a + w * b)
    return angle_of(sine, cosine) / sine
