"""A right arm as a solid: the signed distance of points to its surface, about right in size, exact in sign.

The arm hangs straight from the origin down -y with the palm to the front: ISB axes at the zero configuration (+x to the
front, +z to the right, where the thumb is). Lengths are those of a person of 1.75 m, girths ANSUR II means, rounded.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from arm_ik_service.skin.mesh import Floats

UPPER_ARM_M, FOREARM_M = 0.186 * 1.75, 0.146 * 1.75  # Drillis & Contini, in Winter, table 4.1
WRIST_Y = -UPPER_ARM_M - FOREARM_M

# y from shoulder, half width in x, half width in z, centre x, centre z [m]
_U, _F = UPPER_ARM_M, FOREARM_M
_SECTIONS = np.array(
    [
        (0.058, 0.001, 0.001, 0.000, 0.004),
        (0.052, 0.026, 0.024, 0.000, 0.005),
        (0.036, 0.045, 0.042, 0.000, 0.007),
        (0.010, 0.055, 0.052, 0.000, 0.009),
        (-0.16 * _U, 0.057, 0.054, 0.000, 0.009),
        (-0.34 * _U, 0.051, 0.047, 0.003, 0.004),
        (-0.56 * _U, 0.050, 0.043, 0.005, 0.000),
        (-0.80 * _U, 0.043, 0.040, 0.001, 0.000),
        (-0.94 * _U, 0.038, 0.041, -0.002, 0.000),
        (-1.00 * _U, 0.038, 0.042, -0.002, 0.000),
        (-_U - 0.10 * _F, 0.040, 0.044, 0.001, 0.001),
        (-_U - 0.24 * _F, 0.042, 0.046, 0.003, 0.002),
        (-_U - 0.45 * _F, 0.038, 0.041, 0.002, 0.001),
        (-_U - 0.68 * _F, 0.029, 0.034, 0.000, 0.000),
        (-_U - 0.86 * _F, 0.022, 0.029, 0.000, 0.000),
        (-_U - 1.00 * _F, 0.020, 0.028, 0.000, 0.000),
        (-_U - 1.10 * _F, 0.0165, 0.027, 0.001, 0.001),  # from here on inside the hand
        (-_U - 1.22 * _F, 0.010, 0.019, 0.001, 0.001),
        (-_U - 1.30 * _F, 0.001, 0.001, 0.001, 0.001),
    ]
)

# Each finger: z and y of its knuckle from the wrist, phalanges, radius at the knuckle [m]
_FINGERS = (
    (0.0315, -0.089, (0.044, 0.026, 0.021), 0.0088),  # index
    (0.0105, -0.093, (0.048, 0.030, 0.022), 0.0090),
    (-0.0100, -0.090, (0.045, 0.028, 0.022), 0.0086),
    (-0.0295, -0.082, (0.035, 0.021, 0.019), 0.0076),  # little
)
_CURL = np.radians([38.0, 88.0, 118.0])  # of the phalanges from straight, around a grip
_THUMB = ((0.006, -0.018, 0.018), (0.022, -0.050, 0.043), (0.034, -0.078, 0.047), (0.040, -0.103, 0.036))
_THUMB_RADII = (0.0165, 0.0125, 0.0108, 0.0090)


def limb(y: npt.ArrayLike) -> Floats:
    """Half widths in x and z and centre x and z (..., 4) of the elliptical section at y: a smooth curve [m]."""
    heights = _SECTIONS[::-1, 0]
    return np.stack([_monotone(np.asarray(y, float), heights, _SECTIONS[::-1, k]) for k in range(1, 5)], axis=-1)


def distance(points: Floats) -> Floats:
    """Signed distance [m] (...) of points (..., 3) to wrist and hand, negative inside."""
    half_x, half_z, x, z = np.moveaxis(limb(points[..., 1]), -1, 0)
    across = np.hypot((points[..., 0] - x) / half_x, (points[..., 2] - z) / half_z)
    forearm = np.maximum((across - 1.0) * np.minimum(half_x, half_z), _SECTIONS[-1, 0] - points[..., 1])
    p = points - np.array([0.0, WRIST_Y, 0.0])
    palm = _rounded_box(_arched(p) - [-0.001, -0.052, 0.0005], np.array([0.0125, 0.044, 0.040]), 0.0115)
    palm = _union(
        palm, _cone(p, (0.010, -0.022, 0.014), (0.014, -0.058, 0.026), 0.0155, 0.013), 0.018
    )  # ball of the thumb
    palm = _union(
        palm, _cone(p, (0.008, -0.026, -0.022), (0.007, -0.066, -0.027), 0.0145, 0.012), 0.016
    )  # edge of the hand
    hand = _union(forearm, palm, 0.022)
    thumb = _chain(p, _THUMB, _THUMB_RADII, 0.006)
    hand = _union(hand, thumb, 0.010)
    for finger in _FINGERS:
        hand = _union(hand, _chain(p, *_finger(*finger), 0.004), 0.0065)
    return hand


def _finger(
    z: float, y: float, lengths: tuple[float, ...], radius: float
) -> tuple[tuple[tuple[float, float, float], ...], tuple[float, ...]]:
    """Joints from 20 mm inside the palm to the tip, and radii there."""
    points = [(-0.002, y + 0.020, z * 0.96), (-0.001, y, z)]
    for length, angle in zip(lengths, _CURL, strict=True):
        x0, y0, z0 = points[-1]
        points.append((x0 + length * np.sin(angle), y0 - length * np.cos(angle), z0 * 0.985))
    return tuple(points), (1.02 * radius, 1.04 * radius, 0.98 * radius, 0.92 * radius, 0.78 * radius)


def _arched(p: Floats) -> Floats:
    """Bend the palm so that its edges come forward: knuckles lie on an arc."""
    bent = p.copy()
    bent[..., 0] -= 2.2 * p[..., 2] ** 2
    return bent


def _chain(p: Floats, joints: tuple[tuple[float, float, float], ...], radii: tuple[float, ...], blend: float) -> Floats:
    parts = [_cone(p, joints[k], joints[k + 1], radii[k], radii[k + 1]) for k in range(len(joints) - 1)]
    whole = parts[0]
    for part in parts[1:]:
        whole = _union(whole, part, blend)
    return whole


def _cone(p: Floats, a: npt.ArrayLike, b: npt.ArrayLike, start: float, end: float) -> Floats:
    """A capsule from a to b whose radius goes from `start` to `end`."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    axis = b - a
    t = np.clip((p - a) @ axis / (axis @ axis), 0.0, 1.0)
    return np.asarray(np.linalg.norm(p - a - t[..., None] * axis, axis=-1) - (start + t * (end - start)))


def _rounded_box(p: Floats, half: Floats, rounding: float) -> Floats:
    q = np.abs(p) - half + rounding
    outside = np.linalg.norm(np.maximum(q, 0.0), axis=-1)
    return np.asarray(outside + np.minimum(q.max(axis=-1), 0.0) - rounding)


def _union(a: Floats, b: Floats, blend: float) -> Floats:
    """Of two solids, with a fillet `blend` [m] wide between them."""
    h = np.maximum(blend - np.abs(a - b), 0.0) / blend
    return np.asarray(np.minimum(a, b) - 0.25 * blend * h * h)


def _monotone(x: Floats, at: Floats, values: Floats) -> Floats:
    """Cubic curve through `values` at the increasing places `at` that never overshoots (Fritsch & Carlson 1980)."""
    width = np.diff(at)
    slope = np.diff(values) / width
    before, after = slope[:-1], slope[1:]
    w1, w2 = 2.0 * width[1:] + width[:-1], width[1:] + 2.0 * width[:-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        inner = np.where(before * after > 0.0, (w1 + w2) / (w1 / before + w2 / after), 0.0)
    tangent = np.concatenate([slope[:1], inner, slope[-1:]])
    k = np.clip(np.searchsorted(at, x) - 1, 0, len(at) - 2)
    t = np.clip((x - at[k]) / width[k], 0.0, 1.0)
    return np.asarray(
        (2 * t**3 - 3 * t**2 + 1) * values[k]
        + (t**3 - 2 * t**2 + t) * width[k] * tangent[k]
        + (3 * t**2 - 2 * t**3) * values[k + 1]
        + (t**3 - t**2) * width[k] * tangent[k + 1]
    )
